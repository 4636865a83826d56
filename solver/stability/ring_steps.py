"""Steps in time of a disturbance of all sectors of a ring at one time: the structure wave by wave, O(N log N)."""

from dataclasses import dataclass

import numpy as np

from solver.model import BoolArray, ComplexArray, FloatArray, IntArray
from solver.structure.ring import RingStructure, over_sectors


@dataclass(frozen=True)
class RingSteps:
    """Motion of N sectors, with k displacements and r rows of switching pairs each, in a step of BDF2.

    - by_given (N // 2 + 1, k, 2k), by_force (N // 2 + 1, k, r): of the tuned ring in each wave, from the known parts of
      acceleration and velocity, m per sample, and from forces, N.
    - blade (N // 2 + 1, m, k), moved (N // 2 + 1, k, m), back (N m, N m): amplitudes of the blades, motion under their
      forces, and these forces by the amplitudes without them; m is 0 where all blades are equal.
    """

    by_given: ComplexArray
    by_force: ComplexArray
    blade: ComplexArray
    moved: ComplexArray
    back: FloatArray
    n_sectors: int

    @property
    def n_moving(self) -> int:
        """N k."""
        return self.n_sectors * int(self.by_given.shape[1])

    def motion(self, by: ComplexArray, *pushed: FloatArray) -> FloatArray:
        """Motion (N k, j), m, by `by_given` and known parts, both (N k, j), or by `by_force` and forces (N r, j)."""
        in_waves = by @ np.concatenate([self._in_waves(each) for each in pushed], axis=1)
        if self.back.size:
            blades = self._over_sectors(self.blade @ in_waves)
            in_waves -= self.moved @ self._in_waves(self.back @ blades)
        return self._over_sectors(in_waves)

    def _in_waves(self, values: FloatArray) -> ComplexArray:
        return np.asarray(np.fft.rfft(values.reshape(self.n_sectors, -1, values.shape[1]), axis=0))

    def _over_sectors(self, in_waves: ComplexArray) -> FloatArray:
        return np.fft.irfft(in_waves, self.n_sectors, axis=0).reshape(-1, in_waves.shape[2])


def build_steps(
    structure: RingStructure, moves: BoolArray, rows: IntArray, step: float
) -> tuple[RingSteps, None, FloatArray]:
    """Steps of `step` seconds, and the motion (N r, N r) of the switching pairs under their unit forces, m/N.

    moves (N n,): displacements that move. rows (N r,): of the switching pairs among them, -1 for none; both equal in
    all sectors. Raises numpy.linalg.LinAlgError where the structure is singular.
    """
    n_sectors = len(structure.waves)
    moves, rows = moves[: moves.size // n_sectors], rows[: rows.size // n_sectors]
    there = rows >= 0
    inertia, drag, stiffness = (
        structure.stacked(name)[:, moves][:, :, moves] * over
        for name, over in (("mass", step**-2), ("damping", 1.0 / step), ("stiffness", 1.0))
    )
    flexible = np.linalg.inv(2.25 * inertia + 1.5 * drag + stiffness)
    seen = np.where(there[:, None], flexible[:, rows], 0.0)
    by_force = np.where(there, flexible[:, :, rows], 0.0)
    blade = structure.stacked("blade")[:, :, moves] if structure.deviates else seen[:, :0]
    moved = flexible @ blade.conj().swapaxes(1, 2)
    under_force, back = over_sectors(np.where(there, seen[:, :, rows], 0.0), real=True), np.zeros((0, 0))
    if structure.deviates:
        strong = np.repeat(structure.stiffening, blade.shape[1])
        back = strong[:, None] * np.linalg.inv(np.eye(strong.size) + over_sectors(blade @ moved, real=True) * strong)
        at_rows = np.where(there[:, None], moved[:, rows], 0.0)
        sides = over_sectors(at_rows, real=True), over_sectors(blade @ by_force, real=True)
        under_force = under_force - sides[0] @ back @ sides[1]
    half = slice(n_sectors // 2 + 1)
    by_given = -flexible @ np.concatenate([inertia, drag], axis=2)
    steps = RingSteps(by_given[half], by_force[half], blade[half], moved[half], np.asarray(back, np.float64), n_sectors)
    return steps, None, np.asarray(under_force, np.float64)
