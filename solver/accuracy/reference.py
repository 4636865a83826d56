"""The reference solution: a second run of the computation in which everything is coarser.

The difference of a computation to its reference solution, pair by pair, is taken for its error. Coarser are

- the sweep to the start state: half the nodes, placed between those of the fine sweep (`solver.loading_history`). The
  difference of the tangential histories of both sweeps is extrapolated: the reference solution starts from twice this
  difference;
- the harmonics: the next lower entry of `harmonic_levels`, with the samples that belong to it (the next higher entry
  where the harmonics are few);
- the steps on the slow time: adaptive steps with twice the tolerance, whatever the scheme of the history is.

Some events make an error grow: pairs stick again, a resonance passes, a branch ends. The difference to the reference
solution grows as well, a sum of local errors does not.
"""

from __future__ import annotations

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.model import ReducedModel
from solver.settings import FIRST_HARMONICS, Resolution, SolverSettings

RTOL_RATIO = 2.0
"""Ratio of the step tolerances of reference solution and history: BDF2 steps are then a quarter longer. With 4 the
steps of a reference solution are too long for pairs that stick again: dovetail, 16 pairs, 13 harmonics, 212.75 Hz:
1.208 mm3 for 1.540, an error of 32 % where 0.4 % is true."""

AUTOMATIC = SolverSettings()
"""Settings that let `fewer` reduce both harmonics and samples."""


def coarser(resolution: Resolution, model: ReducedModel) -> Resolution:
    """Harmonics and samples of the reference solution: those of the next lower level.

    With one harmonic alone a joint that slips is another joint. So the reference solution of a history with three
    harmonics or one has the next higher level, where the model has matrices for it.
    """
    richer = shifted(resolution, 1)
    few = resolution.highest <= FIRST_HARMONICS
    return richer if few and model.holds(richer.highest) else fewer(resolution, AUTOMATIC)
