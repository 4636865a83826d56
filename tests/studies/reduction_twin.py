"""Craig-Bampton reduction the plain way: one sparse factorisation, a column of static shapes for each displacement.

The slow twin of `studies.scenes.finite_element.reduction`.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from solver.model import FloatArray, LinearModel, Matrix, needed_nodal_diameters
from studies.scenes.dovetail_mesh import build_dovetail_mesh
from studies.scenes.dovetail_sector import build_elements, build_pairs, build_sector, tip_row
from studies.scenes.finite_element.assembly import assemble_geometric_stiffness, assemble_sector
from studies.scenes.finite_element.contact_pairs import ContactPairs
from studies.scenes.finite_element.cyclic import CyclicSector


@dataclass(frozen=True)
class SectorCoordinates:
    """Nodal displacements = relative @ u_rel + glued @ y.

    glued (3 n_nodes, n_glued): the sector with the pairs glued, at one nodal diameter; complex where that is neither 0
    nor n_sectors / 2. relative (3 n_nodes, 3 n_contact): the moving nodes of the pairs, pair by pair (normal, first,
    second tangent).
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix


def build_coordinates(sector: CyclicSector, pairs: ContactPairs, nodal_diameter: int) -> SectorCoordinates:
    """Coordinates of the sector at a nodal diameter in 0..n_sectors // 2."""
    angle = 2.0 * np.pi / sector.n_sectors
    phase: complex | float
    if nodal_diameter == 0:
        phase = 1.0
    elif 2 * nodal_diameter == sector.n_sectors:
        phase = -1.0
    else:
        phase = cmath.exp(1j * angle * nodal_diameter)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    # Every node follows a master: itself, its image on the left cut face, or the fixed node of its pair.
    master = np.arange(sector.n_nodes)
    master[sector.right] = sector.left
    master[pairs.moving] = pairs.fixed
    blocks = np.tile(np.eye(3, dtype=type(phase)), (sector.n_nodes, 1, 1))
    blocks[sector.right] = phase * rotation
    blocks[np.isin(master, sector.clamped)] = 0.0

    free = np.setdiff1d(master, sector.clamped)
    column = np.zeros(sector.n_nodes, dtype=np.int64)
    column[free] = np.arange(len(free))
    starts = np.arange(sector.n_nodes + 1)
    glued = sparse.bsr_matrix((blocks, column[master], starts), shape=(3 * sector.n_nodes, 3 * len(free))).tocsr()
    glued.eliminate_zeros()
    return SectorCoordinates(glued=glued, relative=_relative(pairs, sector.n_nodes))


def _relative(pairs: ContactPairs, n_nodes: int) -> sparse.csr_matrix:
    """Nodal displacements (3 n_nodes, 3 n_contact) from the relative displacements in the local frames."""
    n_contact = len(pairs.moving)
    order = np.argsort(pairs.moving)
    starts = np.searchsorted(pairs.moving[order], np.arange(n_nodes + 1))
    blocks = np.swapaxes(pairs.frames, 1, 2)[order]
    return sparse.bsr_matrix((blocks, order, starts), shape=(3 * n_nodes, 3 * n_contact)).tocsr()


@dataclass(frozen=True)
class ReducedBasis:
    """nodal (3 n_nodes, n): nodal displacements, m, of the coordinates [relative displacements | stuck modes].

    frequencies (n_modes,): natural frequencies of the glued sector, rad/s, ascending. The modes have unit modal mass.
    """

    nodal: Matrix
    frequencies: FloatArray


