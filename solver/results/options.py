"""Tuning constants of what is reported: safety factors of error estimates, what counts as oscillation."""

from __future__ import annotations

from dataclasses import dataclass

from solver.settings import Scheme


@dataclass(frozen=True)
class ResultOptions:
    """Safety factors and thresholds; each with its meaning, unit (none: a ratio) and the evidence for its value."""

    implicit_safety: float = 1.75
    """Error of a history over its difference to the companion. Short steps: 1; dovetail: 0.6 to 1.3, but 3.1 at
    211.25 Hz with steps of 2000 cycles, where both histories miss the same steep rise: half of that is told."""
    explicit_safety: float = 0.8
    """The same. Short steps: 1/3; dovetail: 0.2 to 0.9."""
    adaptive_safety: float = 0.6
    """The same. Short steps: 1/3; dovetail: 0.05 to 0.4."""
    unknown_wear_rate_error: float = 10.0
    """Relative error that a wear rate counts with where it is not known at all, or only to more: as long as a single
    state of a history is not known the others still say something."""
    start_safety: float = 3.0
    """Error of a worn volume over that of the wear rates of its start state, at least: it grows while the joint wears.
    Dovetail at 212.5 Hz, where the rates are known to 3 %: tangential histories changed pair by pair at random by as
    much as the two sweeps differ move the volume by 1 to 12 %, BLAS kernels of other processors by up to 17 %."""
    crossing_window: float = 0.5
    """Of the cycle count: histories that differ by when something happens cross each other, and where they do their
    difference is small and says nothing. It is the largest one since this fraction of the count (dovetail, 211.25 Hz,
    steps of 2000 cycles: without it a quarter of the true error at the crossing). What comes later has no part in it,
    so that an error does not depend on how far a study goes."""
    alternations: int = 4
    """Increments of a wear rate that alternate in sign and do not shrink, from where on it oscillates."""
    noticeable_oscillation: float = 1e-3
    """Of the largest rate of all pairs together: smaller increments are no oscillation."""
    calming: float = 0.98
    """Increment over the one before, below which an oscillation calms."""

    edge_load: float = 1e-6
    """Of the largest pressure or depth of all pairs: more than this at an edge of the modelled contact is no round-off.
    Strips that are open carry exactly 0; under a stroke whose scar is cut off the last one carries 0.96 of the largest
    pressure and has 0.88 of the largest depth."""

    target_resolution: float = 1e-12
    """Of a step: how exactly the count is found at which it reaches a target; no more than its ends are known."""

    trail_steps: int = 8
    """Steps of a march to the end that are kept for each of its outputs, at most; half as many after those that wear
    least were left out."""
    trail_outputs: int = 50
    """Outputs that such steps are kept for at least, however few are wanted."""

    def companion_safety(self, scheme: Scheme) -> float:
        """Error of a history over its difference to the companion."""
        factors = {"implicit": self.implicit_safety, "explicit": self.explicit_safety, "adaptive": self.adaptive_safety}
        return factors[scheme]


RESULTS = ResultOptions()
