"""Elements, cyclic symmetry and reduction, each on the smallest mesh that shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem
from scipy import linalg, sparse
from scipy.sparse.linalg import spsolve
from skfem.models.elasticity import lame_parameters, linear_elasticity

from studies.scenes.finite_element.assembly import (
    HexMesh,
    assemble,
    assemble_geometric_stiffness,
    assemble_sector,
)
from studies.scenes.finite_element.contact_pairs import ContactPairs, build_contact_pairs
from studies.scenes.finite_element.cyclic import CyclicSector
from studies.scenes.finite_element.hex_element import CORNERS, HexElements, elasticity_matrix
from studies.scenes.finite_element.reduction import GluedSectorError, SectorReduction, order_sector
from studies.scenes.finite_element.structured import graded, join_blocks
from tests.studies.reduction_twin import build_coordinates

YOUNG, POISSON, DENSITY = 114e9, 0.32, 4430.0
ELASTICITY = elasticity_matrix(YOUNG, POISSON)


def reduced(nodes, matrices, pairs, sector, n_modes, nodal_diameter=0):
    """The reduced sector, and the nodal displacements (3 n_nodes, n) of its coordinates."""
    ordered = order_sector(sector, pairs, matrices.stiffness, nodes)
    reduction = SectorReduction(ordered, matrices.stiffness, matrices.mass)
    result = reduction.reduce(nodal_diameter, n_modes, None, np.eye(3 * len(nodes)))
    return result, result.vectors.conj().T


def box(divisions, size=(1.0, 1.0, 1.0), origin=(0.0, 0.0, 0.0)):
    """Grid of points of a box."""
    axes = [start + np.linspace(0.0, length, n + 1) for n, length, start in zip(divisions, size, origin, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def distorted_cube():
    """2 x 2 x 2 elements of a unit cube, the inner node and the nodes inside faces and edges moved off."""
    grid = box((2, 2, 2))
    moved = np.random.default_rng(1).uniform(-0.12, 0.12, grid.shape)
    # Nodes on a face stay on it.
    moved[(grid == 0.0) | (grid == 1.0)] = 0.0
    return join_blocks([grid + moved])[0]


def hexes_of(mesh, incompatible_modes=True):
    return HexElements(mesh.nodes[mesh.elements], ELASTICITY, DENSITY, incompatible_modes)


def test_plain_element_agrees_with_scikit_fem():
    mesh = distorted_cube()
    # scikit-fem numbers the corners of a hexahedron in its own order.
    order = [int(np.flatnonzero((corner == CORNERS).all(axis=1))[0]) for corner in 2.0 * skfem.refdom.RefHex.p.T - 1.0]
    theirs = skfem.MeshHex(mesh.nodes.T, np.ascontiguousarray(mesh.elements[:, order].T))
    basis = skfem.Basis(theirs, skfem.ElementVector(skfem.ElementHex1()), intorder=3)
    dof_order = basis.nodal_dofs.T.ravel()
    stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis).toarray()

    @skfem.BilinearForm
    def inertia(u, v, _):
        return DENSITY * skfem.helpers.dot(u, v)

    mass = inertia.assemble(basis).toarray()
    own = assemble_sector(mesh, hexes_of(mesh, incompatible_modes=False))
    for ours, reference in ((own.stiffness, stiffness), (own.mass, mass)):
        reference = reference[np.ix_(dof_order, dof_order)]
        assert np.abs(ours.toarray() - reference).max() < 1e-12 * np.abs(reference).max()


@pytest.mark.parametrize("incompatible_modes", [True, False])
def test_patch_test_on_distorted_elements(incompatible_modes):
    mesh = distorted_cube()
    hexes = hexes_of(mesh, incompatible_modes)
    stiffness = assemble(hexes.stiffness(), mesh.elements, len(mesh.nodes)).toarray()
    gradient = 1e-3 * np.array([[1.0, 0.3, -0.2], [0.5, -0.7, 0.4], [0.1, -0.6, 0.9]])
    exact = (mesh.nodes @ gradient.T).ravel()
    inner = np.repeat(((mesh.nodes > 0.0) & (mesh.nodes < 1.0)).all(axis=1), 3)
    solved = exact.copy()
    solved[inner] = np.linalg.solve(stiffness[np.ix_(inner, inner)], -stiffness[np.ix_(inner, ~inner)] @ exact[~inner])
    assert np.abs(solved - exact).max() < 1e-11 * np.abs(exact).max()

    strain = 0.5 * (gradient + gradient.T)
    stress = ELASTICITY @ np.array([*np.diag(strain), *(2.0 * strain[[0, 1, 0], [1, 2, 2]])])
    local = solved.reshape(-1, 3)[mesh.elements].reshape(-1, 24)
    assert np.allclose(hexes.stress(local), stress, rtol=0.0, atol=1e-10 * np.abs(stress).max())


def test_element_has_six_rigid_modes_and_no_other():
    mesh = distorted_cube()
    values = np.linalg.eigvalsh(hexes_of(mesh).stiffness()[0])
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-4 * values[-1]


def test_bending_does_not_lock():
    length, height, width = 1.0, 0.05, 0.04
    mesh, (grid,) = join_blocks([box((10, 1, 1), (length, height, width))])
    free = np.setdiff1d(np.arange(len(mesh.nodes)), grid[0])
    dofs = (3 * free[:, None] + np.arange(3)).ravel()
    load = np.zeros((len(mesh.nodes), 3))
    load[grid[-1], 1] = 0.25
    beam = length**3 / (3.0 * YOUNG * width * height**3 / 12.0)
    deflections = []
    for incompatible_modes in (True, False):
        # No lateral contraction: the beam formula does not know that the clamped end hinders it.
        hexes = HexElements(mesh.nodes[mesh.elements], elasticity_matrix(YOUNG, 0.0), DENSITY, incompatible_modes)
        stiffness = assemble(hexes.stiffness(), mesh.elements, len(mesh.nodes)).tocsr()
        solved = spsolve(stiffness[dofs][:, dofs].tocsc(), load.ravel()[dofs])
        deflections.append(solved @ load.ravel()[dofs])
    assert deflections[0] == pytest.approx(beam, rel=0.005)
    assert deflections[1] < 0.6 * beam


def test_mass_and_centrifugal_load_of_a_box():
    size, origin = np.array([0.3, 0.2, 0.1]), np.array([1.0, -0.4, 5.0])
    mesh = join_blocks([box((3, 2, 2), size, origin)])[0]
    matrices = assemble_sector(mesh, hexes_of(mesh))
    mass = DENSITY * size.prod()
    along = np.tile([1.0, 0.0, 0.0], len(mesh.nodes))
    assert along @ matrices.mass @ along == pytest.approx(mass, rel=1e-13)
    total = matrices.load.reshape(-1, 3).sum(axis=0)
    centre = origin + 0.5 * size
    assert np.allclose(total, mass * centre * [1.0, 1.0, 0.0], rtol=1e-12, atol=1e-9)


def test_geometric_stiffness_of_a_bar_in_tension():
    length, area, strain = 2.0, 0.03 * 0.05, 1e-3
    mesh = join_blocks([box((4, 1, 1), (length, 0.03, 0.05))])[0]
    x, y, z = mesh.nodes.T
    stretched = strain * np.stack([x, -POISSON * y, -POISSON * z], axis=1)
    geometric = assemble_geometric_stiffness(mesh, hexes_of(mesh), stretched.ravel())
    # Transverse motion of slope 1 stores force times length, a translation nothing.
    tilt = np.stack([0.0 * x, x, 0.0 * x], axis=1).ravel()
    assert tilt @ geometric @ tilt == pytest.approx(YOUNG * strain * area * length, rel=1e-12)
    shift = np.tile([0.2, 1.0, -0.4], len(mesh.nodes))
    assert np.abs(geometric @ shift).max() < 1e-9 * YOUNG * strain


def test_inverted_element_is_refused():
    mesh = distorted_cube()
    turned = mesh.nodes[mesh.elements][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(ValueError, match="turned inside out"):
        HexElements(turned, ELASTICITY, DENSITY)


def test_graded_stations():
    assert np.allclose(graded([0.0, 1.0, 4.0], [2, 3]), [0.0, 0.5, 1.0, 2.0, 3.0, 4.0])


def ring_sector(n_sectors):
    """Twisted block in one sector of a ring: mesh and the node grid (radial, tangential, axial)."""
    half = np.pi / n_sectors
    reference = box((2, 2, 2), (1.0, 2.0 * half, 0.5), (1.0, -half, 0.0))
    radius, angle, z = np.moveaxis(reference, -1, 0)
    # Skewed along z, so that waves of positive and negative direction differ.
    angle = angle + 0.3 * z * radius
    return join_blocks([np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)])


def no_pairs():
    none = np.zeros(0, dtype=np.int64)
    return ContactPairs(none, none, frames=np.zeros((0, 3, 3)), area=np.zeros(0), position=np.zeros((0, 3)))


@pytest.mark.parametrize("n_sectors", [5, 6])
def test_cyclic_sector_agrees_with_the_full_ring(n_sectors):
    mesh, (grid,) = ring_sector(n_sectors)
    turns = [
        np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        for a in 2.0 * np.pi * np.arange(n_sectors) / n_sectors
    ]
    ring, grids = join_blocks([mesh.nodes[grid] @ turn.T for turn in turns])
    full = assemble_sector(ring, hexes_of(ring))
    free = np.setdiff1d(np.arange(len(ring.nodes)), np.concatenate([grid_[0].ravel() for grid_ in grids]))
    dofs = (3 * free[:, None] + np.arange(3)).ravel()
    stiffness, mass = (m.toarray()[np.ix_(dofs, dofs)] for m in (full.stiffness, full.mass))
    expected = np.sqrt(linalg.eigh(stiffness, mass, eigvals_only=True))

    matrices = assemble_sector(mesh, hexes_of(mesh))
    sector = CyclicSector(
        n_nodes=len(mesh.nodes),
        n_sectors=n_sectors,
        clamped=grid[0].ravel(),
        left=grid[:, 0].ravel(),
        right=grid[:, -1].ravel(),
    )
    found = []
    for k in range(n_sectors // 2 + 1):
        basis, nodal = reduced(mesh.nodes, matrices, no_pairs(), sector, 6, k)
        real = k == 0 or 2 * k == n_sectors
        assert np.isrealobj(nodal) == real
        found += [*basis.frequencies] * (1 if real else 2)

        # Sector j moves with exp(+i j phi): the mode laid around the ring is a mode of the ring.
        around = np.zeros((len(ring.nodes), 3), dtype=complex)
        for j, (grid_, turn) in enumerate(zip(grids, turns, strict=True)):
            shape = nodal[:, 0].reshape(-1, 3)[grid] @ turn.T
            around[grid_] = np.exp(2j * np.pi * k * j / n_sectors) * shape
        mode = around.ravel()[dofs]
        residual = stiffness @ mode - basis.frequencies[0] ** 2 * (mass @ mode)
        assert np.abs(residual).max() < 1e-8 * np.abs(stiffness @ mode).max()
    n_common = 8
    assert np.allclose(np.sort(found)[:n_common], expected[:n_common], rtol=1e-9)


def two_bricks():
    """Two bricks, one on the other, with coincident nodes: nodes, matrices, pairs, the sector that clamps the lower."""
    lower, (lower_grid,) = join_blocks([box((3, 2, 2), (0.3, 0.2, 0.1))])
    upper, (upper_grid,) = join_blocks([box((3, 2, 2), (0.3, 0.2, 0.15), (0.0, 0.0, 0.1))])
    offset = len(lower.nodes)
    mesh = HexMesh(
        nodes=np.concatenate([lower.nodes, upper.nodes]),
        elements=np.concatenate([lower.elements, upper.elements + offset]),
    )
    fixed, moving = lower_grid[:, :, -1], upper_grid[:, :, 0] + offset
    pairs = build_contact_pairs(mesh.nodes, moving, fixed, inside=np.array([0.15, 0.1, 0.2]))
    nothing = np.zeros(0, dtype=np.int64)
    sector = CyclicSector(len(mesh.nodes), 1, clamped=lower_grid[:, :, 0].ravel(), left=nothing, right=nothing)
    return mesh.nodes, assemble_sector(mesh, hexes_of(mesh)), pairs, sector


def test_contact_pairs_of_a_plane_joint():
    _, _, pairs, _ = two_bricks()
    assert pairs.area.sum() == pytest.approx(0.3 * 0.2, rel=1e-13, abs=0)
    # Integrals of the bilinear functions: a corner has a quarter of an element, an inner node a whole one.
    assert pairs.area[0] == pytest.approx(0.25 * 0.1 * 0.1, rel=1e-12, abs=0)
    assert pairs.area.max() == pytest.approx(0.1 * 0.1, rel=1e-12, abs=0)
    # The moving brick lies above: it closes the joint by moving down.
    assert np.allclose(pairs.frames[:, 0], [0.0, 0.0, -1.0], atol=1e-13)
    assert np.allclose(pairs.frames[:, 1], [1.0, 0.0, 0.0], atol=1e-13)
    assert np.allclose(pairs.frames[:, 2], [0.0, 1.0, 0.0], atol=1e-13)


def test_contact_pairs_must_coincide():
    nodes = box((1, 1, 1)).reshape(-1, 3)
    with pytest.raises(ValueError, match="coincide"):
        build_contact_pairs(nodes, np.array([[0, 1], [2, 3]]), np.array([[4, 5], [6, 7]]), np.zeros(3))


def test_reduction_is_exact_in_statics():
    nodes, matrices, pairs, sector = two_bricks()
    coordinates = build_coordinates(sector, pairs, 0)
    n_relative = coordinates.relative.shape[1]
    full = sparse.hstack([coordinates.relative, coordinates.glued]).toarray()
    stiffness = full.T @ matrices.stiffness @ full
    condensed = stiffness[:n_relative, :n_relative] - stiffness[:n_relative, n_relative:] @ np.linalg.solve(
        stiffness[n_relative:, n_relative:], stiffness[n_relative:, :n_relative]
    )
    basis, nodal = reduced(nodes, matrices, pairs, sector, 20)
    reduced_stiffness, reduced_mass = (nodal.T @ (m @ nodal) for m in (matrices.stiffness, matrices.mass))
    scale = np.abs(condensed).max()
    assert np.allclose(reduced_stiffness[:n_relative, :n_relative], condensed, rtol=0.0, atol=1e-11 * scale)
    assert np.allclose(reduced_stiffness[:n_relative, n_relative:], 0.0, rtol=0.0, atol=1e-9 * scale)
    modal = reduced_stiffness[n_relative:, n_relative:]
    assert np.allclose(modal, np.diag(basis.frequencies**2), rtol=0.0, atol=1e-8 * basis.frequencies[-1] ** 2)
    assert np.allclose(reduced_mass[n_relative:, n_relative:], np.eye(20), atol=1e-10)
    assert np.allclose(basis.stiffness, reduced_stiffness, rtol=0.0, atol=1e-9 * scale)
    assert np.allclose(basis.mass, reduced_mass, rtol=0.0, atol=1e-11 * np.abs(reduced_mass).max())


def test_reduced_frequencies_come_down_to_the_exact_ones():
    nodes, matrices, pairs, sector = two_bricks()
    coordinates = build_coordinates(sector, pairs, 0)
    full = sparse.hstack([coordinates.relative, coordinates.glued]).toarray()
    # The pairs cannot open but slide freely.
    closed = np.arange(0, coordinates.relative.shape[1], 3)

    def sliding(stiffness, mass):
        rows = [np.delete(np.delete(matrix, closed, 0), closed, 1) for matrix in (stiffness, mass)]
        return linalg.eigh(*rows, eigvals_only=True)[:8]

    exact = sliding(*(full.T @ m @ full for m in (matrices.stiffness, matrices.mass)))
    errors = []
    for n_modes in (20, 80):
        basis, _ = reduced(nodes, matrices, pairs, sector, n_modes)
        own = sliding(basis.stiffness, basis.mass)
        # The upper brick slides in two directions and turns: three rigid modes.
        assert np.abs(own[:3]).max() < 1e-9 * own[3]
        assert np.all(own[3:] > exact[3:] * (1.0 - 1e-9))
        errors.append(np.sqrt(own[3:] / exact[3:]) - 1.0)
    assert errors[0].max() < 0.01
    assert errors[1].max() < 0.001


def test_singular_sector_is_refused():
    nodes, matrices, pairs, sector = two_bricks()
    loose = CyclicSector(sector.n_nodes, 1, clamped=sector.left, left=sector.left, right=sector.right)
    with pytest.raises(GluedSectorError, match="singular"):
        reduced(nodes, matrices, pairs, loose, 5)


def test_unstable_sector_is_refused():
    nodes, matrices, pairs, sector = two_bricks()
    softened = replace(matrices, stiffness=matrices.stiffness - 1e12 * matrices.spin_mass)
    with pytest.raises(GluedSectorError, match="unstable: spin softening exceeds its stiffness"):
        reduced(nodes, softened, pairs, sector, 5)
