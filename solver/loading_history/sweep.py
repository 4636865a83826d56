"""The loading history of a point: a slow sweep in steps of its own, which leave the joint as the machine would.

Friction makes the periodic states of a joint a family. Which of them is reached depends on the tangential displacements
at which the pairs stick, and these depend on all vibration before. A sweep therefore has nodes of its own: their
distance is chosen by the change of the vibration from node to node, and by nothing else. A state that is asked for
between two nodes is solved from the node before it and leaves the sweep as it is. So a point has one state, whatever
else is asked for.

The reference sweep goes beside it, in steps of twice the length and with fewer harmonics and samples where these are
automatic; the sweep never corrects it. The error of a sweep comes from its steps: a pair that sticks from some
frequency on keeps the history of the last node at which the pair slipped, up to one step too early. The nodes of the
reference sweep therefore lie midway between those of the sweep: with nodes in common both would often take the history
of a pair from one and the same node, and agree by chance. The difference of both sweeps is at least half the error of
the finer one, and as a rule the error of the coarser one.
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
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, move_point
from solver.outcome import SENSITIVE_ERROR, Outcome
from solver.packing import packable
from solver.settings import Resolution
from solver.structure.joint import Case

_FINAL = (Outcome.UNSTABLE, Outcome.UNSETTLED, Outcome.ADRIFT)
"""Ends of a transient just beyond a node, which a shorter step does not change."""

Nodes = tuple[PathPoint, ...]
"""The last nodes of a sweep, one or two with the same harmonics, the current one last; none where there is no state."""


@packable
@dataclass(frozen=True)
class SweepState:
    """What goes on from node to node.

    Attributes
    ----------
    nodes, reference : Nodes
        Of the sweep and of the reference sweep.
    resolution, reference_resolution : Resolution
        Their harmonics and samples.
    checked : PathPoint or None
        The node at which the harmonics were chosen.
    at_limit : bool
        Whether that node needs more harmonics than a sweep may have.
    length : float
        Of the next step, in the unit of the parameter.
    n_nodes : int
        Nodes since both sweeps had one in common.
    branch, fold : int, float
        Folds jumped over so far, and the value of the parameter at the last of them, NaN if none.
    failure, lost_at : Outcome, float
        Why there is no state, and the parameter of the last node before, NaN if there was none.
    iterations : int
        Newton iterations so far.
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


