"""Studies of nonlinear modes: axes.modal_amplitude in place of frequency, excitation and wear."""

import numpy as np
import pytest
import xarray as xr

from solver import backbone
from studies import build_scene
from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.report.contents import draw_report
from studyrunner.report.page import write_page
from studyrunner.result.view import open_for_report
from studyrunner.summary.answer import summary
from tests.mpi.launching import options, results
from tests.studyrunner.small_studies import compute

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("folder")]

# a mass on a rigid slider has its mode while it slides: above 1e-5 m sqrt(kg)
SLIDER = """
study = {name = "slider_modes"}
scene = {model = "sdof_slider", worn = {depth = [[1e-6], [0.0]], cycle = [1e4, 0]}}
axes = {modal_amplitude = [1e-3, 1e-6, 1e-4], mode = [1, 3], sweep = "down"}
scatter = {samples = 2, friction_coefficient = {normal = {std = 0.03}}}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A result; its study stands beside it."""
    path = tmp_path_factory.mktemp("modes") / "out.nc"
    path.with_suffix(".toml").write_text(SLIDER, encoding="utf-8")
    run_study(path.with_suffix(".toml"), path, progress=False).close()
    return path


@pytest.fixture
def study(path):
    return str(path.with_suffix(".toml"))


@pytest.fixture
def result(path):
    return results(path)


def test_the_result_has_its_axes_and_the_values_of_the_solver(result):
    """Amplitudes and worn joints in the order of the study file, each the same as in Python."""
    sizes = dict(zip(result.natural_frequency.dims, result.natural_frequency.shape, strict=True))
    expected = {"mode": 2, "sweep": 1, "sample": 2, "modal_amplitude": 3, "cycle": 2}
    assert list(sizes.items()) == list(expected.items())
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
    said = result.message.isel(sweep=0, sample=0).sel(cycle=0)
    assert "followed down to the amplitude" in said.sel(mode=1, modal_amplitude=1e-6).item()
    assert "fewer linear modes" in said.sel(mode=3)[0].item()
    found = result.natural_frequency.sel(mode=1, modal_amplitude=[1e-4, 1e-3])
    modes = summary(result).values
    assert modes["mode 1"]["natural_frequency"] == [found.min(), found.max()]
    assert modes["mode 3"] == {"n_found": 0}


def test_points_are_the_same_in_another_list(study, result):
    """And a study with more amplitudes goes on from the points that are there."""
    one = ("scatter.samples=1", "axes.mode=1", "scene.worn={depth=0.0, cycle=0}")
    first = compute(study, "out.nc", *one, "axes.modal_amplitude=[1e-4]", "outputs.variables=['slip_fraction']")
    assert "natural_frequency" not in first
    assert summary(first).values["mode 1"]["n_found"] == 1
    more = options(*one, "axes.modal_amplitude={start=1e-5, stop=1e-3, num=3, spacing='log'}")
    # the smallest amplitude has no mode
    assert main([study, "-o", "out.nc", *more]) == 3
    found = results()
    np.testing.assert_array_equal(found.modal_amplitude, [1e-5, 1e-4, 1e-3])
    for amplitude in (1e-4, 1e-3):
        where = {"modal_amplitude": [amplitude], "cycle": [0.0], "mode": [1], "sample": [0]}
        one, other = (each.sel(where).drop_attrs(deep=False) for each in (found, result))
        xr.testing.assert_identical(one, other)


def test_the_report_draws_frequency_and_damping(result, path, folder):
    shown = open_for_report(path)
    items = {item.name: item for item in draw_report(shown)}
    assert "natural_frequency" in items
    assert ", 0 left out, " in write_page(shown, items.values(), folder / "index.html")
    drawn = {line.get_label(): line.get_ydata() for line in items["damping_ratio"].figure.axes[0].get_lines()}
    for label, cycle in (("mode 1, cycle 10\N{NO-BREAK SPACE}000", 1e4), ("mode 1, cycle 0", 0)):
        expected = result.damping_ratio.sel(mode=1, cycle=cycle).isel(sweep=0, sample=0).values[[1, 2, 0]]
        np.testing.assert_allclose(drawn[label], expected)
    shown.dataset.close()
