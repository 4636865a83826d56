"""The root as VTU files: read again they hold the numbers of the result, at the cycle counts of the PVD file."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from studyrunner.report import vtu
from studyrunner.report.cli import BAD_INPUT, main
from tests.studyrunner.report.root_cases import dovetail_file, dovetail_pairs
from tests.studyrunner.results import as_result, build_file

TITLE = "wear --> after -- a title"


@pytest.fixture(scope="module")
def dataset():
    dataset = dovetail_file()
    dataset.attrs["title"] = TITLE
    return dataset


@pytest.fixture(scope="module")
def folder(dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("vtu")
    (folder / "vtu").mkdir()
    (folder / "vtu" / "root_9999.vtu").touch()  # of an older, longer series
    assert vtu.find_writer(as_result(dataset, folder / "some.nc"))(folder) == 5
    return folder


def test_the_series_names_a_file_for_each_cycle_count(folder, dataset):
    sets = ElementTree.parse(folder / "root.pvd").findall("Collection/DataSet")
    assert [float(each.attrib["timestep"]) for each in sets] == dataset["cycle"].values.tolist()
    named = [each.attrib["file"] for each in sets]
    assert sorted(named) == sorted(f"vtu/{path.name}" for path in (folder / "vtu").iterdir())


def test_the_files_hold_the_numbers_of_the_pairs(folder, dataset):
    shown = as_result(dataset, folder / "some.nc").shown_point()
    point = int(np.ravel_multi_index(tuple(shown.values()), dataset["outcome"].shape))
    pairs = dovetail_pairs()
    for cycle in (0, 4):
        mesh = meshio.read(folder / "vtu" / f"root_{cycle:04d}.vtu")
        np.testing.assert_array_equal(mesh.points, np.stack([dataset[f"mesh_{axis}"] for axis in "xyz"], axis=1))
        np.testing.assert_array_equal(mesh.cells_dict["quad"], dataset["mesh_quad"])
        held = np.isfinite(mesh.point_data["wear_depth (m)"])
        assert held.sum() == 2 * len(pairs.area)
        way = np.linalg.norm(mesh.points[held][:, None] - pairs.position, axis=2)
        assert way.min(axis=1).max() < 1e-12
        for name in vtu.FIELDS:
            values = dataset[name].values.reshape(16, 5, -1)[point, cycle]
            units = dataset[name].attrs["units"]
            field = name if units == "1" else f"{name} ({units})"
            np.testing.assert_array_equal(mesh.point_data[field][held], values[way.argmin(axis=1)])
        depth = mesh.point_data["wear_depth (m)"][held]
        # into the blade on one side of the joint, into the disk on the other
        moved = np.einsum(
            "ij,ij->i", mesh.point_data["worn_displacement (m)"][held], pairs.frames[way.argmin(axis=1), 0]
        )
        np.testing.assert_allclose(np.sort(moved), np.sort(np.where(moved > 0.0, depth, -depth)), rtol=1e-9)
        assert (moved > 0.0).sum() == len(pairs.area)
        assert (mesh.point_data["worn_displacement (m)"][~held] == 0.0).all()
        body, surface = (np.concatenate(mesh.cell_data[name]) for name in ("body", "contact_surface"))
        assert set(body) == {0, 1}
        assert (np.bincount(surface + 1)[1:] == 2 * 3).all()


@pytest.mark.parametrize("wrong", ["no library", "no positions"])
def test_what_stands_in_the_way_is_said_before_anything_is_written(tmp_path, monkeypatch, capsys, wrong):
    monkeypatch.chdir(tmp_path)
    build_file(positions=np.full((2, 3), np.nan)).to_netcdf("some.nc")
    if wrong == "no library":
        monkeypatch.setattr(vtu, "find_spec", lambda _: None)
    assert main(["some.nc", "--vtu"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--vtu" in said
    assert ("pip install meshio" if wrong == "no library" else "no positions") in said
    assert [path.name for path in tmp_path.iterdir()] == ["some.nc"]
