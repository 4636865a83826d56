"""Every bundled study runs, at a small size, and shows what it is there to show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.study_file import bundled_studies

SMALL = {
    "dovetail": [
        "scene.mesh=1",
        "axes.frequency=[207.0, 212.5]",
        "slow_time.cycles=3000",
        "slow_time.outputs=4",
        "solver.harmonics=3",
        "solver.samples=64",
    ],
    "sdof_slider": ["axes.frequency=160.0", "slow_time.cycles=4000", "slow_time.outputs=5"],
    "two_masses": ["axes.frequency=0.0954929658551372"],
    "vibro_impact": ["axes.frequency=[0.17, 0.19, 0.21, 0.22]"],
}


def run_small(name: str, folder: Path) -> xr.Dataset:
    path = folder / f"{name}.nc"
    changes = [word for change in SMALL[name] for word in ("--set", change)]
    assert main([name, *changes, "-o", str(path)]) == 0
    with xr.open_dataset(path) as result:
        return result.load()


def test_all_bundled_studies_are_here():
    assert set(bundled_studies()) == set(SMALL)


@pytest.mark.parametrize("name", sorted(SMALL))
def test_every_point_of_a_bundled_study_converges(name, tmp_path):
    result = run_small(name, tmp_path)
    assert (result.outcome == 0).all()
    assert np.isfinite(result.response_amplitude).all()


def test_the_dovetail_wears_near_its_resonance_only(tmp_path):
    worn = run_small("dovetail", tmp_path).worn_volume.isel(cycle=-1).squeeze()
    beside, near = worn.sel(frequency=207.0), worn.sel(frequency=212.5)
    assert (near > 1e-12).all()
    assert (beside < 1e-6 * near).all()


def test_the_two_branches_of_the_vibro_impact_differ(tmp_path):
    response = run_small("vibro_impact", tmp_path).response_amplitude.squeeze()
    assert (response.sel(sweep="up") > 1.3 * response.sel(sweep="down")).any()
