"""The loading history of a point: a slow sweep with steps of its own, which leaves the joint as the machine would.

Friction gives a joint a family of periodic states. The tangential displacements at which the pairs stick select one of
them, and these displacements depend on all vibration before. So a sweep has nodes of its own, whose distance depends
only on the change of the vibration from node to node. A state between two nodes is solved from the node before and
leaves the sweep unchanged. So the state of a point does not depend on the other points of the study.

The reference sweep runs beside the sweep. Its steps are twice as long, and its harmonics and samples fewer where these
are automatic. It never corrects the sweep. The error of a sweep comes from its steps: a pair that sticks from some
frequency on keeps the history of the last node with slip, up to one step too early. The nodes of the reference sweep
therefore lie midway between those of the sweep. At common nodes both would often take the history of a pair from the
same node, and agree by chance. The difference of both sweeps is at least half the error of the finer sweep, and as a
rule the error of the coarser one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.harmonic_levels import fewer
from solver.accuracy.options import ACCURACY
from solver.contact.coulomb import STICK, friction_limit
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import PathPoint, vibration_change, vibration_size
from solver.loading_history.node_resolution import choose_resolution, resolution_holds
from solver.loading_history.options import LOADING
from solver.loading_history.path_step import LoadingPath, Step, in_rows
from solver.newton.journal import RESULTS_PER_SAVE, Journal, Results
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget, move_point
from solver.options import COMMON
from solver.outcome import SENSITIVE_ERROR, Outcome
from solver.packing import packable
from solver.settings import Resolution
from solver.structure.joint import Case

_FINAL = (Outcome.UNSTABLE, Outcome.UNSETTLED, Outcome.ADRIFT)
"""Outcomes of a transient just beyond a node that a shorter step does not change."""

Nodes = tuple[PathPoint, ...]
"""The last one or two nodes of a sweep, with equal harmonics, the current one last; empty where there is no state."""


@packable
@dataclass(frozen=True)
class SweepState:
    """State of a sweep at a node, with which the sweep goes on.

    Attributes
    ----------
    nodes, reference : Nodes
        Last nodes of the sweep and of the reference sweep.
    resolution, reference_resolution : Resolution
        Harmonics and samples of both sweeps.
    checked : PathPoint or None
        The node at which the harmonics were chosen.
    at_limit : bool
        Whether that node needs more harmonics than a sweep may have.
    length : float
        Length of the next step, in the unit of the parameter.
    n_nodes : int
        Number of nodes since the last common node of both sweeps.
    branch, fold : int, float
        Number of folds jumped over so far, and the parameter at the last of them, NaN if none.
    failure, lost_at : Outcome, float
        Reason why there is no state, and the parameter of the last node before, NaN if there was none.
    iterations : int
        Newton iterations so far.
    searched : int
        Of these, the iterations of attempts to begin the sweep again where it was lost.
    """

    resolution: Resolution
    reference_resolution: Resolution
    nodes: Nodes = ()
    reference: Nodes = ()
    checked: PathPoint | None = None
    at_limit: bool = False
    length: float = 0.0
    n_nodes: int = 0
    branch: int = 0
    fold: float = float("nan")
    failure: Outcome = Outcome.START_FAILED
    lost_at: float = float("nan")
    iterations: int = 0
    searched: int = 0


class NodeSweep:
    """A sweep, node by node, up or down along the frequency (rad/s), or along the load factor for a ramp.

    Attributes
    ----------
    state : SweepState
        State at the current node.
    saved : SweepState or None
        State at the last saved node, None before the first node. A resumed sweep that starts from this state and from
        the journal is equal to the last bit.
    journal : Journal
        Results since the last saved node.
    ahead : Step or None
        The next node, where it is known.
    budget : Budget
        Counts and limits the Newton iterations, those of all attempts to begin included.
    alone : bool
        Whether no reference sweep runs beside.
    """

    def __init__(self, case: Case, excitation_amplitude: float, direction: float, omega: float | None = None) -> None:
        """direction: 1 or -1, sign of the steps. omega: frequency of a ramp, rad/s; None for a sweep in frequency."""
        self.path = self.reference_path = LoadingPath(case, excitation_amplitude, omega)
        self.direction = direction
        self.solver, self.reference_solver = JacobianSolver(), JacobianSolver()
        self.journal = Journal()
        self.budget = Budget(journal=self.journal)
        self.state = SweepState(case.resolution, case.resolution)
        self.saved: SweepState | None = None
        self.ahead: Step | None = None
        self.alone = False

    def load_state(self, state: SweepState | None, results: Results) -> None:
        """Go on from the `saved` state and the journal of another sweep; all nodes are equal to the last bit."""
        if state is not None:
            self.saved = self.state = state
            self._take_cases(self.case.at(state.resolution), self.case.at(state.reference_resolution))
            self.budget.iterations = state.iterations
        self._forget()
        self.journal.begin(results)

    @property
    def here(self) -> PathPoint | None:
        """The current node, None where there is no state."""
        return self.state.nodes[-1] if self.state.nodes else None

    @property
    def case(self) -> Case:
        """The case with the harmonics and samples of the nodes."""
        return self.path.case

    def begin(self, case: Case, point: PathPoint) -> bool:
        """Take the first state, which has the harmonics and samples of a case; False where the state is rejected.

        A state that more harmonics change by more than half is rejected: one harmonic can give a joint that slips and
        opens everywhere a state that does not exist.
        """
        self._forget()
        self._take_cases(case, case)
        length = LOADING.longest_sweep_step * self.path.scale(point.parameter)
        self.state = replace(self.state, nodes=(point,), length=length)
        self._begin_reference()
        if self._choose_resolution() > SENSITIVE_ERROR:
            self.state = replace(self.state, nodes=(), reference=(), failure=Outcome.UNSETTLED)
            return False
        self.save()
        return True

    def lose(self) -> None:
        """End the sweep at the current node."""
        at = self.state.lost_at if self.here is None else self.here.parameter
        self.state, self.ahead = replace(self.state, lost_at=at, nodes=(), reference=()), None

    def has_passed(self, parameter: float) -> bool:
        """Whether a value of the parameter lies before the current node, or before the end of a lost sweep."""
        last = self.state.lost_at if self.here is None else self.here.parameter
        return (parameter - last) * self.direction < 0.0

    def advance_to(self, parameter: float) -> None:
        """Go on until the next node lies at or beyond a value of the parameter, or until the branch is lost."""
        while self.here is not None:
            if self.ahead is None:
                self.budget.tell(self.path.describe(self.here))
                self.budget.limit = self.budget.iterations + LOADING.node_iterations
                lost = self.budget.iterations > LOADING.sweep_iterations
                self.ahead = None if lost else self._look_ahead()
                if self.ahead is None:
                    self.lose()
                    return
            if (self.ahead.point.parameter - parameter) * self.direction >= 0.0:
                return
            self._advance(self.ahead)

    def state_at(self, parameter: float, budget: Budget) -> tuple[Step | None, PathPoint | None]:
        """States of the sweep and of the reference sweep at a parameter up to the next node; None where not found.

        A state beyond a fold is solved backwards from the next node, to which the sweep has jumped.
        """
        if self.here is None or self.ahead is None:
            return None, None
        # the sweep must not depend on this state: a solver of its own
        solver = JacobianSolver()
        beyond = [at for at in self.ahead.folds if (parameter - at) * self.direction > 0.0]
        reached: Step | Outcome = Outcome.BRANCH_LOST
        if beyond and parameter != self.ahead.point.parameter:
            reached = self.path.reach((self.ahead.point,), parameter, solver, budget)
            if isinstance(reached, Step):
                reached = Outcome.BRANCH_LOST if reached.folds else replace(reached, folds=tuple(beyond))
        if isinstance(reached, Outcome):
            near = () if self.ahead.folds else (self.ahead.point,)
            reached = self.path.reach((*near, self.here), parameter, solver, budget)
        if isinstance(reached, Outcome):
            self.state = replace(self.state, failure=reached)
            return None, None
        if not self.state.reference:
            return reached, None
        other = self.reference_path.reach(self.state.reference, parameter, JacobianSolver(), budget)
        return reached, None if isinstance(other, Outcome) else other.point

    def _look_ahead(self) -> Step | None:
        """The next node, as far away as the change of the vibration allows."""
        here = self.here
        assert here is not None
        scale = self.path.scale(here.parameter)
        shortest, free = LOADING.shortest_sweep_step * scale, LOADING.free_step * scale
        length = float(np.clip(self.state.length, shortest, LOADING.longest_sweep_step * scale))
        tolerance = self._node_tolerance()
        while not self.budget.exhausted:
            target = here.parameter + self.direction * length
            if self.path.omega is not None:
                target = min(target, 1.0) if self.direction > 0.0 else max(target, 1.0)
            point = self.path.solve(self.state.nodes, target, self.solver, self.budget, tolerance)
            if point is not None:
                change = self._change(here, point)
                if change <= 1.0 or length <= shortest:
                    ratio = min(LOADING.aimed_change / max(change, 1e-12), COMMON.largest_step_ratio)
                    self.state = replace(self.state, length=length * ratio)
                    return Step(point)
                # the change need not be proportional to the length
                shorter = max(LOADING.aimed_change / change, 0.1)
            elif length > free:
                shorter = max(COMMON.smallest_step_ratio, free / length)
            else:
                step = self.path.step(here, target, self.solver, self.budget)
                if isinstance(step, Step):
                    self.state = replace(self.state, length=length)
                    return step
                self.state = replace(self.state, failure=step)
                if length <= shortest or step in _FINAL:
                    return None
                shorter = COMMON.smallest_step_ratio
            length = max(shorter * length, shortest)
        return None

    def _node_tolerance(self) -> float:
        """Tolerance of the scaled residual of a node; reported states are solved to the tolerance of the settings."""
        settings = self.case.settings
        return max(settings.tolerance, NEWTON.forcing * settings.rtol)

    def _change(self, before: PathPoint, after: PathPoint) -> float:
        """Change of the vibration in a step over the largest change allowed."""
        one, other = before.evaluation, after.evaluation
        limit = np.linalg.norm(friction_limit(self.case.friction_coefficient, one.force_h[:, 0, 0]))
        size = max(vibration_size(one), LOADING.small_vibration * float(limit))
        if (one.status_t == STICK).all() and (other.status_t == STICK).all():
            most = CONTINUATION.linear_change
        else:
            most = float(np.clip(LOADING.change_per_rtol * self.case.settings.rtol, *LOADING.change_limits))
        return float(np.linalg.norm((other.predicted_h - one.predicted_h)[:, 1:])) / (size * most)

    def _advance(self, step: Step) -> None:
        """Make the next node the current one."""
        before = self.here
        assert before is not None
        self.ahead = None
        self.state = replace(
            self.state,
            nodes=(step.point,) if step.folds else (before, step.point),
            n_nodes=self.state.n_nodes + 1,
            branch=self.state.branch + len(step.folds),
            fold=(self.state.fold, *step.folds)[-1],
        )
        if step.folds:
            # after a jump both sweeps begin anew: the place of the jump is no measure of the error by steps
            self._begin_reference()
        elif self.state.n_nodes % 2 == 0 and self.state.reference:
            self._advance_reference(0.5 * (before.parameter + step.point.parameter))
        assert self.state.checked is not None
        old, new = self.state.checked.evaluation, step.point.evaluation
        if max(vibration_change(old, new), vibration_change(new, old)) > ACCURACY.vibration_recheck:
            joint = self.path.joint_at(step.point.parameter)
            if resolution_holds(self.case, joint, step.point, self.state.at_limit, self.budget):
                self.state = replace(self.state, checked=step.point)
            else:
                self._choose_resolution()
        if len(self.journal) >= RESULTS_PER_SAVE:
            self.save()

    def _advance_reference(self, target: float) -> None:
        """Solve the next node of the reference sweep; after a failure or a jump, begin this sweep anew."""
        last = self.state.reference
        step = self.reference_path.reach(last, target, self.reference_solver, self.budget, self._node_tolerance())
        if isinstance(step, Outcome) or step.folds:
            self._begin_reference()
        else:
            self.state = replace(self.state, reference=(last[-1], step.point))

    def _begin_reference(self) -> None:
        """Begin the reference sweep, where there is one, at the current node of the sweep."""
        here = self.here
        assert here is not None
        if self.alone:
            return
        case = self.case.at(fewer(self.case.resolution, self.case.settings))
        moved = None
        if case.resolution != self.case.resolution:
            joint = replace(self.path, case=case).joint_at(here.parameter)
            moved = move_point(self.case, case, joint, here, self.budget)
        self._take_cases(self.case, self.case if moved is None else case)
        self.state = replace(self.state, reference=(moved or here,), n_nodes=0)

    def _choose_resolution(self) -> float:
        """Choose the harmonics and samples of the nodes for the current state, as far as they are automatic.

        Returns the estimated relative error of the response, 0 for fixed settings.
        """
        here = self.here
        assert here is not None
        self.state = replace(self.state, checked=here)
        if not self.case.settings.automatic:
            return 0.0
        refined = choose_resolution(self.case, self.path.joint_at(here.parameter), here, self.budget)
        self.state = replace(self.state, at_limit=not refined.accurate)
        point = replace(refined.point, parameter=here.parameter)
        if refined.case.resolution == self.case.resolution:
            self.state = replace(self.state, nodes=(*self.state.nodes[:-1], point), checked=point)
        else:
            self.state = replace(self.state, nodes=(point,), checked=point)
            self._change_case(refined.case)
        return refined.estimate.response

    def _change_case(self, case: Case) -> None:
        """Give both sweeps other harmonics and samples, which the current node has already."""
        old, before = self.reference_path.case, self.state.reference
        reference = case.at(fewer(case.resolution, case.settings))
        self._take_cases(case, reference)
        self.solver, self.reference_solver = JacobianSolver(), JacobianSolver()
        moved = None
        if before and self.state.n_nodes > 0:
            joint = self.reference_path.joint_at(before[-1].parameter)
            moved = move_point(old, reference, joint, before[-1], self.budget)
        if moved is None:
            self._begin_reference()
        else:
            self.state = replace(self.state, reference=(moved,))

    def _take_cases(self, case: Case, reference: Case) -> None:
        self.path, self.reference_path = (replace(self.path, case=one) for one in (case, reference))
        self.state = replace(self.state, resolution=case.resolution, reference_resolution=reference.resolution)

    def save(self) -> None:
        """Save the current node, and drop all that a resumed sweep would not have."""
        state = self.state
        self.state = replace(
            state,
            nodes=tuple(map(in_rows, state.nodes)),
            reference=tuple(map(in_rows, state.reference)),
            checked=None if state.checked is None else in_rows(state.checked),
            iterations=self.budget.iterations,
        )
        self._forget()
        self.saved = self.state
        self.journal.begin()
        self.journal.save()

    def _forget(self) -> None:
        """Drop the factorisations that are kept from node to node, and the next node."""
        self.solver, self.reference_solver, self.ahead = JacobianSolver(), JacobianSolver(), None
