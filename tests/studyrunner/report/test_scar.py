"""The scar of a cylinder and of a sphere, the measured one beside it, and the point that a report shows."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from studyrunner.result.pairs import find_scar, read_profile
from studyrunner.result.view import Result, open_for_report
from studyrunner.user_error import UserError
from tests.studyrunner.report.figure_numbers import draw_figure
from tests.studyrunner.results import build_file, make_result

X = 1e-5 * np.array([1.0, 1.0, 1.0, 3.0, 3.0, 5.0, 5.0, 5.0, 7.0, 7.0, 9.0, 9.0])
Y = 1e-5 * np.array([1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0])


def half_space(model):
    result = make_result()
    x, y = (np.linspace(0.5, 11.5, 12) * 1e-5, np.zeros(12)) if model == "cylinder_on_flat" else (X, Y)
    places = {"contact_x": ("contact", x), "contact_y": ("contact", y), "contact_z": ("contact", np.zeros(12))}
    dataset = result.dataset.assign_coords(places)
    dataset.attrs = {**dataset.attrs, "study": f'[study]\nname = "s"\n[scene]\nmodel = "{model}"\n'}
    return replace(result, dataset=dataset)


@pytest.mark.parametrize("model", ["cylinder_on_flat", "sphere_on_flat"])
def test_the_scar_is_symmetric_and_that_of_the_pairs(model):
    result = half_space(model)
    scar = find_scar(result)
    assert scar is not None
    depth = result.dataset["wear_depth"].isel(result.shown_point()).isel(cycle=-1).values
    drawing = draw_figure(result, "worn_profile")
    panel = drawing.figure.axes[-1] if model == "cylinder_on_flat" else drawing.figure.axes[1]
    (line,) = [each for each in panel.lines if str(each.get_label()).startswith("after")]
    at, drawn = np.array(line.get_xdata()), np.array(line.get_ydata())
    np.testing.assert_allclose(at, -at[::-1])
    np.testing.assert_array_equal(drawn, drawn[::-1])
    right = drawn[at > 0.0]
    row = np.arange(12) if model == "cylinder_on_flat" else np.flatnonzero(Y == 1e-5)
    np.testing.assert_allclose(right / right.max(), depth[row] / depth[row].max())
    assert panel.yaxis_inverted()


def test_every_patch_of_a_sphere_stands_at_four_places():
    scar = find_scar(half_space("sphere_on_flat"))
    assert np.bincount(scar.pairs).tolist() == [4] * 12
    assert len(set(zip(scar.x.tolist(), scar.y.tolist(), strict=True))) == 48
    np.testing.assert_array_equal(np.abs(scar.x), X[scar.pairs])
    assert scar.width == pytest.approx(2e-5)


def test_the_measured_profile_is_drawn_beside_it(tmp_path):
    path = tmp_path / "scar.csv"
    path.write_text("depth (um),x (mm),note\n1.5,0.02,a\n\n0.5,-0.02,b\n", encoding="utf-8")
    profile = read_profile(path)
    np.testing.assert_allclose(profile.x, [-2e-5, 2e-5])
    np.testing.assert_allclose(profile.depth, [0.5e-6, 1.5e-6])
    drawing = draw_figure(replace(half_space("cylinder_on_flat"), measured=profile), "worn_profile")
    (line,) = [each for each in drawing.figure.axes[0].lines if each.get_label() == "measured"]
    assert len(line.get_xdata()) == 2
    assert "scar.csv" in drawing.caption


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,depth\n1,2\n", "line 1"),
        ("x_mm,depth_um\n1,deep\n", "row 2"),
        ("x_mm,depth_um\n", "at least one row"),
        ("x_mm,depth_um\n1,nan\n", "finite"),
    ],
)
def test_what_is_wrong_with_a_profile_is_said(tmp_path, text, words):
    path = tmp_path / "scar.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as error:
        read_profile(path)
    assert "scar.csv" in str(error.value)
    assert words in str(error.value)


def test_figures_show_the_chosen_point(tmp_path):
    path = tmp_path / "out.nc"
    dataset = build_file()
    dataset.to_netcdf(path)
    scheme = str(dataset["scheme"].values[1])
    result = open_for_report(path, {"frequency": f"{dataset['frequency'].values[3]:g}", "scheme": scheme})
    assert result.shown_point()["frequency"] == 3
    assert result.shown_point()["scheme"] == 1
    result.dataset.close()
    for wrong, words in (({"frequency": "1"}, "give one of the values of frequency"), ({"mu": "1"}, "one of the axes")):
        with pytest.raises(UserError, match=words):
            open_for_report(path, wrong)


def test_loops_stand_about_their_means_and_the_caption_tells_the_drift(tmp_path):
    dataset: xr.Dataset = build_file(loops=[2])
    result = Result(tmp_path / "a.nc", dataset)
    loops = dataset["loop_displacement"]
    loops.values[..., -1, :, :, 1] += 3e-3  # last count, first tangent
    drawing = draw_figure(result, "fretting_loops")
    for line in drawing.figure.axes[0].lines[:2]:
        assert abs(np.mean(np.array(line.get_xdata())[:-1])) < 1e-9 * np.ptp(line.get_xdata())
    point = result.shown_point()
    means = loops.isel(point).isel(contact=2, component=1).mean("phase").values
    told = 1e3 * float(means[-1] - means[0])
    assert f"pair 2 {told:.3g} mm " in drawing.caption
