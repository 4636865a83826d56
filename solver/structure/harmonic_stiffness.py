"""The condensed dynamic stiffness Z_r of Eq. (8) at all harmonics: storage, and product with a motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from solver.model import ComplexArray, FloatArray, IntArray, LinearModel
from solver.structure.fourier import to_complex
from solver.structure.rough_forms import RoughStiffness, rough_of_each, rough_of_shared


@dataclass(frozen=True)
class DenseStiffness:
    """Z_r at H harmonics above the static one, for any structure. dense (H, n_rel, n_rel): matrices, N/m."""

    dense: ComplexArray

    def matrix(self, place: int) -> ComplexArray:
        """Matrix (n_rel, n_rel), N/m, of the harmonic at index `place`."""
        return cast("ComplexArray", self.dense[place])

    def apply(self, displacement_h: FloatArray) -> ComplexArray:
        """Amplitudes (n_rel, H), N, of `Z_r u` from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        return cast("ComplexArray", np.matmul(self.dense, moving)[:, :, 0].T)

    @cached_property
    def rough(self) -> RoughStiffness:
        """Z_r in single precision, for directions of Newton's method, not for the residual."""
        return rough_of_each(self.dense)


@dataclass(frozen=True)
class SharedStiffness:
    """Real matrices K, M, C, shared by all harmonics, and the compliance behind the joint at each harmonic.

    With A = K + i n w C - (n w)^2 M and the displacements split into those of the pairs (r) and all others (i),

        Z_r = A_rr - A_ri A_ii^-1 A_ir                                                                         (8)

    A product for all harmonics consists of three real products. Its time is the time of reading 3 n_rel^2 numbers from
    memory, for any H.

    - n_rel: number of relative displacements of the joint.
    - rates (H,): n w, rad/s.
    - columns (3, n, n_rel): columns r of K, M, C, with rows r before rows i.
    - back (3, n_rel, n_i): K_ri, M_ri, C_ri.
    - held_compliance (H, n_i, n_i): `A_ii^-1`, m/N.
    - linear, relative (n_rel,), internal (n_i,): the structure, and its displacements of the pairs and all others.
    """

    n_rel: int
    rates: FloatArray
    columns: FloatArray
    back: FloatArray
    held_compliance: ComplexArray
    linear: LinearModel
    relative: IntArray
    internal: IntArray

    @property
    def dense(self) -> ComplexArray:
        """As in DenseStiffness; computed at each call: the matrices may need as much memory as all other data."""
        return np.array([self.matrix(place) for place in range(self.rates.size)]).reshape(-1, self.n_rel, self.n_rel)

    def matrix(self, place: int) -> ComplexArray:
        """As in DenseStiffness."""
        rate = self.rates[place]
        stiffness, mass, damping = self.columns
        columns = stiffness - rate**2 * mass + 1j * rate * damping
        back = self.back[0] - rate**2 * self.back[1] + 1j * rate * self.back[2]
        held = self.held_compliance[place] @ columns[self.n_rel :]
        return cast("ComplexArray", columns[: self.n_rel] - back @ held)

    def apply(self, displacement_h: FloatArray) -> ComplexArray:
        """As in DenseStiffness."""
        forces = self._products(self.columns, to_complex(displacement_h))
        behind = np.matmul(self.held_compliance, forces[self.n_rel :].T[:, :, None])[:, :, 0].T
        return forces[: self.n_rel] - self._products(self.back, behind)

    @cached_property
    def rough(self) -> RoughStiffness:
        """As in DenseStiffness."""
        few = rough_of_shared(self.linear, self.relative, self.internal, self.rates, self.held_compliance)
        return rough_of_each(self.dense) if few is None else few

    def _products(self, parts: FloatArray, amplitudes: ComplexArray) -> ComplexArray:
        """`(K + i n w C - (n w)^2 M) u` (rows, H) of real parts K, M, C (3, rows, n) and complex u (n, H).

        One real product for all harmonics: real and imaginary parts are columns side by side.
        """
        _, n_rows, n = parts.shape
        columns = np.ascontiguousarray(amplitudes).view(np.float64)
        found = (parts.reshape(3 * n_rows, n) @ columns).view(np.complex128)
        spring, inertia, drag = found.reshape(3, n_rows, self.rates.size)
        return np.asarray(spring + 1j * self.rates * drag - self.rates**2 * inertia)


def share_matrices(
    linear: LinearModel, relative: IntArray, internal: IntArray, rates: FloatArray, held_compliance: ComplexArray
) -> SharedStiffness:
    """Z_r of a real structure at the rates n w (H,), rad/s. held_compliance: as in SharedStiffness."""
    every = np.concatenate([relative, internal])
    parts = [np.asarray(np.real(part), np.float64) for part in (linear.stiffness, linear.mass, linear.damping)]
    return SharedStiffness(
        relative.size,
        rates,
        np.stack([part[every[:, None], relative] for part in parts]),
        np.stack([part[relative[:, None], internal] for part in parts]),
        held_compliance,
        linear,
        relative,
        internal,
    )


HarmonicStiffness = DenseStiffness | SharedStiffness
