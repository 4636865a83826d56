"""An approximate inverse of a ring's Jacobian: that of equal sectors, wave by wave.

With the derivatives of the contact law averaged over the sectors the Jacobian has one block for each wave q. The real
coefficients c and s of a harmonic have complex waves; with the stiffness Z_q of the amplitude c - i s,

    f_c = 1/2 [Z_q (c - i s) + conj(Z_-q) (c + i s)],      f_s = i/2 [Z_q (c - i s) - conj(Z_-q) (c + i s)].

GMRES is left what the sectors differ in. 47 shrouded sectors of 8 pairs at the begin of a sweep take 5 to 8 products,
and 109 to 186 with the exact inverse of each sector alone, 180 to 280 with marches through the period.
"""

from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.dlft import Linearisation, spread_blocks
from solver.model import ComplexArray, FloatArray
from solver.structure.ring_stiffness import RingStiffness

SMALL_SECTOR = 40
"""Relative displacements of a sector up to which its ring is inverted by waves, as such joints are factorised. With
48 (12 dovetail sectors) marches of each sector need 16 to 43 products, which take less time than an inverse."""

LARGEST_WAVE = 1000
"""Largest number of unknowns of a wave that is inverted: 0.3 s for each. Above, the highest harmonics are left out."""


@dataclass(frozen=True)
class RingFactor:
    """Inverse (N // 2 + 1, n k, n k) of each wave, in the first k coefficients of n displacements, the identity in all
    others, and the sign of the determinant.
    """

    inverse: ComplexArray
    n_sectors: int
    width: int
    sign: float

    exact = False

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (N n, 2H+1) for a right-hand side (N n, 2H+1)."""
        found = right.copy()
        in_waves = np.fft.rfft(right[:, : self.width].reshape(self.n_sectors, -1, 1), axis=0)
        solved = np.matmul(self.inverse, in_waves.astype(self.inverse.dtype))
        found[:, : self.width] = np.fft.irfft(solved, self.n_sectors, axis=0).reshape(len(right), self.width)
        return found


def build_ring_factor(tangent: Linearisation, shift: float) -> RingFactor | None:
    """Inverse of a Jacobian with a shift of its eigenvalues; None for other structures, for large sectors, and where
    a wave is singular.
    """
    structure, orders = tangent.joint.structure, tangent.joint.basis.orders
    moving = structure.moving
    if not isinstance(moving, RingStiffness) or not orders:
        return None
    n_sectors, n = moving.n_sectors, moving.waves.shape[-1]
    if n > SMALL_SECTOR:
        return None
    width = min(2 * len(orders) + 1, 2 * (LARGEST_WAVE // n // 2) + 1)
    parts = (tangent.motion_tangent, tangent.force_tangent)
    mean = np.array([part.reshape(n_sectors, -1, *part.shape[1:]).mean(axis=0) for part in parts])
    motion, force = spread_blocks(mean, *np.divmod(tangent.joint.component_index[:n], 3), width)
    still = np.fft.fft(structure.static_stiffness[:, :n].reshape(n_sectors, n, n), axis=0)
    forward, backward = motion[:, 1::2] - 1j * motion[:, 2::2], motion[:, 1::2] + 1j * motion[:, 2::2]
    inverse, sign = np.empty((n_sectors // 2 + 1, n * width, n * width), np.complex64), 1.0
    for wave in range(n_sectors // 2 + 1):
        matrix = force.astype(complex)
        matrix[:, 0] += still[wave] @ motion[:, 0]
        ahead, back = moving.waves[: width // 2, wave], moving.waves[: width // 2, -wave].conj()
        one = np.matmul(ahead, forward.transpose(1, 0, 2)).transpose(1, 0, 2)
        other = np.matmul(back, backward.transpose(1, 0, 2)).transpose(1, 0, 2)
        matrix[:, 1::2] += 0.5 * (one + other)
        matrix[:, 2::2] += 0.5j * (one - other)
        whole = matrix.reshape(n * width, n * width) + shift * np.eye(n * width)
        try:
            inverse[wave] = np.linalg.inv(whole)
        except np.linalg.LinAlgError:
            return None
        if wave in (0, n_sectors / 2):
            # the determinants of all other waves come in conjugate pairs
            sign *= float(np.linalg.slogdet(whole.real)[0])
    return RingFactor(inverse, n_sectors, width, sign)
