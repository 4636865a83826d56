"""All displacements of a structure in one harmonic behind those of its pairs, of a ring wave by wave."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, cast

import numpy as np
from scipy.linalg.lapack import zgetrf, zgetrs

from solver.model import BoolArray, ComplexArray, IntArray, LinearModel
from solver.structure.ring import RingStructure, over_sectors
from solver.structure.schur import dynamic_stiffness


class Motion(Protocol):
    """A structure with n displacements, those at `relative` given, in motions exp(s t) with the exponent s, 1/s."""

    def times(self, name: str, motion: ComplexArray, /) -> ComplexArray:
        """A matrix of the structure, by its name in `LinearModel`, times a motion (n,)."""

    def force(self, motion: ComplexArray, /) -> ComplexArray:
        """Dynamic stiffness times a motion (n,), N."""

    def behind(self, force: ComplexArray, /) -> ComplexArray:
        """Motion (n,) with the given displacements at rest under a force (n,), N, on all others.

        Raises numpy.linalg.LinAlgError where the structure with a stuck joint is singular.
        """


@dataclass(frozen=True)
class DenseMotion:
    """As `Motion`, of any structure."""

    linear: LinearModel
    exponent: complex
    relative: IntArray

    @cached_property
    def _full(self) -> ComplexArray:
        return dynamic_stiffness(self.linear, self.exponent, ...)

    @cached_property
    def _others(self) -> IntArray:
        return np.setdiff1d(np.arange(len(self._full)), self.relative)

    @cached_property
    def _factor(self) -> tuple[ComplexArray, IntArray]:
        factor, pivots, singular = zgetrf(self._full[np.ix_(self._others, self._others)])
        if singular:
            raise np.linalg.LinAlgError
        return factor, pivots

    def times(self, name: str, motion: ComplexArray, /) -> ComplexArray:  # noqa: D102
        return cast("ComplexArray", getattr(self.linear, name) @ motion)

    def force(self, motion: ComplexArray, /) -> ComplexArray:  # noqa: D102
        return self._full @ motion

    def behind(self, force: ComplexArray, /) -> ComplexArray:  # noqa: D102
        found = np.zeros(force.shape, complex)
        if self._others.size:
            found[self._others] = zgetrs(*self._factor, force[self._others])[0]
        return found


@dataclass(frozen=True)
class RingMotion:
    """As `Motion`, of a ring of N sectors with n displacements each: by waves, and the blades' deviations over them."""

    ring: RingStructure
    exponent: complex
    relative: IntArray

    @cached_property
    def _full(self) -> ComplexArray:
        """Tuned dynamic stiffness (N, n, n) in each wave."""
        stiffness, damping, mass = (self.ring.stacked(name) for name in ("stiffness", "damping", "mass"))
        return stiffness + self.exponent * damping + self.exponent**2 * mass

    @cached_property
    def _inner(self) -> BoolArray:
        """Whether a displacement (n,) of a sector is none of the given ones."""
        n = self._full.shape[1]
        return ~np.isin(np.arange(n), self.relative[: self.relative.size // len(self._full)])

    @cached_property
    def _blades(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Rows P (N, m, n) of the blades, motion (N, n, m) under `P^H`, and `kappa (1 + C kappa)^-1` (N m, N m)."""
        rows = self.ring.stacked("blade")
        moved = self._tuned(rows.conj().swapaxes(1, 2))
        strong = np.repeat(self.ring.stiffening, rows.shape[1])
        flexible = np.eye(strong.size) + over_sectors(rows @ moved) * strong
        return rows, moved, strong[:, None] * np.linalg.inv(flexible)

    def _tuned(self, force: ComplexArray) -> ComplexArray:
        """Motion (N, n, k) of the tuned ring in each wave, with the given displacements at rest, under (N, n, k), N."""
        found, inner = np.zeros(force.shape, complex), self._inner
        found[:, inner] = np.linalg.solve(self._full[:, inner][:, :, inner], force[:, inner])
        return found

    def _in_waves(self, motion: ComplexArray) -> ComplexArray:
        return np.fft.fft(motion.reshape(len(self._full), -1, 1), axis=0)

    def times(self, name: str, motion: ComplexArray, /) -> ComplexArray:  # noqa: D102
        return np.fft.ifft(self.ring.stacked(name) @ self._in_waves(motion), axis=0).ravel()

    def force(self, motion: ComplexArray, /) -> ComplexArray:  # noqa: D102
        in_waves = self._in_waves(motion)
        found = self._full @ in_waves
        if self.ring.deviates:
            rows = self._blades[0]
            blades = np.fft.ifft(rows @ in_waves, axis=0) * self.ring.stiffening[:, None, None]
            found = found + rows.conj().swapaxes(1, 2) @ np.fft.fft(blades, axis=0)
        return np.fft.ifft(found, axis=0).ravel()

    def behind(self, force: ComplexArray, /) -> ComplexArray:  # noqa: D102
        found = self._tuned(self._in_waves(force))
        if self.ring.deviates:
            rows, moved, stiff = self._blades
            blades = np.fft.ifft(rows @ found, axis=0)
            found = found - moved @ np.fft.fft((stiff @ blades.ravel()).reshape(blades.shape), axis=0)
        return np.fft.ifft(found, axis=0).ravel()


def motion_of(linear: LinearModel, exponent: complex, relative: IntArray) -> Motion:
    """The motion of a structure."""
    kind = RingMotion if isinstance(linear, RingStructure) else DenseMotion
    return kind(linear, exponent, relative)  # type: ignore[arg-type]
