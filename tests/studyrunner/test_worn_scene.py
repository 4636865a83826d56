"""Joints that are worn before their history begins."""

import numpy as np
import pytest
import xarray as xr

from studyrunner.api import run_study

SLIDER = {
    "axes.frequency": [150.0],
    "axes.wear_coefficient": 1e-10,
    "axes.excitation_amplitude": 20.0,
    "axes.scheme": "adaptive",
    "slow_time.cycles": 1000,
    "slow_time.outputs": 3,
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A history over twice the cycles, with the state in between."""
    path = tmp_path_factory.mktemp("worn") / "whole.nc"
    run_study("sdof_slider", path, overrides={**SLIDER, "slow_time.cycles": 2000}, progress=False).close()
    return path


def worn(path, **changes):
    return {**SLIDER, "scene.worn": {"result": str(path), "cycle": [0, 1000], **changes}}


@pytest.mark.slow
def test_a_history_that_begins_with_a_worn_joint_goes_on_where_the_other_ended(whole, tmp_path):
    with xr.open_dataset(whole) as first, run_study("sdof_slider", tmp_path / "w.nc", overrides=worn(whole)) as later:
        before, states = first.squeeze(), later.squeeze()
        np.testing.assert_array_equal(states.worn_cycle, [0.0, 1000.0])
        np.testing.assert_array_equal(states.worn_depth, before.wear_depth.sel(cycle=[0.0, 1000.0]))
        # the unworn state is the same study
        np.testing.assert_allclose(
            states.worn_volume.isel(worn_cycle=0, cycle=-1), before.worn_volume.sel(cycle=1000.0), rtol=1e-2
        )
        vibrates = states.response_amplitude.isel(worn_cycle=1, cycle=0)
        np.testing.assert_allclose(vibrates, before.response_amplitude.sel(cycle=1000.0), rtol=1e-3)
        assert vibrates > 1.002 * states.response_amplitude.isel(worn_cycle=0, cycle=0)
        more = before.worn_volume.sel(cycle=2000.0) - before.worn_volume.sel(cycle=1000.0)
        np.testing.assert_allclose(states.worn_volume.isel(worn_cycle=1, cycle=-1), more, rtol=1e-2)
