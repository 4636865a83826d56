"""The reference solution: a second computation whose difference, pair by pair, is taken for the error.

It starts from another sweep: a third of the nodes, placed between those of the fine sweep (`solver.loading_history`).
The difference of the tangential histories of both sweeps is extrapolated: the reference solution starts from twice
this difference. It is coarser in all: its steps on the slow time have twice the tolerance, and it has the next lower
harmonics (the next higher ones where the harmonics are few) with the samples that belong to them.

A history with given Euler steps has no reference solution of its own: it is compared with the adaptive history, whose
errors are known, and which all given steps share. A coarser history with the same steps errs as they do: where a pair
only just slips (dovetail, 16 pairs, 212.5 Hz) it sticks with implicit steps, 1.89 mm3, with steps of 250 cycles 1.90;
the truth is 2.03.

Some events make an error grow: pairs stick again, a resonance passes, a branch ends. The difference to the reference
solution grows as well, a sum of local errors does not.
"""

from __future__ import annotations

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.model import ReducedModel
from solver.settings import FIRST_HARMONICS, Resolution, SolverSettings

RTOL_RATIO = 2.0
"""Ratio of the step tolerances of reference solution and adaptive history: BDF2 steps are then a quarter longer. With 4
the steps of a reference solution are too long for pairs that stick again: dovetail, 16 pairs, 13 harmonics, 212.75 Hz:
1.208 mm3 for 1.540, an error of 32 % where 0.4 % is true."""

AUTOMATIC = SolverSettings()
"""Settings that let `fewer` reduce both harmonics and samples."""


def coarser(resolution: Resolution, model: ReducedModel) -> Resolution:
    """Harmonics and samples of the reference solution: those of the next lower level.

    With one harmonic alone a joint that slips is another joint. So the reference solution of a history with three
    harmonics or one has the next higher level, where the model has matrices for it.
    """
    few = resolution.highest <= FIRST_HARMONICS
    richer = shifted(resolution, 1)
    return richer if few and model.holds(richer.highest) else fewer(resolution, AUTOMATIC)
