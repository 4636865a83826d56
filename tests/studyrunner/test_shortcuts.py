"""What is left out because it is the same is the same: a study with shortcuts against one without."""

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.study.study_file import read_study
from studyrunner.variables import CERTIFICATE, KEPT, LOOPS, USUAL

STUDY = [
    "axes.frequency=[100.0, 160.0]",
    "axes.wear_coefficient=[1e-12, 0, 1e-11, 4e-12]",
    "axes.step=[100, 250, 1000]",
    "axes.scheme=['implicit', 'explicit', 'adaptive']",
    "slow_time.cycles=4000",
    "slow_time.outputs=[0, 130, 1000, 4000]",
    "outputs.loops=[0]",
]
BY_DEPTH = ["axes.wear_coefficient=1e-11", "slow_time.largest_depth=2e-8"]
NO_CYCLES = ["slow_time.cycles=0", "slow_time.outputs=1"]
EFFORT = ("newton_iterations", "run_time")

pytestmark = pytest.mark.slow


def run(folder, *overrides):
    path = folder / "out.nc"
    changes = [word for change in (*STUDY, *overrides) for word in ("--set", change)]
    assert main(["sdof_slider", *changes, "-o", str(path)]) == 0
    with xr.open_dataset(path) as result:
        return result.load()


def both_ways(folder, *overrides):
    """The results with and without shortcuts."""
    return run(folder, *overrides), run(folder, *overrides, "solver.shortcuts=false")


def assert_same(name, short, long):
    """To round-off; violations are relative themselves, and what is left of them where they vanish is round-off."""
    if short[name].dtype.kind in "OU":
        assert (short[name] == long[name]).all(), name
        return
    round_off = 1e-9 if name in CERTIFICATE else 1e-6 * float(abs(long[name]).max()) if name in LOOPS else 0.0
    if name == "response_mean":
        # a response that swings around zero
        round_off = 1e-9 * float(long["response_amplitude"].max())
    found, expected = short[name].astype(float), long[name].astype(float)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=round_off, err_msg=name)


COMPARED = [name for name in (*USUAL, *LOOPS, *KEPT) if name not in EFFORT]


def test_what_is_shared_is_the_same_and_no_row_of_zeros(tmp_path):
    results = both_ways(tmp_path)
    for name in COMPARED:
        assert_same(name, *results)
    for result, shortcuts in zip(results, (True, False), strict=True):
        (tmp_path / "again.toml").write_text(result.attrs["study"], encoding="utf-8")
        assert read_study(str(tmp_path / "again.toml")).solver.shortcuts is shortcuts
        worn = result.worn_volume.isel(cycle=-1)
        assert (worn.sel(frequency=160.0).where(result.wear_coefficient > 0.0, drop=True) > 0.0).all()
        assert (worn.sel(wear_coefficient=0.0) == 0.0).all()
        force = result.loop_force.isel(component=0).mean("phase")
        np.testing.assert_allclose(force, result.mean_pressure * result.contact_area, rtol=1e-9)
        # the largest depth takes half the normal force: the loops are not all the same
        assert np.ptp(force.isel(cycle=-1).values) > 0.01


@pytest.mark.parametrize("overrides", [BY_DEPTH, NO_CYCLES], ids=["largest depth", "no cycles"])
def test_other_reasons(overrides, tmp_path):
    short, long = both_ways(tmp_path, *overrides, "axes.frequency=160", "axes.scheme=['explicit', 'adaptive']")
    for name in COMPARED:
        assert_same(name, short, long)
