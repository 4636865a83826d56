"""Figures and maps of pairs show those of one scene, and the depth of the last count where a file holds no other."""

import base64
from pathlib import Path

import meshio
import numpy as np
import pytest

from studies.scene import SurfaceMesh
from studyrunner.report.contents import draw_report
from studyrunner.report.figures.flanks import find_flanks
from studyrunner.report.page.data import build_page_data, build_root_numbers
from studyrunner.report.root import read_root
from studyrunner.report.vtu import find_writer
from studyrunner.result.opening import check_dataset
from studyrunner.result.pairs import last_depth, of_shown_scene
from studyrunner.result.view import Result
from tests.studyrunner.report.cases import with_mesh
from tests.studyrunner.report.test_page import decode
from tests.studyrunner.results import flank_positions, mesh_file, sample_file

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
