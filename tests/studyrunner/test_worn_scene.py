"""Joints that are worn before their history begins."""

import numpy as np
import pytest
import xarray as xr

from studyrunner import compute_worn_joint
from studyrunner.api import run_study
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError

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
        most = states.isel(worn_cycle=int(states.worn_volume.isel(cycle=-1).argmax()))
        compute_worn_joint(tmp_path / "w.nc", tmp_path, loops=[0], progress=False)
        with xr.open_dataset(tmp_path / "worn_joint_loops.nc") as again:
            total = float(most.worn_depth + most.wear_depth.isel(cycle=-1))
            assert again.worn_depth.values.ravel()[-1] == pytest.approx(total, rel=1e-12)


def test_the_effective_study_holds_the_depths(whole, tmp_path):
    text = format_study(read_study("sdof_slider", worn(whole)))
    path = tmp_path / "again.toml"
    path.write_text(text, encoding="utf-8")
    whole.rename(aside := tmp_path / "aside.nc")
    try:
        again = read_study(path)
    finally:
        aside.rename(whole)
    assert format_study(again) == text
    assert next(variant.scene.worn.depth[0] for variant in again.variants if variant.scene.worn) == (0.0,)
    assert again.dimensions["worn_cycle"] == (0.0, 1000.0)


def test_depths_may_be_given(tmp_path):
    study = read_study("sdof_slider", {**SLIDER, "scene.worn": {"depth": 5e-6}})
    assert study.scene.worn.depths(3) == (5e-6,) * 3
    assert "worn_cycle" not in study.dimensions
    two = read_study("sdof_slider", {**SLIDER, "scene.worn": {"depth": [5e-6, 1e-6]}})
    with pytest.raises(UserError, match=r"scene.worn.depth: there are 2 depths: .* has 1 contact pair"):
        run_study(two, tmp_path / "two.nc", progress=False)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"frequency": 151.0}, "scene.worn.frequency = 151.0: give a value of the result: 150"),
        ({"cycle": [10]}, "scene.worn.cycle = 10.0: give a value of the result: 0"),
        ({"cycle": [0, 0]}, "give every value once"),
        ({"freq": 150.0}, "scene.worn.freq = 150.0: unknown key"),
        ({"scheme": "explicit", "sweep": "up"}, "give a value of the result: adaptive"),
        ({"scheme": "explicit", "frequency": 151.0}, "scene.worn.frequency = 151.0: give a value of the result"),
        ({"result": "none.nc"}, 'scene.worn.result = "none.nc": there is no such file'),
        ({"depth": -1.0}, "scene.worn.depth = -1.0: give a number that is 0 or more"),
        ({"depth": [[1e-6], [2e-6], [3e-6]]}, "3 states with 2 cycle counts: give one cycle count"),
        ({"depth": [[1e-6], [2e-6]], "cycle": ["a", 1]}, 'scene.worn.cycle = "a": give a number'),
        ({"result": 3}, "scene.worn.result = 3: give a text in quotes"),
    ],
)
def test_what_is_wrong_is_said(changes, said, whole):
    with pytest.raises(UserError) as error:
        read_study("sdof_slider", worn(whole, **changes))
    assert said in str(error.value)


def test_the_result_that_the_depths_are_from_is_not_replaced(whole):
    before = whole.read_bytes()
    with pytest.raises(UserError, match=r"this one is read by the run"):
        run_study("sdof_slider", whole, overrides=worn(whole), progress=False, overwrite=True)
    assert whole.read_bytes() == before


def test_a_file_that_is_no_whole_result_is_said(whole, tmp_path):
    with xr.open_dataset(whole) as result:
        result[["wear_depth"]].isel(cycle=0, contact=0).to_netcdf(tmp_path / "part.nc")
    with pytest.raises(UserError, match=r"part\.nc: the file = damaged: give a result file"):
        read_study("sdof_slider", worn(tmp_path / "part.nc"))
