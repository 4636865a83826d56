"""One step of a loading path: from a stable state to a stable state at another frequency or excitation.

`LoadingPath.solve` solves one balance, with a linear extrapolation of the last two states as its start. Where Newton's
method fails or the state is unstable, `LoadingPath.step` searches by smaller natural steps, by arc-length continuation
through folds, and by integration in time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from solver.contact.coulomb import STICK
from solver.continuation.arc_length import Arc, follow_arc
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.converged import PathPoint, final_history, history_at_rest, vibration_change
from solver.harmonic_balance.dlft import Balance
from solver.loading_history.options import LOADING
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, solve_balance
from solver.outcome import Outcome
from solver.packing import packable
from solver.stability.hill import is_stable_at
from solver.structure.joint import Case, Joint


@packable
@dataclass(frozen=True)
class Step:
    """End of a step.

    point: the state reached.
    folds: values of the parameter at the folds that the step has jumped over.
    """

    point: PathPoint
    folds: tuple[float, ...] = ()


@dataclass(frozen=True)
class LoadingPath:
    """The unworn joint along its frequency or its excitation, which is the parameter of the path.

    case: model, friction and settings.
    excitation_amplitude: N.
    omega: None where the parameter is the frequency, rad/s; else the fixed frequency, rad/s, and the parameter is the
        load factor on the amplitude.
    """

    case: Case
    excitation_amplitude: float
    omega: float | None = None

    def joint_at(self, parameter: float) -> Joint:
        """Joint at a value of the parameter."""
        if self.omega is None:
            return self.case.joint(parameter, self.excitation_amplitude)
        return self.case.joint(self.omega, parameter * self.excitation_amplitude)

    def balance_at(self, parameter: float, history: FloatArray) -> Balance:
        """Unworn balance at a value of the parameter. history (n_contact, 2): m."""
        unworn = np.zeros(self.case.model.contact.n_contact)
        return Balance.frozen(self.joint_at(parameter), history, unworn)

    def scale(self, parameter: float) -> float:
        """Reference value for the lengths of steps."""
        return abs(parameter) if self.omega is None else 1.0

    def solve(
        self,
        nodes: tuple[PathPoint, ...],
        target: float,
        solver: JacobianSolver,
        budget: Budget,
        tolerance: float | None = None,
    ) -> PathPoint | None:
        """Stable state at a value of the parameter by Newton's method alone; None where none is found.

        Parameters
        ----------
        nodes : tuple of PathPoint
            One or two states of the branch with equal harmonics. Newton's method starts on the line through them. The
            tangential history comes from the last state.
        target : float
            Value of the parameter.
        solver, budget
            As in `solve_balance`.
        tolerance : float, optional
            Tolerance of the scaled residual, by default from the settings.
        """
        start = nodes[-1]
        joint, begin = self.joint_at(target), start.evaluation.predicted_h
        balance = Balance.frozen(joint, history_at_rest(joint, start), start.evaluation.wear_depth)
        if len(nodes) > 1:
            ratio = (target - start.parameter) / (start.parameter - nodes[0].parameter)
            begin = begin + ratio * (begin - nodes[0].evaluation.predicted_h)
        limit = self.case.settings.tolerance if tolerance is None else tolerance
        result = solve_balance(balance, begin, solver, limit, budget, CONTINUATION.near_iterations)
        if not result.converged or not is_stable_at(balance, result.evaluation, solver, budget):
            return None
        return PathPoint(target, result.evaluation, final_history(balance, result.evaluation))

    def reach(
        self,
        nodes: tuple[PathPoint, ...],
        target: float,
        solver: JacobianSolver,
        budget: Budget,
        tolerance: float | None = None,
    ) -> Step | Outcome:
        """Stable state at a target from the last of some nodes by `solve`, or else by `step`; or why there is none."""
        point = self.solve(nodes, target, solver, budget, tolerance)
        return self.step(nodes[-1], target, solver, budget) if point is None else Step(point)

    def step(self, start: PathPoint, target: float, solver: JacobianSolver, budget: Budget) -> Step | Outcome:
        """Stable state at a target from a state with equal harmonics and samples, or the reason why there is none."""
        tolerance = self.case.settings.tolerance
        start = replace(start, history=history_at_rest(self.joint_at(start.parameter), start))
        scale = self.scale(target)
        folds: list[float] = []

        def accepted(point: PathPoint) -> bool:
            balance = self.balance_at(point.parameter, point.evaluation.history)
            return is_stable_at(balance, point.evaluation, solver, budget)

        while not budget.exhausted:
            point, arrived = follow_naturally(
                self.balance_at, start, target, solver, tolerance, budget, fine=LOADING.free_step * scale
            )
            if arrived and accepted(point):
                return Step(point, tuple(folds))
            # natural steps may have passed the unknown start of an unstable part: then the search begins before them
            end = start if arrived else point
            arc = Arc(self.balance_at, end, CONTINUATION.arc_span * scale, solver, tolerance, budget)
            found = follow_arc(arc, target, accepted, beyond=False)
            if found.point is not None:
                return Step(found.point, (*folds, *found.jumps))
            if arrived and not found.folds and abs(target - end.parameter) > LOADING.free_step * scale:
                # a shorter step comes closer to the loss of stability without a fold
                return Outcome.UNSTABLE
            landed = self._settled(end, target, found.folds, solver, budget)
            if isinstance(landed, Outcome):
                return landed
            folds.extend(landed.folds)
            if landed.point.parameter == target:
                return Step(landed.point, tuple(folds))
            start = landed.point
        return Outcome.BRANCH_LOST

    def describe(self, point: PathPoint) -> str:
        """Parameter of a state and number of its pairs that slip or open, in words."""
        at = f"{point.parameter / (2.0 * np.pi):.6g} Hz" if self.omega is None else f"load factor {point.parameter:.3g}"
        moving = int(np.count_nonzero((point.evaluation.status_t != STICK).any(axis=1)))
        return f"at {at}, {moving} of {len(point.evaluation.status_t)} pairs slip or open"

    def _settled(
        self, end: PathPoint, target: float, folds: tuple[float, ...], solver: JacobianSolver, budget: Budget
    ) -> Step | Outcome:
        """State to which the structure settles in time from the end of a branch, a little beyond this end."""
        fine = LOADING.free_step * self.scale(end.parameter)
        beyond = end.parameter + float(np.clip(target - end.parameter, -fine, fine))
        joint, before = (self.joint_at(at) for at in (beyond, end.parameter))
        unworn = np.zeros(self.case.model.contact.n_contact)
        why, found = relax_to_periodic(self.case, joint, unworn, end.evaluation, before, end.history, solver, budget)
        if found is None:
            return why
        landed = PathPoint(beyond, found.evaluation, found.history)
        if vibration_change(end.evaluation, found.evaluation) <= CONTINUATION.smooth_change:
            return Step(landed)
        # an arc that ended beyond the fold has found the fold all the same
        return Step(
            landed, (max((end.parameter, *folds), key=lambda at: (at - end.parameter) * (target - end.parameter)),)
        )


def in_rows(point: PathPoint) -> PathPoint:
    """The point with arrays in the memory layout of a saved one, so that sums over them are equal to the last bit."""
    values: dict[str, Any] = {entry.name: getattr(point.evaluation, entry.name) for entry in fields(point.evaluation)}
    lain: dict[str, Any] = {
        name: np.array(value, order="C") for name, value in values.items() if isinstance(value, np.ndarray)
    }
    return replace(point, evaluation=replace(point.evaluation, **lain), history=np.array(point.history, order="C"))
