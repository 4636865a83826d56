"""The reference solution: the same computation once more with everything coarser.

The difference of a computation to its reference solution, pair by pair, is taken for its error. Coarser are

- the sweep to the start state: half the nodes, between those of the sweep (`solver.loading_history`). The tangential
  history that both sweeps leave is extrapolated: the reference solution starts from twice the difference;
- the harmonics: one level less, and the samples that go with them;
- the steps on the slow time: those of the adaptive scheme with four times the tolerance, whatever the scheme of the
  history is.

Whatever makes an error grow - pairs that stick again, a resonance that passes, a branch that ends - makes the
difference grow as well. A sum of local errors does not see this growth.
"""

from __future__ import annotations

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.settings import Resolution, SolverSettings

RTOL_RATIO = 4.0
"""Tolerance of the steps of the reference solution over that of the history: BDF2 steps are then about twice as long.
With 8 one reference solution of the dovetail was lost (211.25 Hz)."""

AUTOMATIC = SolverSettings()
"""With these settings harmonics and samples may be left out."""


def coarser(resolution: Resolution) -> Resolution:
    """Harmonics and samples of the reference solution: one level less, or one level more than one harmonic alone."""
    return shifted(resolution, 1) if resolution.highest <= 1 else fewer(resolution, AUTOMATIC)
