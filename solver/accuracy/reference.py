"""The reference solution: the same computation once more with everything coarser.

The difference of a computation to its reference solution, pair by pair, is taken for its error. Coarser are

- the sweep to the start state: half the nodes, between those of the sweep (`solver.loading_history`);
- the harmonics: one level less, and the samples that go with them;
- the steps on the slow time: one where the history takes two.

Whatever makes an error grow - pairs that stick again, a resonance that passes, a branch that ends - makes the
difference grow as well. A sum of local errors does not see this growth.

Explicit steps beyond what is stable for some pairs go up and down. With steps twice as long they may be wrong in the
same direction. Their reference solution takes implicit steps, whose error has the other sign.
"""

from __future__ import annotations

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.settings import RESOLUTION, Resolution, SolverSettings

AUTOMATIC = SolverSettings()
"""With these settings harmonics and samples may be left out."""


def coarser(resolution: Resolution) -> Resolution:
    """Harmonics and samples of the reference solution.

    One harmonic cannot be left out, and with one harmonic alone a joint that slips is another joint: with few harmonics
    the reference solution has more.
    """
    if resolution.highest <= RESOLUTION.first_harmonics:
        return shifted(resolution, 1)
    return fewer(resolution, AUTOMATIC)


def every_second(ends: tuple[float, ...]) -> tuple[float, ...]:
    """Ends of the steps of the reference solution; ends: the first count of a history and the ends of all its steps."""
    later = ends[1:]
    chosen = later[1::2]
    return chosen if not later or (chosen and chosen[-1] == later[-1]) else (*chosen, later[-1])
