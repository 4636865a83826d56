"""Pseudo-arc-length continuation of a branch through its folds: the parameter is the further unknown of a bordered
system, whose further equation puts the point in a plane across the tangent of the branch.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.continuation.natural import FINE_STEP, LARGEST_STEP_RATIO, NEAR_ITERATIONS, SMALL_CHANGE, SMOOTH_CHANGE
from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.harmonic_balance.state import State, state_of
from solver.model import FloatArray
from solver.newton.run import SHORTEST_STEP, Bordered, Run

SHORTEST_ARC = FINE_STEP / 10.0
"""Shortest step: where none of this length converges, the branch has a corner."""


@dataclass(frozen=True)
class Arc:
    """A branch and its arc-length steps in scaled unknowns (p / size, parameter / span), with the history of its start.

    balance_at: balance at a value of the parameter, with this history. slope: of the residual (n_rel, m), N, by the
    parameter, at a fixed predicted force. span: natural length of the parameter.
    """

    balance_at: Callable[[float], Balance]
    slope: Callable[[Balance, Evaluation], FloatArray]
    start: State
    span: float
    run: Run

    @cached_property
    def size(self) -> float:
        """Norm of the first predicted force, N."""
        return max(float(np.linalg.norm(self.start.evaluation.predicted_h)), 1e-300)

    def steps(self, toward: float) -> Iterator[tuple[State, State, State | None]]:
        """Start and end of each step along the branch, and the state at the fold between both, None if none.

        toward: sign of the first change of the parameter.
        """
        state, length = self.start, SMALL_CHANGE
        along = np.zeros(state.evaluation.predicted_h.size + 1)
        along[-1] = toward
        tangent = self.tangent(state, along)
        while tangent is not None and not self.run.budget.exhausted:
            reached = None
            while reached is None and length > SHORTEST_ARC:
                reached = self.step(state, tangent, length)
                length = 0.5 * length if reached is None else min(2.0 * length, SMOOTH_CHANGE)
            reached = reached or self._step_over_corner(state, tangent)
            if reached is None:
                return
            back = state is self.start and (reached.parameter - state.parameter) * toward < 0.0
            ahead = self.tangent(reached, self.place(reached) - self.place(state))
            turns = ahead is not None and ahead[-1] * tangent[-1] < 0.0
            yield state, reached, state if back else self._fold(state, tangent, reached) if turns else None
            state, tangent, length = reached, ahead, max(length, FINE_STEP)

    def place(self, state: State) -> FloatArray:
        """Scaled unknowns of a state."""
        return np.append(state.evaluation.predicted_h.ravel() / self.size, state.parameter / self.span)

    def state_of(self, here: Bordered) -> State:
        """State of the branch from an evaluation with the scaled parameter."""
        found = state_of(here.balance.joint, here.at, float(here.values[0] * self.span))
        return replace(found, next_history=self.start.next_history)

    def tangent(self, state: State, along: FloatArray) -> FloatArray | None:
        """Unit tangent of the branch, of the sign of a direction `along`; None where the tangent is not defined."""
        balance, at = self.balance_at(state.parameter), state.evaluation
        steps = self.run.steps(balance, at, [-self.span * self.slope(balance, at)])
        tangent = np.append((steps / self.size).ravel(), 1.0)
        largest = float(np.abs(tangent).max())
        if not np.isfinite(largest):
            return None
        # near a fold the square of the step may overflow, although its direction is right
        tangent /= largest
        tangent /= np.linalg.norm(tangent)
        return np.asarray(tangent * (np.sign(tangent @ along) or 1.0))

    def step(self, state: State, tangent: FloatArray, length: float) -> State | None:
        """State of the branch at the given length along the tangent; None where the corrector does not converge."""
        plane = _Plane(self, self.place(state), tangent, length)
        found = self.run.solve_bordered(plane, *plane.first(), NEAR_ITERATIONS - 1)
        return None if found is None else self.state_of(found)

    def _step_over_corner(self, state: State, tangent: FloatArray) -> State | None:
        """State behind a corner, along the tangent a little ahead, with both signs; None where none is found."""
        plane = _Plane(self, self.place(state), tangent, FINE_STEP)
        turned = self.tangent(self.state_of(plane.evaluate(*plane.first())), tangent)
        if turned is None:
            return None
        for sign in (1.0, -1.0):
            reached = self.step(state, sign * turned, FINE_STEP)
            if reached is None:
                continue
            chord = self.place(reached) - plane.base
            # a chord within 8 degrees of the backward tangent lies on the branch before the corner
            if chord @ tangent > -0.99 * np.linalg.norm(chord):
                return reached
        return None

    def state_at(self, before: State, after: State, target: float) -> State | None:
        """State at the target between two states of the branch; None where Newton's method fails."""
        fraction = (target - before.parameter) / (after.parameter - before.parameter)
        one, other = before.evaluation.predicted_h, after.evaluation.predicted_h
        found = self.run.state(self.balance_at(target), one + fraction * (other - one), target, NEAR_ITERATIONS)
        return None if found is None else replace(found, next_history=self.start.next_history)

    def _fold(self, state: State, tangent: FloatArray, after: State) -> State:
        """State with the extreme parameter between two states, by bisection of the length; tangent: at the first."""
        sign, low, high = np.sign(tangent[-1]), 0.0, float(tangent @ (self.place(after) - self.place(state)))
        best = max(state, after, key=lambda each: sign * each.parameter)
        shortest = SHORTEST_STEP * high  # the parameter is off by its square; with an eighth folds are equal
        while high - low > shortest:
            place = 0.5 * (low + high)
            found = self.step(state, tangent, place)
            ahead = None if found is None else self.tangent(found, tangent)
            if found is None or ahead is None:
                break
            best = max(best, found, key=lambda each: sign * each.parameter)
            low, high = (place, high) if ahead[-1] * sign > 0.0 else (low, place)
        return best


@dataclass(frozen=True)
class _Plane:
    """As BorderedProblem: a branch, and the plane across its tangent at a length from a base, both scaled (n + 1,)."""

    arc: Arc
    base: FloatArray
    tangent: FloatArray
    length: float

    def first(self) -> tuple[FloatArray, FloatArray]:
        """Predicted force (n_rel, m), N, and scaled parameter (1,) where the tangent meets the plane."""
        ahead = self.base + self.length * self.tangent
        return ahead[:-1].reshape(self.arc.start.evaluation.predicted_h.shape) * self.arc.size, ahead[-1:]

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        balance = self.arc.balance_at(float(values[0] * self.arc.span))
        moved = np.append(predicted_h.ravel() / self.arc.size, values) - self.base
        ahead = float(self.tangent @ moved) - self.length
        return Bordered(balance, balance.evaluate(predicted_h), values, np.array([ahead]), extra=moved)

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        return [self.arc.span * self.arc.slope(here.balance, here.at)], self.tangent[-1:, None]

    def by_step(self, _: Bordered, __: Linearisation, step: FloatArray) -> FloatArray:
        return np.array([self.tangent[:-1] @ step.ravel() / self.arc.size])

    def fraction(self, here: Bordered, _: FloatArray) -> float:
        # without it the branch of `tests/solver/test_whole_response.py` is left for another one
        far = np.linalg.norm(here.extra) > LARGEST_STEP_RATIO * abs(self.length)
        return np.nan if far else 1.0
