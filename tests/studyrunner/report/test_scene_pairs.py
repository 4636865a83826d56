"""Figures and maps of pairs show those of one scene; the depth of the last count; coordinates that lie are refused."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from studyrunner.report.figures.flank import draw_flanks
from studyrunner.report.page.maps import LAST_DEPTH
from studyrunner.report.reading.flanks import find_flanks

from studyrunner.report.drawing import style
from studyrunner.report.page.data import build_page_data
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.scene_pairs import last_depth, of_scene, of_shown_scene
from studyrunner.report.reading.schema_check import check_dataset
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.vtu import find_writer
from tests.studyrunner.report.scatter_cases import mesh_file, sample_file
from tests.studyrunner.report.test_page_data import decode

FEW, MANY = 12, 24


@pytest.fixture(scope="module")
def meshes():
    return Result(Path("meshes.nc"), check_dataset(mesh_file(), "meshes.nc"))


@pytest.fixture(scope="module")
def samples():
    return Result(Path("samples.nc"), check_dataset(sample_file(), "samples.nc"))


@pytest.fixture(scope="module")
def page(samples):
    return build_page_data(samples, 4e6).content


def test_a_scene_has_its_own_pairs(meshes):
    shown = of_shown_scene(meshes)
    assert shown.shown_point() == meshes.shown_point() | {"mesh": 0}
    assert [shown.dataset.sizes["contact"], sum(len(flank.pairs) for flank in find_flanks(shown))] == [FEW, FEW]
    other = of_scene(meshes, {**meshes.shown_point(), "mesh": 1})
    assert other.dataset.sizes["contact"] == MANY
    assert read_root(shown) is not None
    np.testing.assert_array_equal(
        shown.at("wear_depth", shown.shown_point()), meshes.at("wear_depth", meshes.shown_point())[:, :FEW]
    )


def test_axes_of_the_scene_are_named_with_their_unit(meshes):
    shown = of_shown_scene(meshes)
    assert "rpm, mesh 1" in shown.describe(shown.shown_point())
    choice = choose(shown, [], 4)
    assert choice.sentence == "Shown for mesh 1; the file also holds 1 other value of mesh."


def test_figures_show_the_pairs_of_the_shown_scene(meshes):
    with style():
        items = {item.name: item for item in draw_flanks(of_shown_scene(meshes))}
    assert set(items) == {"wear_depth", "mean_pressure", "worn_profile"}
    assert "mesh 1" in items["worn_profile"].caption


def test_panels_of_each_scene_name_places_in_the_file(meshes):
    content = build_page_data(meshes, 4e6).content
    maps: Any = content["maps"]
    assert maps["scenes"] == [meshes.axes.index("mesh")]
    for panels, n_pairs in zip(maps["panels"], (FEW, MANY), strict=True):
        pairs = np.concatenate([np.ravel(panel["pairs"]) for panel in panels])
        assert sorted(pairs) == list(range(n_pairs))


def test_the_depth_of_the_last_count_is_drawn(samples):
    with style():
        items = {item.name: item for item in draw_flanks(samples)}
    assert "worn_profile" in items
    depth = samples.at(LAST_DEPTH, samples.shown_point()).values
    assert f"at pair {int(np.argmax(depth))}" in items["wear_depth"].caption


def test_the_page_holds_the_depth_of_every_sample(samples, page):
    entry = page["maps"]["variables"][LAST_DEPTH]
    expected = samples.dataset[LAST_DEPTH].values.reshape(len(entry["points"]), 1, -1)
    np.testing.assert_array_equal(decode(entry, *expected.shape), expected.astype("f4"))


def test_the_page_holds_what_samples_draw(samples, page):
    scatter = page["scatter"]
    assert scatter["axis"] == samples.axes.index("sample")
    by_label = {entry["label"]: entry for entry in scatter["inputs"]}
    wear = samples.dataset["sample_wear_coefficient"].values
    np.testing.assert_array_equal(decode(by_label["wear coefficient"], 1, wear.size)[0], wear.astype("f4"))
    labels = [entry["label"] for entry in scatter["inputs"]]
    assert [labels[place] for place in scatter["deciding"]] == ["wear coefficient"] * 2


def test_little_room_takes_the_shown_combination(samples):
    data = build_page_data(samples, 3e4)
    scatter: Any = data.content["scatter"]
    assert scatter["held"] == [samples.shown_point()["frequency"]]
    assert "The scatter is on this page for one of 2 combinations of the other axes." in data.notes


@pytest.mark.parametrize(("kind", "n_files"), [("meshes", 3), ("samples", 1)])
def test_the_root_of_one_scene_is_written(kind, n_files, request, tmp_path):
    result = request.getfixturevalue(kind)
    series = find_writer(result)(tmp_path)
    assert series.n_files == n_files
    mesh = meshio.read(tmp_path / "vtu" / f"root_{n_files - 1:04d}.vtu")
    expected = last_depth(result, result.shown_point())
    assert np.nanmax(mesh.point_data["wear_depth (m)"]) == np.nanmax(expected)
