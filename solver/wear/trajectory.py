"""The state of a joint while it wears: one step on the slow time scale, and what happens where a branch ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from solver.accuracy.certificate import Certificate, certify
from solver.accuracy.error_estimate import NOTHING, UNKNOWN, Estimate
from solver.accuracy.options import ACCURACY
from solver.accuracy.pair_error import slip_work_error
from solver.accuracy.period_events import lacks_even
from solver.accuracy.refinement import refine
from solver.contact.archard import volume_rate, wear_gain, wear_rate
from solver.contact.wear_law import ARCHARD, WearLaw, wearing_work
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import BalanceAt, PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance
from solver.outcome import Outcome
from solver.packing import attributes, set_attributes
from solver.results.history import StartState
from solver.results.oscillation import RatesState, WearRates
from solver.results.state_report import StateReport, report_state
from solver.settings import Resolution, Scheme
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, Hold, Joint
from solver.wear.branch_loss import state_after_fold, stays
from solver.wear.euler import euler_step
from solver.wear.free_slide import creeps, free_slide, held_on
from solver.wear.options import WEAR
from solver.wear.step_limit import check_step, explicit_step_limit


class Progress(TypedDict):
    """What goes on from step to step: attributes of `Trajectory`."""

    cycle: float
    point: PathPoint
    certificate: Certificate | None
    last_change: tuple[float, FloatArray] | None
    unresolved: float
    jumps: int
    jump_cycle: float
    failure: Outcome
    held_from: float
    step_limit: float
    largest_rate: float
    estimate: Estimate
    estimated_for: FloatArray
    estimated_at: tuple[float, float]
    accurate: bool
    slip_work_error: FloatArray
    inaccurate_from: float
    worst: Estimate


class TrajectoryState(TypedDict):
    """The same with the harmonics and samples, Newton iterations so far and wear rates."""

    progress: Progress
    resolution: Resolution
    iterations: int
    rates: RatesState
    hold: Hold | None


@dataclass
class Trajectory:
    """The current state of a joint that wears, and how it goes on.

    loops: pairs whose fretting loops are reported. with_resonance: whether the resonance of the vibration is.
    """

    case: Case
    start: StartState
    wear_coefficient: float
    scheme: Scheme
    loops: tuple[int, ...] = ()
    wear_law: WearLaw = ARCHARD
    with_resonance: bool = False

    def __post_init__(self) -> None:
        state = self.start.state
        assert state is not None
        self.joint: Joint = self.case.joint(state.omega, state.excitation_amplitude)
        self.wearing = wearing_work(self.wear_law, self.joint.contact, self.joint.friction_coefficient)
        self.solver = JacobianSolver()
        self.effort = Effort()
        self.cycle = 0.0
        self.jump_cycle = float("nan")
        self.last_change: tuple[float, FloatArray] | None = None
        self.unresolved = 0.0
        self.jumps = 0
        # whether a step that is too long ends it; that of a companion only shows in the error
        self.bounded = True
        # N m, against which the slip work of a state in which next to nothing wears is judged
        self.usual_work = 0.0
        self.failure, self.reason = Outcome.MARCH_FAILED, ""
        # count from which on the mean position of a joint that slides all over is held (`free_slide`)
        self.held_from = float("nan")
        self.step_limit = float("nan")
        # m3 per cycle, of every pair and of all together
        self.rates = WearRates(self.case.model.contact.n_contact + 1)
        self.largest_rate = 0.0
        self.estimate = Estimate(self.start.response_error, self.start.wear_rate_error)
        self.slip_work_error = np.zeros(self.case.model.contact.n_contact)
        self.certificate: Certificate | None = None
        self.accurate = self.start.outcome is Outcome.CONVERGED
        # the first count at which it was not, and the largest errors from there on
        self.inaccurate_from = float("inf")
        self.worst = NOTHING

    def state_dict(self) -> TrajectoryState:
        """What goes on from step to step, to be packed; a factorisation that is kept for the next step is not in it."""
        return {
            "progress": attributes(self, Progress),
            "resolution": self.case.resolution,
            "iterations": self.effort.iterations,
            "rates": self.rates.state_dict(),
            "hold": self.case.hold,
        }

    def load_state(self, state: TrajectoryState) -> None:
        """Go on from the state of another one, without its kept factorisation."""
        set_attributes(self, state["progress"])
        self.rates.load_state(state["rates"])
        self.case = self.case.held(state["hold"]).at(state["resolution"])
        self.joint = self.case.joint(self.joint.omega, self.joint.excitation_amplitude)
        self.effort.iterations = state["iterations"]
        self.solver = JacobianSolver()

    def begin(self) -> Outcome:
        """Take up the unworn state, and whether it may be reported."""
        self.take_start()
        self._compare_pairs()
        return self.check()

    def take_start(self) -> None:
        """Take up the unworn state: it is evaluated, not solved again."""
        state = self.start.state
        assert state is not None
        balance = Balance.frozen(self.joint, state.start_history, state.wear_depth)
        predicted = balance.predict(state.displacement_h, state.contact_force_h)
        evaluation = balance.evaluate(predicted)
        self.point = PathPoint(0.0, evaluation, final_history(balance, evaluation))
        self._note()
        self.estimated_for, self.estimated_at = evaluation.predicted_h, self._worn()

    def check(self) -> Outcome:
        """Whether the current state may be reported: a certificate that holds. `accurate`: with errors below rtol."""
        now = self.point.evaluation.predicted_h[:, 1:]
        changed = float(np.linalg.norm(now - self.estimated_for[:, 1:]))
        accurate, anew = True, False
        automatic = self.case.settings.harmonics == "auto"
        unseen = automatic and lacks_even(self.case.resolution.orders, self.point.evaluation)
        vibrates_otherwise = changed > ACCURACY.vibration_recheck * float(np.linalg.norm(self.estimated_for[:, 1:]))
        if vibrates_otherwise or unseen or self._wears_otherwise():
            accurate, anew = self._refine(), True
        holds = self._certify()
        if not holds and accurate and self.case.settings.automatic:
            # more harmonics or samples may be all that it needs
            accurate, anew = self._refine(), True
            holds = self._certify()
        self.accurate = self.accurate if not anew else accurate
        # NaN where harmonics and samples are fixed and no state with others was found to compare with
        known = not np.isnan(self.estimate.largest)
        if not self.accurate or not known:
            self.inaccurate_from = min(self.inaccurate_from, self.cycle)
            if not self.estimate.largest < self.worst.largest:
                self.worst = self.estimate if known else UNKNOWN
        if not holds:
            return Outcome.CERTIFICATE_FAILED
        if self.case.hold is not None and creeps(self.joint, self.case.hold, self.point.evaluation):
            return Outcome.ADRIFT
        return self._judge(every=False) if anew else Outcome.CONVERGED

    def _wears_otherwise(self) -> bool:
        """Whether so much has worn at another rate that errors may have become others, however alike the vibration."""
        (rate, volume), (rate_then, volume_then) = self._worn(), self.estimated_at
        return (
            abs(rate - rate_then) > WEAR.rate_recheck * max(rate, rate_then)
            and volume - volume_then > WEAR.rate_recheck * volume
        )

    def _worn(self) -> tuple[float, float]:
        """Wear rate, m3 per cycle, and worn volume, m3."""
        area = self.joint.contact.area
        return float(self.rate() @ area), float(self.point.evaluation.wear_depth @ area)

    def _certify(self) -> bool:
        """Certificate of the current state, and whether it holds."""
        self.certificate = replace(
            certify(self.joint, self.point.evaluation),
            response_error=self.estimate.response,
            wear_rate_error=self.wearing.amplification(*worn_by(self.point.evaluation)) * self.estimate.wear_rate,
        )
        return self.certificate.holds(self.case.settings.tolerance)

    def _refine(self) -> bool:
        """Estimate the errors of the current state; False where they cannot be brought below rtol."""
        at = self.case, self.joint.omega, self.joint.excitation_amplitude, self.point
        refined = refine(*at, self.effort, usual_work=self.usual_work)
        self.estimate, self.point = refined.estimate, refined.point
        if refined.case is not self.case:
            self.case, self.solver, self.last_change = refined.case, JacobianSolver(), None
            self.joint = self.case.joint(self.joint.omega, self.joint.excitation_amplitude)
        self.estimated_for, self.estimated_at = self.point.evaluation.predicted_h, self._worn()
        self._compare_pairs()
        return refined.accurate

    def _compare_pairs(self) -> None:
        """What the slip work of each pair is wrong by; nothing where nothing wears."""
        self.slip_work_error = np.zeros_like(self.slip_work_error)
        if self.wears():
            self.slip_work_error = slip_work_error(self.case, self.joint, self.point, self.effort)

    def report(self) -> StateReport:
        """What is reported of the current state, which has been checked."""
        assert self.certificate is not None
        at = worn_by(self.point.evaluation)
        report = report_state(
            self.joint,
            self.point.evaluation,
            self.certificate,
            self.slip_work_error,
            self.loops,
            with_resonance=self.with_resonance,
        )
        by_slip_work, _, _ = self.wearing.slopes(*at)
        return replace(
            report, wearing_work=self.wearing.work(*at), wearing_work_error=by_slip_work * report.wearing_work_error
        )

    def rate(self) -> FloatArray:
        """Wear rate (n_contact,) of the current state, m per cycle, Eqs. (7), (21), (25)."""
        return wear_rate(
            self.wear_coefficient, self.joint.contact.area, self.wearing.work(*worn_by(self.point.evaluation))
        )

    def wears(self) -> bool:
        """Whether anything wears at all, more than round-off of the slip that the static load has caused."""
        return bool(self.rate() @ self.joint.contact.area > WEAR.no_wear * self.largest_rate)

    def advance(self, reach: float) -> bool:
        """One Euler step to the cycle count `reach`; False where the branch ends before: then the step has gone as far
        as there is a stable state, to within `fold_resolution`, and `jump` goes on.
        """
        length = reach - self.cycle
        balance_at = euler_step(
            self.joint, self.scheme, self.point.evaluation, length, self.wear_coefficient, self.wearing
        )
        base = PathPoint(0.0, self.point.evaluation, self.point.history)
        if (found := self._extrapolated(balance_at(1.0, base.history), length)) is not None:
            self.take(PathPoint(1.0, found, base.history), balance_at, length)
            return True
        # the end of a branch is to be known to a fraction of the count; in the first step to that of the step
        resolution = WEAR.fold_resolution * (self.cycle if self.cycle > 0.0 else length) / length
        shortest = max(min(resolution, CONTINUATION.shortest_fraction), WEAR.smallest_fold_resolution)
        tolerance = self.case.settings.tolerance
        last, arrived = follow_naturally(
            balance_at, base, 1.0, self.solver, tolerance, self.effort, keep_history=True, shortest=shortest
        )
        if not stays(self.joint, last.evaluation, self.solver):
            # where it has become unstable is not known: the jump is made from the start of the step
            last, arrived = base, False
        if arrived or last.parameter > 0.0:
            self.take(last, balance_at, length)
        self.unresolved = shortest * length
        return arrived

    def jump(self, length: float) -> bool:
        """The branch has ended at the current count, in a step of the given length: land on another stable state a
        little beyond; False where there is none. Raises StepTooLongError.
        """
        if self.jumps >= WEAR.most_jumps:
            return False
        beyond = min(2.0 * self.unresolved, length)
        worn = self.point.evaluation.wear_depth + beyond * self.rate()
        if self.bounded:
            check_step(self.joint, self.point.evaluation, worn, self.cycle, beyond)
        self.last_change = None
        self.effort.limit = self.effort.iterations + WEAR.jump_iterations
        landed = self._land(beyond, worn)
        self.effort.limit = float("inf")
        return landed

    def _land(self, beyond: float, worn: FloatArray) -> bool:
        """Take up a stable state at the depths `worn`, so many cycles ahead; False where there is none."""
        landed: PathPoint | Outcome | None = self._held(worn)
        if landed is None:
            landed = state_after_fold(self.case, self.joint, self.point, worn, self.solver, self.effort)
        if not isinstance(landed, PathPoint):
            self.failure = landed if landed is Outcome.ADRIFT else Outcome.MARCH_FAILED
            return False
        if vibration_change(self.point.evaluation, landed.evaluation) > WEAR.jump_change:
            # corners at which the branch folds back a little are no jumps, and there may be many of them
            self.jumps += 1
            self.jump_cycle = self.cycle if np.isnan(self.jump_cycle) else self.jump_cycle
        self.point = landed
        self.cycle += beyond
        return True

    def _held(self, worn: FloatArray) -> PathPoint | None:
        """The same vibration at the depths `worn`, m, of a joint that slides all over, its mean position held from here
        on; None where that is not why the branch ends.
        """
        if self.case.hold is not None:
            return None
        held = held_on(self.case, self.joint, self.point, worn, self.solver, self.effort)
        if held is None:
            return None
        self.case, self.joint, point = held
        self.held_from = self.cycle
        return point

    def stability(self) -> Outcome:
        """Whether the current state is one that the vibration stays at."""
        # of a joint that is free to slide the determinant is zero, and its sign round-off
        free = free_slide(self.joint, self.point.evaluation) is not None
        if not free and not stays(self.joint, self.point.evaluation, self.solver):
            return Outcome.UNSTABLE
        return self._judge(every=True)

    def _judge(self, every: bool) -> Outcome:
        """Whether the vibration stays at the current state; `every`: as in `find_instability`."""
        unstable = find_instability(self.case, self.joint, self.point.evaluation, self.effort, every)
        if unstable is None:
            return Outcome.CONVERGED
        self.reason = unstable.sentence
        return unstable.outcome

    def oscillates(self) -> bool:
        """Whether the wear rate of the joint or of a pair went up and down from step to step."""
        return self.rates.oscillate(WEAR.oscillation_round_off * self.largest_rate)

    def take(self, point: PathPoint, balance_at: BalanceAt, length: float) -> None:
        """Make the state at a fraction of a step the current one. Raises StepTooLongError."""
        ahead = point.parameter * length
        if self.bounded:
            check_step(self.joint, self.point.evaluation, point.evaluation.wear_depth, self.cycle, ahead)
        balance = balance_at(point.parameter, self.point.history)
        self.accept(PathPoint(0.0, point.evaluation, final_history(balance, point.evaluation)), ahead)

    def accept(self, point: PathPoint, length: float) -> None:
        """Make a state that is so many cycles ahead the current one."""
        self.last_change = (length, point.evaluation.predicted_h - self.point.evaluation.predicted_h)
        self.point = point
        self.cycle += length
        self._note()

    def _note(self) -> None:
        """Keep the wear rate of the current state, and the limit of the explicit step at the first one that wears."""
        rate = self.rate()
        volumes = rate * self.joint.contact.area
        self.rates.add(np.append(volumes, volumes.sum()))
        # with the static slip: where all pairs stick the vibration of the joint itself is round-off
        motion = self.point.evaluation.displacement_h[:, 1:]
        pressed = np.abs(self.point.evaluation.force_t[:, 0]).max(axis=1)
        moved = float(pressed @ np.linalg.norm(motion, axis=(1, 2)))
        most = self.wearing.largest_factor * moved
        self.largest_rate = max(self.largest_rate, volume_rate(self.wear_coefficient, most))
        if np.isnan(self.step_limit) and self.wears():
            gain = wear_gain(self.wear_coefficient, self.joint.contact.area, 1.0)
            self.step_limit = explicit_step_limit(self.joint, self.point.evaluation, gain, self.wearing, self.solver)

    def predicted(self, balance: Balance, length: float) -> FloatArray:
        """Predicted force (n_rel, m), N, to begin a step with: extrapolated over the last step, or that of now."""
        now = self.point.evaluation.predicted_h
        if self.last_change is None:
            return now
        before, change = self.last_change
        ahead = now + (length / before) * change
        nearer = balance.evaluate(ahead).scaled_residual() <= balance.evaluate(now).scaled_residual()
        return ahead if nearer else now

    def _extrapolated(self, balance: Balance, length: float) -> Evaluation | None:
        """State at the end of the step from a start extrapolated over the last one; None where it does not converge."""
        start = self.predicted(balance, length)
        if start is self.point.evaluation.predicted_h:
            return None
        most = WEAR.extrapolated_iterations
        result = solve_balance(balance, start, self.solver, self.case.settings.tolerance, self.effort, most)
        return result.evaluation if result.converged else None
