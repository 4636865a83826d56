"""The points of a nonlinear mode at given amplitudes, each with its errors, or the reason where there is none.

The errors of frequency and damping are, as those of a start state, the change with more harmonics and samples, times a
safety factor, and the change with the tangential history that the reference sweep leaves.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, cast

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.refinement import DIFFERENCE_SAFETY
from solver.accuracy.resolved_state import shifted
from solver.clock import computing_time
from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.state import Failure, first_response
from solver.loading_history.path import Step
from solver.loading_history.sweep import Sweep
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.modes.mode import TOP_BASE, ModeState, NonlinearMode, Rest, find_rest
from solver.newton.run import Budget, Run, guarded
from solver.outcome import Ended, Outcome, is_known_to
from solver.packing import Keep
from solver.settings import ROUND_OFF, Resolution, SolverSettings
from solver.structure.ring import RingModel

Direction = Literal["up", "down"]

_NO_FIRST = Failure(Outcome.START_FAILED, "the mode was not found at its first amplitude")


@dataclass(frozen=True)
class ModePoint(Ended):
    """A point of a nonlinear mode, as `solver.Backbone` at one amplitude. Values are NaN where no state was found.

    - newton_iterations: of the way from rest to the point and of the point, as for this point alone.
    - run_time: CPU seconds of the computing thread since the point before.
    - found: the mode with its harmonics, and its state.
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
    found: tuple[NonlinearMode, ModeState] | None = None


def follow_mode(
    model: ReducedModel,
    amplitudes: FloatArray,
    number: int,
    direction: Direction,
    settings: SolverSettings,
    keep: Keep = lambda _: None,
) -> Iterator[tuple[int, ModePoint]]:
    """Points of a nonlinear mode: index and point, one by one, in the order of the way to them.

    amplitudes: m sqrt(kg), in any order. number, direction: as in `solver.backbone`.
    settings: the limit of time holds for each point with the way from the point before. keep: called with words.
    """
    if isinstance(model, RingModel):
        # the equations of a mode change the matrices of the structure
        model = model.assembled()
    way = _Way((model, number, settings), direction, keep)
    for index in sorted(range(len(amplitudes)), key=lambda index: way.place(float(amplitudes[index]))):
        began = computing_time()
        run = Run(settings.tolerance, Budget(deadline=began + settings.time_limit))
        point = guarded(partial(way.point, float(amplitudes[index]), run))
        if isinstance(point, Failure):
            linear, pairs = model.linear[0], np.full(model.contact.n_contact, math.nan)
            response, shape = (np.full(len(part), math.nan, complex) for part in (linear.response, linear.mass))
            numbers = math.nan, math.nan, math.nan, math.nan
            point = ModePoint(point.outcome, point.message, *numbers, response, shape, pairs, pairs, 0, 0)
        iterations = way.spent.iterations + run.budget.iterations
        yield index, replace(point, newton_iterations=iterations, run_time=computing_time() - began)


def _top_of(amplitude: float) -> float:
    """Amplitude, m sqrt(kg), from which the amplitude of a point is lowered."""
    return float(TOP_BASE ** math.ceil(math.log(2.0 * amplitude, TOP_BASE)))


@dataclass
class _Way:
    """The sweeps to the points: one with rising amplitude, and one with falling amplitude from the present `top`.

    - asked: model, number of the mode, settings.
    - report: called with the progress in words.
    - to_rest, spent: Newton iterations to the rest, and those of the way to the last point without other points.
    """

    asked: tuple[ReducedModel, int, SolverSettings]
    direction: Direction
    report: Keep = lambda _: None
    rest: Rest | Failure | None = None
    up: Sweep[ModeState] | None = None
    down: Sweep[ModeState] | None = None
    top: float = 0.0
    to_rest: int = 0
    spent: Budget = field(default_factory=Budget)

    def place(self, amplitude: float) -> tuple[float, float]:
        """Key by which amplitudes come in the order of the way."""
        return (0.0, amplitude) if self.direction == "up" else (_top_of(amplitude), -amplitude)

    def point(self, amplitude: float, run: Run) -> ModePoint | Failure:
        """The point at the next amplitude, m sqrt(kg). run: of this point alone."""
        deadline = run.budget.deadline
        if self.rest is None:
            own = Run(run.tolerance, Budget(deadline=deadline))
            self.rest = find_rest(*self.asked, own)
            self.to_rest = own.budget.iterations
        self.spent, rest = Budget(self.to_rest), self.rest
        if isinstance(rest, Failure):
            return rest
        if self.direction == "up" and not rest.glued:
            said = 'the joint has no such mode while its pairs stick: give sweep = "down", from large amplitudes'
            return Failure(Outcome.START_FAILED, said)
        if self.direction == "up" and amplitude < rest.first_amplitude:
            node = rest.raised(amplitude, run)
            return _NO_FIRST if node is None else _judged(rest.mode, node, None, run)
        lowered, top = self.direction == "down", _top_of(amplitude)
        sweep = self._lowered_from(rest, top, deadline) if lowered else self._raised_to(rest, amplitude, deadline)
        if sweep.last is None:
            return _NO_FIRST
        self.spent = sweep.budget
        if self.up is not None and lowered and sweep.here is not None and sweep.here.parameter < amplitude:
            # the mode could not be raised to the amplitude from which it is lowered
            return _lost(self.up)
        sweep.budget.deadline = deadline
        found = sweep.state_at(amplitude, run.fresh())
        if not isinstance(found, Step):
            return _lost(sweep)
        return _judged(cast("NonlinearMode", sweep.path), found.state, sweep, run)

    def _raised_to(self, rest: Rest, amplitude: float, deadline: float) -> Sweep[ModeState]:
        """The sweep with rising amplitude at the node before an amplitude; without a node where it does not begin."""
        if self.up is None:
            budget = Budget(self.to_rest, deadline=deadline, report=self.report)
            first = rest.raised(rest.first_amplitude, Run(rest.mode.case.settings.tolerance, budget))
            self.up = _begun(rest.mode, first, 1.0, budget)
        self.up.budget.deadline = deadline
        self.up.advance_to(amplitude)
        return self.up

    def _lowered_from(self, rest: Rest, top: float, deadline: float) -> Sweep[ModeState]:
        """The sweep with falling amplitude from a top, m sqrt(kg), to which the mode is raised first, as far as it
        goes. A joint that has its mode only while it slides begins at the top.
        """
        if self.down is None or top != self.top:
            mode, budget = rest.mode, Budget(self.to_rest, deadline=deadline, report=self.report)
            if rest.glued:
                raised = self._raised_to(rest, top, deadline)
                first = raised.last if raised.ahead is None else raised.ahead.state
                mode, budget.iterations = cast("NonlinearMode", raised.path), raised.budget.iterations
            else:
                first = rest.sliding(top, Run(mode.case.settings.tolerance, budget))
            self.down, self.top = _begun(mode, first, -1.0, budget), top
        return self.down


