"""Lowest modes by a block Lanczos method with the inverse stiffness, without restarts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import qr

from solver.model import FloatArray, Matrix

_TOLERANCE = 1e-13  # residual of a mode, relative to its flexibility
_DEPENDENT = 1e-12  # of a block: what is left of it where it depends on those before
_MASSLESS = 1e-14  # modal mass of a vector of length 1 that is round-off of the largest one
_STIFF = 1e-11  # flexibility of a mode that is round-off of the largest one


def lowest_modes(
    solve: Callable[[Matrix], Matrix], multiply_mass: Callable[[Matrix], Matrix], start: Matrix, n_modes: int
) -> tuple[FloatArray, Matrix]:
    """Squares (n_modes,) of the lowest angular frequencies, ascending, and the modes (n, n_modes) of unit modal mass.

    There are fewer where the structure has fewer, as one with a singular mass.

    solve: displacements (n, n_columns) under forces. multiply_mass: forces of inertia (n, n_columns) of displacements.
    start: displacements (n, n_block) to begin with, no force in them. n_modes: at least 1.
    """
    n, n_block = start.shape
    # Vectors in rows, orthonormal with the mass, and their forces of inertia; and the flexibility in their terms.
    basis, inertia = (np.empty((max(4 * n_modes, 8 * n_block), n), dtype=start.dtype) for _ in range(2))
    flexibility = np.zeros((0, 0), dtype=start.dtype)
    heaviest = float(np.max(_modal_masses(start / np.linalg.norm(start, axis=0), multiply_mass)))
    block, forces, _ = _orthonormal(start, multiply_mass, 0.0, 0.0, heaviest)
    known = 0
    while True:
        size = known + block.shape[1]
        if size > len(basis):
            basis, inertia = (np.concatenate([each, np.empty_like(each)]) for each in (basis, inertia))
        basis[known:size], inertia[known:size] = block.T, forces.T
        image = solve(forces)
        scale = float(np.linalg.norm(image, axis=0).max())
        coefficients, image = _orthogonal(basis[:size], inertia[:size], image)
        moved = float(np.linalg.norm(coefficients, axis=0).max())
        following, _, first = _orthonormal(image, multiply_mass, scale, moved, heaviest)
        # Once more: what was small before it was normalised is not orthogonal to round-off.
        scale = float(np.linalg.norm(following, axis=0).max(initial=0.0))
        correction, following = _orthogonal(basis[:size], inertia[:size], following)
        coefficients += correction @ first
        following, forces, second = _orthonormal(following, multiply_mass, scale, 1.0, heaviest)

        grown = np.zeros((size, size), dtype=start.dtype)
        grown[:known, :known] = flexibility
        grown[:, known:] = coefficients
        grown[known:, :known] = coefficients[:known].conj().T
        flexibility = 0.5 * (grown + grown.conj().T)
        values, vectors = np.linalg.eigh(flexibility)
        values, vectors = values[::-1][:n_modes], vectors[:, ::-1][:, :n_modes]
        residuals = np.linalg.norm(second @ first @ vectors[known:], axis=0)
        if following.shape[1] == 0 or (len(values) == n_modes and (residuals <= _TOLERANCE * values).all()):
            found = values > _STIFF * values[0]
            return 1.0 / values[found], basis[:size].T @ vectors[:, found]
        block, known = following, size


def _orthogonal(basis: Matrix, inertia: Matrix, block: Matrix) -> tuple[Matrix, Matrix]:
    """Coefficients of a block (n, n_columns) along the basis (n_basis, n), and what is left of it.

    inertia (n_basis, n): forces of inertia of the basis.
    """
    # The conjugate of the small one: the basis is not copied.
    coefficients = (inertia @ block.conj()).conj()
    return coefficients, block - basis.T @ coefficients


def _modal_masses(vectors: Matrix, multiply_mass: Callable[[Matrix], Matrix]) -> FloatArray:
    """Modal masses (n_columns,) of vectors (n, n_columns)."""
    return np.asarray(np.einsum("ij,ij->j", vectors.conj(), multiply_mass(vectors)).real)


def _orthonormal(
    block: Matrix, multiply_mass: Callable[[Matrix], Matrix], scale: float, moved: float, heaviest: float
) -> tuple[Matrix, Matrix, Matrix]:
    """`unit, inertia, factors` with `block = unit @ factors`, unit orthonormal with the mass, inertia its forces.

    Directions that are round-off are left out: of the scale, a norm of displacements, of moved, one with the mass, or
    of heaviest, a modal mass of displacements of norm 1. So is what a singular mass does not move.
    """
    unit, factors, order = qr(block, mode="economic", pivoting=True, check_finite=False)
    sizes = np.abs(np.diag(factors))
    rank = int(np.count_nonzero(sizes > _DEPENDENT * max(scale, float(sizes.max(initial=0.0)))))
    unit, factors = unit[:, :rank], factors[:rank, np.argsort(order)]
    inertia = multiply_mass(unit)
    gram = unit.conj().T @ inertia
    gram = 0.5 * (gram + gram.conj().T)
    masses, vectors = np.linalg.eigh(gram)
    sizes = np.sqrt(np.maximum(masses, 0.0)) * np.linalg.norm(vectors.conj().T @ factors, axis=1)
    massive = (masses > _MASSLESS * heaviest) & (sizes > _DEPENDENT * moved)
    if not massive.all():
        chosen = vectors[:, massive]
        unit, inertia, factors = unit @ chosen, inertia @ chosen, chosen.conj().T @ factors
        gram = np.diag(masses[massive])
    root = np.linalg.cholesky(gram).conj().T
    inverse = np.linalg.inv(root)
    return unit @ inverse, inertia @ inverse, root @ factors
