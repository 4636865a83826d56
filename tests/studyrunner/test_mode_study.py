"""Studies of nonlinear modes: axes.modal_amplitude in place of frequency, excitation and wear."""

import numpy as np
import pytest
import xarray as xr

from solver import backbone
from studies import build_scene
from studyrunner.api import run_study
from studyrunner.kinds.kind import build_tasks
from studyrunner.report.contents import draw_report
from studyrunner.report.page.page import write_page
from studyrunner.result.view import open_for_report
from studyrunner.study.study import Study
from studyrunner.study.study_file import format_study, read_study
from tests.studyrunner.fakes import points_of

pytestmark = pytest.mark.slow

# a mass on a rigid slider has its mode while it slides: above 1e-5 m sqrt(kg)
SLIDER = """
[study]
name = "slider_modes"
[scene]
model = "sdof_slider"
worn = {depth = [[1e-6], [0.0]], cycle = [1e4, 0]}
[axes]
modal_amplitude = [1e-3, 1e-6, 1e-4]
mode = [1, 3]
sweep = "down"
[scatter]
samples = 2
friction_coefficient = {normal = {std = 0.03}}
"""
SHAPE = {"mode": 2, "sweep": 1, "sample": 2, "modal_amplitude": 3, "cycle": 2}


@pytest.fixture(scope="module")
def study_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("modes") / "slider_modes.toml"
    path.write_text(SLIDER, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def result(study_file):
    return run_study(study_file, study_file.with_name("out.nc"), progress=False).load()


def without_time(dataset):
    return dataset.drop_vars(["run_time", "ended"]).drop_attrs(deep=False)


def test_the_result_has_its_axes_and_the_values_of_the_solver(result):
    """Amplitudes and worn joints in the order of the study file, each the same as in Python."""
    sizes = dict(zip(result.natural_frequency.dims, result.natural_frequency.shape, strict=True))
    assert list(sizes.items()) == list(SHAPE.items())
    np.testing.assert_array_equal(result.cycle, [1e4, 0.0])
    for variable in result.variables.values():
        assert {"units", "long_name"} <= variable.attrs.keys()
    model = build_scene("sdof_slider")
    for sample, cycle, depth in ((0, 1, 0.0), (1, 0, 1e-6)):
        friction = result.sample_friction_coefficient.values[sample]
        direct = backbone(model, result.modal_amplitude, friction, sweep="down", wear_depth=depth)
        at = result.isel(mode=0, sweep=0, sample=sample, cycle=cycle)
        for name, values in {
            "natural_frequency": direct.frequency,
            "natural_frequency_error": direct.frequency_error,
            "damping_ratio": direct.damping_ratio,
            "damping_ratio_error": direct.damping_error,
            "response_amplitude": np.abs(direct.response),
            "slip_fraction": direct.slip_fraction,
            "open_fraction": direct.open_fraction,
            "harmonics_used": direct.harmonics_used,
            "outcome": direct.outcome,
        }.items():
            np.testing.assert_array_equal(at[name], values, err_msg=name)
    assert (result.harmonics_used.sel(mode=1, modal_amplitude=[1e-4, 1e-3]) > 0).all()


def test_a_mode_that_is_not_there_says_so(result):
    assert "followed down to the amplitude" in str(
        result.message.sel(mode=1, modal_amplitude=1e-6, cycle=0)[0, 0].item()
    )
    assert "fewer linear modes" in str(result.message.sel(mode=3, cycle=0)[0, 0, 0].item())
    found = result.natural_frequency.sel(mode=1, modal_amplitude=[1e-4, 1e-3])
    first, third = result.fretwear.summary().modes
    assert (first.number, first.frequency) == (1, (found.min(), found.max()))
    assert (third.number, third.n_found, third.n_points) == (3, 0, 12)
    assert "The mode may turn back before it (a fold)" in result.outcome.attrs["sentences"]


def test_points_are_the_same_in_another_list(study_file, result, tmp_path):
    """And a study with more amplitudes goes on from the points that are there."""
    changes = {"scatter.samples": 1, "axes.mode": 1, "scene.worn": {"depth": 0.0, "cycle": 0}}
    few = {**changes, "axes.modal_amplitude": [1e-4], "outputs.variables": ["slip_fraction"]}
    more = {**changes, "axes.modal_amplitude": {"start": 1e-5, "stop": 1e-3, "num": 3, "spacing": "log"}}
    with run_study(study_file, tmp_path / "out.nc", overrides=few, progress=False) as first:
        assert "natural_frequency" not in first
        assert first.fretwear.summary().modes[0].n_found == 1
    found = run_study(study_file, tmp_path / "out.nc", overrides=more, progress=False, overwrite=True).load()
    np.testing.assert_array_equal(found.modal_amplitude, [1e-5, 1e-4, 1e-3])
    for amplitude in (1e-4, 1e-3):
        where = {"modal_amplitude": [amplitude], "cycle": [0.0], "mode": [1], "sample": [0]}
        xr.testing.assert_identical(without_time(found.sel(where)), without_time(result.sel(where)))


def test_the_effective_study_is_the_same_study(study_file, tmp_path):
    study = read_study(study_file)
    text = format_study(study)
    for name in ("slow_time", "[wear]", "frequency =", "scheme", "step"):
        assert name not in text.replace("natural_frequency", "")
    (tmp_path / "again.toml").write_text(text, encoding="utf-8")
    assert read_study(tmp_path / "again.toml").dimensions == study.dimensions
    assert format_study(read_study(tmp_path / "again.toml")) == text


def test_points_of_a_line_share_a_task(study_file):
    """Lines that are equal are followed once."""
    study: Study = read_study(study_file, {"scene.worn.depth": [[0.0], [0.0]], "axes.sweep": ["up", "down"]})
    plan = build_tasks(study, 2)
    assert plan.n_points == 2 * 2 * 2 * 3 * 2
    assert [mode.amplitudes for mode in plan.results] == [(1e-6, 1e-4, 1e-3)] * len(plan.results)
    points = [point for mode in plan.results for point in points_of(mode)]
    assert len(set(points)) == len(points) == plan.n_points


def test_the_report_draws_frequency_and_damping(result, study_file, tmp_path):
    with open_for_report(study_file.with_name("out.nc")).dataset as dataset:
        assert dataset.sizes == result.sizes
    shown = open_for_report(study_file.with_name("out.nc"))
    items = {item.name: item for item in draw_report(shown)}
    assert {"natural_frequency", "damping_ratio"} <= items.keys()
    summary = write_page(shown, items.values(), tmp_path / "index.html")
    assert summary.n_missing == 0
    lines = items["damping_ratio"].figure.axes[0].get_lines()
    found = [result.damping_ratio.sel(mode=1, cycle=cycle).isel(sweep=0, sample=0).values for cycle in (1e4, 0)]
    drawn = {line.get_label(): line.get_ydata() for line in lines}
    for label, values in zip(("mode 1, cycle 10\N{NO-BREAK SPACE}000", "mode 1, cycle 0"), found, strict=True):
        np.testing.assert_allclose(drawn[label], values[[1, 2, 0]])
    shown.dataset.close()
