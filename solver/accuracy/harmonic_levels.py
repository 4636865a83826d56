"""The resolutions between which automatic settings choose."""

from __future__ import annotations

from solver.settings import Resolution, SolverSettings, all_orders, samples_for

LADDER = (1, 3, 5, 7, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
"""Highest harmonics; "auto" uses all but the last two, those above `MOST_HARMONICS` only where they are odd and few."""
MOST_HARMONICS = 79
COSTLY, LIGHT = 2500, 1600
"""Unknowns from which a state on the way takes fewer harmonics than its error asks for, and how many it has then."""
RESOLVED = 0.5  # periods of the highest harmonic that the shortest contact takes, from where on harmonics see it


def n_unknowns(resolution: Resolution, n_rel: int) -> int:
    """Unknowns of a balance of so many relative displacements."""
    return n_rel * (2 * len(resolution.orders) + 1)


def on_ladder(resolution: Resolution, steps: int) -> Resolution:
    """Up (or with -1 down) the ladder, with samples enough for it; odd harmonics stay odd."""
    if steps > 0:
        above = [step for step in LADDER if step > resolution.highest]
        highest = above[steps - 1] if len(above) >= steps else (steps + 1) * resolution.highest
    else:
        highest = max((step for step in LADDER if step < resolution.highest), default=resolution.highest)
    orders = all_orders(highest)
    if resolution.highest > 1 and all(order % 2 for order in resolution.orders):
        orders = orders[::2]
    return Resolution(orders, max(resolution.samples, samples_for(highest)))


def fewer(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """One step down: harmonics and samples, whichever are automatic."""
    orders = on_ladder(resolution, -1).orders if settings.harmonics == "auto" else resolution.orders
    samples = resolution.samples
    if settings.samples == "auto":
        samples = max(samples // 2, samples_for(orders[-1]))
    return Resolution(orders, samples)


def steps_to_see(resolution: Resolution, contact: float, fewest: int) -> int:
    """Steps up the ladder, at least `fewest`, to harmonics that see a contact which takes such a share of the period.

    While a contact takes less than about half a period of the highest harmonic, its force is much the same in every
    harmonic, and a few more of them change next to nothing, however large the error.
    """
    above = [step for step in LADDER if step > resolution.highest]
    blind = sum(step * contact < RESOLVED for step in above)
    return max(fewest, min(blind + 1, len(above)))


def steps_to_reach(resolution: Resolution, highest: int, fewest: int) -> int:
    """Steps up the ladder, at least `fewest`, to harmonics up to `highest`."""
    return max(fewest, sum(resolution.highest < step <= highest for step in LADDER))
