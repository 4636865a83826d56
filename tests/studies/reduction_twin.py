"""Craig-Bampton reduction the plain way: one sparse factorisation, a column of static shapes for each displacement.

The slow twin of `studies.finite_element`.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from solver.model import FloatArray, LinearModel, Matrix, needed_nodal_diameters
from studies.finite_element.elements.assembly import (
    assemble_mass,
    assemble_stiffness,
    assemble_tangent_stiffness,
    centrifugal_load,
    spin_softening,
)
from studies.finite_element.joint.pairing import ContactPairs
from studies.finite_element.joint_model import JointDefinition
from studies.scenes.dovetail_sector import define_sector


@dataclass(frozen=True)
class SectorCoordinates:
    """Nodal displacements = relative @ u_rel + glued @ y.

    glued (3 n_nodes, n_glued): the sector with the pairs glued, at one nodal diameter; complex where that is neither 0
    nor n_sectors / 2. relative (3 n_nodes, 3 n_contact): the moving nodes of the pairs, pair by pair (normal, first,
    second tangent).
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix


def build_coordinates(joint: JointDefinition, nodal_diameter: int) -> SectorCoordinates:
    """Coordinates of the sector at a nodal diameter in 0..n_sectors // 2."""
    cut, pairs = joint.cut, joint.pairs
    n_nodes, n_sectors = len(joint.held), cut.axis.n_sectors
    angle = 2.0 * np.pi / n_sectors
    phase: complex | float
    if nodal_diameter == 0:
        phase = 1.0
    elif 2 * nodal_diameter == n_sectors:
        phase = -1.0
    else:
        phase = cmath.exp(1j * angle * nodal_diameter)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    # Every node follows a master: itself, its image on the left cut face, or the fixed node of its pair.
    master = np.arange(n_nodes)
    master[cut.right] = cut.left
    master[pairs.moving] = pairs.opposite.argmax(axis=1).ravel()
    blocks = np.tile(np.eye(3, dtype=type(phase)), (n_nodes, 1, 1))
    blocks[cut.right] = phase * rotation
    clamped = np.flatnonzero(joint.held.all(axis=1))
    blocks[np.isin(master, clamped)] = 0.0

    free = np.setdiff1d(master, clamped)
    column = np.zeros(n_nodes, dtype=np.int64)
    column[free] = np.arange(len(free))
    starts = np.arange(n_nodes + 1)
    glued = sparse.bsr_matrix((blocks, column[master], starts), shape=(3 * n_nodes, 3 * len(free))).tocsr()
    glued.eliminate_zeros()
    return SectorCoordinates(glued=glued, relative=_relative(pairs, n_nodes))


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
    model, joint = define_sector(parameters)
    elastic, mass = assemble_stiffness(model.mesh), assemble_mass(model.mesh)
    load = centrifugal_load(mass, model.coordinates, model.rotation)
    stiffness = elastic
    if parameters.stress_stiffening:
        glued = solve_glued(elastic, load, build_coordinates(joint, 0))
        stiffness = (assemble_tangent_stiffness(model.mesh, glued) + spin_softening(mass, model.rotation)).tocsr()
    tip, excited = joint.load.row(model.mesh.n_nodes), parameters.nodal_diameter
    wanted = needed_nodal_diameters(excited, parameters.n_sectors, n_harmonics)
    linear, damping = {}, 0.0
    for k in sorted({excited, *wanted}, key=lambda k: (k != excited, k)):
        basis = build_basis(stiffness, mass, build_coordinates(joint, k), parameters.stuck_modes)
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
