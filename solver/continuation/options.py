"""Tuning constants of the continuation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationOptions:
    """Step lengths and budgets, each with its meaning, unit (none: a ratio) and the evidence for its value.

    A state that is found is exact to the tolerance for all values of the options. The *change* of the vibration is
    `vibration_change` of two states, relative to the first state. Steps are doubled after a success and halved after a
    failure.
    """

    # shared
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
    value leads to equal states. A relaxation in time seeks a periodic state below a tenth of this change. Largest
    length of an arc-length step; the first one has a tenth (with the whole length seven branches with folds take 1.5 %
    more iterations)."""

    # arc length, in unknowns divided by the norm of the first predicted force
    arc_span: float = 0.05
    """Natural length of a frequency over the frequency, and of a load factor. Distance from the end of a sweep to the
    next attempt to begin it again, over the frequency."""
    arc_correctors: int = 300
    """Correctors of one continuation, converged or not."""
    corner_arc: float = 1e-3
    """Length of the step behind a corner, and least length after a step. Where no step of a tenth of this length
    converges, the branch has a corner. Without such a least length the same branches
    take 46 % more iterations; with ten times the value 8 % more than with several lengths, with this value 5 %."""
    arc_wander: float = 2.0
    """Distance of a corrector from its start over the length of the step, above which the corrector is given up.
    Without it the branch of `tests/solver/test_arc_length.py` is left for another one. Four times the length takes 1 %
    more iterations."""
    farthest: float = 10.0
    """Natural lengths of the parameter from start and target at which the search ends."""

    # first state
    load_steps: int = 20
    """Steps of the static load, which may change the state. The state of the dovetail is unchanged with 10 and 40."""
    relief: tuple[float, ...] = (0.1, 0.4)
    """Fractions of the static friction forces that are removed where the excitation cannot be raised with the full
    forces. Other fractions lead to other states that friction allows: 5 % for a mass that ratchets."""
    viscosity_cut: float = 0.2
    """Factor on the viscosity of a static state after a step in time. With 0.05 and 0.1 as many random decks
    (`tests/random_decks.py`) have a static state, for 6 % fewer to 30 % more iterations."""
    viscosity_rise: float = 10.0
    """Factor on this viscosity after a step that was not found. With 5 as many iterations."""
    viscous_steps: int = 300
    """Most steps in time on the way to a static state. Of 300 random decks one needs more than 60: a block that rocks
    through a gap with little friction."""

    # relaxation in time; a change is the norm of the change of the amplitudes over the larger norm of two motions
    search_iterations: int = 800
    """Most Newton iterations of one search behind the end of a branch: of a relaxation with its periodic state, of the
    last way to a first state, of a jump while the joint wears. A jump at a fold of vibro-impact takes 400 to 500. A
    motion that does not settle (a blade whose 16 pairs all slip and lift) would take thousands."""
    transient_cut: float = 0.35
    """Factor of the length of a step that fails, or whose change is twice `smooth_change`. Half the value takes 2.5
    times the iterations of a jump at a fold. With 0.5 a random scene (`THROWN_OFF` in `tests/solver/test_homotopy.py`)
    does not settle within the budget."""
    runaway: float = 1e3
    """Mean relative displacement over the largest displacement of vibration and start; above it parts run away."""

    # states at a given phase lag
    largest_frequency_change: float = 0.02
    """Largest change of the frequency in an iteration, over the frequency."""

    # largest amplitudes over the frequency
    peak_rise: float = 2.0
    """Largest rise of the logarithm of the response with the phase lag, 1/rad, over rtol, at which an amplitude counts
    as the largest one: its frequency is then within 2 rtol of half the width of the resonance, and the amplitude within
    2 rtol^2. The states of single samples change with the frequency, so that the rise is rough: by 0.005 for the
    dovetail with rtol 0.01, which would take five solves a step with 1e-4."""
    largest_lag_step: float = 0.2
    """Largest change of the phase lag between two solves, rad."""

    @property
    def linear_change(self) -> float:
        """Largest change over a step between two states in which no pair slips or opens.

        The reversal of phase at a linear resonance is a change of 2.
        """
        return 5.0 * self.smooth_change

    @property
    def relaxed_change(self) -> float:
        """Change over a step of a relaxation in time below which a periodic state is sought."""
        return self.smooth_change / 10.0

    @property
    def shortest_arc(self) -> float:
        """Shortest length of an arc-length step."""
        return self.corner_arc / 10.0


CONTINUATION = ContinuationOptions()
