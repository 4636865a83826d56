"""A nonlinear mode along its amplitude, which is raised slowly from zero, or lowered (`loading_history.sweep`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import STICK
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.state import history_at_rest
from solver.loading_history.node_resolution import choose_resolution
from solver.loading_history.options import LOADING
from solver.loading_history.path_of_states import Step
from solver.march.steps import LARGEST_STEP_RATIO
from solver.model import FloatArray
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution
from solver.structure.joint import Case


@dataclass(frozen=True)
class ModePath:
    """The mode of a problem along its amplitude; lengths of steps are logarithms of the ratio of two amplitudes."""

    problem: ModeProblem

    @property
    def case(self) -> Case:
        """As in Path."""
        return self.problem.case

    @property
    def steps(self) -> tuple[float, float, float]:
        """As in Path: where a smaller ratio is needed the mode is lost; with a tenth of the step modes are equal."""
        shortest = math.log1p(LOADING.free_step)
        return shortest, math.log(LARGEST_STEP_RATIO), shortest

    @property
    def node_tolerance(self) -> float:
        """As in Path."""
        return self.case.settings.tolerance

    def ahead(self, parameter: float, length: float) -> float:
        """As in Path."""
        return parameter * math.exp(length)

    def solve(self, states: tuple[ModeState, ...], target: float, run: Run) -> ModeState | None:
        """As in Path: Newton's method starts on the line through both states, or from the last one in proportion."""
        here, problem = states[-1], self.problem
        history = history_at_rest(problem.joint_of(here), here.state)
        for start, values in (*_on_line(states, target), _grown(here, target)):
            found = problem.solve(target, start, values, history, run, CONTINUATION.near_iterations)
            if found is not None:
                return found
        return None

    def rescue(self, _: ModeState, __: float, ___: Run) -> Step[ModeState] | Outcome:
        """As in Path: a mode that turns back is not followed."""
        return Outcome.BRANCH_LOST

    def change(self, before: ModeState, after: ModeState, wider: float) -> float:
        """As in Path."""
        sticks = all(bool((at.state.evaluation.status_t == STICK).all()) for at in (before, after))
        return self.differs(before, after) / LOADING.largest_change(self.case.settings.rtol, wider, sticks=sticks)

    def rests(self, _: ModeState) -> bool:
        """As in Path: a mode has a reference sweep from its first amplitude on."""
        return False

    def forgets(self, _: ModeState) -> bool:
        """As in Path."""
        return False

    def differs(self, before: ModeState, after: ModeState) -> float:
        """As in Path: of the vibrating predicted force per amplitude."""
        one, other = (at.state.evaluation.predicted_h[:, 1:] / at.parameter for at in (before, after))
        return float(np.linalg.norm(other - one)) / max(float(np.linalg.norm(one)), 1e-300)

    def at(self, resolution: Resolution) -> ModePath:
        """As in Path."""
        return ModePath(self.problem.at(resolution))

    def move(self, state: ModeState, other: ModePath, run: Run) -> ModeState | None:
        """As in Path."""
        return self.problem.move(state, other.problem, run)

    def choose(self, state: ModeState, run: Run) -> tuple[ModePath, ModeState, bool, float]:
        """As in Path."""
        case = self.problem.case_at(state.omega, state.damping_ratio)
        chosen = choose_resolution(case, case.joint(state.omega, state.drive), state.state, run)
        other = self.at(chosen.case.resolution)
        moved = state if chosen.case.resolution == self.case.resolution else self.move(state, other, run)
        # the error of the first response is judged in a sweep of the frequency only
        return (self, state, False, 0.0) if moved is None else (other, moved, chosen.accurate, 0.0)

    def suffices(self, _: ModeState, __: bool, ___: Run) -> bool:
        """As in Path: harmonics are chosen anew."""
        return False

    def describe(self, state: ModeState) -> str:
        """As in Path."""
        return f"at the modal amplitude {state.parameter:.4g} m sqrt(kg)"


def _on_line(states: tuple[ModeState, ...], target: float) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Predicted force and values on the line through two states of equal harmonics, if there are two."""
    if len(states) < 2:
        return ()
    one, here = states
    first, last = (at.state.evaluation.predicted_h for at in states)
    ratio = (target - here.parameter) / (here.parameter - one.parameter)
    return ((last + ratio * (last - first), here.values + ratio * (here.values - one.values)),)


def _grown(here: ModeState, target: float) -> tuple[FloatArray, FloatArray]:
    """Predicted force and values of a state, the vibration in proportion to the amplitude."""
    start, growth = here.state.evaluation.predicted_h.copy(), target / here.parameter
    start[:, 1:] *= growth
    return start, here.values * np.array([1.0, 1.0, growth])