class NodeSweep:
    """A sweep along the frequency (rad/s; up or down), or along the load factor for a ramp, node by node.

    Attributes
    ----------
    state : SweepState
        At the current node.
    saved : SweepState or None
        At the last node from which the sweep goes on as another one would that knows no more than this.
    ahead : Step or None
        The next node, where it is known.
    budget : Budget
        Newton iterations so far, and their limits.
    """

    def __init__(self, case: Case, excitation_amplitude: float, direction: float, omega: float | None = None) -> None:
        """direction: 1 or -1, of the parameter. omega: rad/s, of a ramp; None for a sweep along the frequency."""
        self.path = self.reference_path = LoadingPath(case, excitation_amplitude, omega)
        self.direction = direction
        self.solver, self.reference_solver = JacobianSolver(), JacobianSolver()
        self.budget = Budget()
        self.state = SweepState(case.resolution, case.resolution)
        self.saved: SweepState | None = None
        self.ahead: Step | None = None

    def load_state(self, state: SweepState) -> None:
        """Go on from what was `saved` of another sweep to the same points: the nodes follow to the last bit."""
        self.saved = self.state = state
        self._take_cases(self.case.at(state.resolution), self.case.at(state.reference_resolution))
        self.budget.iterations = state.iterations
        self._forget()

    @property
    def here(self) -> PathPoint | None:
        """The current node, None where there is no state."""
        return self.state.nodes[-1] if self.state.nodes else None

    @property
    def case(self) -> Case:
        """Harmonics and samples of the nodes."""
        return self.path.case

    def begin(self, case: Case, point: PathPoint) -> bool:
        """Take up the first state, which has the harmonics and samples of a case; False where it is none.

        A state that more harmonics change by more than half is none: one harmonic gives a joint that slips and opens
        all over a state that it does not have.
        """
        self._forget()
        self._take_cases(case, case)
        length = LOADING.longest_sweep_step * self.path.scale(point.parameter)
        self.state = replace(self.state, nodes=(point,), length=length)
        self._begin_reference()
        if self._choose_resolution() > SENSITIVE_ERROR:
            self.state = replace(self.state, nodes=(), reference=(), failure=Outcome.UNSETTLED)
            return False
        self._save()
        return True

    def lose(self) -> None:
        """The sweep ends behind the current node."""
        at = self.state.lost_at if self.here is None else self.here.parameter
        self.state, self.ahead = replace(self.state, lost_at=at, nodes=(), reference=()), None

    def has_passed(self, parameter: float) -> bool:
        """Whether a value of the parameter lies before the current node, or before where the sweep was lost."""
        last = self.state.lost_at if self.here is None else self.here.parameter
        return (parameter - last) * self.direction < 0.0

    def advance_to(self, parameter: float) -> None:
        """Go on until the next node lies at or beyond a value of the parameter, or the branch is lost before it."""
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
        """State at a value of the parameter up to the next node, and that of the reference sweep; None where not found.

        Behind a fold that the next step jumps over it is reached backwards from the next node, which has jumped.
        """
        if self.here is None or self.ahead is None:
            return None, None
        # nothing of this is to be seen in the sweep
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
        """The next node: as far as the change of the vibration lets it be."""
        here = self.here
        assert here is not None
        scale = self.path.scale(here.parameter)
        shortest, free = LOADING.shortest_sweep_step * scale, LOADING.free_step * scale
        length = float(np.clip(self.state.length, shortest, LOADING.longest_sweep_step * scale))
        tolerance = self._node_tolerance()
        while not self.budget.exhausted:
            target = here.parameter + self.direction * length
            if self.path.omega is not None:
                target = min(target, 1.0)
            point = self.path.solve(self.state.nodes, target, self.solver, self.budget, tolerance)
            if point is not None:
                change = self._change(here, point)
                if change <= 1.0 or length <= shortest:
                    ratio = float(np.clip(LOADING.aimed_change / max(change, 1e-12), *LOADING.lengthening))
                    self.state = replace(self.state, length=length * ratio)
                    return Step(point)
                shorter = float(np.clip(LOADING.aimed_change / change, LOADING.lengthening[0], LOADING.aimed_change))
            elif length > free:
                shorter = max(0.25, free / length)
            else:
                step = self.path.step(here, target, self.solver, self.budget)
                if isinstance(step, Step):
                    self.state = replace(self.state, length=length)
                    return step
                self.state = replace(self.state, failure=step)
                if length <= shortest or step in _FINAL:
                    return None
                shorter = 0.25
            length = max(shorter * length, shortest)
        return None

    def _node_tolerance(self) -> float:
        """Scaled residual of a node: the states that are handed out are solved to the end."""
        settings = self.case.settings
        return max(settings.tolerance, LOADING.node_residual * settings.rtol)

    def _change(self, before: PathPoint, after: PathPoint) -> float:
        """Change of the vibration in a step over the largest that there may be."""
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
            # behind a jump both sweeps begin anew: where the reference jumps says nothing of the steps
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
        if self.state.n_nodes % LOADING.nodes_per_save == 0:
            self._save()

    def _advance_reference(self, target: float) -> None:
        """The next node of the reference sweep; where it does not arrive, or jumps, it goes on from the sweep."""
        last = self.state.reference
        step = self.reference_path.reach(last, target, self.reference_solver, self.budget, self._node_tolerance())
        if isinstance(step, Outcome) or step.folds:
            self._begin_reference()
        else:
            self.state = replace(self.state, reference=(last[-1], step.point))

    def _begin_reference(self) -> None:
        """Both sweeps are at the current node."""
        here = self.here
        assert here is not None
        case = self.case.at(fewer(self.case.resolution, self.case.settings))
        moved = None
        if case.resolution != self.case.resolution:
            joint = replace(self.path, case=case).joint_at(here.parameter)
            moved = move_point(self.case, case, joint, here, self.budget)
        self._take_cases(self.case, self.case if moved is None else case)
        self.state = replace(self.state, reference=(moved or here,), n_nodes=0)

    def _choose_resolution(self) -> float:
        """Give the nodes the harmonics and samples that the current state needs, as far as they are automatic.

        Returns the estimated relative error of the response, 0 where it is not asked for.
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
        """Both sweeps go on with other harmonics and samples, which the current node has already."""
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

    def _save(self) -> None:
        """Keep the current node: the sweep goes on as another one would that knows no more than this."""
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

    def _forget(self) -> None:
        """Give up the factorisations that are kept from node to node, and the next node."""
        self.solver, self.reference_solver, self.ahead = JacobianSolver(), JacobianSolver(), None
