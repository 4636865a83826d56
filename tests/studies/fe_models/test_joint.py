"""Surfaces, pairing, cut faces: each against closed forms, and what is said of wrong ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from studies.finite_element import surfaces
from studies.finite_element.cut_faces import CyclicAxis, find_cut_faces, match_cut_faces
from studies.finite_element.elements import ELEMENT_KINDS
from studies.finite_element.pairing import ContactSurfaces, build_contact_pairs
from studies.finite_element.solid_mesh import rigid_motions
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import BLOCKS, prepared_deck
from tests.studies.fe_models.sectors import N_SECTORS, Sector, Z, cubes_on_each_other, faces_where, surface_where
from tests.studies.fe_models.solid_meshes import block, joined

NONE = np.empty(0, dtype=np.int64)


def tube(points):
    """A quarter of a tube of radii 1 and 2, 0.5 long."""
    radius, angle = 1.0 + points[:, 0], 0.5 * np.pi * points[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.5 * points[:, 2]], axis=1)


@pytest.mark.parametrize("kind", ELEMENT_KINDS)
def test_forces_of_a_pressure(kind):
    """5 Pa on a face of 2 by 3 m: its resultant and moments, of quadratic faces the second moment as well."""
    mesh, _ = block(kind, (2, 2, 2), lambda points: points * [2.0, 3.0, 1.0])
    faces = faces_where(mesh, np.abs(mesh.coordinates[:, 2] - 1.0) < 1e-9)
    areas, vectors = surfaces.integrate_shapes(mesh.coordinates, surfaces.faces_of_elements(mesh, "TOP", *faces))
    forces = -5.0 * vectors
    np.testing.assert_allclose(areas, vectors[:, 2], atol=1e-12)
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, -30.0], atol=1e-12)
    np.testing.assert_allclose(np.cross(mesh.coordinates, forces).sum(axis=0), [-45.0, 30.0, 0.0], atol=1e-12)
    if ELEMENT_KINDS[kind].reference.edges:
        assert forces[:, 2] @ mesh.coordinates[:, 0] ** 2 == pytest.approx(-40.0, rel=1e-12)


@pytest.mark.parametrize("kind", ELEMENT_KINDS)
def test_areas_and_normals_of_a_cylinder(kind):
    mesh, reference = block(kind, (1, 12, 2), tube)
    surface = surface_where(mesh, "INSIDE", reference[:, 0] == 0.0)
    area, normal = surface.areas_and_normals(mesh.coordinates)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(0.25 * np.pi, rel=2e-3)
    inwards = -mesh.coordinates[surface.nodes] * [1.0, 1.0, 0.0]
    # but for the ends, where a node has the facets of one side only; unsymmetric triangles tilt it a little
    inner = (reference[surface.nodes, 1] > 0.0) & (reference[surface.nodes, 1] < 1.0)
    assert np.abs(normal - inwards)[inner].max() < (0.03 if kind in ("C3D4", "C3D10", "C3D10M") else 4e-3)
    assert np.abs(normal - inwards).max() < 0.08
    nodes = np.flatnonzero(reference[:, 0] == 0.0)
    again = surfaces.surface_of_nodes(mesh, "INSIDE", nodes)
    assert np.array_equal(again.nodes, nodes)
    assert np.allclose(again.areas_and_normals(mesh.coordinates)[0], area, rtol=1e-12)


@pytest.mark.parametrize("kind", ["C3D4", "C3D8", "C3D10", "C3D20R"])
def test_closest_points_against_a_search(kind):
    mesh, reference = block(kind, (1, 3, 2), tube)
    surface = surface_where(mesh, "OUTSIDE", reference[:, 0] == 1.0)
    rng = np.random.default_rng(1)
    points = tube(np.column_stack([1.1 + 0.0 * rng.random(12), rng.uniform(-0.1, 1.1, 12), rng.uniform(-0.1, 1.1, 12)]))
    weights, distances = surfaces.closest_points(points, surface, mesh.coordinates)

    def on_quad(place, corners):
        (a, b, c, d), (x, y) = corners, place
        return (1 - x) * (1 - y) * a + x * (1 - y) * b + x * y * c + (1 - x) * y * d

    for point, distance in zip(points, distances, strict=True):
        best = np.inf
        for facet in surface.facets:
            corners = mesh.coordinates[facet]

            def away(place, corners=corners, point=point):
                return ((on_quad(place, corners) - point) ** 2).sum()

            best = min(best, minimize(away, [0.4, 0.4], bounds=[(0, 1)] * 2, tol=1e-14).fun)
        assert distance == pytest.approx(np.sqrt(best), abs=1e-6)
    assert np.allclose(weights.sum(axis=1), 1.0)
    # the point on the curved face is the foot of the perpendicular where that is inside
    assert (np.linalg.norm(weights @ mesh.coordinates - points, axis=1) < distances + 0.08).all()


@pytest.mark.parametrize(("lower", "upper"), [("C3D8", "C3D10"), ("C3D20R", "C3D15"), ("C3D10", "C3D4")])
def test_pairs_interpolate_what_a_face_can_hold(lower, upper):
    mesh, low, up = cubes_on_each_other(lower, upper, (2, 3, 1), (7, 7, 1), lift=0.01)
    pairs = build_contact_pairs(mesh, [ContactSurfaces(low, up, 0.02, with_gaps=True)], Z)
    assert pairs.moving_name == ("UP",)
    assert np.array_equal(pairs.moving, up.nodes)
    assert pairs.area.sum() == pytest.approx(1.0, rel=1e-12)
    assert np.allclose(pairs.frames[:, 0], -Z)
    assert np.allclose(pairs.distance, 0.01)
    assert np.array_equal(pairs.gap, pairs.distance)
    x, y, _ = mesh.coordinates.T
    field = 1.0 + 2.0 * x - 3.0 * y + (x * y if lower == "C3D8" else x * x - 0.7 * x * y + 0.4 * y * y)
    assert np.allclose(pairs.opposite @ field, field[pairs.moving], rtol=0.0, atol=1e-10)
    # across the gap all moves as one body
    motions = rigid_motions(mesh.coordinates)
    carried = pairs.carried(mesh.coordinates, None) @ motions.reshape(-1, 6)
    np.testing.assert_allclose(carried, motions[pairs.moving].reshape(-1, 6), atol=1e-13)


def test_a_coarse_surface_inside_a_finer_one_moves():
    first, a = block("C3D8", (8, 8, 1))
    second, b = block("C3D8", (2, 2, 1), lambda points: 0.5 * points + [0.3, 0.2, 1.0])
    mesh = joined(first, second)
    low = surfaces.surface_of_nodes(mesh, "LOW", np.flatnonzero(a[:, 2] == 1.0))
    up = surfaces.surface_of_nodes(mesh, "UP", first.n_nodes + np.flatnonzero(b[:, 2] == 0.0))
    pairs = build_contact_pairs(mesh, [ContactSurfaces(low, up)], Z)
    assert pairs.moving_name == ("UP",)
    assert pairs.area.sum() == pytest.approx(0.25)


@pytest.mark.parametrize(("layers", "tolerance"), [(1, None), (1, 0.5), (4, 0.5), (4, None)])
def test_no_pair_goes_through_a_body(layers, tolerance):
    """Both faces of one plate, which is thin beside its facets, so that they are within the usual tolerance."""
    mesh, reference = block("C3D8", (2, 2, layers), lambda points: points * [1.0, 1.0, 0.02])
    top, bottom = (surface_where(mesh, name, reference[:, 2] == z) for name, z in (("A", 1.0), ("B", 0.0)))
    with pytest.raises(SceneError, match=r"A and B .* 9 of 9 nodes .* 0\.02 m"):
        build_contact_pairs(mesh, [ContactSurfaces(top, bottom, tolerance)], Z)


def test_wrong_surfaces_are_named():
    mesh, low, up = cubes_on_each_other("C3D8", "C3D8", (2, 2, 1), (3, 3, 1), lift=0.02)
    with pytest.raises(SceneError, match=r"16 of 16 nodes of UP .* 0\.01 m from LOW"):
        build_contact_pairs(mesh, [ContactSurfaces(low, up, tolerance=0.01)], Z)
    with pytest.raises(SceneError, match="LOW and LOW share 9 nodes"):
        build_contact_pairs(mesh, [ContactSurfaces(low, low)], Z)
    with pytest.raises(SceneError, match=r"face S5 of element 1 \(C3D4\)"):
        surfaces.surface_of_faces(block("C3D4", (1, 1, 1))[0], "S", np.array([1]), np.array([5]))
    with pytest.raises(SceneError, match="names element 99"):
        surfaces.surface_of_faces(mesh, "S", np.array([99]), np.array([1]))
    with pytest.raises(SceneError, match="2 of 10 nodes of S "):
        surfaces.surface_of_nodes(mesh, "S", np.append(up.nodes[: 10 - 1], mesh.n_nodes - 1))


def test_cut_faces_are_matched_and_found():
    sector = Sector("C3D10", "C3D8")
    mesh = sector.mesh
    axis = CyclicAxis(N_SECTORS, np.zeros(3), Z)
    shuffled = np.random.default_rng(0).permutation(sector.left)
    cut = match_cut_faces(mesh, axis, sector.right, shuffled)
    turned = mesh.coordinates[cut.left] @ cut.axis.pitch().T
    assert np.allclose(turned, mesh.coordinates[cut.right], atol=1e-10)
    assert np.array_equal(np.sort(cut.left), sector.left)
    found = find_cut_faces(mesh, axis, NONE)
    assert dict(zip(found.left, found.right, strict=True)) == dict(zip(cut.left, cut.right, strict=True))
    # about another axis through another point
    frame = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    frame *= np.linalg.det(frame)
    moved = mesh.coordinates @ frame.T + [1.0, 2.0, 3.0]
    tilted = CyclicAxis(N_SECTORS, np.array([1.0, 2.0, 3.0]), frame @ Z)
    again = match_cut_faces(replace(mesh, coordinates=moved), tilted, sector.left, sector.right)
    assert np.array_equal(again.left[np.argsort(again.left)], np.sort(cut.left))
    assert np.allclose(again.axis.pitch() @ frame, frame @ cut.axis.pitch(), atol=1e-12)


def test_wrong_cut_faces_are_named():
    sector = Sector("C3D8", "C3D8")
    mesh = sector.mesh
    with pytest.raises(SceneError, match=r" 7\.66 degrees"):
        find_cut_faces(mesh, CyclicAxis(47, np.zeros(3), Z), NONE)
    axis = CyclicAxis(N_SECTORS, np.zeros(3), Z)
    coordinates = mesh.coordinates.copy()
    coordinates[sector.left[2]] += [1e-3, 0.0, 0.0]
    with pytest.raises(SceneError, match=f"1 nodes .*: {mesh.numbers[sector.left[2]]}"):
        match_cut_faces(replace(mesh, coordinates=coordinates), axis, sector.left, sector.right)


# --- free structures, and elements that are read as others ---

FREE = BLOCKS.partition("*BOUNDARY")[0]


def glued(folder, text, n=9, **given):
    return prepared_deck(folder, text, **given)[0].frequencies(0, n)


def test_a_free_structure_hangs_on_soft_springs(tmp_path):
    """Six rigid motions at the frequency of the suspension; the squares of all others rise by its square."""
    soft, stiff = (glued(tmp_path, FREE, suspension=each) for each in (2.0, 2000.0))
    assert soft[:6] == pytest.approx(np.full(6, 2.0), rel=1e-4)
    assert stiff[:6] == pytest.approx(np.full(6, 2000.0), rel=1e-6)
    assert soft[6] > 1e3
    assert stiff[6:] ** 2 - soft[6:] ** 2 == pytest.approx(np.full(3, 2000.0**2 - 2.0**2), rel=1e-3)
    with pytest.raises(SceneError, match="a `suspension`"):
        glued(tmp_path, FREE)


def test_elements_are_read_as_others_with_as_many_nodes(tmp_path):
    asked = FREE.replace("TYPE=C3D8,", "TYPE=C3D8R,")
    with pytest.raises(SceneError, match=r'C3D8R, whose matrices depend on the program.*read_as = \{C3D8R = "C3D8I"\}'):
        glued(tmp_path, asked, suspension=2.0)
    found = glued(tmp_path, asked, suspension=2.0, read_as={"C3D8R": "C3D8I"})
    expected = glued(tmp_path, FREE.replace("TYPE=C3D8,", "TYPE=C3D8I,"), suspension=2.0)
    assert found == pytest.approx(expected, rel=1e-12)
    for given, words in (({"C3D8R": "C3D4"}, "same 8 nodes"), ({"C3D20": "C3D20R"}, "has no element C3D20")):
        with pytest.raises(SceneError, match=words):
            glued(tmp_path, asked, suspension=2.0, read_as=given)
