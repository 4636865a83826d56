"""Element matrices against CalculiX and closed forms."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from studies.fe_models.matrices.read import read_matrices
from studies.finite_element import solid_mesh
from studies.finite_element.elements import ASSEMBLED_KINDS as KINDS
from studies.finite_element.solid_mesh import ElementGroup, Material, Rotation, SolidMesh
from studies.scene_error import SceneError
from tests.studies.fe_models.solid_meshes import (
    EXPORT,
    STEEL,
    block,
    centrifugal,
    deck_lines,
    needs_ccx,
    node_set,
    run_ccx,
)


def skewed(points):
    """A block whose elements are parallelepipeds of several sizes."""
    return points @ np.array([[0.10, 0.01, 0.0], [0.02, 0.07, 0.0], [0.0, 0.01, 0.05]])


def distorted(points):
    """A block with curved faces."""
    x, y, z = skewed(points).T
    return np.stack([x + 2.0 * y * z, y + 0.5 * x * x - z * x, z + 0.8 * x * y], axis=1)


def warped(seed):
    """A skewed block whose inner nodes are moved off their places, by a tenth of an element of a 2 x 2 x 2 grid."""

    def shape(points):
        moved = 0.03 * np.random.default_rng(seed).uniform(-1.0, 1.0, points.shape)
        moved[((points == 0.0) | (points == 1.0)).any(axis=1)] = 0.0
        return skewed(points + moved)

    return shape


@needs_ccx
@pytest.mark.parametrize("kind", KINDS)
def test_agrees_with_calculix(kind, tmp_path):
    mesh, _ = block(kind, (2, 2, 1), distorted)
    run_ccx(tmp_path, [*deck_lines(mesh), "*STEP", *EXPORT[1:]])
    exported = read_matrices(tmp_path / "job")
    stiffness, mass = exported.stiffness, exported.mass
    n = 3 * mesh.n_nodes
    own = solid_mesh.assemble_mass(mesh)
    assert np.abs(own - mass[:n, :n]).max() < 1e-12 * np.abs(own).max()
    own = solid_mesh.assemble_stiffness(mesh)
    if kind == "C3D8I":
        # CalculiX keeps the incompatible modes as nodes of their own, and has another variant of them
        inner = stiffness[n:, n:].toarray()
        condensed = stiffness[:n, :n] - stiffness[:n, n:] @ np.linalg.solve(inner, stiffness[n:, :n].toarray())
        assert 1e-6 < np.abs(own - condensed).max() / np.abs(own).max() < 2e-2
    else:
        assert np.abs(own - stiffness[:n, :n]).max() < 1e-12 * np.abs(own).max()


@pytest.mark.parametrize("kind", KINDS)
def test_patch_test(kind):
    mesh, reference = block(kind, (2, 2, 2), warped(3), straight=True)
    stiffness = solid_mesh.assemble_stiffness(mesh)
    gradient = 1e-3 * np.array([[1.0, 0.3, -0.2], [0.5, -0.7, 0.4], [0.1, -0.6, 0.9]])
    exact = (mesh.coordinates @ gradient.T).ravel()
    inner = np.repeat(((reference > 0.0) & (reference < 1.0)).all(axis=1), 3)
    solved = spsolve(stiffness[inner][:, inner].tocsc(), -stiffness[inner][:, ~inner] @ exact[~inner])
    assert np.abs(solved - exact[inner]).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.parametrize("kind", KINDS)
def test_stress_stiffening_of_a_stretched_bar(kind):
    size, strain = np.array([0.8, 0.03, 0.05]), 1e-3
    mesh, _ = block(kind, (2, 1, 1), lambda points: points * size)
    x, y, z = mesh.coordinates.T
    stretched = strain * np.stack([x, -STEEL.poisson_ratio * y, -STEEL.poisson_ratio * z], axis=1)
    tangent = solid_mesh.assemble_tangent_stiffness(mesh, stretched.ravel())
    # A rotation of angle 1 stores force times length, a translation nothing.
    turn = np.stack([-y, x, 0.0 * x], axis=1).ravel()
    work = STEEL.young_modulus * strain * size.prod()
    tilt = turn @ tangent @ turn
    # in Green's strain the elastic stiffness turns with the bar, up to the square of the strain
    assert tilt == pytest.approx(work, rel=1e-10 if kind == "C3D8I" else 5.0 * strain)
    shift = np.tile([0.2, 1.0, -0.4], mesh.n_nodes)
    assert np.abs(tangent @ shift).max() < 1e-12 * abs(tangent).max()


@needs_ccx
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "C3D8I"])
def test_prestress_agrees_with_calculix(kind, tmp_path):
    """Stress stiffening, large-displacement terms and spin softening that PERTURBATION puts into the stiffness."""
    mesh, reference = block(kind, (2, 2, 1), lambda points: distorted(points) + [0.2, 0.0, 0.0], straight=True)
    held = np.flatnonzero(reference[:, 0] == 0.0)
    static = ["*BOUNDARY", "F, 1, 3", "*STEP", "*STATIC", *centrifugal(mesh, 5e5), "*END STEP"]
    export = ["*STEP, PERTURBATION", "*BOUNDARY, OP=NEW", *EXPORT]
    run_ccx(tmp_path, [*deck_lines(mesh), *node_set("F", mesh.numbers[held]), *static, *export])
    expected = read_matrices(tmp_path / "job").stiffness

    stiffness, mass = solid_mesh.assemble_stiffness(mesh), solid_mesh.assemble_mass(mesh)
    rotation = Rotation(5e5, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    load = solid_mesh.centrifugal_load(mass, mesh.coordinates, rotation)
    free = np.repeat(reference[:, 0] > 0.0, 3)
    displacements = np.zeros_like(load)
    displacements[free] = spsolve(stiffness[free][:, free].tocsc(), load[free])
    own = solid_mesh.assemble_tangent_stiffness(mesh, displacements) + solid_mesh.spin_softening(mass, rotation)
    assert np.abs(own - expected).max() < 1e-12 * np.abs(own).max()
    assert np.abs(stiffness - expected).max() > 1e-5 * np.abs(own).max()


def test_bending_does_not_lock():
    length, height, width = 1.0, 0.05, 0.04
    # No lateral contraction: the beam formula does not know that the clamped end hinders it.
    material = Material(114e9, 0.0, 4430.0)
    beam = length**3 / (3.0 * material.young_modulus * width * height**3 / 12.0)
    deflections = []
    for kind in ("C3D8I", "C3D8"):
        mesh, reference = block(kind, (10, 1, 1), lambda points: points * [length, height, width], material)
        free = np.repeat(reference[:, 0] > 0.0, 3)
        load = np.zeros((mesh.n_nodes, 3))
        load[reference[:, 0] == 1.0, 1] = 0.25
        solved = spsolve(solid_mesh.assemble_stiffness(mesh)[free][:, free].tocsc(), load.ravel()[free])
        deflections.append(solved @ load.ravel()[free])
    assert deflections[0] == pytest.approx(beam, rel=0.005)
    assert deflections[1] < 0.6 * beam


def test_inverted_element_is_named():
    mesh, _ = block("C3D10", (1, 1, 1))
    group = mesh.groups[0]
    nodes = group.nodes.copy()
    nodes[3] = nodes[3, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    wrong = SolidMesh(mesh.coordinates, mesh.numbers, (ElementGroup("C3D10", nodes, group.numbers, STEEL),))
    solid_mesh.check_elements(mesh)
    with pytest.raises(SceneError, match=r"element 4 is turned inside out"):
        solid_mesh.check_elements(wrong)
