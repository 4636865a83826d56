"""Lowest modes by a block Lanczos method with the inverse stiffness, without restarts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import qr

from solver.model import FloatArray, Matrix

_TOLERANCE = 1e-13  # residual of a mode, relative to its flexibility
_DEPENDENT = 1e-12  # of a block: what is left of it where it depends on those before


def lowest_modes(
    solve: Callable[[Matrix], Matrix], multiply_mass: Callable[[Matrix], Matrix], start: Matrix, n_modes: int
) -> tuple[FloatArray, Matrix]:
    """Squares (n_modes,) of the lowest angular frequencies, ascending, and the modes (n, n_modes) of unit modal mass.

    There are fewer where the structure has fewer.

    Parameters
    ----------
    solve
        Displacements (n, n_columns) under forces.
    multiply_mass
        Forces of inertia (n, n_columns) of displacements.
    start
        Displacements (n, n_block) to begin with, no force in them.
    n_modes
        At least 1.
    """
    n, n_block = start.shape
    # Vectors in rows, orthonormal with the mass; and the flexibility in their terms.
    basis = np.empty((max(4 * n_modes, 8 * n_block), n), dtype=start.dtype)
    flexibility = np.zeros((0, 0), dtype=start.dtype)
    block, _ = _orthonormal(start, multiply_mass, 0.0)
    known = 0
    while True:
        size = known + block.shape[1]
        if size > len(basis):
            basis = np.concatenate([basis, np.empty_like(basis)])
        basis[known:size] = block.T
        image = solve(multiply_mass(block))
        scale = float(np.linalg.norm(image, axis=0).max())
        coefficients, image = _orthogonal(basis[:size], image, multiply_mass)
        following, first = _orthonormal(image, multiply_mass, scale)
        # Once more: what was small before it was normalised is not orthogonal to round-off.
        scale = float(np.linalg.norm(following, axis=0).max(initial=0.0))
        correction, following = _orthogonal(basis[:size], following, multiply_mass)
        coefficients += correction @ first
        following, second = _orthonormal(following, multiply_mass, scale)

        grown = np.zeros((size, size), dtype=start.dtype)
        grown[:known, :known] = flexibility
        grown[:, known:] = coefficients
        grown[known:, :known] = coefficients[:known].conj().T
        flexibility = 0.5 * (grown + grown.conj().T)
        values, vectors = np.linalg.eigh(flexibility)
        values, vectors = values[::-1][:n_modes], vectors[:, ::-1][:, :n_modes]
        residuals = np.linalg.norm(second @ first @ vectors[known:], axis=0)
        if following.shape[1] == 0 or (len(values) == n_modes and (residuals <= _TOLERANCE * values).all()):
            return 1.0 / values, basis[:size].T @ vectors
        block, known = following, size


def _orthogonal(basis: Matrix, block: Matrix, multiply_mass: Callable[[Matrix], Matrix]) -> tuple[Matrix, Matrix]:
    """Coefficients of a block (n, n_columns) along the basis (n_basis, n), and what is left of it."""
    # The conjugate of the small one: the basis is not copied.
    coefficients = (basis @ multiply_mass(block).conj()).conj()
    return coefficients, block - basis.T @ coefficients


def _orthonormal(block: Matrix, multiply_mass: Callable[[Matrix], Matrix], scale: float) -> tuple[Matrix, Matrix]:
    """`unit, factors` with `block = unit @ factors`; directions that are round-off of the scale are left out."""
    unit, factors, order = qr(block, mode="economic", pivoting=True, check_finite=False)
    sizes = np.abs(np.diag(factors))
    rank = int(np.count_nonzero(sizes > _DEPENDENT * max(scale, float(sizes.max(initial=0.0)))))
    unit, factors = unit[:, :rank], factors[:rank, np.argsort(order)]
    gram = unit.conj().T @ multiply_mass(unit)
    root = np.linalg.cholesky(0.5 * (gram + gram.conj().T)).conj().T
    return unit @ np.linalg.inv(root), root @ factors
