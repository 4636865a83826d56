"""slow_time.cycles = inf, from the study file to the report."""

import numpy as np
import pytest
import xarray as xr

from studyrunner import open_result, run_study
from studyrunner.accessor import join_results
from studyrunner.kinds.kind import build_tasks
from studyrunner.result.view import open_for_report
from studyrunner.study.study_file import read_study

END = (
    "axes.frequency=160",
    "axes.sweep=ramp",
    "slow_time.cycles=inf",
    "slow_time.outputs=6",
    "solver.harmonics=3",
    "solver.samples=64",
)


def study_with(*overrides):
    return read_study("sdof_slider", (*END, "axes.scheme=adaptive", *overrides))


@pytest.mark.slow
def test_points_have_counts_of_their_own_in_file_report_and_archive(tmp_path):
    wears = "axes.wear_coefficient=[1.1e-11, 2.2e-12, 0.0]"
    study = study_with(wears, 'axes.scheme=["adaptive", "implicit"]', "axes.step=2000", "outputs.loops=[0]")
    with run_study(study, tmp_path / "end.nc") as opened:
        result = opened.load()
    one = result.squeeze([name for name in result.outcome.dims if result.sizes[name] == 1], drop=True)
    assert one.outcome.values.tolist() == [[0, 0]] * 3
    assert one.cycle.values.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert one.cycle_count.dims == ("wear_coefficient", "scheme", "cycle")
    counts, volumes = one.cycle_count.values, one.worn_volume.values
    assert not counts[:, :, 0].any()
    assert (np.diff(counts[:2], axis=-1) > 0.0).all()
    assert volumes[:2, ..., -1] == pytest.approx(np.full((2, 2), 1e-4 * 1e-4), rel=1e-3)
    way = volumes[:2] / volumes[:2, ..., -1:] + counts[:2] / counts[:2, ..., -1:]
    assert np.diff(way, axis=-1) == pytest.approx(np.full((2, 2, 5), 2.0 / 5.0), rel=1e-6)
    # the same history of both coefficients, five times as slow; nothing wears without one
    assert counts[1, 0] == pytest.approx(5.0 * counts[0, 0])
    assert one.wear_rate.values[1, 0] == pytest.approx(one.wear_rate.values[0, 0] / 5.0)
    assert one.last_cycle.values[:2] == pytest.approx(counts[:2, :, -1])
    assert not counts[2].any()
    assert not volumes[2].any()
    # another march where the step is five times as short in wear
    assert volumes[1, 1, -1] == pytest.approx(volumes[0, 1, -1], rel=1e-4)
    again = run_study(tmp_path / "end.nc", tmp_path / "again.nc").load()
    xr.testing.assert_identical(again.drop_vars("run_time"), result.drop_vars("run_time").assign_attrs(again.attrs))
    with open_result(tmp_path / "end.nc") as opened:
        assert np.array_equal(opened.cycle_count.values, result.cycle_count.values)
    shown = open_for_report(tmp_path / "end.nc")
    assert np.array_equal(shown.cycles, shown.counts(shown.shown_point()))
    assert shown.cycles[-1] in counts[:, :, -1]
    shown.dataset.close()
    with pytest.raises(ValueError, match="joins only those"):
        join_results([result, result.drop_vars("cycle_count")])


@pytest.mark.slow
def test_the_scheme_final_is_computed_once_for_all_coefficients_and_steps(tmp_path):
    overrides = ("axes.wear_coefficient=[1.1e-11, 1e-12]", 'axes.scheme=["adaptive", "final"]', "axes.step=[10, 100]")
    study = study_with(*overrides)
    assert len(build_tasks(study, 2).results) == 1
    with run_study(study, tmp_path / "final.nc") as opened:
        result = opened.squeeze(drop=True).load()
    assert (result.outcome == 0).all()
    assert np.array_equal(result.worn_volume.sel(scheme="final"), result.worn_volume.sel(scheme="adaptive"))
    rates = result.wear_rate.sel(scheme="final").isel(cycle=0, step=0).values
    assert rates[0] == pytest.approx(11.0 * rates[1])
