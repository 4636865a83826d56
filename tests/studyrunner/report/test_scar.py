"""The scar of a cylinder and of a sphere, and the measured one beside it."""

from dataclasses import replace

import numpy as np
import pytest

from studyrunner.result.pairs import read_profile
from studyrunner.user_error import UserError
from tests.studyrunner.report.cases import draw_figure
from tests.studyrunner.results import make_result

X = 1e-5 * np.array([1.0, 1.0, 1.0, 3.0, 3.0, 5.0, 5.0, 5.0, 7.0, 7.0, 9.0, 9.0])
Y = 1e-5 * np.array([1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0])


def half_space(model):
    result = make_result()
    x, y = (np.linspace(0.5, 11.5, 12) * 1e-5, np.zeros(12)) if model == "cylinder_on_flat" else (X, Y)
    places = {"contact_x": ("contact", x), "contact_y": ("contact", y), "contact_z": ("contact", np.zeros(12))}
    study = f'[study]\nname = "s"\n[scene]\nmodel = "{model}"\n'
    return replace(result, dataset=result.dataset.assign_coords(places).assign_attrs(study=study))


@pytest.mark.parametrize(
    ("model", "row"),
    [("cylinder_on_flat", np.arange(12)), ("sphere_on_flat", np.flatnonzero(Y == 1e-5))],
)
def test_the_scar_is_symmetric_and_that_of_the_pairs(model, row):
    result = half_space(model)
    depth = result.dataset["wear_depth"].isel(result.shown).isel(cycle=-1).values
    panel = draw_figure(result, "worn_profile").figure.axes[0]
    (line,) = [each for each in panel.lines if str(each.get_label()).startswith("after")]
    at, drawn = np.array(line.get_xdata()), np.array(line.get_ydata())
    np.testing.assert_allclose(at, -at[::-1])
    np.testing.assert_array_equal(drawn, drawn[::-1])
    right = drawn[at > 0.0]
    np.testing.assert_allclose(right / right.max(), depth[row] / depth[row].max())
    assert panel.yaxis_inverted()


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
    ("text", "place"),
    [
        ("x,depth\n1,2\n", "line 1"),
        ("x_mm,depth_um\n1,deep\n", "row 2"),
        ("x_mm,depth_um\n", "row"),
        ("x_mm,depth_um\n1,nan\n", "finite"),
    ],
)
def test_a_wrong_profile_is_refused(tmp_path, text, place):
    path = tmp_path / "scar.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=rf"scar\.csv.*{place}"):
        read_profile(path)
