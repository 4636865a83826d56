"""The numbers of harmonics between which automatic settings choose, and how many more an error estimate needs.

"One level up" means the next entry of `HARMONIC_LEVELS`. Two effects hide an error from a comparison with only a few
more harmonics:

- a contact that is shorter than the period of the highest harmonic: its force is nearly equal in all harmonics;
- a structure that answers the higher harmonics otherwise than the penalty does. With the penalty E and the compliance
  G of a pair, the harmonics of the predicted force that are left out are `(1 - E_n G_n) lambda_n`
  (`solver.structure.penalty`). They need not decrease over the next few harmonics: the modal mass of a slider on a beam
  falls from mode to mode, and a slider behind a stiff spring acts as a mass only up to the resonance of both.
"""

from __future__ import annotations

import numpy as np

from solver.model import ReducedModel
from solver.settings import Resolution, SolverSettings, all_orders, samples_for
from solver.structure.condensation import relative_indices
from solver.structure.penalty import build_penalty, compliance_at

HARMONIC_LEVELS = (1, 3, 5, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
"""Highest harmonics between which "auto" chooses. The last two serve for comparison only. 7 is left out: on the
dovetail, states with five and seven harmonics agree by chance (212 Hz: errors of the worn volume of 1.9, 1.2 and 0.1 %
with 5, 7 and 9)."""

DISPLACEMENTS_OF_LIMITS = 144
"""Relative displacements of the dovetail with 48 pairs, to which the limits of unknowns belong."""

STIFFNESS_MISMATCH = 0.25
"""Largest |1 - E G|: above, structure and penalty answer differently, and more harmonics are needed."""

MOST_UNKNOWNS = 8000
"""Most unknowns of a balance in a history with "auto"; of a balance that is solved for comparison half as many more."""


def n_unknowns(resolution: Resolution, n_rel: int) -> int:
    """Number of unknowns of a balance with `n_rel` relative displacements."""
    return n_rel * (2 * len(resolution.orders) + 1)


def room_for(unknowns: float, n_rel: int) -> float:
    """Limit of the unknowns of a joint with `n_rel` relative displacements; `unknowns`: the limit with 48 pairs.

    The limit of a larger joint grows in proportion: it limits the harmonics and not the pairs.
    """
    return unknowns * max(1.0, n_rel / DISPLACEMENTS_OF_LIMITS)


def shifted(resolution: Resolution, levels: int) -> Resolution:
    """Resolution so many levels up, or one level down for -1, with enough samples; odd harmonics stay odd."""
    if levels > 0:
        above = [highest for highest in HARMONIC_LEVELS if highest > resolution.highest]
        highest = above[levels - 1] if len(above) >= levels else (levels + 1) * resolution.highest
    else:
        below = (highest for highest in HARMONIC_LEVELS if highest < resolution.highest)
        highest = max(below, default=resolution.highest)
    orders = all_orders(highest)
    if resolution.highest > 1 and all(order % 2 for order in resolution.orders):
        orders = orders[::2]
    return Resolution(orders, max(resolution.samples, samples_for(highest)))


def fewer(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """Resolution with one level fewer harmonics and half the samples, as far as these are automatic."""
    orders = shifted(resolution, -1).orders if settings.harmonics == "auto" else resolution.orders
    samples = resolution.samples
    if settings.samples == "auto":
        samples = max(samples // 2, samples_for(orders[-1]))
    return Resolution(orders, samples)


def levels_to(resolution: Resolution, highest: float) -> int:
    """Levels up, at least two, to the first level with the harmonic `highest`."""
    above = [level for level in HARMONIC_LEVELS if level > resolution.highest]
    return max(2, min(sum(level < highest for level in above) + 1, len(above)))


def reach(model: ReducedModel, omega: float, highest: int) -> int:
    """Lowest harmonic of the levels, not below `highest`, beyond which |1 - E G| is small for all pairs.

    G is evaluated at real rates (growth instead of vibration), where the structure has no resonances. omega: rad/s.
    The last level where |1 - E G| is small beyond none.
    """
    _, component_index = relative_indices(model.contact)
    pair, tangent = component_index // 3, np.minimum(component_index % 3, 1)
    for level in (highest, *(level for level in HARMONIC_LEVELS if level > highest)):
        penalty = build_penalty(model, omega, level)
        half_octaves = np.arange(0.0, 2.0 * np.log2(HARMONIC_LEVELS[-1] / (level + 1)) + 1.0)
        rates = (level + 1) * omega * 2.0 ** (0.5 * half_octaves)
        apart = (1.0 - penalty.at_rate(rate)[pair, tangent] * compliance_at(model, rate) for rate in rates)
        if all(np.abs(each).max(initial=0.0) <= STIFFNESS_MISMATCH for each in apart):
            return level
    return HARMONIC_LEVELS[-1]
