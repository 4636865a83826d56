"""The first frequency of a sweep, which depends on the scene and on the point but not on the other points of a study.

In a run-up or run-down a machine passes other frequencies before the point, and the joint keeps their history. So a
sweep begins well away from the point: for "up" between 0.49 and 0.7 times its frequency, for "down" between 1.3 and
1.85 times. All points of a quarter octave have one first frequency: the one at which the vibration loads the stuck
joint least, so that no sweep begins at a resonance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.model import ReducedModel
from solver.packing import packable
from solver.structure.condensation import build_structure

Direction = Literal["up", "down", "ramp"]

BEGIN_AWAY = 0.3
"""Least distance from the start of a sweep to the point, as a fraction of the frequency of the point. With 0.22 and
0.38 the dovetail has the same state within 2e-3."""

CELLS_PER_OCTAVE = 4
"""Cells in an octave. All points of a cell have one first frequency: 105 Hz, half the resonance, for the dovetail."""

ORIGIN_CANDIDATES = 8
"""Candidates for the first frequency of a cell, of which the one with the least load on the stuck joint is chosen."""


@packable
@dataclass(frozen=True)
class Origin:
    """Start of the sweep to a point.

    starts: frequencies at which a first state is sought, Hz, the preferred one first; empty for "ramp", which begins at
        the frequency of the point.
    penalty: frequency at which the penalty of the contact law is taken, Hz: the upper end of the cell.
    cell: number of the frequency interval (cell). One sweep passes all points of a cell.
    """

    starts: tuple[float, ...]
    penalty: float
    cell: int


def cell_of(frequency: float) -> int:
    """Number of the cell of a frequency, Hz."""
    return math.floor(CELLS_PER_OCTAVE * math.log2(frequency))


def find_origin(model: ReducedModel, cell: int, sweep: Direction) -> Origin:
    """Origin of the sweep to the points of a cell."""
    low, high = (2.0 ** (edge / CELLS_PER_OCTAVE) for edge in (cell, cell + 1))
    if sweep == "ramp":
        return Origin((), high, cell)
    width = 2.0 ** (1.0 / CELLS_PER_OCTAVE)
    # further attempts where no state is found at the quiet frequency
    near, away = ((1.0 - BEGIN_AWAY) * low, 1.0 / width) if sweep == "up" else ((1.0 + BEGIN_AWAY) * high, width)
    return Origin((_quiet(model, near * away, near), near, near / away), high, cell)


def _quiet(model: ReducedModel, far: float, near: float) -> float:
    """Frequency between two of them, Hz, at which the excitation loads the stuck joint least."""
    frequencies = [float(at) for at in np.geomspace(far, near, ORIGIN_CANDIDATES + 1)]
    loads = []
    for frequency in frequencies:
        try:
            structure = build_structure(model, 2.0 * np.pi * frequency, 1.0, (1,))
            loads.append(float(np.linalg.norm(structure.harmonic_force)))
        except np.linalg.LinAlgError:
            loads.append(math.inf)
    # of equally good frequencies the farthest: round-off must not decide
    least = min(loads) * (1.0 + 1e-6)
    return next(at for at, load in zip(frequencies, loads, strict=True) if load <= least)
