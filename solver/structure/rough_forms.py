"""K, M and C among the displacements of the pairs for products of three digits, in less time than exact ones.

K has full rank, but few motions of the joint carry much of the mass, and damping is often a multiple of the stiffness:

    M = V E V^T,      C = s K + V E V^T      (each with its own V and E)

leaves one large product of three. Where a remainder is too large for that (damping of another kind), the matrix itself
is kept. All of it in single precision: such products are bound by reading memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from solver.model import FloatArray, IntArray, LinearModel
from solver.structure.identity import Identity
from solver.structure.options import STRUCTURE

SingleArray = NDArray[np.float32]


@dataclass(frozen=True)
class LowRank:
    """A symmetric matrix `V E V^T`, or itself.

    vectors (n, k), values (k,): V, E. remainder: Frobenius norm of what is left out. whole (n, n): the matrix.
    """

    vectors: SingleArray
    values: SingleArray
    remainder: float
    whole: SingleArray

    def apply(self, motion: SingleArray, most: float) -> SingleArray:
        """Product with (n, k); most: remainder that does not matter, in the unit of the matrix."""
        if self.remainder > most:
            return self.whole @ motion
        return self.vectors @ (self.values[:, None] * (self.vectors.T @ motion))


@dataclass(frozen=True)
class RoughForms:
    """stiffness (n_rel, n_rel): K. slope: s. mass: M. drag: `C - s K`. size: root mean square of K's eigenvalues."""

    stiffness: SingleArray
    slope: float
    mass: LowRank
    drag: LowRank
    size: float

    def apply(self, motion: SingleArray, rates: FloatArray) -> tuple[SingleArray, SingleArray, SingleArray]:
        """`K u`, `M u` and `C u` (n_rel, k) for the harmonics at these rates n w, rad/s."""
        highest = float(rates.max(initial=0.0))
        most = STRUCTURE.rough * self.size
        spring = self.stiffness @ motion
        inertia = self.mass.apply(motion, most / highest**2 if highest > 0.0 else np.inf)
        drag = self.drag.apply(motion, most / highest if highest > 0.0 else np.inf)
        return spring, inertia, np.float32(self.slope) * spring + drag


def rough_forms(linear: LinearModel, relative: IntArray) -> RoughForms:
    """Forms of a real structure among the displacements `relative` (n_rel,); made once for each structure."""
    return _forms(Identity(linear), tuple(relative.tolist()))


@lru_cache(maxsize=2)
def _forms(structure: Identity, relative: tuple[int, ...]) -> RoughForms:
    rows, linear = np.array(relative), cast("LinearModel", structure.objects[0])
    stiffness, mass, damping = (
        np.asarray(np.real(part)[rows[:, None], rows], np.float64)
        for part in (linear.stiffness, linear.mass, linear.damping)
    )
    norm = float(np.linalg.norm(stiffness))
    slope = float(np.vdot(stiffness, damping)) / norm**2 if norm > 0.0 else 0.0
    return RoughForms(
        stiffness.astype(np.float32),
        slope,
        _low_rank(mass),
        _low_rank(damping - slope * stiffness),
        norm / np.sqrt(max(rows.size, 1)),
    )


def _low_rank(matrix: FloatArray) -> LowRank:
    """The largest part of a matrix, found by a few powers on fixed vectors."""
    n = matrix.shape[0]
    image: FloatArray = matrix @ np.random.default_rng(0).normal(size=(n, min(STRUCTURE.rough_directions, n)))
    for _ in range(2):
        image = matrix @ np.linalg.qr(image)[0]
    basis = np.linalg.qr(image)[0]
    values, turned = np.linalg.eigh(basis.T @ matrix @ basis)
    vectors = basis @ turned
    remainder = float(np.linalg.norm(matrix - (vectors * values) @ vectors.T))
    return LowRank(vectors.astype(np.float32), values.astype(np.float32), remainder, matrix.astype(np.float32))
