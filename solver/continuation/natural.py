"""Steps along a parameter, natural steps, shakedown of sliding masses by them, and constants that all searches share.

The length of a step along frequency, load, amplitude, cycles or missions follows from the change of the state over the
step, or its local error, over the one allowed (`take_step`). Natural steps, by Newton's method alone, are halved where
it fails (`follow_naturally`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import Failure, State
from solver.newton.run import MOST_ITERATIONS, SHORTEST_STEP, Run
from solver.structure.joint import Joint

ATTEMPTS = 25
"""Most attempts of a search that comes closer with each of them: natural steps that fail, solves for the phase lag of
the largest amplitude (a step takes one or two), shakedown of sliding masses, pairs that are opened. Half and twice:
slider, masses, blocks and impacts are equal."""

NEAR_ITERATIONS = 10
"""Newton iterations from a near state, where a shorter step is the alternative. Of 1400 solves eight needed ten."""

SMOOTH_CHANGE = 0.2
"""Largest change over a smooth step of a branch, of the phase lag in rad; a fold with a smaller change is a corner.
Half the value takes up to 50 % more iterations; twice the value leads to equal states."""

SMALL_CHANGE = SMOOTH_CHANGE / 10.0
"""Change over a step of a relaxation below which a periodic state is sought, of the first arc-length step over the
norm of the first predicted force, and most of a frequency that is an unknown in an iteration. Half and twice: followed
resonance and peak of the slider are equal within 5e-4."""

FINE_STEP = 1e-3
"""Length over which the end or a corner of a branch is located, over the parameter, the cycle count or the force along
the branch: there a sweep is left to its rescue, and no shorter step is made but of a sweep. Also the first load factor
of a ramp, and the first amplitude of a mode, as vibrating contact forces over the friction limits. Wear with 5e-3: 20
of 300 steps at corners of a resonance have up to four times the allowed error (dovetail, 48 pairs, 211.25 Hz), and
other kernels of BLAS end 0.75 % apart, with 1e-3 0.4 %. Arc length without it: seven branches with folds take 46 % more
iterations. Modes with 1e-2 and 1e-4: the damping of the dovetail changes by 7e-5 and 1e-3."""

STEP_SAFETY = 0.85
"""Length of a step over the length with the allowed error, and the largest factor on a step that was refused. With 0.7
and 0.95 histories of slider, blocks and spheres agree within their errors (2e-3) with 2 % fewer and 7 % more
iterations."""

LARGEST_STEP_RATIO = 2.0
"""Largest ratio of two successive steps, and of a step to its wanted length; BDF2 is zero-stable below 1 + sqrt(2).
With 1.4 the damping of a mode of the dovetail changes by 5e-6."""

SMALLEST_STEP_RATIO = 0.25
"""Factor on a step whose end was not found, and smallest factor on a step that was refused. On the viscosity of a
joint that settles under its static load, with 0.05 as many random decks have a static state."""

HereT = TypeVar("HereT", contravariant=True)
EndT = TypeVar("EndT")


class SteppedProblem(Protocol[HereT, EndT]):
    """What goes on by steps (`take_step`)."""

    def attempt(self, here: HereT, length: float, /) -> EndT | None:
        """End of a step; None where it is not found."""

    def ratio(self, here: HereT, end: EndT, length: float, /) -> float:
        """Change or error of a step over the allowed one; above 1 the step is refused."""

    def rescue(self, here: HereT, length: float, /) -> EndT | Failure:
        """End of a step that is not found, or refused, however short; or why no step goes on."""


@dataclass(frozen=True)
class Lengths:
    """The rule for the length of a step, at least the shortest. safety: as `STEP_SAFETY`.

    order: power of the length with which the ratio of `SteppedProblem` grows.
    rescue: length at and below which a step that is not found is left to the rescue.
    """

    order: int
    safety: float = STEP_SAFETY
    shortest: float = 0.0
    rescue: float = 0.0

    def factor(self, ratio: float, *, accepted: bool) -> float:
        """Length of the next step, or of the next attempt of a refused one, over the present length."""
        wanted = self.safety * max(ratio, 1e-12) ** (-1.0 / self.order)
        least, most = self.safety, LARGEST_STEP_RATIO
        return float(np.clip(wanted, *((least, most) if accepted else (SMALLEST_STEP_RATIO, least))))


def take_step(
    problem: SteppedProblem[HereT, EndT], here: HereT, length: float, lengths: Lengths
) -> tuple[EndT, float] | Failure:
    """The end of one step and the length of the next one, or why there is none; length: of the first attempt."""
    length = max(length, lengths.shortest)
    while True:
        end = problem.attempt(here, length)
        ratio = math.inf if end is None else problem.ratio(here, end, length)
        # an error that is not known
        ratio = math.inf if math.isnan(ratio) else ratio
        if end is not None and ratio <= 1.0:
            return end, length * lengths.factor(ratio, accepted=True)
        floor = lengths.rescue if end is None else lengths.shortest
        if length <= floor:
            rescued = problem.rescue(here, length)
            return rescued if isinstance(rescued, Failure) else (rescued, length)
        length = max(lengths.factor(ratio, accepted=False) * length, floor)


def follow_naturally(
    balance_from: Callable[[float, State], Balance], start: State, target: float, run: Run, fine: float = np.inf
) -> tuple[State, bool]:
    """Step the parameter to the target; returns the last state, and whether it is at the target.

    The first Newton iteration from the last state is a tangent predictor (for wear: Eq. (19)).
    balance_from: balance at a parameter from the last state. fine: longest step.
    """
    state, whole = start, target - start.parameter
    # fractions of two: sums of them are exact, so that the last step ends at the target
    fraction = longest = 2.0 ** math.floor(math.log2(min(fine / max(abs(whole), 1e-300), 1.0)))
    shortest, done, failures = min(SHORTEST_STEP, 0.25 * longest), 0.0, 0
    while state.parameter != target:
        ahead = min(done + fraction, 1.0)
        reach = target if ahead == 1.0 else start.parameter + ahead * whole
        most = MOST_ITERATIONS if fraction <= 2.0 * shortest else NEAR_ITERATIONS
        found = run.state(balance_from(reach, state), state.evaluation.predicted_h, reach, most)
        if found is not None:
            state, done, fraction = found, ahead, min(2.0 * fraction, longest)
            continue
        fraction, failures = 0.5 * (ahead - done), failures + 1
        if fraction < shortest or failures > ATTEMPTS or run.budget.exhausted:
            return state, False
    return state, True


def ratchets(joint: Joint, at: Evaluation, fraction: float) -> bool:
    """Whether the work of ratcheting in a period exceeds a fraction of the slip work.

    Only a very small stiffness (`penalty.mean`) keeps the mean position of a mass on a slider, so that the law may
    ratchet in each period although the Fourier series are periodic. This slip counts as wear, but its work is not in
    the balance of energy.
    """
    work = float(np.abs(at.force_h[:, 0, 0]) @ np.where(joint.penalty.inertial, at.change, 0.0))
    return work > fraction * float(at.slip_work.sum())


def shake_down(joint: Joint, state: State, fraction: float, run: Run) -> State:
    """State after shakedown of the masses at an unchanged wear depth: the mean position becomes the new history until
    the work of ratcheting is at most a fraction of the slip work. The last state found where this does not end.
    """
    run = run.fresh()
    for _ in range(ATTEMPTS):
        if not ratchets(joint, state.evaluation, fraction):
            break
        moved, arrived = _shifted(joint, state, run)
        if not arrived:
            break
        state = replace(moved, parameter=state.parameter)
    return state


def _shifted(joint: Joint, state: State, run: Run) -> tuple[State, bool]:
    """As `follow_naturally`, along the history of the masses from that of a state to that which the state leaves."""
    at = state.evaluation
    left = joint.law.final_history(at, at.displacement_h)
    shift = np.where(joint.penalty.inertial[:, None], left - at.start_history, 0.0)

    def balance_from(part: float, _: State) -> Balance:
        return Balance(joint, at.start_history + part * shift, at.wear_depth, energy=at.energy)

    return follow_naturally(balance_from, replace(state, parameter=0.0), 1.0, run)
