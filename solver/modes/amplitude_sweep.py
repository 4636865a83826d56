"""The way to a point of a nonlinear mode: the amplitude is raised slowly from zero, or lowered.

As in a sweep of the frequency (`solver.loading_history.sweep`), nodes of its own lead the tangential history along, and
a point between two nodes is solved from the node before. So a point depends on its own amplitude only. A reference
sweep with fewer harmonics and twice the steps, whose nodes lie midway, shows the error by the steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.harmonic_levels import fewer
from solver.accuracy.options import ACCURACY
from solver.contact.coulomb import STICK
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import history_at_rest
from solver.loading_history.node_resolution import choose_resolution
from solver.loading_history.options import LOADING
from solver.model import FloatArray
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget
from solver.options import COMMON


@dataclass(frozen=True)
class Nodes:
    """Last one or two nodes of a sweep, the current one last, with the harmonics of `problem`."""

    problem: ModeProblem
    states: tuple[ModeState, ...]

    @property
    def here(self) -> ModeState:
        """The current node."""
        return self.states[-1]

    def reach(
        self, amplitude: float, solver: JacobianSolver, budget: Budget, ahead: ModeState | None = None
    ) -> ModeState | None:
        """The mode at an amplitude with the history of the current node; None where it is not found.

        Newton's method starts on the line through the last two nodes, or through the current one and the next, `ahead`.
        """
        here, problem = self.here, self.problem
        other = ahead or (self.states[0] if len(self.states) > 1 else None)
        history = history_at_rest(problem.joint_of(here), here.point)
        # grown in proportion, the start contains no noise of two near nodes
        for start, values in (*self._on_line(amplitude, other), self._grown(amplitude)):
            tolerance, most = problem.case.settings.tolerance, CONTINUATION.near_iterations
            found = problem.solve(amplitude, start, values, history, solver, tolerance, budget, most)
            if found is not None:
                return found
        return None

    def _on_line(self, amplitude: float, other: ModeState | None) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """Predicted force and values on the line through the current node and another of equal harmonics, if any."""
        here = self.here
        predicted = here.point.evaluation.predicted_h
        if other is None or other.point.evaluation.predicted_h.shape != predicted.shape:
            return ()
        ratio = (amplitude - here.amplitude) / (other.amplitude - here.amplitude)
        start = predicted + ratio * (other.point.evaluation.predicted_h - predicted)
        return ((start, here.values + ratio * (other.values - here.values)),)

    def _grown(self, amplitude: float) -> tuple[FloatArray, FloatArray]:
        """Predicted force and values of the current node, the vibration in proportion to the amplitude."""
        start, growth = self.here.point.evaluation.predicted_h.copy(), amplitude / self.here.amplitude
        start[:, 1:] *= growth
        return start, self.here.values * np.array([1.0, 1.0, growth])


def shape_change(before: ModeState, after: ModeState) -> float:
    """Relative change of the vibrating predicted force per amplitude between two states of equal harmonics."""
    one, other = (state.point.evaluation.predicted_h[:, 1:] / state.amplitude for state in (before, after))
    return float(np.linalg.norm(other - one)) / max(float(np.linalg.norm(one)), 1e-300)


class AmplitudeSweep:
    """A sweep, node by node; its harmonics and those of the reference sweep are chosen on the way.

    - nodes, reference: nodes of the sweep and of the reference sweep.
    - ahead: the next node where it is known.
    - lost: whether the sweep has ended at the current node.
    """

    def __init__(self, nodes: Nodes, direction: float, budget: Budget) -> None:
        """direction: 1 for a rising amplitude, -1 for a falling one."""
        self.nodes, self.reference = nodes, nodes
        self.direction, self.budget = direction, budget
        self.ahead: ModeState | None = None
        self.lost = False
        self._ratio, self._n_nodes = COMMON.largest_step_ratio, 0
        self._solver = JacobianSolver()
        self._checked = nodes.here
        self._choose_resolution()
        self._begin_reference(self.nodes)

    def advance_to(self, amplitude: float) -> None:
        """Go on until the next node is at or beyond an amplitude, or until the mode is lost."""
        while not self.lost:
            self.ahead = self.ahead or self._look_ahead()
            if self.ahead is None:
                self.lost = True
            elif (self.ahead.amplitude - amplitude) * self.direction >= 0.0:
                return
            else:
                self._take(self.ahead)

    def state_at(self, amplitude: float) -> tuple[ModeState | None, ModeState | None]:
        """The mode at an amplitude between the current and the next node, and the same from the reference sweep."""
        if self.ahead is None or (amplitude - self.nodes.here.amplitude) * self.direction < 0.0:
            return None, None
        # solvers of their own: the sweep must not depend on this state
        found = self.nodes.reach(amplitude, JacobianSolver(), self.budget, self.ahead)
        return found, self.reference.reach(amplitude, JacobianSolver(), self.budget)

    def _look_ahead(self) -> ModeState | None:
        """The next node, as far away as the change of the mode allows."""
        here, settings = self.nodes.here, self.nodes.problem.case.settings
        ratio = self._ratio
        while True:
            found = self.nodes.reach(here.amplitude * ratio**self.direction, self._solver, self.budget)
            # where a smaller ratio is needed the mode is lost; with a tenth of the step modes are equal
            shortest = ratio <= 1.0 + LOADING.free_step
            change = 1.0
            if found is not None:
                sticks = all((at.point.evaluation.status_t == STICK).all() for at in (here, found))
                limit = float(np.clip(LOADING.change_per_rtol * settings.rtol, *LOADING.change_limits))
                change = shape_change(here, found) / (CONTINUATION.linear_change if sticks else limit)
                if change <= 1.0 or shortest:
                    wider = min(LOADING.aimed_change / max(change, 1e-12), COMMON.largest_step_ratio)
                    self._ratio = float(np.clip(ratio**wider, 1.0 + LOADING.free_step, COMMON.largest_step_ratio))
                    return found
            if shortest:
                return None
            wanted = 0.0 if found is None else LOADING.aimed_change / change
            ratio = max(ratio ** max(wanted, COMMON.smallest_step_ratio), 1.0 + LOADING.free_step)

    def _take(self, following: ModeState) -> None:
        """Make the next node the current one."""
        before = self.nodes.here
        self.ahead = None
        self.nodes = replace(self.nodes, states=(before, following))
        self._n_nodes += 1
        if self._n_nodes % 2 == 0:
            middle = float(np.sqrt(before.amplitude * following.amplitude))
            found = self.reference.reach(middle, JacobianSolver(), self.budget)
            if found is None:
                self._begin_reference(self.nodes)
            else:
                self.reference = replace(self.reference, states=(self.reference.here, found))
        if shape_change(self._checked, following) > ACCURACY.vibration_recheck:
            self._choose_resolution()

    def _begin_reference(self, reference: Nodes) -> None:
        """Go on with the reference sweep from a node, with fewer harmonics than the sweep has."""
        problem = self.nodes.problem
        settings = problem.case.settings
        other = problem.at(fewer(problem.case.resolution, settings))
        moved = reference.problem.move(reference.here, other, self.budget, settings.tolerance)
        self.reference = self.nodes if moved is None else Nodes(other, (moved,))

    def _choose_resolution(self) -> None:
        """Harmonics and samples that the current node needs, as far as they are automatic."""
        problem, here = self.nodes.problem, self.nodes.here
        self._checked = here
        if not problem.case.settings.automatic:
            return
        case = problem.case_at(here.omega, here.damping_ratio)
        chosen = choose_resolution(case, case.joint(here.omega, here.drive), here.point, self.budget)
        if chosen.case.resolution == problem.case.resolution:
            return
        other = problem.at(chosen.case.resolution)
        moved = problem.move(here, other, self.budget, problem.case.settings.tolerance)
        if moved is not None:
            self.nodes, self._checked, self._solver = Nodes(other, (moved,)), moved, JacobianSolver()
            self._begin_reference(self.reference)
