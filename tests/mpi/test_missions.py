"""Missions under mpiexec: blocks with scenes of their own, computed by any number of ranks."""

import pytest
import xarray as xr

from tests.mpi.launching import ROOT
from tests.mpi.test_ranks import start

pytestmark = [pytest.mark.mpi, pytest.mark.slow]

STUDY = """
[study]
name = "missions"
[scene]
model = "sdof_slider"
normal_stiffness = 0.0
[axes]
frequency = 160
wear_coefficient = 1e-11
damping = [0.0, 0.5]
[slow_time]
missions = 1
outputs = 2
[solver]
harmonics = 3
samples = 64
rtol = 0.1
[[mission]]
name = "hard"
excitation_amplitude = 14.0
cycles = 3000
[[mission]]
name = "heavy"
normal_load = 12.0
excitation_amplitude = 14.0
cycles = 2000
"""


def test_real_missions_are_the_same_on_any_number_of_ranks(tmp_path):
    """Two points with two scenes each: a rank gets both models of a mission with its task."""
    (tmp_path / "missions.toml").write_text(STUDY, encoding="utf-8")
    results = []
    for n_ranks in (0, 2):
        arguments = ["-m", "studyrunner.cli", "missions.toml", "-o", f"{n_ranks}.nc"]
        done = start(n_ranks, arguments, tmp_path, {"PYTHONPATH": str(ROOT)})
        assert done.returncode == 0, done.stderr
        with xr.open_dataset(tmp_path / f"{n_ranks}.nc") as result:
            results.append(result.load().drop_vars("run_time"))
    assert (results[0].block_worn_volume.isel(mission=-1) > 0.0).all()
    xr.testing.assert_identical(results[1], results[0])
