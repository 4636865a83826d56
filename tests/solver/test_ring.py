"""Contact with the next sector: one sector of a wave against all sectors of the ring, integrated in time."""

import numpy as np
import pytest

from solver import frequency_response, march_wear
from tests.benchmarks.ring import FRICTION, WEAR, ring_in_time
from tests.ring_of_masses import one_sector

CYCLES, STEPS = 300.0, 360


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "frequency", "amplitude"), [(1, 280.0, 3.3), (3, 320.0, 12.0), (5, 280.0, 3.3)])
def test_a_wave_of_the_sector_is_that_of_the_ring_in_time(diameter, frequency, amplitude):
    tips, volumes = ring_in_time(diameter, frequency, amplitude, (STEPS,), CYCLES)
    waves = np.fft.fft(tips[0]) / tips[0].size
    assert np.abs(np.delete(waves, diameter)).max() < 1e-3 * abs(waves[diameter])
    sector = one_sector(diameter)
    tip = frequency_response(sector, [frequency], amplitude, FRICTION).response[0, 0]
    assert tip == pytest.approx(waves[diameter], rel=1e-2)
    worn = march_wear(sector, frequency, amplitude, FRICTION, WEAR, CYCLES)
    volume = worn.worn_volume[-1]
    # the steps in time are known to 1 %
    assert abs(volume - volumes.mean()) < (worn.worn_volume_error[-1] + 1e-2) * volume
    assert volume > 0.0
