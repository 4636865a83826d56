"""The points of a nonlinear mode at given amplitudes, each with its errors, or the reason where there is none.

The errors of frequency and damping ratio are the changes with more harmonics and samples, times a safety factor, and
the difference to the reference sweep, which has fewer harmonics and longer steps in amplitude.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.harmonic_levels import shifted
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import nothing_happens
from solver.accuracy.refinement import refine
from solver.clock import computing_time
from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import Failure
from solver.loading_history.sweep import Path, Step, Sweep
from solver.model import BoolArray, ComplexArray, FloatArray, ReducedModel
from solver.modes.modal_model import natural_frequencies
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.modes.mode_path import TOP_BASE, ModePath, Rest, find_rest
from solver.newton.run import Budget, OutOfTimeError, Run
from solver.outcome import Outcome, describe_error, known_to
from solver.settings import ROUND_OFF, Resolution, SolverSettings
from solver.structure.fourier import to_complex

Direction = Literal["up", "down"]

_NO_FIRST = Failure(Outcome.START_FAILED, "the mode was not found at its first amplitude")

NEAR_RESONANCE = 0.02
"""Distance of a harmonic from a natural frequency, relative, that the message of a lost mode names."""

RESONANT_ORDER = 7
"""Highest harmonic that this message names: higher ones are always near some natural frequency."""


@dataclass(frozen=True)
class ModePoint:
    """A point of a nonlinear mode. Its values are NaN where no state was found.

    - outcome, message: how the computation of the point ended.
    - frequency to samples_used: as in `solver.Backbone`, at one amplitude.
    - newton_iterations: of the way from rest to the point and of the point, as for this point alone.
    - run_time: CPU seconds of the computing thread since the point before.
    - found: the state, and the joint with its harmonics.
    """

    outcome: Outcome
    message: str
    frequency: float
    damping_ratio: float
    frequency_error: float
    damping_error: float
    response: ComplexArray
    shape: ComplexArray
    slip_fraction: FloatArray
    open_fraction: FloatArray
    harmonics_used: int
    samples_used: int
    newton_iterations: int = 0
    run_time: float = 0.0
    found: tuple[ModeProblem, ModeState] | None = None


def without_state(model: ReducedModel, outcome: Outcome, message: str = "") -> ModePoint:
    """A point of a mode of a model that has no state."""
    nan, linear = float("nan"), model.linear[0]
    sizes = len(linear.response), len(linear.mass), model.contact.n_contact
    response, shape, pairs = (np.full(size, nan) for size in sizes)
    vectors = response.astype(complex), shape.astype(complex), pairs, pairs
    return ModePoint(outcome, message, nan, nan, nan, nan, *vectors, 0, 0)


def follow_mode(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    amplitudes: FloatArray,
    number: int,
    direction: Direction,
    settings: SolverSettings,
) -> Iterator[tuple[int, ModePoint]]:
    """Points of a nonlinear mode: index and point, one by one, in the order of the way to them.

    amplitudes: modal amplitudes, m sqrt(kg), in any order. number, direction: as in `solver.backbone`.
    settings: the limit of time holds for each point with the way from the point before.
    """
    way = _Way((model, friction_coefficient, number, settings), direction)
    for index in sorted(range(len(amplitudes)), key=lambda index: way.place(float(amplitudes[index]))):
        began = computing_time()
        run = Run(settings.tolerance, Budget(deadline=began + settings.time_limit))
        point: ModePoint | Failure
        try:
            point = way.point(float(amplitudes[index]), run)
        except OutOfTimeError:
            point = Failure(Outcome.TIME_LIMIT)
        except np.linalg.LinAlgError:
            point = Failure(Outcome.SINGULAR)
        except Exception as error:
            # an error spoils one point only
            point = Failure(Outcome.EXCEPTION, describe_error(error))
        if isinstance(point, Failure):
            point = without_state(model, point.outcome, point.message)
        iterations = way.spent + run.budget.iterations
        yield index, replace(point, newton_iterations=iterations, run_time=computing_time() - began)


def top_of(amplitude: float) -> float:
    """Amplitude, m sqrt(kg), from which the amplitude of a point is lowered."""
    return float(TOP_BASE ** math.ceil(math.log(2.0 * amplitude, TOP_BASE)))


@dataclass
class _Way:
    """The sweeps to the points: one with rising amplitude, and one with falling amplitude from each `top_of`.

    - asked: model, friction coefficient, number of the mode, settings.
    - spent: Newton iterations of the way to the last point, those to other points left out.
    - rest, up, down: what has been found so far, and the sweep from the present `top`. to_rest, to_up, to_down: Newton
      iterations up to their begin. Sweeps count for themselves: their nodes do not depend on the points asked for.
    """

    asked: tuple[ReducedModel, float | FloatArray | None, int, SolverSettings]
    direction: Direction
    spent: int = 0
    rest: Rest | Failure | None = None
    up: Sweep[ModeState] | None = None
    down: Sweep[ModeState] | None = None
    top: float = 0.0
    to_rest: int = 0
    to_up: int = 0
    to_down: int = 0

    def place(self, amplitude: float) -> tuple[float, float]:
        """Key by which amplitudes come in the order of the way."""
        return (0.0, amplitude) if self.direction == "up" else (top_of(amplitude), -amplitude)

    def point(self, amplitude: float, run: Run) -> ModePoint | Failure:
        """The point at the next amplitude, m sqrt(kg). run: of this point alone."""
        deadline = run.budget.deadline
        if self.rest is None:
            own = Run(run.tolerance, Budget(deadline=deadline))
            self.rest, self.to_rest = find_rest(*self.asked, own), own.budget.iterations
        self.spent, rest = self.to_rest, self.rest
        if isinstance(rest, Failure):
            return rest
        if self.direction == "up" and not rest.glued:
            said = 'the joint has no such mode while its pairs stick: give sweep = "down", from large amplitudes'
            return Failure(Outcome.START_FAILED, said)
        if self.direction == "up" and amplitude < rest.first_amplitude:
            node = rest.raised(amplitude, run)
            return _NO_FIRST if node is None else judge_point(rest.problem, node, None, run)
        if self.direction == "up":
            sweep, before = self._raised_to(rest, amplitude, deadline), self.to_up
        else:
            self._begin_down(rest, top_of(amplitude), deadline)
            sweep, before = self.down, self.to_down
        self.spent = before
        if sweep is None:
            return _NO_FIRST
        if sweep is self.down and sweep.here is not None and sweep.here.parameter < amplitude:
            # the mode could not be raised to the amplitude from which it is lowered
            assert self.up is not None
            return Failure(Outcome.BRANCH_LOST, describe_loss(self.up))
        sweep.set_deadline(deadline)
        sweep.advance_to(amplitude)
        self.spent += sweep.n_iterations
        return solve_point(sweep, amplitude, run)

    def _raised_to(self, rest: Rest, amplitude: float, deadline: float) -> Sweep[ModeState] | None:
        """The sweep with rising amplitude at the node before an amplitude; None where it does not begin."""
        if self.up is None:
            own = Run(rest.problem.case.settings.tolerance, Budget(deadline=deadline))
            first = rest.raised(rest.first_amplitude, own)
            self.to_up = self.to_rest + own.budget.iterations
            self.up = None if first is None else _begun(ModePath(rest.problem), first, 1.0, deadline)
        if self.up is not None:
            self.up.set_deadline(deadline)
            self.up.advance_to(amplitude)
        return self.up

    def _begin_down(self, rest: Rest, top: float, deadline: float) -> None:
        """Begin the sweep with falling amplitude from a top, m sqrt(kg), if it is another one.

        The mode is raised to the top first, or as far as it goes. A joint that has its mode only while it slides begins
        at the top.
        """
        if top == self.top:
            return
        own, first, path = Budget(deadline=deadline), None, ModePath(rest.problem)
        if not rest.glued:
            first = rest.sliding(top, Run(path.case.settings.tolerance, own))
            self.to_down = self.to_rest + own.iterations
        elif (raised := self._raised_to(rest, top, deadline)) is not None:
            first = raised.last if raised.ahead is None else raised.ahead.state
            path, self.to_down = ModePath(problem_of(raised.path)), self.to_up + raised.n_iterations
        self.down, self.top = None if first is None else _begun(path, first, -1.0, deadline), top


def _begun(path: ModePath, first: ModeState, direction: float, deadline: float) -> Sweep[ModeState]:
    """A sweep at its first node."""
    sweep: Sweep[ModeState] = Sweep(path, direction, Budget(deadline=deadline), with_reference=True)
    sweep.begin(path, first)
    return sweep


def solve_point(sweep: Sweep[ModeState], amplitude: float, run: Run) -> ModePoint | Failure:
    """The point of a mode at an amplitude, m sqrt(kg), to which a sweep was advanced."""
    if sweep.here is None:
        return Failure(Outcome.BRANCH_LOST, describe_loss(sweep))
    found = sweep.state_at(amplitude, run.fresh())
    if not isinstance(found, Step):
        ahead = sweep.here if sweep.ahead is None else sweep.ahead.state
        ends = f"{sweep.here.parameter:.4g} and {ahead.parameter:.4g}"
        said = f"no state was found between the amplitudes {ends} m sqrt(kg), where the mode has states"
        return Failure(Outcome.BRANCH_LOST, said)
    other = None
    if sweep.reference is not None:
        path, states = sweep.reference
        reference = path.solve(states, amplitude, run.fresh())
        other = None if reference is None else (problem_of(path), reference)
    return judge_point(problem_of(sweep.path), found.state, other, run)


def problem_of(path: Path[ModeState]) -> ModeProblem:
    """The problem of a path, with its harmonics."""
    assert isinstance(path, ModePath)
    return path.problem


def judge_point(
    problem: ModeProblem, found: ModeState, reference: tuple[ModeProblem, ModeState] | None, run: Run
) -> ModePoint | Failure:
    """The point with the harmonics that it needs, and its errors.

    problem, found: the state, with the harmonics of the problem. reference: the same from the reference sweep, if any.
    """
    settings = problem.case.settings
    # half of rtol is left for the error by the steps of the sweep
    case = replace(problem.case_of(found.values), settings=replace(settings, rtol=0.5 * settings.rtol))
    refined = refine(case, found.omega, float(found.values[2]), found.state, run)
    accurate = refined.accurate
    other = problem.at(refined.case.resolution)
    if other.case.resolution != problem.case.resolution:
        moved = problem.move(found, other, run)
        accurate &= moved is not None
        problem, found = (problem, found) if moved is None else (other, moved)
    errors = _errors_by_resolution(problem, found, run)
    if reference is not None:
        by_steps = reference[0].move(reference[1], problem, run) or reference[1]
        errors = errors + np.abs(by_steps.values - found.values)[:2]
    joint, at, resolution = problem.joint_of(found.values), found.state.evaluation, problem.case.resolution
    certificate = certify(joint, at)
    if not certificate.holds(settings.tolerance):
        return Failure(Outcome.CERTIFICATE_FAILED, certificate.sentence(settings.tolerance))
    # the damping ratio is the sum of parts that may cancel: its error is judged against the part of friction
    by_friction = float(joint.law.friction_work(at).sum()) / (2.0 * np.pi * (found.omega * found.parameter) ** 2)
    damping = max(by_friction, abs(found.damping_ratio), ROUND_OFF)
    known = {"natural frequency": float(errors[0]) / found.omega, "damping ratio": float(errors[1]) / damping}
    said = [f"the {name} {known_to(error, settings.rtol)}" for name, error in known.items() if error > settings.rtol]
    return ModePoint(
        outcome=Outcome.INACCURATE if said or not accurate else Outcome.CONVERGED,
        message="; ".join(said),
        frequency=found.omega / (2.0 * np.pi),
        damping_ratio=found.damping_ratio,
        frequency_error=float(errors[0]) / (2.0 * np.pi),
        damping_error=float(errors[1]),
        response=to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0],
        shape=found.shape,
        slip_fraction=_slips(at).mean(axis=1),
        open_fraction=(at.status_t == SEPARATED).mean(axis=1),
        harmonics_used=resolution.highest,
        samples_used=resolution.samples,
        found=(problem, found),
    )


def _errors_by_resolution(problem: ModeProblem, state: ModeState, run: Run) -> FloatArray:
    """Errors (2,) of frequency, rad/s, and damping ratio by harmonics and samples; inf where they are not known."""
    if nothing_happens(state.state.evaluation):
        return np.zeros(2)

    def change(resolution: Resolution) -> FloatArray:
        moved = problem.move(state, problem.at(resolution), run)
        return np.full(2, np.inf) if moved is None else np.abs(moved.values - state.values)[:2]

    here, errors = problem.case.resolution, np.full(2, np.inf)
    for levels, safety in ((2, ACCURACY.two_levels_safety), (1, ACCURACY.one_level_safety), (-1, 1.0)):
        other = shifted(here, levels)
        if other.orders != here.orders and problem.model.holds(other.highest) and np.isinf(errors).any():
            errors = safety * change(other)
    # samples of their own: an event may stay next to the same sample of twice as many
    return errors + ACCURACY.triple_samples_safety * change(Resolution(here.orders, 3 * here.samples + 2))


def describe_loss(sweep: Sweep[ModeState]) -> str:
    """Sentence about the end of a mode: the last amplitude, and what ends the mode there."""
    here, problem = sweep.last, problem_of(sweep.path)
    assert here is not None
    up = sweep.direction > 0.0
    way, beyond = ("up", "larger") if up else ("down", "smaller")
    said = f"the mode is followed {way} to the amplitude {here.parameter:.4g} m sqrt(kg), at {_hertz(here.omega)}"
    dofs = problem.model.contact.dofs.ravel()
    for order in (n for n in problem.case.resolution.orders if 1 < n <= RESONANT_ORDER):
        omegas, _ = natural_frequencies(problem.model.harmonic_structure(order), dofs[dofs >= 0])
        near = omegas[np.abs(omegas - order * here.omega) < NEAR_RESONANCE * order * here.omega]
        if near.size:
            return f"{said}, where harmonic {order} meets the natural frequency {_hertz(float(near[0]))} of the joint"
    return f"{said}; no state is found at a {beyond} amplitude: the mode turns back there (a fold), or ends"


def _hertz(omega: float) -> str:
    return f"{omega / (2.0 * np.pi):.6g} Hz"


def _slips(at: Evaluation) -> BoolArray:
    """Samples (n_contact, N) in which a pair slips; a pair at its friction limit that does not move sticks."""
    moved = np.abs(np.diff(at.state_t, axis=2)).max(axis=1)
    least = ROUND_OFF * np.abs(at.state_t).max(axis=(1, 2))
    return np.asarray((at.status_t == SLIP) & (moved > least[:, None]))
