"""A point of a nonlinear mode with its errors, and the reason where there is none.

The errors of frequency and damping ratio are the changes with more harmonics and samples, times a safety factor, and
the difference to the reference sweep, which has fewer harmonics and longer steps in amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.harmonic_levels import shifted
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import nothing_happens
from solver.accuracy.refinement import refine
from solver.loading_history.path_of_states import Step
from solver.loading_history.sweep import Sweep
from solver.model import FloatArray
from solver.modes.modal_model import natural_frequencies
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.modes.mode_path import ModePath
from solver.modes.options import MODES
from solver.newton.run import Run
from solver.outcome import Outcome, known_to
from solver.settings import ROUND_OFF, Resolution


@dataclass(frozen=True)
class ModePoint:
    """A point of a nonlinear mode.

    - outcome, message: how the computation of the point ended. A point without state has no further values.
    - problem: joint with the harmonics of the state. state: the state.
    - errors (2,): estimated errors of the frequency, rad/s, and of the damping ratio.
    - newton_iterations: of the way from rest to the point and of the point, as for this point alone.
    - run_time: CPU seconds of the computing thread since the point before.
    """

    outcome: Outcome
    message: str = ""
    problem: ModeProblem | None = None
    state: ModeState | None = None
    errors: FloatArray | None = None
    newton_iterations: int = 0
    run_time: float = 0.0


def solve_point(sweep: Sweep[ModeState], amplitude: float, run: Run) -> ModePoint:
    """The point of a mode at an amplitude, m sqrt(kg), to which a sweep was advanced."""
    if sweep.here is None:
        return ModePoint(Outcome.BRANCH_LOST, describe_loss(sweep))
    found = sweep.state_at(amplitude, run.fresh())
    if not isinstance(found, Step):
        ahead = sweep.here if sweep.ahead is None else sweep.ahead.state
        ends = f"{sweep.here.parameter:.4g} and {ahead.parameter:.4g}"
        said = f"no state was found between the amplitudes {ends} m sqrt(kg), where the mode has states"
        return ModePoint(Outcome.BRANCH_LOST, said)
    reference = sweep.reference_at(amplitude, run.fresh())
    other = None if reference is None or sweep.reference is None else (problem_of(sweep.reference), reference)
    return judge_point(problem_of(sweep), found.state, other, run)


def problem_of(sweep: Sweep[ModeState]) -> ModeProblem:
    """The problem of a sweep, with its present harmonics."""
    assert isinstance(sweep.path, ModePath)
    return sweep.path.problem


def judge_point(
    problem: ModeProblem, found: ModeState, reference: tuple[ModeProblem, ModeState] | None, run: Run
) -> ModePoint:
    """The point with the harmonics that it needs, and its errors.

    Parameters
    ----------
    problem, found
        The state, with the harmonics of the problem.
    reference
        The same from the reference sweep, where there is one.
    run
        Tolerance and limits.
    """
    tolerance, rtol = problem.case.settings.tolerance, problem.case.settings.rtol
    # half of rtol is left for the error by the steps of the sweep
    finer = replace(problem.case.settings, rtol=0.5 * rtol)
    case = replace(problem, case=replace(problem.case, settings=finer)).case_at(found.omega, found.damping_ratio)
    refined = refine(case, found.omega, found.drive, found.state, run)
    accurate = refined.accurate
    other = problem.at(refined.case.resolution)
    if other.case.resolution != problem.case.resolution:
        moved = problem.move(found, other, run)
        accurate &= moved is not None
        problem, found = (problem, found) if moved is None else (other, moved)
    errors = _errors_by_resolution(problem, found, run)
    if reference is not None:
        moved = reference[0].move(reference[1], problem, run)
        by_steps = reference[1] if moved is None else moved
        errors = errors + np.abs(by_steps.values - found.values)[:2]
    joint = problem.joint_of(found)
    certificate = certify(joint, found.state.evaluation)
    if not certificate.holds(tolerance):
        return ModePoint(Outcome.CERTIFICATE_FAILED, certificate.sentence(tolerance))
    # the damping ratio is the sum of parts that may cancel: its error is judged against the part of friction
    by_friction = float(joint.law.friction_work(found.state.evaluation).sum()) / (
        2.0 * np.pi * (found.omega * found.parameter) ** 2
    )
    damping = max(by_friction, abs(found.damping_ratio), ROUND_OFF)
    known = [float(errors[0]) / found.omega, float(errors[1]) / damping]
    if accurate and max(known) <= rtol:
        return ModePoint(Outcome.CONVERGED, "", problem, found, errors)
    names = ("natural frequency", "damping ratio")
    said = [f"the {name} {known_to(error, rtol)}" for name, error in zip(names, known, strict=True) if error > rtol]
    return ModePoint(Outcome.INACCURATE, "; ".join(said), problem, found, errors)


def _errors_by_resolution(problem: ModeProblem, state: ModeState, run: Run) -> FloatArray:
    """Errors (2,) of frequency, rad/s, and damping ratio by harmonics and samples; inf where they are not known."""
    if nothing_happens(state.state.evaluation):
        return np.zeros(2)
    here, errors = problem.case.resolution, np.full(2, np.inf)
    for levels, safety in ((2, ACCURACY.two_levels_safety), (1, ACCURACY.one_level_safety), (-1, 1.0)):
        other = shifted(here, levels)
        if other.orders != here.orders and problem.model.holds(other.highest) and np.isinf(errors).any():
            errors = safety * _change(problem, state, other, run)
    # samples of their own: an event may stay next to the same sample of twice as many
    finer = Resolution(here.orders, 3 * here.samples + 2)
    return errors + ACCURACY.triple_samples_safety * _change(problem, state, finer, run)


def _change(problem: ModeProblem, state: ModeState, resolution: Resolution, run: Run) -> FloatArray:
    """Change (2,) of frequency, rad/s, and damping ratio with another resolution; inf where there is no state."""
    moved = problem.move(state, problem.at(resolution), run)
    return np.full(2, np.inf) if moved is None else np.abs(moved.values - state.values)[:2]


def describe_loss(sweep: Sweep[ModeState]) -> str:
    """Sentence about the end of a mode: the last amplitude, and what ends the mode there."""
    here, problem = sweep.last, problem_of(sweep)
    assert here is not None
    way = "up" if sweep.direction > 0.0 else "down"
    said = f"the mode is followed {way} to the amplitude {here.parameter:.4g} m sqrt(kg), at {_hertz(here.omega)}"
    for order in (n for n in problem.case.resolution.orders if 1 < n <= MODES.resonant_order):
        linear = problem.model.harmonic_structure(order)
        dofs = problem.model.contact.dofs.ravel()
        omegas, _ = natural_frequencies(linear, dofs[dofs >= 0])
        near = omegas[np.abs(omegas - order * here.omega) < MODES.near_resonance * order * here.omega]
        if near.size:
            return f"{said}, where harmonic {order} meets the natural frequency {_hertz(float(near[0]))} of the joint"
    beyond = "larger" if sweep.direction > 0.0 else "smaller"
    return f"{said}; no state is found at a {beyond} amplitude: the mode turns back there (a fold), or ends"


def _hertz(omega: float) -> str:
    return f"{omega / (2.0 * np.pi):.6g} Hz"
