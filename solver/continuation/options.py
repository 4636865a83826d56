"""Limits that several searches share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationOptions:
    """Limits of searches, each with its unit (none: a ratio) and the evidence for its value.

    A state that is found is exact to the tolerance for all values. The *change* of the vibration is `vibration_change`
    of two states, relative to the first state.
    """

    attempts: int = 25
    """Most attempts of a search that comes closer with each of them: natural steps that fail (a branch with more
    corners is left to arc length), solves for the phase lag of the largest amplitude (a step takes one or two),
    shakedown of sliding masses, pairs that are opened."""
    near_iterations: int = 10
    """Newton iterations from a near state, where a shorter step is the alternative. Of 1400 such converged solves
    (impacts, sliders, random scenes, dovetail) eight needed all ten."""
    smooth_change: float = 0.2
    """Largest change over a smooth step of a branch. A step with a larger change is divided. A fold with a larger
    change is a jump, with a smaller change a corner. Half the value takes up to 50 % more iterations; twice the
    value leads to equal states. Largest length of an arc-length step."""
    linear_change: float = 1.0
    """Largest change over a step between two states in which no pair slips or opens. The reversal of phase at a linear
    resonance is a change of 2."""
    relief: tuple[float, ...] = (0.1, 0.4)
    """Fractions of the static friction forces that are removed where the excitation cannot be raised with the full
    forces. Other fractions lead to other states that friction allows: 5 % for a mass that ratchets."""
    search_iterations: int = 800
    """Most Newton iterations of one search behind the end of a branch: of a relaxation with its periodic state, of the
    last way to a first state, of a jump while the joint wears. A jump at a fold of vibro-impact takes 400 to 500. A
    motion that does not settle (a blade whose 16 pairs all slip and lift) would take thousands."""
    runaway: float = 1e3
    """Displacement over the largest one of vibration and start; above it parts run away."""


CONTINUATION = ContinuationOptions()
