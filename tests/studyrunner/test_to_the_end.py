"""slow_time.cycles = inf, from the study file to the report."""

import base64

import numpy as np
import pytest
import xarray as xr

from studyrunner import open_result, run_study
from studyrunner.accessor import join_results
from studyrunner.kinds.kind import build_tasks
from studyrunner.result.opening import check_numbers
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
    assert np.isfinite(shown.read("harmonics_used")).all()
    shown.dataset.close()
    with pytest.raises(ValueError, match="joins only those"):
        join_results([result, result.drop_vars("cycle_count")])


@pytest.mark.slow
def test_the_report_shows_a_final_state_as_one(tmp_path):
    """It has no cycle count: a level beside a history, and alone no history at all; on the page infinite."""
    from studyrunner.report.figures.wear import draw_final, draw_history, draw_map
    from studyrunner.report.page.data import build_page_data

    two = study_with('axes.scheme=["adaptive", "final"]', "axes.frequency=[155, 160]")
    with run_study(two, tmp_path / "both.nc"):
        pass
    both = open_for_report(tmp_path / "both.nc")
    assert both.has_history
    marched, level = draw_history(both)[0].axes[0].get_lines()  # type: ignore[index, union-attr]
    assert len(marched.get_xdata()) == 6  # type: ignore[arg-type]
    assert level.get_label() == "final scheme: final state"
    assert list(level.get_ydata()) == pytest.approx([10.0, 10.0])  # type: ignore[arg-type]
    assert draw_map(both, "worn_volume") is None, "points share no cycle counts"
    content = build_page_data(both, 1e6, [])
    (counts,) = [entry for entry in content["variables"] if entry["name"] == "cycle_count"]
    decoded = np.frombuffer(base64.b64decode(counts["data"]), "<f4").reshape(*both.held.shape, 6)
    assert np.array_equal(np.isinf(decoded).any(axis=-1), both.dataset["final_method"] == 1)
    both.dataset.close()
    one = study_with("axes.scheme=final", "axes.wear_coefficient=[1.1e-11, 1e-12]")
    with run_study(one, tmp_path / "final.nc"):
        pass
    alone = open_for_report(tmp_path / "final.nc")
    assert not alone.has_history
    assert (alone.cycle_label(-1), alone.when(-1)) == ("the final state", "in the final state")
    final, history = draw_final(alone), draw_history(alone)
    assert "10 mm³ ± 1e-06 % at " in history  # type: ignore[operator]
    assert "worn volume at the end" in final[0].axes[0].get_ylabel()  # type: ignore[index, union-attr]
    alone.dataset.close()


@pytest.mark.slow
def test_the_scheme_final_is_computed_once_and_says_how(tmp_path):
    overrides = ("axes.wear_coefficient=[1.1e-11, 1e-12]", 'axes.scheme=["adaptive", "final"]', "axes.step=[10, 100]")
    study = study_with(*overrides)
    plan = build_tasks(study, 2)
    assert len(plan.results) == 2
    assert any("the same state for every wear_coefficient" in item.reason for item in plan.left_out)
    with run_study(study, tmp_path / "final.nc") as opened:
        result = opened.squeeze(drop=True).load()
    direct = result.sel(scheme="final")
    assert result.final_method.attrs["flag_meanings"].split() == ["none", "active_set", "march"]
    assert (direct.final_method == 1).all()
    assert (result.sel(scheme="adaptive").final_method == 0).all()
    assert (direct.outcome == 0).all()
    assert np.isinf(direct.cycle_count.isel(cycle=-1)).all()
    assert direct.worn_volume.isel(cycle=slice(1, -1)).isnull().all()
    assert not direct.harmonics_used.isel(cycle=slice(1, -1)).any()
    assert direct.worn_volume.isel(cycle=-1).values == pytest.approx(1e-8)
    rates = direct.wear_rate.isel(cycle=0, step=0).values
    assert rates[0] == pytest.approx(11.0 * rates[1])
    shown = open_for_report(tmp_path / "final.nc")
    check_numbers(shown.dataset, "final.nc")
    assert np.isfinite(shown.worn).all()
    assert len(shown.cycles) == 6
    # states that there are not have no harmonics
    used = shown.read("harmonics_used").sel(scheme="final").values.reshape(-1, 6)
    assert np.isnan(used[0]).tolist() == [False, True, True, True, True, False]
    shown.dataset.close()
