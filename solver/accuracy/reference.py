"""The reference solution: the same computation once more with everything coarser.

The difference of a computation to its reference solution, pair by pair, is taken for its error. Coarser are

- the sweep to the start state: half the nodes, between those of the sweep (`solver.loading_history`). The tangential
  history that both sweeps leave is extrapolated: the reference solution starts from twice the difference;
- the harmonics: one level less, and the samples that go with them;
- the steps on the slow time: one where the history takes two.

Whatever makes an error grow - pairs that stick again, a resonance that passes, a branch that ends - makes the
difference grow as well. A sum of local errors does not see this growth.

Explicit steps beyond what is stable for some pairs go up and down. With steps twice as long they may be wrong in the
same direction. Their reference solution takes implicit steps, whose error has the other sign.
"""

from __future__ import annotations

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.settings import Resolution, SolverSettings

AUTOMATIC = SolverSettings()
"""With these settings harmonics and samples may be left out."""


def coarser(resolution: Resolution) -> Resolution:
    """Harmonics and samples of the reference solution: one level less, or one level more than one harmonic alone."""
    return shifted(resolution, 1) if resolution.highest <= 1 else fewer(resolution, AUTOMATIC)


def every_second(ends: tuple[float, ...]) -> tuple[float, ...]:
    """Ends of the steps of the reference solution; ends: the first count of a history and the ends of all its steps."""
    later = ends[1:]
    chosen = later[1::2]
    return chosen if not later or (chosen and chosen[-1] == later[-1]) else (*chosen, later[-1])
