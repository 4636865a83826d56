"""An approximate inverse of a ring's Jacobian: that of equal sectors, wave by wave.

With the derivatives of the contact law averaged over the sectors the Jacobian has one block for each wave q. The real
coefficients c and s of a harmonic have complex waves; with the stiffness Z_q of the amplitude c - i s,

    f_c = 1/2 [Z_q (c - i s) + conj(Z_-q) (c + i s)],      f_s = i/2 [Z_q (c - i s) - conj(Z_-q) (c + i s)].

The blades' deviations in the first harmonic are added by Woodbury's formula, with matrices over the sectors alone: with
their amplitudes `Q_q u` and forces `L_q` in each wave, and W over the sectors,

    (M + L W Q)^-1 r = M^-1 r - M^-1 L W (1 + Q M^-1 L W)^-1 Q M^-1 r.

GMRES is left what contacts of the sectors differ in. 47 shrouded sectors of 8 pairs at the begin of a sweep take 5 to 8
products, and 109 to 186 with the exact inverse of each sector alone, 180 to 280 with marches through the period.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver.harmonic_balance.dlft import Linearisation, spread_blocks
from solver.model import ComplexArray, FloatArray
from solver.structure.ring import over_sectors
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

    seen (N // 2 + 1, 2 m, n k), moved (N // 2 + 1, n k, 2 m), back (N 2 m, N 2 m): Q, M^-1 L and W (1 + Q M^-1 L W)^-1
    of m modes of a blade, whose cosine comes before its sine; m is 0 where all blades are equal.
    """

    inverse: ComplexArray
    seen: ComplexArray
    moved: ComplexArray
    back: FloatArray
    n_sectors: int
    width: int
    sign: float

    exact = False

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (N n, 2H+1) for a right-hand side (N n, 2H+1)."""
        found = right.copy()
        in_waves = np.fft.rfft(right[:, : self.width].reshape(self.n_sectors, -1, 1), axis=0)
        solved = np.matmul(self.inverse, in_waves.astype(self.inverse.dtype))
        if self.back.size:
            blades = np.fft.irfft(np.matmul(self.seen, solved), self.n_sectors, axis=0)
            forces = (self.back @ blades.ravel()).reshape(blades.shape)
            solved -= np.matmul(self.moved, np.fft.rfft(forces, axis=0))
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
    ahead, behind = (side[:, 0].astype(complex) for side in (forward, backward))
    inverse, sign = np.empty((n_sectors // 2 + 1, n * width, n * width), np.complex64), 1.0
    seen, moved = list[ComplexArray](), list[ComplexArray]()
    for wave in range(n_sectors // 2 + 1):
        matrix = force.astype(complex)
        matrix[:, 0] += still[wave] @ motion[:, 0]
        one, other = (
            np.matmul(stiffness, side.transpose(1, 0, 2)).transpose(1, 0, 2)
            for stiffness, side in (
                (moving.waves[: width // 2, wave], forward),
                (moving.waves[: width // 2, -wave].conj(), backward),
            )
        )
        matrix[:, 1::2] += 0.5 * (one + other)
        matrix[:, 2::2] += 0.5j * (one - other)
        whole = matrix.reshape(n * width, n * width) + shift * np.eye(n * width)
        try:
            exact = np.linalg.inv(whole.astype(np.complex64))
        except np.linalg.LinAlgError:
            return None
        inverse[wave] = exact
        if wave in (0, n_sectors / 2):
            # the determinants of all other waves come in conjugate pairs
            sign *= float(np.linalg.slogdet(whole.real)[0])
        rows = moving.seen[0, wave] @ ahead, moving.seen[0, -wave].conj() @ behind
        seen.append(np.concatenate([0.5 * (rows[0] + rows[1]), 0.5j * (rows[0] - rows[1])]))
        pushed = _in_coefficients(moving.pushed[0, wave], moving.pushed[0, -wave].conj())
        moved.append(exact.reshape(-1, n, width)[:, :, 1:3].reshape(n * width, -1) @ pushed)
    back, turned = _blades(moving, np.array(seen), np.array(moved))
    single = partial(np.asarray, dtype=inverse.dtype)
    return RingFactor(inverse, single(seen), single(moved), back, n_sectors, width, sign * turned)


def _in_coefficients(ahead: ComplexArray, behind: ComplexArray) -> ComplexArray:
    """Forces (2 n, 2 m), cosine and sine of each displacement, of those of a blade, by L_q and conj(L_-q) (n, m)."""
    cosines, sines = 0.5 * (ahead + behind), 0.5j * (ahead - behind)
    both = np.concatenate([cosines, -sines], axis=1), np.concatenate([sines, cosines], axis=1)
    return np.asarray(np.stack(both, axis=1).reshape(2 * len(ahead), -1))


def _blades(moving: RingStiffness, seen: ComplexArray, moved: ComplexArray) -> tuple[FloatArray, float]:
    """Blades' forces by their amplitudes without these, (N 2 m, N 2 m), and the sign of the determinant they add."""
    if moving.deviating is None:
        return np.zeros((0, 0)), 1.0
    n, m = moving.n_sectors, seen.shape[1] // 2
    of_all = seen @ moved
    flexible = over_sectors(np.concatenate([of_all, of_all[1 : (n + 1) // 2][::-1].conj()]), real=True)
    stiff = moving.deviating[0].reshape(n, m, n, m)
    pair = np.array([[stiff.real, stiff.imag], [-stiff.imag, stiff.real]])
    strong = pair.transpose(2, 0, 3, 4, 1, 5).reshape(2 * n * m, 2 * n * m)
    whole = np.eye(len(strong)) + flexible @ strong
    return strong @ np.linalg.inv(whole), float(np.linalg.slogdet(whole)[0])
