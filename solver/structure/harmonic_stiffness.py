"""The condensed dynamic stiffness Z_r of Eq. (8) at all harmonics: storage, and product with a motion."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import cast

import numpy as np

from solver.model import ComplexArray, FloatArray, IntArray, LinearModel
from solver.structure.fourier import from_complex, to_complex


def solved(matrices: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Solutions (n, k) of systems with k matrices (k, n, n), for right-hand sides (n, k)."""
    return cast("ComplexArray", np.linalg.solve(matrices, right.T[:, :, None])[:, :, 0].T)


@dataclass(frozen=True)
class DenseStiffness:
    """Z_r at H harmonics above the static one, for any structure. dense: (H, n_rel, n_rel), N/m."""

    dense: ComplexArray

    def apply(self, displacement_h: FloatArray) -> ComplexArray:
        """Amplitudes (n_rel, H), N, of `Z_r u` from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T, self.dense.dtype)[:, :, None]
        return cast("ComplexArray", np.matmul(self.dense, moving)[:, :, 0].T)

    def apply_transposed(self, force_h: FloatArray) -> ComplexArray:
        """Amplitudes (n_rel, H) of the conjugate transpose of Z_r, which is the transposed real matrix, times y."""
        moving = np.ascontiguousarray(to_complex(force_h).T)[:, None, :]
        return cast("ComplexArray", np.matmul(moving.conj(), self.dense)[:, 0, :].conj().T)

    def block(self, count: int, rows: IntArray) -> ComplexArray:
        """Z_r (count, n, n) of the lowest harmonics, in some rows and columns (n,)."""
        return self.dense[:count, rows[:, None], rows]

    def solve(self, places: slice | IntArray, force: ComplexArray) -> ComplexArray:
        """Amplitudes (n_rel, k), m, with `Z_r u = force` (n_rel, k), N, at some of the harmonics."""
        return solved(self.dense[places], force)

    @cached_property
    def single(self) -> "DenseStiffness":
        """Z_r in single precision."""
        return DenseStiffness(self.dense.astype(np.complex64))


@dataclass(frozen=True)
class SharedStiffness:
    """Real matrices K, M, C, shared by all harmonics, and the compliance behind the joint at each harmonic.

    A product with `Z_r = A_rr - A_ri A_ii^-1 A_ir` (`condensation`) for all harmonics is one real product of [K M C]
    with the motions times 1, -(n w)^2 and i n w. Its time is that of reading 3 n_rel^2 numbers. With 336 pairs and 13
    harmonics the matrices of all harmonics take 211 MB, these take 24 MB. Methods as in `DenseStiffness`.

    - relative (n_rel,): displacements of the pairs. rates (H,): n w, rad/s.
    - inner_compliance (H, n_i, n_i): `A_ii^-1`, m/N; in the precision of all products.
    """

    linear: LinearModel
    relative: IntArray
    rates: FloatArray
    inner_compliance: ComplexArray

    @cached_property
    def _parts(self) -> tuple[FloatArray, FloatArray]:
        return _real_parts(self.linear, tuple(self.relative.tolist()), self.inner_compliance.real.dtype.name)

    @cached_property
    def _factors(self) -> ComplexArray:
        """Factors (3, 1, H) of K, M and C in A."""
        ones = np.ones(self.rates.size)
        return np.stack([ones, -(self.rates**2), 1j * self.rates])[:, None].astype(self.inner_compliance.dtype)

    @property
    def dense(self) -> ComplexArray:
        """As in `DenseStiffness`; computed at each call."""
        n_rel = self.relative.size
        found = np.empty((self.rates.size, n_rel, n_rel), self.inner_compliance.dtype)
        for place, factors in enumerate(self._factors[:, 0].T):
            columns, back = (
                sum(factor * part for factor, part in zip(factors, np.split(parts, 3, axis=1), strict=True))
                for parts in self._parts
            )
            found[place] = columns[:n_rel] - back @ (self.inner_compliance[place] @ columns[n_rel:])
        return found

    def apply(self, displacement_h: FloatArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        n_rel, (columns, back) = self.relative.size, self._parts
        forces = self._product(columns, to_complex(displacement_h))
        behind = np.matmul(self.inner_compliance, forces[n_rel:].T[:, :, None])[:, :, 0].T
        return forces[:n_rel] - self._product(back, behind)

    def apply_transposed(self, force_h: FloatArray) -> ComplexArray:
        """As in `DenseStiffness`: a real structure is symmetric."""
        return np.conj(self.apply(from_complex(force_h[:, 0], np.conj(to_complex(force_h)))))

    def block(self, count: int, rows: IntArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        return self.dense[:count, rows[:, None], rows]

    def solve(self, places: slice | IntArray, force: ComplexArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        return solved(self.dense[places], force)

    @cached_property
    def single(self) -> "SharedStiffness":
        """As in `DenseStiffness`."""
        return replace(self, inner_compliance=self.inner_compliance.astype(np.complex64))

    def _product(self, parts: FloatArray, amplitudes: ComplexArray) -> ComplexArray:
        """A u (rows, H) of real parts K, M, C (rows, 3n) and complex u (n, H)."""
        kind = self.inner_compliance.dtype
        motions = (self._factors * amplitudes.astype(kind, copy=False)).reshape(parts.shape[1], self.rates.size)
        return np.asarray((parts @ motions.view(parts.dtype)).view(kind))


@lru_cache(maxsize=4)
def _real_parts(linear: LinearModel, relative: tuple[int, ...], kind: str) -> tuple[FloatArray, FloatArray]:
    """Columns r (n, 3 n_rel) of K, M, C, with rows r before rows i, and blocks ri (n_rel, 3 n_i), at any frequency."""
    three = [np.real(part) for part in (linear.stiffness, linear.mass, linear.damping)]
    others = tuple(np.setdiff1d(np.arange(len(linear.mass)), relative).tolist())
    columns, back = (
        np.hstack([np.asarray(part[np.ix_(rows, places)], kind) for part in three])
        for rows, places in ((relative + others, relative), (relative, others))
    )
    return columns, back
