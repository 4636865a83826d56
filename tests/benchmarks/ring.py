"""A ring of blades whose shrouds touch, by time integration, against one sector with contact to the next one.

    python -m tests.benchmarks.ring

The ring (`tests.rings`) has all sectors and contacts, without symmetry. Periods are integrated one by one with
n and 2 n steps until the motion repeats, and extrapolated. Printed: first harmonic of the tips and worn volume of a
sector after some cycles, of the ring and of the sector by harmonic balance.

The sector knows one wave, and one wear for all sectors. With 4 N at 280 Hz and nodal diameter 1 the wave of the ring is
unstable: waves of other nodal diameters grow beside it, to a third of it at 6 N and 310 Hz. While it wears, sectors
begin to wear unequally: from 500 cycles on at nodal diameter 1, from 1000 at 3.
"""

from collections.abc import Sequence

import numpy as np

from solver import march_wear
from tests.benchmarks.frame import Table
from tests.benchmarks.time_integration import driven, first_harmonic, one_period, ramp
from tests.rings import N, one_sector, whole_ring

FRICTION, WEAR, CYCLES = 0.3, 1e-10, 300
CASES = ((0, 138.0, 0.5), (1, 280.0, 3.3), (2, 300.0, 10.0), (3, 320.0, 12.0), (4, 300.0, 10.0), (5, 280.0, 3.3))
"""Nodal diameter, frequency, Hz, excitation amplitude, N."""

_REPEATS = 1e-7
_MOST_PERIODS = 20_000


def ring_in_time(diameter: int, frequency: float, amplitude: float, steps: Sequence[int], cycles: float):
    """First harmonics (n, N) of the unworn tips, m, and worn volumes (n, N), m3, for numbers of steps a period."""
    model, tips, volumes = whole_ring(diameter), [], []
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
        for _ in range(round(cycles)):
            motion = one_period(structure, motion, gap + depth)
            depth = depth + WEAR * motion.work / model.contact.area
        volumes.append(depth * model.contact.area)
    return np.array(tips), np.array(volumes)


def main() -> None:
    table = Table("nodal diameter, Hz, N", "tip um", "sector", "volume mm3", "sector", "estimated", "true")
    for diameter, frequency, amplitude in CASES:
        tips, volumes = ring_in_time(diameter, frequency, amplitude, (360, 720), CYCLES)
        worn = march_wear(one_sector(diameter), frequency, amplitude, FRICTION, WEAR, CYCLES)
        # of n and 2 n steps, whose error falls as 1 / n^2
        tip, true = ((4.0 * fine - coarse) / 3.0 for coarse, fine in (tips, volumes))
        volume, error = float(worn.worn_volume[-1]), abs(worn.worn_volume[-1] / true.mean() - 1.0)
        numbers = 1e6 * abs(tip).mean(), 1e6 * abs(worn.response[0, 0]), 1e9 * true.mean(), 1e9 * volume
        numbers += worn.worn_volume_error[-1], error if volume > 0.0 else 0.0
        table.row(f"{diameter}, {frequency:g}, {amplitude:g}", *map(float, numbers))


if __name__ == "__main__":
    main()