def factorise(stiffness: sparse.csr_matrix) -> SuperLU:
    """LU factors of a sparse symmetric or Hermitian matrix.

    Raises ValueError where the matrix is singular.
    """
    try:
        return splu(
            stiffness.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise ValueError("the stiffness of the glued sector is singular") from error


def solve_glued(stiffness: sparse.csr_matrix, load: FloatArray, coordinates: SectorCoordinates) -> FloatArray:
    """Nodal displacements (3 n_nodes,), m, of the glued sector at nodal diameter 0 under a nodal load (3 n_nodes,)."""
    glued = coordinates.glued
    return np.asarray(glued @ factorise(glued.T @ stiffness @ glued).solve(glued.T @ load))


def build_basis(
    stiffness: sparse.csr_matrix,
    mass: sparse.csr_matrix,
    coordinates: SectorCoordinates,
    n_modes: int,
) -> ReducedBasis:
    """Static shapes of unit relative displacements with all else free, and the lowest modes of the glued sector.

    stiffness, mass (3 n_nodes, 3 n_nodes): unconstrained. Start vector, order and phase of the modes are fixed, so
    that the same sector gives the same basis bit for bit.

    Raises ValueError where the glued sector is singular or, from spin softening, unstable.
    """
    glued = coordinates.glued
    glued_h = glued.conj().T.tocsr()
    inner = (glued_h @ stiffness @ glued).tocsc()
    inner_mass = (glued_h @ mass @ glued).tocsr()
    factors = factorise(inner)
    n_inner = inner.shape[0]

    coupling = (glued_h @ (stiffness @ coordinates.relative)).toarray()
    constraint = coordinates.relative.toarray() - glued @ factors.solve(coupling)

    values, vectors = _lowest_modes(inner, inner_mass, factors, n_modes)
    start = _start(n_inner)
    vectors /= np.sqrt(np.einsum("ij,ij->j", vectors.conj(), inner_mass @ vectors).real)
    # No mode is orthogonal to a random vector: what that sees of a mode is made real and positive.
    seen = start @ vectors
    vectors *= seen.conj() / np.abs(seen)
    return ReducedBasis(nodal=np.hstack([constraint, glued @ vectors]), frequencies=np.sqrt(values))


def glued_frequencies(
    stiffness: sparse.csr_matrix, mass: sparse.csr_matrix, coordinates: SectorCoordinates, n_modes: int
) -> FloatArray:
    """Lowest natural frequencies (n_modes,) of the glued sector, rad/s, ascending; arguments as in `build_basis`.

    Raises ValueError where the glued sector is singular or, from spin softening, unstable.
    """
    glued = coordinates.glued
    glued_h = glued.conj().T.tocsr()
    inner = (glued_h @ stiffness @ glued).tocsc()
    values, _ = _lowest_modes(inner, (glued_h @ mass @ glued).tocsr(), factorise(inner), n_modes)
    return np.sqrt(values)


def _lowest_modes(
    stiffness: sparse.csc_matrix, mass: sparse.csr_matrix, factors: SuperLU, n_modes: int
) -> tuple[FloatArray, Matrix]:
    """Squares (n_modes,) of the lowest angular frequencies, ascending, and the modes (n, n_modes)."""
    n = stiffness.shape[0]
    values, vectors = eigsh(
        stiffness,
        k=n_modes,
        M=mass,
        sigma=0.0,
        OPinv=LinearOperator((n, n), matvec=factors.solve, dtype=stiffness.dtype),
        v0=_start(n).astype(stiffness.dtype),
    )
    order = np.argsort(values)
    if values[order[0]] <= 0.0:
        raise ValueError("the glued sector is unstable: spin softening exceeds its stiffness")
    return values[order], vectors[:, order]


def _start(n: int) -> FloatArray:
    """Start vector (n,) of the search for modes, always the same."""
    return np.random.default_rng(0).standard_normal(n)


def project(matrix: sparse.csr_matrix, basis: Matrix) -> Matrix:
    """Hermitian projection `basis^H matrix basis` of a real, symmetric sparse matrix."""
    # Seen as pairs of real columns, a complex basis needs half the multiplications.
    columns = np.ascontiguousarray(basis)
    product = np.ascontiguousarray(matrix @ columns.view(np.float64)).view(columns.dtype)
    reduced = columns.conj().T @ product
    return np.asarray(0.5 * (reduced + reduced.conj().T))


def build_linear(parameters, n_harmonics):
    """Linear models of `dovetail_sector` by nodal diameter, without a retainer."""
    mesh = build_dovetail_mesh(parameters)
    pairs, sector = build_pairs(mesh), build_sector(parameters, mesh)
    hexes = build_elements(parameters, mesh)
    matrices = assemble_sector(mesh.mesh, hexes)
    elastic, mass = matrices.stiffness.tocsr(), matrices.mass.tocsr()
    load = parameters.angular_speed**2 * matrices.load
    stiffness = elastic
    if parameters.stress_stiffening:
        glued = solve_glued(elastic, load, build_coordinates(sector, pairs, 0))
        stiffness = (
            elastic
            + assemble_geometric_stiffness(mesh.mesh, hexes, glued)
            - parameters.angular_speed**2 * matrices.spin_mass
        ).tocsr()
    tip, excited = tip_row(parameters, mesh), parameters.nodal_diameter
    wanted = needed_nodal_diameters(excited, parameters.n_sectors, n_harmonics)
    linear, damping = {}, 0.0
    for k in sorted({excited, *wanted}, key=lambda k: (k != excited, k)):
        basis = build_basis(stiffness, mass, build_coordinates(sector, pairs, k), parameters.stuck_modes)
        if k == excited:
            damping = parameters.loss_factor / basis.frequencies[0]
        nodes = basis.nodal
        linear[k] = LinearModel(
            mass=project(mass, nodes),
            damping=damping * project(elastic, nodes),
            stiffness=project(stiffness, nodes),
            load_static=(nodes.real.T @ load) * (k == 0),
            load_harmonic=(nodes.conj().T @ tip).astype(complex) * (k == excited),
            response=(tip @ nodes)[None, :],
        )
    return linear
