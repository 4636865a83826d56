"""The root in three dimensions: which faces are in contact, the worn shape, views, patches, figures."""

import math

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from studyrunner.report.root import face_normals, find_views, read_root
from tests.studyrunner.report.figure_numbers import draw_figure
from tests.studyrunner.report.root_cases import dovetail_file, dovetail_pairs, volume
from tests.studyrunner.results import as_result


@pytest.fixture(scope="module")
def dovetail(tmp_path_factory):
    return as_result(dovetail_file(), tmp_path_factory.mktemp("root") / "dovetail.nc")


@pytest.fixture(scope="module")
def surface(dovetail):
    found = read_root(dovetail)
    assert found is not None
    return found


def test_the_flanks_of_both_bodies_are_found_with_area_and_normals_of_the_pairs(surface):
    pairs = dovetail_pairs()
    assert surface.bodies == ("disk", "blade")
    assert surface.flanks == ("intrados", "extrados")
    areas = np.linalg.norm(face_normals(surface.nodes, surface.faces), axis=1)
    half = len(pairs.area) // 2
    for body, outwards in ((0, -1.0), (1, 1.0)):
        for flank, own in ((0, slice(None, half)), (1, slice(half, None))):
            chosen = (surface.body == body) & (surface.contact.flank == flank)
            assert areas[chosen].sum() == pytest.approx(pairs.area[own].sum(), rel=1e-9)
            at = np.isin(surface.contact.nodes, surface.faces[chosen])
            found = surface.contact.pairs[at]
            assert sorted(found) == list(range(len(pairs.area)))[own]
            places = surface.nodes[surface.contact.nodes[at]]
            np.testing.assert_allclose(places, pairs.position[found], atol=1e-12)
            # normals of pairs point out of the moving body, the blade
            normals = outwards * surface.contact.normals[at]
            np.testing.assert_allclose(normals, pairs.frames[found, 0], atol=1e-9)


@pytest.mark.parametrize("body", [0, 1])
def test_the_worn_shape_loses_the_worn_volume(surface, body):
    """To first order a depth h of the pairs takes sum(h alpha) off a body: alpha is the integral of shape functions."""
    pairs = dovetail_pairs()
    depth = np.random.default_rng(3).uniform(0.5, 1.0, len(pairs.area)) * 1e-9
    own = surface.faces[surface.body == body]
    before = volume(surface.nodes, own)
    assert before > 0.0
    lost = (before - volume(surface.worn(depth, 50.0), own)) / 50.0
    # neighbours of the flanks are not perpendicular to them everywhere: second order
    assert lost == pytest.approx(float(depth @ pairs.area), rel=1e-4)


@pytest.mark.parametrize("deepest", [1e-9, 3e-7, 1.07e-5, 2e-3, 0.2])
def test_the_exaggeration_is_a_round_number_that_shows_the_depth(surface, deepest):
    factor = surface.exaggeration(deepest)
    head = factor / 10.0 ** math.floor(math.log10(factor) + 1e-9)
    assert min(abs(head - each) for each in (1.0, 2.0, 5.0)) < 1e-9
    assert 0.4 * surface.well_seen <= factor * deepest <= surface.well_seen * (1.0 + 1e-9)


@pytest.mark.parametrize("wrong", ["no mesh", "no faces", "elsewhere"])
def test_without_a_mesh_at_the_pairs_there_is_no_root(tmp_path, wrong):
    dataset = dovetail_file()
    if wrong == "no faces":
        dataset = dataset.isel(mesh_quad_index=slice(0, 0))
    elif wrong == "no mesh":
        dataset = dataset.drop_vars("mesh_quad")
    else:
        dataset["mesh_x"] = dataset["mesh_x"] + 1.0
    assert read_root(as_result(dataset, tmp_path / "file.nc")) is None


@pytest.mark.slow
def test_the_faces_near_the_contact_are_kept(tmp_path):
    surface = read_root(as_result(dovetail_file(density=4), tmp_path / "fine.nc"))
    fewer = surface.near_contact(1000)
    assert len(fewer.faces) == 1000
    assert (fewer.contact.flank >= 0).sum() == (surface.contact.flank >= 0).sum()
    np.testing.assert_array_equal(fewer.nodes[fewer.contact.nodes], surface.nodes[surface.contact.nodes])
    assert surface.near_contact(len(surface.faces)) is surface


def test_the_figures_of_the_dovetail(dovetail):
    worn, numbers = draw_figure(dovetail, "worn_root"), draw_figure(dovetail, "pair_numbers")
    assert draw_figure(dovetail, "whole_disk").figure.axes
    depth = dovetail.at("wear_depth", dovetail.shown_point(), -1).values
    root = read_root(dovetail)
    assert f"at pair {int(np.argmax(depth))}." in worn.caption
    assert f"{root.exaggeration(float(depth.max())):g} times exaggerated" in worn.caption.replace("\u00a0", "")
    written = [text.get_text() for panel in numbers.figure.axes for text in panel.texts]
    assert sorted(map(int, written)) == list(range(16))


def test_the_root_is_coloured_by_the_wear_depth_of_its_pairs(dovetail):
    """Shares of red, green and blue: the light on a face, which differs, makes all of them larger or smaller."""

    def shares(colours):
        return np.asarray(colours[..., :3] / colours[..., :3].sum(axis=-1, keepdims=True))

    def of_faces(name, surface):
        """Of a variable of pairs: a face has four of them at its corners."""
        pairs = shown.fretwear.flank(name, surface).values
        return np.asarray(0.25 * (pairs[1:, 1:] + pairs[1:, :-1] + pairs[:-1, 1:] + pairs[:-1, :-1])).ravel()

    result, root = dovetail, read_root(dovetail)
    views = {view.title: view.frame for view in find_views(root)}
    shown = result.dataset.isel(result.shown_point()).isel(cycle=-1)
    panels = draw_figure(result, "worn_root").figure.axes[1:3]
    for panel, surface in zip(panels, shown.fretwear.surfaces, strict=True):
        assert surface in panel.get_title()
        faces = next(item for item in panel.collections if isinstance(item, PolyCollection))
        drawn = shares(np.asarray(faces.get_facecolors()))
        wanted = shares(mpl.colormaps["cividis"](of_faces("wear_depth", surface) / float(shown.wear_depth.max())))
        centres = np.stack([of_faces(f"contact_{axis}", surface) for axis in "xyz"], axis=1)
        right, up, _ = views[panel.get_title()]
        for colour, centre in zip(wanted, centres, strict=True):
            alike = np.flatnonzero(np.abs(drawn - colour).max(axis=1) < 1e-3)
            places = np.array([faces.get_paths()[each].vertices[:4].mean(axis=0) for each in alike])
            # in mm; the worn shape is moved by some of them, and faces are 13 mm long
            assert np.linalg.norm(places - 1e3 * np.array([centre @ right, centre @ up]), axis=1).min() < 5.0
