"""Wear on the slow time scale: explicit and implicit Euler steps, and what happens where a branch ends."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from solver.adapt import Estimate, refine
from solver.balance import Balance, Evaluation
from solver.certificate import certify
from solver.history import StartState, WearHistory
from solver.joint import Case, Joint, build_case
from solver.linear import JacobianSolver
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.path import BalanceAt, Effort, PathPoint, final_history, follow_arc, follow_naturally, solve_balance
from solver.record import Recorder
from solver.response import StateReport, report_state, solve_first_state
from solver.settings import SolverSettings

RECHECK = 0.3  # relative change of the vibration after which errors are estimated again

Scheme = Literal["explicit", "implicit"]


def march_wear(
    model: ReducedModel,
    friction_coefficient: float,
    start: StartState,
    wear_coefficient: float,
    step: float,
    scheme: Scheme,
    cycles: FloatArray,
    settings: SolverSettings,
    largest_depth: float | None = None,
) -> WearHistory:
    """Wear history of one point of a study.

    wear_coefficient: 1/Pa. step: h, cycles. cycles (n_output,): ascending counts to report, the first 0; between two
    steps they are interpolated linearly, and the last step is shortened to end on the last of them. largest_depth: m;
    where given, the explicit scheme takes its step from Eq. (22) instead of `step`.
    """
    started = time.thread_time()
    recorder = Recorder(model, cycles, start.newton_iterations, start.run_time)
    if start.state is None:
        return recorder.failed(start.outcome, 0.0)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    march = _March(case, start, wear_coefficient, scheme)
    outcome = Outcome.CONVERGED
    try:
        outcome = march.begin()
        recorder.add(0.0, march.report(), wear_coefficient)
        end = float(cycles[-1])
        while outcome is Outcome.CONVERGED and march.cycle < end:
            if not march.wears():
                recorder.add(end, march.report(), wear_coefficient)
                break
            planned = march.planned_step(step, largest_depth)
            # a remainder below round-off of the count is no step of its own
            reach = end if march.cycle + planned >= end * (1.0 - 1e-12) else march.cycle + planned
            outcome = march.advance(reach)
            if outcome is not Outcome.CONVERGED:
                break
            recorder.add(march.cycle, march.report(), wear_coefficient)
    except np.linalg.LinAlgError:
        outcome = Outcome.SINGULAR
    spent = time.thread_time() - started
    return recorder.finish(outcome, march.jump_cycle, march.effort.iterations, spent)


@dataclass
class _March:
    """The current state and how it goes on."""

    case: Case
    start: StartState
    wear_coefficient: float
    scheme: Scheme

    def __post_init__(self) -> None:
        state = self.start.state
        assert state is not None
        self.joint: Joint = self.case.joint(state.omega, state.excitation_amplitude)
        self.solver = JacobianSolver()
        self.effort = Effort()
        self.cycle = 0.0
        self.jump_cycle = float("nan")
        self.still = np.zeros(self.case.model.contact.n_contact)
        self.last_change: tuple[float, FloatArray] | None = None
        self.estimate = Estimate(self.start.response_error, self.start.wear_rate_error)

    def begin(self) -> Outcome:
        """Take up the unworn state: it is evaluated, not solved again."""
        state = self.start.state
        assert state is not None
        balance = Balance(self.joint, state.start_history, state.wear_depth, self.still)
        predicted = balance.predict(state.displacement_h, state.contact_force_h)
        evaluation = balance.evaluate(predicted)
        self.point = PathPoint(0.0, evaluation, final_history(balance, evaluation))
        self.estimated_for = evaluation.predicted_h
        return self.certify()

    def certify(self) -> Outcome:
        """Certificate of the current state."""
        self.certificate = replace(
            certify(self.joint, self.point.evaluation),
            response_error=self.estimate.response,
            wear_rate_error=self.estimate.wear_rate,
        )
        holds = self.certificate.holds(self.case.settings.tolerance)
        return Outcome.CONVERGED if holds else Outcome.CERTIFICATE_FAILED

    def refine(self) -> bool:
        """Estimate the errors again, where the state has changed enough; False where they cannot be kept below rtol."""
        now = self.point.evaluation.predicted_h[:, 1:]
        changed = float(np.linalg.norm(now - self.estimated_for[:, 1:]))
        if changed <= RECHECK * float(np.linalg.norm(self.estimated_for[:, 1:])):
            return True
        refined = refine(self.case, self.joint.omega, self.joint.excitation_amplitude, self.point, self.effort)
        self.estimate, self.point = refined.estimate, refined.point
        if refined.case is not self.case:
            self.case, self.solver, self.last_change = refined.case, JacobianSolver(), None
            self.joint = self.case.joint(self.joint.omega, self.joint.excitation_amplitude)
        self.estimated_for = self.point.evaluation.predicted_h
        return refined.accurate

    def report(self) -> StateReport:
        """What is reported of the current state."""
        return report_state(self.joint, self.point.evaluation, self.certificate)

    def rate(self) -> FloatArray:
        """Wear rate (n_contact,) of the current state, m per cycle, Eqs. (7), (21)."""
        return self.wear_coefficient / self.joint.contact.area * self.point.evaluation.slip_work

    def wears(self) -> bool:
        """Whether anything wears at all."""
        return bool(self.rate().max(initial=0.0) > 0.0)

    def planned_step(self, step: float, largest_depth: float | None) -> float:
        """Step h in cycles: as given, or by the largest-depth rule, Eq. (22), over the pairs that wear."""
        if largest_depth is None or self.scheme == "implicit":
            return step
        return largest_depth / float(self.rate().max())

    def advance(self, reach: float) -> Outcome:
        """One Euler step to the cycle count `reach`, and how it ended."""
        length = reach - self.cycle
        balance_at = self._explicit(length) if self.scheme == "explicit" else self._implicit(length)
        tolerance = self.case.settings.tolerance
        base = PathPoint(0.0, self.point.evaluation, self.point.history)
        found = self._extrapolated(balance_at(1.0, base.history), length)
        if found is None:
            last, arrived = follow_naturally(
                balance_at, base, 1.0, self.solver, tolerance, self.effort, keep_history=True
            )
            found = last.evaluation if arrived else self._jump(balance_at, last, length)
        if found is None:
            return Outcome.MARCH_FAILED
        balance = balance_at(1.0, base.history)
        change = found.predicted_h - self.point.evaluation.predicted_h
        self.last_change = (length, change)
        self.point = PathPoint(0.0, found, final_history(balance, found))
        self.cycle = reach
        return self.certify() if self.refine() else Outcome.INACCURATE

    def _explicit(self, length: float) -> BalanceAt:
        before, grown = self.point.evaluation.wear_depth, length * self.rate()

        def balance_at(share: float, history: FloatArray) -> Balance:
            return Balance(self.joint, history, before + share * grown, self.still)

        return balance_at

    def _implicit(self, length: float) -> BalanceAt:
        before = self.point.evaluation.wear_depth
        gain = length * self.wear_coefficient / self.joint.contact.area

        def balance_at(share: float, history: FloatArray) -> Balance:
            return Balance(self.joint, history, before, share * gain)

        return balance_at

    def _extrapolated(self, balance: Balance, length: float) -> Evaluation | None:
        """State at the end of the step from a start extrapolated over the last one; None where it does not converge."""
        if self.last_change is None:
            return None
        before, change = self.last_change
        predicted = self.point.evaluation.predicted_h + (length / before) * change
        if (
            balance.evaluate(predicted).scaled_residual()
            > balance.evaluate(self.point.evaluation.predicted_h).scaled_residual()
        ):
            return None
        result = solve_balance(balance, predicted, self.solver, self.case.settings.tolerance, self.effort, 8)
        return result.evaluation if result.converged else None

    def _jump(self, balance_at: BalanceAt, last: PathPoint, length: float) -> Evaluation | None:
        """The branch has ended within the step: follow it through its fold, or land on another one."""
        tolerance = self.case.settings.tolerance
        if np.isnan(self.jump_cycle):
            self.jump_cycle = self.cycle + last.parameter * length
        self.last_change = None
        beyond = follow_arc(balance_at, last, 1.0, 1.0, tolerance, self.effort)
        if beyond is not None:
            return beyond.evaluation
        worn = last.evaluation.wear_depth
        _, other = solve_first_state(
            self.case, self.joint.omega, self.joint.excitation_amplitude, worn, self.solver, self.effort
        )
        if other is None:
            return None
        landed, arrived = follow_naturally(
            balance_at,
            PathPoint(0.0, other.evaluation, other.history),
            1.0,
            self.solver,
            tolerance,
            self.effort,
            keep_history=True,
        )
        return landed.evaluation if arrived else None
