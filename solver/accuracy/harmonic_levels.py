"""The harmonic levels between which automatic settings choose, and how many levels up an error would show.

Two things hide an error from states with a few more harmonics: a contact that is shorter than the period of the highest
of them, and a structure that answers higher harmonics otherwise than the penalty does. With the penalty E and the
compliance G of a pair the harmonics of the predicted force that are left out are `(1 - E_n G_n) lambda_n`
(`solver.structure.penalty`). They need not fall with the next few harmonics: a slider on a beam has a mass that falls
from mode to mode, and one behind a stiff spring a mass only up to the resonance of the two. As long as the highest
harmonic is below that, states with a few more harmonics are alike and all wrong.
"""

from __future__ import annotations

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.model import ReducedModel
from solver.settings import Resolution, SolverSettings, all_orders, samples_for
from solver.structure.condensation import relative_indices
from solver.structure.penalty import build_penalty, compliance_at


def n_unknowns(resolution: Resolution, n_rel: int) -> int:
    """Unknowns of a balance of so many relative displacements."""
    return n_rel * (2 * len(resolution.orders) + 1)


def room_for(unknowns: float, n_rel: int) -> float:
    """Unknowns that a joint may have where one of 48 pairs may have `unknowns`: a large one has the same harmonics."""
    return unknowns * max(1.0, n_rel / ACCURACY.displacements_of_limits)


def shifted(resolution: Resolution, levels: int) -> Resolution:
    """So many harmonic levels up (or with -1 one down), with samples enough for them; odd harmonics stay odd."""
    if levels > 0:
        above = [highest for highest in ACCURACY.harmonic_levels if highest > resolution.highest]
        highest = above[levels - 1] if len(above) >= levels else (levels + 1) * resolution.highest
    else:
        below = (highest for highest in ACCURACY.harmonic_levels if highest < resolution.highest)
        highest = max(below, default=resolution.highest)
    orders = all_orders(highest)
    if resolution.highest > 1 and all(order % 2 for order in resolution.orders):
        orders = orders[::2]
    return Resolution(orders, max(resolution.samples, samples_for(highest)))


def fewer(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """One level down: harmonics and samples, whichever are automatic."""
    orders = shifted(resolution, -1).orders if settings.harmonics == "auto" else resolution.orders
    samples = resolution.samples
    if settings.samples == "auto":
        samples = max(samples // 2, samples_for(orders[-1]))
    return Resolution(orders, samples)


def levels_to_see(resolution: Resolution, contact: float, fewest: int) -> int:
    """Levels up, at least `fewest`, to harmonics that resolve a contact which lasts a fraction `contact` of the period.

    While a contact takes less than about half a period of the highest harmonic, its force is much the same in every
    harmonic, and a few more of them change next to nothing, however large the error.
    """
    above = [highest for highest in ACCURACY.harmonic_levels if highest > resolution.highest]
    blind = sum(highest * contact < ACCURACY.periods_in_contact for highest in above)
    return max(fewest, min(blind + 1, len(above)))


def levels_to_reach(resolution: Resolution, highest: int, fewest: int) -> int:
    """Levels up, at least `fewest`, to harmonics up to `highest`."""
    return max(fewest, sum(resolution.highest < level <= highest for level in ACCURACY.harmonic_levels))


def reaches(model: ReducedModel, omega: float, highest: int) -> bool:
    """Whether |1 - E G| stays below `stiffness_mismatch` for all pairs and all harmonics above the highest one.

    Judged at real rates, at which the structure has no resonances. omega: rad/s.
    """
    penalty = build_penalty(model, omega, highest)
    _, component_index = relative_indices(model.contact)
    pair, tangent = component_index // 3, component_index % 3 > 0
    held = np.where(tangent, penalty.tangential[pair], penalty.normal[pair])
    marched = tangent & penalty.inertial[pair]
    for octaves in np.arange(0.0, ACCURACY.octaves_beyond + 0.5, 0.5):
        rate = (highest + 1) * omega * 2.0**octaves
        acts = np.where(marched, penalty.mass[pair] * rate**2, held)
        if np.abs(1.0 - acts * compliance_at(model, rate)).max(initial=0.0) > ACCURACY.stiffness_mismatch:
            return False
    return True


def reach(model: ReducedModel, omega: float, highest: int) -> int:
    """Lowest highest harmonic of a level, at least the given one, that reaches so far; the last where none does.

    omega: rad/s.
    """
    above = (level for level in ACCURACY.harmonic_levels if level > highest)
    return next((level for level in (highest, *above) if reaches(model, omega, level)), ACCURACY.harmonic_levels[-1])
