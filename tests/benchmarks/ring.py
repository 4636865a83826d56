"""A ring of blades whose shrouds touch, by time integration, against its harmonic balance, sector by sector.

    python -m tests.benchmarks.ring

The ring (`tests.rings`) has all sectors and contacts, without symmetry. Periods are integrated one by one with
n and 2 n steps until the motion repeats, and extrapolated. Printed: largest first harmonic of a tip before any wear,
and how far any tip is off; worn volume of all sectors after some cycles, its estimated error, how far it is off, and
how far that of any sector is off, over the largest one. In 300 cycles the vibration lags behind the wear, which the
balance leaves out: where it wears four times as slowly, what is off falls to a third.

With 4 N at 280 Hz and nodal diameter 1 the wave of equal blades is unstable: waves of other nodal diameters grow beside
it, to a third of it at 6 N and 310 Hz. So they do at 300 Hz, 10 N and nodal diameter 2 from 100 cycles on.
"""

from collections.abc import Sequence

import numpy as np

from solver import march_wear
from solver.structure.ring import build_ring
from tests.benchmarks.frame import Table
from tests.benchmarks.time_integration import driven, first_harmonic, one_period, ramp
from tests.rings import N, one_sector, whole_ring

FRICTION, WEAR, CYCLES = 0.3, 1e-10, 300
EQUAL, ONE, RANDOM = np.zeros(N), 0.01 * np.eye(N)[2], 0.02 * np.random.default_rng(0).standard_normal(N)
CASES = (
    *((d, f, a, EQUAL, 1) for d, f, a in ((0, 138.0, 0.5), (1, 280.0, 3.3), (3, 320.0, 12.0), (5, 280.0, 3.3))),
    *((d, f, a, each, 1) for each in (ONE, RANDOM) for d, f, a in ((1, 280.0, 3.3), (3, 320.0, 12.0))),
    (3, 320.0, 12.0, RANDOM, 4),
)
"""Nodal diameter, frequency, Hz, excitation amplitude, N, deviations of the blades, and how much slower they wear."""

_REPEATS = 1e-7
_MOST_PERIODS = 20_000


def ring_in_time(
    diameter: int, frequency: float, amplitude: float, steps: Sequence[int], cycles: float, deviation=EQUAL, slower=1
):
    """First harmonics (n, N) of the unworn tips, m, and worn volumes (n, N), m3, for numbers of steps a period.

    slower: the wear coefficient is smaller by this factor, and the cycles are as many times more.
    """
    model, tips, volumes = whole_ring(diameter, deviation), [], []
    gap, rows = model.contact.gap, np.real(model.linear[0].response)
    for n_steps in steps:
        structure, motion = driven(model, FRICTION, ramp(frequency, amplitude, 300), n_steps)
        for _ in range(_MOST_PERIODS):
            before, motion = motion.x, one_period(structure, motion, gap)
            if np.abs(motion.x - before).max() < _REPEATS * np.abs(motion.x).max():
                break
        else:
            raise RuntimeError("the motion does not repeat")
        tips.append(first_harmonic(structure, motion, rows))
        depth = np.zeros(N)
        for _ in range(round(slower * cycles)):
            motion = one_period(structure, motion, gap + depth)
            depth = depth + WEAR / slower * motion.work / model.contact.area
        volumes.append(depth * model.contact.area)
    return np.array(tips), np.array(volumes)


def main() -> None:
    columns = "tip um", "by harmonics", "off", "volume 1e-3 mm3", "by harmonics", "estimated", "true", "of a sector"
    table = Table("nodal diameter, Hz, N, deviations", *columns)
    for diameter, frequency, amplitude, deviation, slower in CASES:
        tips, volumes = ring_in_time(diameter, frequency, amplitude, (360, 720), CYCLES, deviation, slower)
        model = build_ring(one_sector(diameter), deviation)
        worn = march_wear(model, frequency, amplitude, FRICTION, WEAR, CYCLES)
        # of n and 2 n steps, whose error falls as 1 / n^2
        tip, true = ((4.0 * fine - coarse) / 3.0 for coarse, fine in (abs(tips), volumes))
        found, volume = abs(worn.response[0]), worn.wear_depth[-1] * model.contact.area
        total, most = (true.sum(), true.max()) if volume.any() else (np.inf, np.inf)
        numbers = 1e6 * tip.max(), 1e6 * found.max(), abs(found - tip).max() / tip.max(), 1e12 * true.sum()
        numbers += 1e12 * volume.sum(), worn.worn_volume_error[-1], abs(volume.sum() - true.sum()) / total
        kind = {id(EQUAL): "equal", id(ONE): "1 % of one", id(RANDOM): "2 % at random"}[id(deviation)]
        name = f"{diameter}, {frequency:g}, {amplitude:g}, {kind}" + (f", {slower} times slower" if slower > 1 else "")
        table.row(name, *map(float, numbers), abs(volume - true).max() / most)


if __name__ == "__main__":
    main()
