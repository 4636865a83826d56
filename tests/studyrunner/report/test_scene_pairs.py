"""Figures and maps of pairs show those of one scene, and the depth of the last count where a file holds no other."""

import base64
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from studies.scene import SurfaceMesh
from studyrunner.measured import read_profile
from studyrunner.report.contents import draw_report
from studyrunner.report.page import build_page_data, build_root_numbers
from studyrunner.report.root import find_writer, read_root
from studyrunner.result.opening import check_dataset
from studyrunner.result.pairs import find_flanks, last_depth, of_shown_scene
from studyrunner.result.view import Result
from studyrunner.user_error import UserError
from tests.studyrunner.report.cases import draw_figure, with_mesh
from tests.studyrunner.report.test_page import decode
from tests.studyrunner.results import flank_positions, mesh_file, sample_file, smooth_result

FEW = 12
LAST_DEPTH = "wear_depth_last"


def with_faces(dataset, n_along, n_across):
    """The file with a mesh of both flanks, whose nodes are the pairs."""
    nodes = flank_positions(n_along, n_across)
    grid = np.arange(len(nodes)).reshape(2, n_along, n_across)
    quads = np.stack([grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]], axis=-1).reshape(-1, 4)
    return with_mesh(dataset, SurfaceMesh(nodes, quads, ("flank",) * len(quads)))


@pytest.fixture(scope="module")
def meshes():
    return Result(Path("meshes.nc"), check_dataset(with_faces(mesh_file(), 3, 2), "meshes.nc"))


@pytest.fixture(scope="module")
def samples():
    return Result(Path("samples.nc"), check_dataset(with_faces(sample_file(), 4, 3), "samples.nc"))


def test_a_scene_has_its_own_pairs(meshes):
    shown = of_shown_scene(meshes)
    assert shown.shown == meshes.shown | {"mesh": 0}
    assert [shown.dataset.sizes["contact"], sum(len(flank.pairs) for flank in find_flanks(shown))] == [FEW, FEW]
    assert read_root(shown) is not None
    np.testing.assert_array_equal(shown.at("wear_depth", shown.shown), meshes.at("wear_depth", meshes.shown)[:, :FEW])


def test_figures_show_the_pairs_of_the_shown_scene_and_the_depth_of_the_last_count(meshes, samples):
    items = {item.name: item for item in draw_report(meshes)}
    assert {"wear_depth", "mean_pressure", "worn_profile"} <= set(items)
    assert "mesh 1" in items["worn_profile"].title
    items = {item.name: item for item in draw_report(samples)}
    assert "worn_profile" in items
    deepest = int(np.argmax(samples.at(LAST_DEPTH, samples.shown).values))
    assert f"at pair {deepest}" in items["wear_depth"].caption


def test_the_page_holds_the_depth_and_the_draws_of_every_sample_and_the_root_of_the_shown_scene(meshes, samples):
    content = build_page_data(samples, 4e6, [])
    (depth,) = [entry for entry in content["variables"] if entry["name"] == LAST_DEPTH]
    np.testing.assert_array_equal(*decode(depth, samples.dataset[LAST_DEPTH]))
    (wear,) = [entry for entry in content["coords"] if entry["name"] == "sample_wear_coefficient"]
    np.testing.assert_array_equal(*decode(wear, samples.dataset["sample_wear_coefficient"]))
    assert wear["dim"] == "sample"
    root = build_root_numbers(meshes, [])
    assert root["scene"] == {"mesh": 0}
    assert np.frombuffer(base64.b64decode(root["contact"]["pairs"]), "<f4").max() == FEW - 1


@pytest.mark.parametrize(("kind", "n_files"), [("meshes", 3), ("samples", 1)])
def test_the_root_of_one_scene_is_written(kind, n_files, request, tmp_path):
    result = request.getfixturevalue(kind)
    assert find_writer(result)(tmp_path) == n_files
    mesh = meshio.read(tmp_path / "vtu" / f"root_{n_files - 1:04d}.vtu")
    expected = last_depth(result, result.shown)
    assert np.nanmax(mesh.point_data["wear_depth (m)"]) == np.nanmax(expected)


def test_directions_have_the_words_of_the_scene(meshes):
    plain = of_shown_scene(meshes)
    told = replace(plain, dataset=plain.dataset.assign_attrs(contact_directions="axial, up the flank"))
    assert {each.directions for each in find_flanks(told)} == {("axial", "up the flank")}
    assert {each.directions[0] for each in find_flanks(plain)} == {"z"}


# --- the scar of a cylinder and of a sphere, and the measured one beside it ---

X = 1e-5 * np.array([1.0, 1.0, 1.0, 3.0, 3.0, 5.0, 5.0, 5.0, 7.0, 7.0, 9.0, 9.0])
Y = 1e-5 * np.array([1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0, 5.0, 1.0, 3.0, 1.0, 3.0])


def half_space(mirrored):
    result = smooth_result()
    x, y = (np.linspace(0.5, 11.5, 12) * 1e-5, np.zeros(12)) if mirrored == "x" else (X, Y)
    places = {"contact_x": ("contact", x), "contact_y": ("contact", y), "contact_z": ("contact", np.zeros(12))}
    return replace(result, dataset=result.dataset.assign_coords(places).assign_attrs(contact_mirrored=mirrored))


@pytest.mark.parametrize(("mirrored", "row"), [("x", np.arange(12)), ("x, y", np.flatnonzero(Y == 1e-5))])
def test_the_scar_is_symmetric_and_that_of_the_pairs(mirrored, row):
    result = half_space(mirrored)
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
    path.write_text("depth (um),x (mm),note\n1.5,0.02,a,\n\n0.5,-0.02,b,\n", encoding="utf-8")
    profile = read_profile(path)
    np.testing.assert_allclose(profile.x, [-2e-5, 2e-5])
    np.testing.assert_allclose(profile.depth, [0.5e-6, 1.5e-6])
    drawing = draw_figure(replace(half_space("x"), measured=profile), "worn_profile")
    (line,) = [each for each in drawing.figure.axes[0].lines if each.get_label() == "measured"]
    assert len(line.get_xdata()) == 2
    assert "scar.csv" in drawing.caption


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("x,depth\n1,2\n", "line 1"),
        ("x_mm,depth_um\n0,1\n1,deep\n", "row 3"),
        ("x_mm|depth_um\n1|2\n", "line 1"),
        ("x_mm,depth_um\n", "row"),
        ("x_mm,depth_um\n1,nan\n", "finite"),
    ],
)
def test_a_wrong_profile_is_refused(tmp_path, text, place):
    path = tmp_path / "scar.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=rf"scar\.csv.*{place}"):
        read_profile(path)
