"""The condensed dynamic stiffness Z_r of Eq. (8) of a ring of sectors: wave by wave, and what the blades deviate.

In each wave the structure is condensed as that of a sector. A deviating blade adds the force `P^H g` on the amplitudes
`a = P x` of its modes, `g = kappa a` with `kappa = 2 delta + delta^2` of its sector. With the tuned structure's
amplitudes `Q u + a_f - C g` this is

    Z_r u + L W Q u = F_r - L W a_f,      W = kappa (1 + C kappa)^-1,

with small matrices over the sectors alone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
from scipy import fft

from solver.model import ComplexArray, FloatArray, IntArray, Matrix
from solver.structure.fourier import from_complex, to_complex
from solver.structure.ring import RingStructure, over_sectors


@dataclass(frozen=True)
class RingStiffness:
    """Z_r of N sectors at H harmonics above the static one; methods as in `DenseStiffness`.

    - waves (H, N, n, n): of the tuned sector with n relative displacements in each wave, N/m.
    - seen (H, N, m, n), pushed (H, N, n, m): Q and L. deviating (H, N m, N m): W, over the sectors; None where all
      blades are equal.
    """

    waves: ComplexArray
    seen: ComplexArray
    pushed: ComplexArray
    deviating: ComplexArray | None

    @property
    def n_sectors(self) -> int:
        """N."""
        return int(self.waves.shape[1])

    def apply(self, displacement_h: FloatArray) -> ComplexArray:
        """Amplitudes (N n, H), N, of `Z_r u` from u (N n, 2H+1), m: products in each wave, O(N log N)."""
        return self._product(to_complex(displacement_h), self.waves, self.seen, self.pushed, self.deviating)

    def apply_transposed(self, force_h: FloatArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        waves, seen, pushed = (np.conj(part.swapaxes(-2, -1)) for part in (self.waves, self.pushed, self.seen))
        deviating = None if self.deviating is None else np.conj(self.deviating.swapaxes(1, 2))
        return self._product(to_complex(force_h), waves, seen, pushed, deviating)

    def _product(
        self,
        amplitudes: ComplexArray,
        waves: ComplexArray,
        seen: ComplexArray,
        pushed: ComplexArray,
        deviating: ComplexArray | None,
    ) -> ComplexArray:
        n_orders, n, size, _ = waves.shape
        moved = amplitudes.T.reshape(n_orders, n, size, 1).astype(waves.dtype, copy=False)
        in_waves = fft.fft(moved, axis=1)
        force = np.matmul(waves, in_waves)
        if deviating is not None:
            blades = fft.ifft(np.matmul(seen, in_waves), axis=1)
            back = np.matmul(deviating, blades.reshape(n_orders, -1, 1)).reshape(blades.shape)
            force += np.matmul(pushed, fft.fft(back, axis=1))
        return cast("ComplexArray", fft.ifft(force, axis=1).reshape(n_orders, n * size).T)

    def block(self, count: int, rows: IntArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        deviating = None if self.deviating is None else self.deviating[:count]
        lowest = RingStiffness(self.waves[:count], self.seen[:count], self.pushed[:count], deviating)
        return lowest.dense[:, rows[:, None], rows]

    def solve(self, places: slice | IntArray, force: ComplexArray) -> ComplexArray:
        """As in `DenseStiffness`."""
        waves, seen, pushed = self.waves[places], self.seen[places], self.pushed[places]
        n_orders, n, size, _ = waves.shape
        moved = np.linalg.solve(waves, fft.fft(force.T.reshape(n_orders, n, size, 1), axis=1))
        if self.deviating is not None:
            # u = Z^-1 (force - L y) with y = W Q u
            deviating, softened = self.deviating[places], np.linalg.solve(waves, pushed)
            through = np.array([over_sectors(each) for each in seen @ softened])
            blades = fft.ifft(seen @ moved, axis=1).reshape(n_orders, -1, 1)
            system = np.eye(through.shape[-1]) + deviating @ through
            back = np.linalg.solve(system, deviating @ blades).reshape(n_orders, n, -1, 1)
            moved = moved - softened @ fft.fft(back, axis=1)
        return cast("ComplexArray", fft.ifft(moved, axis=1).reshape(n_orders, n * size).T)

    @property
    def dense(self) -> ComplexArray:
        """As in `DenseStiffness`; computed at each call."""
        found = []
        for place, waves in enumerate(self.waves):
            whole = over_sectors(waves)
            if self.deviating is not None:
                sides = over_sectors(self.pushed[place]), over_sectors(self.seen[place])
                whole = whole + sides[0] @ self.deviating[place] @ sides[1]
            found.append(whole)
        return np.array(found, complex).reshape(-1, *(2 * [self.n_sectors * self.waves.shape[-1]]))

    @cached_property
    def single(self) -> "RingStiffness":
        """As in `DenseStiffness`."""
        parts = (part if part is None else part.astype(np.complex64) for part in vars(self).values())
        return RingStiffness(*cast("Iterator[ComplexArray]", parts))


class RingOfHarmonic(NamedTuple):
    """One harmonic of a ring, condensed; N sectors with n relative displacements, k rows, m blade modes each.

    waves, seen, pushed, deviating: as in `RingStiffness`. force (N n,): F_r, N. rows (N k, N n), offset (N k,): of
    displacements u and with u = 0.
    """

    waves: ComplexArray
    seen: ComplexArray
    pushed: ComplexArray
    deviating: ComplexArray | None
    force: Matrix
    rows: Matrix
    offset: Matrix


def condense_harmonic(
    ring: RingStructure, relative: IntArray, exponent: complex, loads: ComplexArray, driven: FloatArray
) -> RingOfHarmonic:
    """Condensation of a ring's structure in one harmonic.

    relative (n,): of a sector. exponent: `i n w`, 1/s. loads (N, size): in each wave, N. driven (N,): of each sector.
    Raises numpy.linalg.LinAlgError where the structure with a stuck joint is singular.
    """
    n = relative.size
    parts = ring.stacked("stiffness"), ring.stacked("damping"), ring.stacked("mass")
    full = parts[0] + exponent * parts[1] + exponent**2 * parts[2]
    others = np.setdiff1d(np.arange(full.shape[-1]), relative)
    blade = ring.stacked("blade") if ring.deviates else np.zeros((len(full), 0, full.shape[-1]), complex)
    rows = np.concatenate([ring.stacked("response"), loads.conj()[:, None], blade], axis=1)
    pushes = np.concatenate([loads[:, :, None], blade.conj().swapaxes(1, 2)], axis=2)
    right = np.concatenate([full[:, others][..., relative], pushes[:, others]], axis=2)
    behind = np.linalg.solve(full[:, others][..., others], right)
    back, seen = full[:, relative][..., others] @ behind, rows[..., others] @ behind
    stiffness = full[:, relative][..., relative] - back[..., :n]
    force, pushed = np.split(pushes[:, relative] - back[..., n:], [1], axis=2)
    by_motion, (by_load, by_blade) = rows[..., relative] - seen[..., :n], np.split(seen[..., n:], [1], axis=2)
    k, m = rows.shape[1] - blade.shape[1], blade.shape[1]
    reduced, at_rest = over_sectors(force) @ driven, over_sectors(by_load[:, :k]) @ driven
    seen_rows = over_sectors(by_motion[:, :k])
    if not m:
        return RingOfHarmonic(stiffness, by_motion[:, k:], pushed, None, reduced, seen_rows, at_rest)
    strong = np.repeat(ring.stiffening, m)
    deviating = strong[:, None] * np.linalg.inv(np.eye(strong.size) + over_sectors(by_blade[:, k:]) * strong)
    loaded = deviating @ (over_sectors(by_load[:, k:]) @ driven)
    through = over_sectors(by_blade[:, :k])
    return RingOfHarmonic(
        stiffness,
        by_motion[:, k:],
        pushed,
        deviating,
        force=reduced - over_sectors(pushed) @ loaded,
        rows=seen_rows - through @ deviating @ over_sectors(by_motion[:, k:]),
        offset=at_rest - through @ loaded,
    )


def stiffness_in_motions(
    rings: Sequence[RingStructure], exponents: ComplexArray, relative: IntArray
) -> tuple[FloatArray, RingStiffness]:
    """Static Z_r (N n, N n), real, and Z_r of the other harmonics, in motions exp(s t) with the exponents (1 + H,)."""
    n_sectors, found = len(rings[0].waves), list[RingOfHarmonic]()
    of_sector, nothing = relative[: relative.size // n_sectors], np.zeros(len(rings[0].waves))
    for ring, exponent in zip(rings, exponents.tolist(), strict=True):
        loads = np.zeros((n_sectors, len(ring.waves[0].load_static)), complex)
        found.append(condense_harmonic(ring, of_sector, exponent, loads, nothing))
    return _assembled(found[0]), _stiffness_of(found[1:], n_sectors, of_sector.size)


def _assembled(rest: RingOfHarmonic) -> FloatArray:
    """Static stiffness (N n, N n), N/m, of all sectors."""
    stiffness = np.asarray(over_sectors(rest.waves, real=True), np.float64)
    if rest.deviating is not None:
        stiffness = stiffness + np.real(over_sectors(rest.pushed) @ rest.deviating @ over_sectors(rest.seen))
    return stiffness


def condense_ring(
    rings: tuple[RingStructure, ...], relative: IntArray, omega: float, amplitude: float, orders: tuple[int, ...]
) -> dict[str, Any]:
    """The fields of a `CondensedStructure`; arguments as in `build_structure`, the structure at rest first.

    relative (N n,): of all sectors. Raises numpy.linalg.LinAlgError where the structure is singular.
    """
    still, n_sectors = rings[0], len(rings[0].waves)
    of_sector = relative[: relative.size // n_sectors]
    loads = np.zeros((n_sectors, len(still.waves[0].load_static)), complex)
    loads[0] = still.waves[0].load_static
    rest = condense_harmonic(still, of_sector, 0.0, loads, np.ones(n_sectors))
    n_responses = rest.offset.size // n_sectors - 1
    force, found = np.zeros((relative.size, len(orders)), complex), list[RingOfHarmonic]()
    for place, (ring, order) in enumerate(zip(rings[1:], orders, strict=True)):
        loads = amplitude * ring.stacked("load_harmonic") * (order == 1)
        found.append(condense_harmonic(ring, of_sector, 1j * order * omega, loads, ring.driven))
        force[:, place] = found[-1].force
    rows = np.array([each.rows for each in found], complex).reshape(len(orders), n_sectors, n_responses + 1, -1)
    first = found[0] if found else None
    offset = np.zeros((n_sectors, n_responses + 1), complex) if first is None else first.offset.reshape(n_sectors, -1)
    drive, driven = rows[0, :, -1] if found else np.zeros((n_sectors, relative.size), complex), still.driven
    return {
        "static_stiffness": _assembled(rest),
        "moving": _stiffness_of(found, n_sectors, of_sector.size),
        "force_h": from_complex(np.real(rest.force), force),
        "static_response": _responses(np.real(rest.rows), n_sectors),
        "dynamic_response": rows[:, :, :-1].reshape(len(orders), -1, relative.size),
        "static_offset": _responses(np.real(rest.offset), n_sectors),
        "harmonic_offset": offset[:, :-1].ravel(),
        "drive": driven @ drive,
        "drive_offset": complex(driven @ offset[:, -1]),
    }


def _responses(rows: FloatArray, n_sectors: int) -> FloatArray:
    """Without the last row of each sector, that of its load; (N k, ...)."""
    each = rows.reshape(n_sectors, -1, *rows.shape[1:])[:, :-1]
    return np.ascontiguousarray(each.reshape(-1, *rows.shape[1:]))


def _stiffness_of(found: list[RingOfHarmonic], n_sectors: int, n: int) -> RingStiffness:
    """The stiffness of all harmonics (H,), of N sectors with n relative displacements."""
    if not found:
        waves, seen, pushed = (np.zeros((0, n_sectors, *size), complex) for size in ((n, n), (0, n), (n, 0)))
        return RingStiffness(waves, seen, pushed, None)
    waves, seen, pushed = (np.array([getattr(each, name) for each in found]) for name in ("waves", "seen", "pushed"))
    deviating = [each.deviating for each in found if each.deviating is not None]
    return RingStiffness(waves, seen, pushed, np.array(deviating) if deviating else None)
