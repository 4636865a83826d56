"""Craig-Bampton reduction of a sector to its relative displacements and stuck modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from solver.model import FloatArray, Matrix
from studies.scenes.finite_element.cyclic import SectorCoordinates


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
