"""Natural continuation of a converged state along one parameter, and constants that all searches share.

The parameter is the frequency, the excitation amplitude, the position of sliding masses or the fraction of a step on
the slow time scale. The *change* of the vibration is `vibration_change` of two states, relative to the first one. A
state that is found is exact to the tolerance for all values of the constants.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import STICK
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import BalanceAt, State, final_history, vibration_change
from solver.newton.run import MOST_ITERATIONS, SHORTEST_STEP, Run

ATTEMPTS = 25
"""Most attempts of a search that comes closer with each of them: natural steps that fail, solves for the phase lag of
the largest amplitude (a step takes one or two), shakedown of sliding masses, pairs that are opened."""

NEAR_ITERATIONS = 10
"""Newton iterations from a near state, where a shorter step is the alternative. Of 1400 such converged solves (impacts,
sliders, random scenes, dovetail) eight needed all ten."""

SMOOTH_CHANGE = 0.2
"""Largest change over a smooth step of a branch. A step with a larger change is divided. A fold with a larger change is
a jump, with a smaller change a corner. Half the value takes up to 50 % more iterations; twice the value leads to equal
states."""

LINEAR_CHANGE = 1.0
"""Largest change over a step between two states in which no pair slips or opens. The reversal of phase at a linear
resonance is a change of 2."""


def follow_naturally(
    balance_at: BalanceAt,
    start: State,
    target: float,
    run: Run,
    keep_history: bool = False,
    fine: float = np.inf,
) -> tuple[State, bool]:
    """Step the parameter to the target; returns the last state, and whether it is at the target.

    Steps are halved where Newton's method needs many iterations. The first Newton iteration from the last state is a
    tangent predictor (for wear: Eq. (19)), so that no other predictor is needed.

    balance_at, start, target, run: balance at a value of the parameter; first state, with its parameter; last value of
    the parameter; limits.
    keep_history: keeps the tangential history of the start, for intermediate states that are no states of the joint.
    fine: step length, in the unit of the parameter. A longer step is accepted only if the vibration changes little over
    the step: where each step leaves a history to the next step, the state at the target depends on the steps.
    """
    state, whole, shortest = start, target - start.parameter, SHORTEST_STEP
    if np.isfinite(fine) and whole != 0.0:
        shortest = min(shortest, 0.25 * fine / abs(whole))
    # fractions of two: sums of them are exact, so that the last step ends at the target
    fraction, done, failures = 1.0, 0.0, 0
    while state.parameter != target:
        ahead = min(done + fraction, 1.0)
        reach = target if ahead == 1.0 else start.parameter + ahead * whole
        balance = balance_at(reach, state.history)
        most = MOST_ITERATIONS if fraction <= 2.0 * shortest else NEAR_ITERATIONS
        result = run.solve(balance, state.evaluation.predicted_h, most)
        smooth = abs(reach - state.parameter) <= fine or _is_smooth(state.evaluation, result.evaluation)
        if result.converged and smooth:
            history = state.history if keep_history else final_history(balance, result.evaluation)
            state, done, fraction = State(result.evaluation, history, reach), ahead, min(2.0 * fraction, 1.0)
            continue
        fraction = 0.5 * (ahead - done)
        failures += not result.converged
        if fraction < shortest or failures > ATTEMPTS or run.budget.exhausted:
            return state, False
    return state, True


def _is_smooth(before: Evaluation, after: Evaluation) -> bool:
    """Whether the vibration changes so little between two states that no step between them is needed."""
    linear = bool((before.status_t == STICK).all() and (after.status_t == STICK).all())
    return vibration_change(before, after) <= (LINEAR_CHANGE if linear else SMOOTH_CHANGE)
