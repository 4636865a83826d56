"""The loading history of a point: a slow sweep in steps of its own, which leave the joint as the machine would.

Friction makes the periodic states of a joint a family: which one is reached depends on the tangential displacements at
which the pairs stick, and these on all vibration before. A sweep therefore walks along nodes whose distance is chosen
by what happens to the tangential history, and by nothing else. A state that is asked for between two nodes is reached
from the node before it and leaves the walk as it is, so that a point has the same state whatever else is asked for.

A coarse walk goes beside it, in steps of twice the length and with fewer harmonics and samples where these are
automatic; it is never corrected by the other one. What the steps of a sweep do wrong is that a pair which sticks from
some frequency on keeps the history of the last node at which it slipped, which is up to a step too early. The nodes
of the coarse walk therefore lie midway between those of the fine one: with nodes in common both walks would often
take the same history of a pair from the same node and agree by chance. The difference of both is then at least half
the error of the fine walk, and as a rule that of the coarse one.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypedDict

import numpy as np

from solver.accuracy.harmonic_levels import fewer
from solver.accuracy.options import ACCURACY
from solver.accuracy.refinement import Refined, refine
from solver.contact.coulomb import STICK, friction_limit
from solver.harmonic_balance.converged import PathPoint, vibration_change
from solver.loading_history.options import LOADING
from solver.loading_history.route import Route, Step
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, move_point
from solver.outcome import SENSITIVE_ERROR, Outcome
from solver.packing import attributes, set_attributes
from solver.settings import Resolution, first_resolution
from solver.structure.joint import Case

_FINAL = (Outcome.UNSTABLE, Outcome.UNSETTLED, Outcome.ADRIFT)
"""Ends of a transient just beyond a node, which a shorter step does not change."""


class NodeState(TypedDict):
    """What goes on from node to node: attributes of `Sweep`."""

    here: PathPoint | None
    coarse: PathPoint | None
    checked: PathPoint | None
    length: float
    slope: float
    n_nodes: int
    n_walked: int
    branch: int
    fold: float
    failure: Outcome
    lost_at: float


class SweepState(TypedDict):
    """The same with harmonics and samples of the nodes and of the coarse walk, and Newton iterations so far."""

    node: NodeState
    resolution: Resolution
    coarse_resolution: Resolution
    iterations: int


class Sweep:
    """The walk along the frequency (rad/s; up or down), or along the load factor for a ramp.

    here, coarse: the last node of each walk, None where there is no state. branch: folds jumped over so far. fold: the
    last of them, NaN if none. failure: why there is no state.
    """

    def __init__(self, case: Case, excitation_amplitude: float, direction: float, omega: float | None = None) -> None:
        """direction: 1 or -1, of the parameter. omega: rad/s, of a ramp; None for a sweep along the frequency."""
        self.route = self.coarse_route = Route(case, excitation_amplitude, omega)
        self.direction = direction
        self.solver, self.coarse_solver = JacobianSolver(), JacobianSolver()
        self.effort = Effort()
        self.here: PathPoint | None = None
        self.coarse: PathPoint | None = None
        self.checked: PathPoint | None = None
        self.ahead: Step | None = None
        self.length = self.slope = 0.0
        self.n_nodes = self.n_walked = 0
        self.saved: SweepState | None = None
        self.lost_at = float("nan")
        self.branch = 0
        self.fold = float("nan")
        self.failure = Outcome.START_FAILED

    def state_dict(self) -> SweepState:
        """What goes on from node to node, to be packed."""
        return {
            "node": attributes(self, NodeState),
            "resolution": self.case.resolution,
            "coarse_resolution": self.coarse_route.case.resolution,
            "iterations": self.effort.iterations,
        }

    def load_state(self, state: SweepState) -> None:
        """Go on from what was `saved` of another walk to the same points: its nodes follow to the last bit."""
        self.saved = state
        set_attributes(self, state["node"])
        self._take_cases(self.case.at(state["resolution"]), self.case.at(state["coarse_resolution"]))
        self.effort.iterations = state["iterations"]
        self.solver, self.coarse_solver, self.ahead = JacobianSolver(), JacobianSolver(), None

    @property
    def case(self) -> Case:
        """Harmonics and samples of the nodes."""
        return self.route.case

    @property
    def omega(self) -> float | None:
        """rad/s, of a ramp."""
        return self.route.omega

    def _take_cases(self, case: Case, coarse: Case) -> None:
        self.route, self.coarse_route = (replace(self.route, case=one) for one in (case, coarse))

    def begin(self, case: Case, point: PathPoint) -> bool:
        """Take up the first state, which has the harmonics and samples of a case; False where it is none.

        A state that more harmonics change by more than half is none: one harmonic gives a joint that slips and opens
        all over a state that it does not have.
        """
        self.solver, self.coarse_solver = JacobianSolver(), JacobianSolver()
        self._take_cases(case, case)
        self.here = point
        self.length = LOADING.longest_sweep_step * self.route.scale(point.parameter)
        self._begin_coarse()
        if self._choose_harmonics() > SENSITIVE_ERROR:
            self.here = self.coarse = None
            self.failure = Outcome.UNSETTLED
            return False
        self._save()
        return True

    def _begin_coarse(self) -> None:
        """Both walks are at the current node."""
        assert self.here is not None
        self.n_nodes = 0
        coarse = self.case.at(fewer(self.case.resolution, self.case.settings))
        joint = self.route.joint_at(self.here.parameter)
        moved = None
        if coarse.resolution != self.case.resolution:
            joint = replace(self.route, case=coarse).joint_at(self.here.parameter)
            moved = move_point(self.case, coarse, joint, self.here, self.effort)
        self._take_cases(self.case, self.case if moved is None else coarse)
        self.coarse = moved or self.here

    def _save(self) -> None:
        """Keep the current node: the walk goes on from it as another one would that knows no more than this."""
        self.here, self.coarse, self.checked = (_in_rows(point) for point in (self.here, self.coarse, self.checked))
        self.solver, self.coarse_solver = JacobianSolver(), JacobianSolver()
        self.saved = self.state_dict()

    def has_passed(self, parameter: float) -> bool:
        """Whether a value of the parameter lies before the current node, or before where the walk was lost."""
        last = self.lost_at if self.here is None else self.here.parameter
        return (parameter - last) * self.direction < 0.0

    def walk_to(self, parameter: float) -> None:
        """Go on until the next node lies at or beyond a value of the parameter, or the branch is lost before it."""
        while self.here is not None:
            if self.ahead is None:
                self.effort.tell(self.route.describe(self.here))
                self.effort.limit = self.effort.iterations + LOADING.node_iterations
                lost = self.effort.iterations > LOADING.sweep_iterations
                self.ahead = None if lost else self._look_ahead()
                if self.ahead is None:
                    self.lost_at, self.here, self.coarse = self.here.parameter, None, None
                    return
            if (self.ahead.point.parameter - parameter) * self.direction >= 0.0:
                return
            self._advance(self.ahead)

    def state_at(self, parameter: float, effort: Effort) -> tuple[Step | None, PathPoint | None]:
        """State at a value of the parameter up to the next node, and that of the coarse walk; None where not found.

        Behind a fold that the next step jumps over it is reached backwards from the next node, which has jumped.
        """
        if self.here is None or self.ahead is None:
            return None, None
        # nothing of this is to be seen in the walk
        solver = JacobianSolver()
        beyond = [at for at in self.ahead.folds if (parameter - at) * self.direction > 0.0]
        reached = None
        if beyond and parameter != self.ahead.point.parameter:
            back = self.route.step(self.ahead.point, parameter, solver, effort)
            reached = None if isinstance(back, Outcome) or back.folds else Step(back.point, tuple(beyond))
        reached = reached or self._step(self.here, parameter, solver, effort)
        if reached is None or self.coarse is None:
            return reached, None
        coarse = self.coarse_route.step(self.coarse, parameter, JacobianSolver(), effort)
        return reached, None if isinstance(coarse, Outcome) else coarse.point

    def _step(self, start: PathPoint, target: float, solver: JacobianSolver, effort: Effort) -> Step | None:
        step = self.route.step(start, target, solver, effort)
        if isinstance(step, Outcome):
            self.failure = step
            return None
        return step

    def _look_ahead(self) -> Step | None:
        """The next node: as far as the tangential history lets it be."""
        here = self.here
        assert here is not None
        scale = self.route.scale(here.parameter)
        shortest = LOADING.shortest_sweep_step * scale * max(1.0, self.n_walked / LOADING.many_nodes) ** 2
        wanted = LOADING.history_change_per_rtol * self.case.settings.rtol
        most = float(np.clip(wanted, LOADING.smallest_history_change, LOADING.largest_history_change))
        aim = LOADING.aimed_history_change * most
        free = LOADING.free_step * scale
        while True:
            length = min(self.length, LOADING.longest_sweep_step * scale)
            target = here.parameter + self.direction * length
            if self.omega is not None and target > 1.0:
                target = 1.0
            step = self._step(here, target, self.solver, self.effort)
            at_last = length <= shortest
            if step is not None:
                change = self._history_change(here, step.point)
                if change <= most or at_last or (step.folds and length <= free):
                    # towards a resonance the history changes ever faster: as much faster as in the last step
                    slope = max(change, 1e-12) / length
                    growth = float(np.clip(slope / self.slope, 1.0, LOADING.most_growth)) if self.slope > 0.0 else 1.0
                    ratio = np.clip(aim / (slope * growth * length), LOADING.most_shortening, LOADING.most_lengthening)
                    self.length, self.slope = length * float(ratio), slope
                    return step
                shorter = 0.8 * most / change
            elif at_last or self.effort.exhausted or (length <= free and self.failure in _FINAL):
                return None
            else:
                shorter = 0.25
            self.length = max(length * float(np.clip(shorter, 0.1, 0.8)), 0.999 * shortest)

    def _advance(self, step: Step) -> None:
        """Make the next node the current one."""
        before_node = self.here
        assert before_node is not None
        self.here, self.ahead = step.point, None
        self.branch += len(step.folds)
        self.fold = step.folds[-1] if step.folds else self.fold
        self.n_nodes += 1
        self.n_walked += 1
        if step.folds:
            # behind a jump both walks begin anew: where the coarse one jumps says nothing of the steps
            self._begin_coarse()
        elif self.n_nodes % 2 == 0 and self.coarse is not None:
            target = 0.5 * (before_node.parameter + step.point.parameter)
            coarse = self.coarse_route.step(self.coarse, target, self.coarse_solver, self.effort)
            if isinstance(coarse, Outcome) or coarse.folds:
                # one that does not arrive, or jumps, goes on from the other
                self._begin_coarse()
            else:
                self.coarse = coarse.point
        before, now = self.checked, step.point
        assert before is not None
        old, new = before.evaluation, now.evaluation
        if max(vibration_change(old, new), vibration_change(new, old)) > ACCURACY.vibration_recheck:
            self._choose_harmonics()
        if self.n_nodes % LOADING.nodes_per_save == 0:
            self._save()

    def _history_change(self, before: PathPoint, after: PathPoint) -> float:
        """Change of the tangential history, as a force, over the friction limits of the static state.

        Of the pairs that stick all period long behind the step: where others stick follows from the state itself, and
        a mass that sits on its slider has no history but its mean position.
        """
        penalty = self.case.penalty
        sticks = (after.evaluation.status_t == STICK).all(axis=1) & ~penalty.inertial
        stiffness = np.where(sticks, penalty.tangential, 0.0)[:, None]
        change = np.linalg.norm((after.history - before.history) * stiffness)
        limit = float(np.linalg.norm(friction_limit(self.case.friction_coefficient, after.evaluation.force_h[:, 0, 0])))
        return float(change) / limit if limit > 0.0 else 0.0

    def _choose_harmonics(self) -> float:
        """Give the nodes the harmonics and samples that the current state needs, as far as they are automatic.

        Returns the estimated relative error of the response, 0 where it is not asked for.
        """
        assert self.here is not None
        self.checked = self.here
        if not self.case.settings.automatic:
            return 0.0
        joint = self.route.joint_at(self.here.parameter)
        # what the walk misses for want of harmonics shows in the difference to the coarse one
        most = ACCURACY.coarse_unknowns
        refined = refine(self.case, joint.omega, joint.excitation_amplitude, self.here, self.effort, most)
        fewest = first_resolution(self.case.settings)
        if refined.case.resolution.highest < fewest.highest:
            # a joint that sticks needs one harmonic, but the next node may be the first one that slips
            if self.case.resolution == fewest:
                return refined.estimate.response
            case = self.case.at(fewest)
            level = move_point(
                refined.case, case, case.joint(joint.omega, joint.excitation_amplitude), refined.point, self.effort
            )
            refined = refined if level is None else replace(refined, case=case, point=level)
        if refined.case is not self.case:
            self._change_case(refined)
        else:
            self.here = replace(refined.point, parameter=self.here.parameter)
        self.checked = self.here
        return refined.estimate.response

    def _change_case(self, refined: Refined) -> None:
        assert self.here is not None
        parameter, old, before = self.here.parameter, self.coarse_route.case, self.coarse
        self.here, self.solver = replace(refined.point, parameter=parameter), JacobianSolver()
        self.coarse_solver = JacobianSolver()
        coarse = refined.case.at(fewer(refined.case.resolution, refined.case.settings))
        self._take_cases(refined.case, coarse)
        moved = None
        if before is not None and self.n_nodes > 0:
            moved = move_point(old, coarse, self.coarse_route.joint_at(before.parameter), before, self.effort)
        if moved is None:
            self._begin_coarse()
        self.coarse = moved or self.coarse


def _in_rows(point: PathPoint | None) -> PathPoint | None:
    """The same point with arrays that lie in memory as they do when they were kept: sums over them are the same."""
    if point is None:
        return None
    values: dict[str, Any] = {entry.name: getattr(point.evaluation, entry.name) for entry in fields(point.evaluation)}
    lain: dict[str, Any] = {
        name: np.array(value, order="C") for name, value in values.items() if isinstance(value, np.ndarray)
    }
    return replace(point, evaluation=replace(point.evaluation, **lain), history=np.array(point.history, order="C"))
