"""Where a sweep begins: a frequency that depends on the scene and on the point alone, not on the others of a study.

A machine that is run up or down passes the frequencies before the point, and the joint remembers. So a sweep
begins well away from the point: for "up" between 0.49 and 0.7 times its frequency, for "down" between 1.3 and 1.85
times. It is the same for all points of a quarter octave, and it begins where the vibration loads the stuck joint least,
so that it does not begin at a resonance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.loading_history.options import LOADING
from solver.model import ReducedModel
from solver.packing import packable
from solver.structure.condensation import build_structure

Sweep = Literal["up", "down", "ramp"]


@packable
@dataclass(frozen=True)
class Origin:
    """Where the sweep to a point begins, all in Hz.

    starts: frequencies at which a first state is sought, the preferred one first; empty for "ramp", which begins at the
    point itself. penalty: where the penalty of the contact law is taken, that of no point of the cell is lower.
    cell: what all points have in common that are passed by the same sweep.
    """

    starts: tuple[float, ...]
    penalty: float
    cell: int


def find_origin(model: ReducedModel, frequency: float, sweep: Sweep) -> Origin:
    """Origin of the sweep to a frequency, Hz."""
    cell = math.floor(LOADING.cells_per_octave * math.log2(frequency))
    low, high = (2.0 ** (edge / LOADING.cells_per_octave) for edge in (cell, cell + 1))
    if sweep == "ramp":
        return Origin((), high, cell)
    width = 2.0 ** (1.0 / LOADING.cells_per_octave)
    # where no state is found at the quiet frequency, the edge of the cell and one nearer to the points are tried
    near, away = (
        ((1.0 - LOADING.begin_away) * low, 1.0 / width) if sweep == "up" else ((1.0 + LOADING.begin_away) * high, width)
    )
    return Origin((_quiet(model, near * away, near), near, near / away), high, cell)


def _quiet(model: ReducedModel, far: float, near: float) -> float:
    """Frequency between two of them, Hz, at which the excitation loads the stuck joint least."""
    frequencies = np.geomspace(far, near, LOADING.origin_candidates + 1)
    loads = []
    for frequency in frequencies:
        try:
            structure = build_structure(model, 2.0 * np.pi * float(frequency), 1.0, (1,))
            loads.append(float(np.linalg.norm(structure.harmonic_force)))
        except np.linalg.LinAlgError:
            loads.append(math.inf)
    # the farthest of those that are as good: round-off must not choose
    least = min(loads)
    return next(float(at) for at, load in zip(frequencies, loads, strict=True) if load <= least * (1.0 + 1e-6))
