"""The root in three dimensions: faces in contact, the worn shape, figures, and VTU files with the same numbers."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.collections import PolyCollection

from studyrunner.report import root
from studyrunner.report.cli import BAD_INPUT, main
from studyrunner.report.root import face_normals, read_root
from tests.studyrunner.report.cases import dovetail, dovetail_file, draw_figure
from tests.studyrunner.results import as_result, build_file


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return as_result(dovetail_file(), tmp_path_factory.mktemp("root") / "dovetail.nc")


@pytest.fixture(scope="module")
def surface(result):
    found = read_root(result)
    assert found is not None
    return found


def volume(nodes, quads):
    """Volume inside closed faces, m3, by the divergence theorem: a sixth of the sum of triple products of triangles.

    Quadrilaterals are the mean of their two splits, which is exact to second order in what bends them.
    """
    total = 0.0
    for corners in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)):
        a, b, c = (nodes[quads[:, corner]] for corner in corners)
        total += float(np.einsum("ij,ij->", a, np.cross(b, c))) / 12.0
    return total


def test_the_flanks_of_both_bodies_are_found_with_area_and_normals_of_the_pairs(surface):
    pairs, _ = dovetail()
    assert surface.bodies == ("disk", "blade")
    assert surface.flanks == ("intrados", "extrados")
    areas = np.linalg.norm(face_normals(surface.nodes[surface.faces]), axis=1)
    half = len(pairs.area) // 2
    for body, outwards in ((0, -1.0), (1, 1.0)):
        for flank, own in ((0, slice(None, half)), (1, slice(half, None))):
            chosen = (surface.body == body) & (surface.flank == flank)
            assert areas[chosen].sum() == pytest.approx(pairs.area[own].sum(), rel=1e-9)
            at = np.isin(surface.contact_nodes, surface.faces[chosen])
            found = surface.pairs[at]
            assert sorted(found) == list(range(len(pairs.area)))[own]
            places = surface.nodes[surface.contact_nodes[at]]
            np.testing.assert_allclose(places, pairs.position[found], atol=1e-12)
            # normals of pairs point out of the moving body, the blade
            normals = outwards * surface.normals[at]
            np.testing.assert_allclose(normals, pairs.frames[found, 0], atol=1e-9)


@pytest.mark.parametrize("body", [0, 1])
def test_the_worn_shape_loses_the_worn_volume(surface, body):
    """To first order a depth h of the pairs takes sum(h alpha) off a body: alpha is the integral of shape functions."""
    area = dovetail()[0].area
    depth = np.random.default_rng(3).uniform(0.5, 1.0, len(area)) * 1e-9
    own = surface.faces[surface.body == body]
    before = volume(surface.nodes, own)
    assert before > 0.0
    lost = (before - volume(surface.worn(depth, 50.0), own)) / 50.0
    # neighbours of the flanks are not perpendicular to them everywhere: second order
    assert lost == pytest.approx(float(depth @ area), rel=1e-4)


@pytest.mark.parametrize(
    "change",
    [
        lambda dataset: dataset.drop_vars("mesh_quad"),
        lambda dataset: dataset.isel(mesh_quad_index=slice(0, 0)),
        lambda dataset: dataset.assign(mesh_x=dataset["mesh_x"] + 1.0),
    ],
    ids=["no mesh", "no faces", "elsewhere"],
)
def test_without_a_mesh_at_the_pairs_there_is_no_root(tmp_path, change):
    assert read_root(as_result(change(dovetail_file()), tmp_path / "file.nc")) is None


@pytest.mark.slow
def test_the_faces_near_the_contact_are_kept(tmp_path):
    surface = read_root(as_result(dovetail_file(density=4), tmp_path / "fine.nc"))
    fewer = surface.near_contact(1000)
    assert len(fewer.faces) == 1000
    assert (fewer.flank >= 0).sum() == (surface.flank >= 0).sum()
    np.testing.assert_array_equal(fewer.nodes[fewer.contact_nodes], surface.nodes[surface.contact_nodes])
    assert surface.near_contact(len(surface.faces)) is surface


def test_the_figures_of_the_dovetail(result, surface):
    worn, numbers = draw_figure(result, "worn_root"), draw_figure(result, "pair_numbers")
    depth = result.at("wear_depth", result.shown, -1).values
    assert f"at pair {int(np.argmax(depth))}." in worn.caption
    assert f"{surface.exaggeration(float(depth.max())):g} times" in worn.caption.replace("\u00a0", "")
    # the deepest pair has nearly the colour of the end of the colour bar
    painted = np.concatenate([each.get_facecolors() for each in worn.figure.findobj(PolyCollection)])
    assert np.abs(painted - colormaps["cividis"](1.0)).max(axis=1).min() < 0.1
    written = [text.get_text() for panel in numbers.figure.axes for text in panel.texts]
    assert sorted(map(int, written)) == list(range(16))


# --- for ParaView ---


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("vtu")
    (folder / "vtu").mkdir()
    (folder / "vtu" / "root_9999.vtu").touch()  # of an older, longer series
    assert root.find_writer(result)(folder) == 5
    return folder


def test_the_series_names_a_file_for_each_cycle_count(folder, result):
    sets = ElementTree.parse(folder / "root.pvd").findall("Collection/DataSet")
    assert [float(each.attrib["timestep"]) for each in sets] == result.cycles.tolist()
    named = [each.attrib["file"] for each in sets]
    assert sorted(named) == sorted(f"vtu/{path.name}" for path in (folder / "vtu").iterdir())


@pytest.mark.parametrize("cycle", [0, 4])
def test_the_files_hold_the_numbers_of_the_pairs(folder, result, cycle):
    dataset, (pairs, surface_mesh) = result.dataset, dovetail()
    mesh = meshio.read(folder / "vtu" / f"root_{cycle:04d}.vtu")
    np.testing.assert_array_equal(mesh.points, surface_mesh.nodes)
    np.testing.assert_array_equal(mesh.cells_dict["quad"], surface_mesh.quads)
    there = np.isfinite(mesh.point_data["wear_depth (m)"])
    assert there.sum() == 2 * len(pairs.area)
    way = np.linalg.norm(mesh.points[there][:, None] - pairs.position, axis=2)
    assert way.min(axis=1).max() < 1e-12
    pair = way.argmin(axis=1)
    for name in filter(result.has, root.FIELDS):
        units = dataset[name].attrs["units"]
        field = mesh.point_data[name if units == "1" else f"{name} ({units})"]
        np.testing.assert_array_equal(field[there], result.at(name, result.shown, cycle).values[pair])
    depth, moved = mesh.point_data["wear_depth (m)"][there], mesh.point_data["worn_displacement (m)"]
    # into the blade on one side of the joint, into the disk on the other
    along = np.einsum("ij,ij->i", moved[there], pairs.frames[pair, 0])
    np.testing.assert_allclose(np.sort(along), np.sort(np.where(along > 0.0, depth, -depth)), rtol=1e-9)
    assert (along > 0.0).sum() == len(pairs.area)
    assert (moved[~there] == 0.0).all()
    body, surface = (np.concatenate(mesh.cell_data[name]) for name in ("body", "contact_surface"))
    assert set(body) == {0, 1}
    assert (np.bincount(surface + 1)[1:] == 2 * 3).all()


@pytest.mark.parametrize(("library", "said"), [(False, "pip install meshio"), (True, "no positions")])
def test_what_stands_in_the_way_is_said_before_anything_is_written(tmp_path, monkeypatch, capsys, library, said):
    monkeypatch.chdir(tmp_path)
    build_file(positions=np.full((2, 3), np.nan)).to_netcdf("some.nc")
    if not library:
        monkeypatch.setattr(root, "find_spec", lambda _: None)
    assert main(["some.nc", "--vtu"]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert "--vtu" in line
    assert said in line
    assert [path.name for path in tmp_path.iterdir()] == ["some.nc"]