def _begun(mode: NonlinearMode, first: ModeState | None, sign: float, budget: Budget) -> Sweep[ModeState]:
    sweep: Sweep[ModeState] = Sweep(mode, sign, budget)
    if first is not None:
        sweep.begin(first)
    return sweep


def _judged(mode: NonlinearMode, found: ModeState, sweep: Sweep[ModeState] | None, run: Run) -> ModePoint | Failure:
    """The point with the harmonics that it needs, and its errors. sweep: that has led to the state, if any."""
    settings = mode.case.settings
    # half of rtol is left for the error by the steps of the sweep
    found = mode.refined(found, run, part=0.5)
    mode = mode.at(found.resolution)
    joint, at, resolution = mode.joint_of(found), found.evaluation, mode.case.resolution
    certificate = certify(joint, at)
    if certificate.failures(settings.tolerance):
        return Failure(Outcome.CERTIFICATE_FAILED, certificate.sentence(settings.tolerance))
    errors = _errors_by_resolution(mode, found, run)
    reference = None if sweep is None else sweep.reference_of(found, run)
    if isinstance(reference, Failure):
        errors = np.full(3, math.inf)
    elif reference is not None:
        errors = errors + np.abs(reference.values - found.values)
    # the damping ratio is the sum of parts that may cancel: its error is judged against the part of friction
    by_friction = float(joint.law.friction_work(at).sum()) / (2.0 * np.pi * (found.omega * found.parameter) ** 2)
    damping = max(by_friction, abs(found.damping_ratio), ROUND_OFF)
    # a pair that slips moves
    moved, least = np.abs(np.diff(at.state_t, axis=2)).max(axis=1), ROUND_OFF * np.abs(at.state_t).max(axis=(1, 2))
    known = {"natural frequency": float(errors[0]) / found.omega, "damping ratio": float(errors[1]) / damping}
    said = [f"the {name} {is_known_to(error, settings.rtol)}" for name, error in known.items() if error > settings.rtol]
    return ModePoint(
        outcome=Outcome.INACCURATE if said else Outcome.CONVERGED,
        message="; ".join(said),
        frequency=found.omega / (2.0 * np.pi),
        damping_ratio=found.damping_ratio,
        frequency_error=float(errors[0]) / (2.0 * np.pi),
        damping_error=float(errors[1]),
        response=first_response(joint, at),
        shape=found.shape,
        slip_fraction=((at.status_t == SLIP) & (moved > least[:, None])).mean(axis=1),
        open_fraction=(at.status_t == SEPARATED).mean(axis=1),
        harmonics_used=resolution.highest,
        samples_used=resolution.samples,
        found=(mode, found),
    )


def _errors_by_resolution(mode: NonlinearMode, state: ModeState, run: Run) -> FloatArray:
    """Errors (3,) of frequency, rad/s, damping ratio and drive by harmonics and samples, by a state two levels up; inf
    where it is not found.
    """
    above, two_up = (shifted(mode.case.resolution, levels) for levels in (1, 2))
    # another number of samples, as an event may stay next to the same one
    for samples in (3 * two_up.samples + 2, 4 * two_up.samples + 2) if mode.model.has_harmonics(two_up.highest) else ():
        wanted, between = (mode.at(Resolution(each.orders, samples)) for each in (two_up, above))
        found = wanted.moved(state, run)
        if found is None and (near := between.moved(state, run)) is not None:
            found = wanted.moved(near, run)
        if found is not None:
            return DIFFERENCE_SAFETY * np.abs(found.values - state.values)
    return np.full(3, math.inf)


def _lost(sweep: Sweep[ModeState]) -> Failure:
    """The end of a mode: its last amplitude, and what may end the mode there."""
    here, (way, beyond) = sweep.last, ("up", "larger") if sweep.sign > 0.0 else ("down", "smaller")
    assert here is not None
    at = f"{here.parameter:.4g} m sqrt(kg), at {here.omega / (2.0 * np.pi):.6g} Hz"
    ends = "the mode turns back there (a fold), meets another mode at a multiple of its frequency, or ends"
    # the sweep may go on behind a fold that one of its steps has passed
    behind = sweep.here and sweep.ahead
    where = f"from there to {behind.state.parameter:.4g} m sqrt(kg)" if behind else f"at a {beyond} amplitude"
    said = f"the mode is followed {way} to the amplitude {at}; no state is found {where}: {ends}"
    return Failure(Outcome.BRANCH_LOST, said)
