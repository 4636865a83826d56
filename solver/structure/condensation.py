"""The linear structure at one frequency, condensed on the relative displacements of the contact pairs.

With the dynamic stiffness A = K + i n w C - (n w)^2 M of harmonic n, Eq. (1), the load f, and the displacements split
into those of the pairs (r) and all others (i),

    Z_r = A_rr - A_ri A_ii^-1 A_ir,      F_r = f_r - A_ri A_ii^-1 f_i.                                         (8)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np

from solver.model import ComplexArray, FloatArray, IntArray, LinearModel, Matrix, ReducedModel
from solver.structure.fourier import from_complex, to_complex
from solver.structure.harmonic_stiffness import DenseStiffness, SharedStiffness
from solver.structure.ring import RingStructure
from solver.structure.ring_motion import motion_of
from solver.structure.ring_stiffness import RingStiffness, condense_ring, stiffness_in_motions
from solver.structure.schur import condense, dynamic_stiffness, regular

DENSE_BYTES = 2e6
"""Bytes of the matrices of all harmonics up to which a product with each matrix is fastest. Half and twice: dovetail,
waves and blocks are equal."""

CACHED_STRUCTURES = 8
"""Condensed structures in the cache. A wear history with its errors uses six."""


@dataclass(frozen=True, eq=False)
class CondensedStructure:
    """`Z_r u + lambda = F_r` for each harmonic, Eq. (8), and the responses as functions of u.

    The `n_rel` relative displacements u are ordered pair by pair: closing, tangent 1, tangent 2, as far as they exist.

    - static_stiffness (n_rel, n_rel), moving: static Z_r, N/m, and Z_r at the H harmonics above the static one.
    - force_h (n_rel, 2H+1): F_r, N.
    - static_response (n_response, n_rel), dynamic_response (H, n_response, n_rel): responses per relative displacement.
    - static_offset, harmonic_offset (n_response,): responses to the loads with u = 0, m.
    - drive (n_rel,), drive_offset: `drive . u + drive_offset` is `F^H x`, N m, of harmonic load and displacements x.
    """

    static_stiffness: FloatArray
    moving: DenseStiffness | SharedStiffness | RingStiffness
    force_h: FloatArray
    static_response: FloatArray
    dynamic_response: ComplexArray
    static_offset: FloatArray
    harmonic_offset: ComplexArray
    drive: ComplexArray
    drive_offset: complex

    @property
    def dynamic_stiffness(self) -> ComplexArray:
        """Z_r (H, n_rel, n_rel), N/m, at the harmonics above the static one."""
        return self.moving.dense

    @property
    def harmonic_force(self) -> ComplexArray:
        """Amplitude (n_rel,) of F_r in the lowest harmonic, N."""
        return to_complex(self.force_h)[:, 0]

    def apply(self, displacement_h: FloatArray, *, roughly: bool = False) -> FloatArray:
        """`Z_r u` of Eq. (8), N, (n_rel, 2H+1) from u (n_rel, 2H+1), m.

        roughly: in single precision, which takes 0.5 to 0.7 of the time, but for the static part: a joint that slides
        as a whole moves far.
        """
        moving = self.moving.single if roughly else self.moving
        return from_complex(self.static_stiffness @ displacement_h[:, 0], moving.apply(displacement_h))

    def apply_transposed(self, force_h: FloatArray) -> FloatArray:
        """The transpose of `apply`, as a real matrix, times y (n_rel, 2H+1)."""
        return from_complex(self.static_stiffness.T @ force_h[:, 0], self.moving.apply_transposed(force_h))

    def response_h(self, displacement_h: FloatArray) -> FloatArray:
        """Responses (n_response, 2H+1), m, from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        amplitudes = np.matmul(self.dynamic_response, moving)[:, :, 0].T
        if amplitudes.shape[1]:
            amplitudes[:, 0] += self.harmonic_offset
        return from_complex(self.static_response @ displacement_h[:, 0] + self.static_offset, amplitudes)

    def input_work(self, displacement_h: FloatArray) -> float:
        """Work of the excitation over a period, N m, from u (n_rel, 2H+1), m."""
        return float(-np.pi * np.imag(self.drive @ to_complex(displacement_h)[:, 0] + self.drive_offset))


def build_structure(
    model: ReducedModel, omega: float, excitation_amplitude: float, orders: tuple[int, ...]
) -> CondensedStructure:
    """Condense the structure at a frequency, rad/s, with an excitation amplitude, N, in harmonic 1.

    orders: harmonics above the static one, ascending.
    Raises SingularStructureError where the structure with a stuck joint is singular at a harmonic.
    """
    structures = tuple(model.harmonic_structure(harmonic) for harmonic in (0, *orders))
    return _condensed(structures, tuple(model.contact.relative.tolist()), omega, excitation_amplitude, orders)


@lru_cache(maxsize=CACHED_STRUCTURES)
def _condensed(
    structures: tuple[LinearModel, ...],
    relative: tuple[int, ...],
    omega: float,
    excitation_amplitude: float,
    orders: tuple[int, ...],
) -> CondensedStructure:
    """As `build_structure`, from the structure of each harmonic, the static one included."""
    still, first, at = structures[0], structures[min(1, len(orders))], np.array(relative, np.intp)
    if isinstance(still, RingStructure):
        rings = cast("tuple[RingStructure, ...]", structures)
        with regular(f"at {omega / (2.0 * np.pi):.6g} Hz, at one of its harmonics, or at rest"):
            return CondensedStructure(**condense_ring(rings, at, omega, excitation_amplitude, orders))
    n_rel, parts = at.size, (still.mass, still.damping, still.stiffness, still.response)
    alike = all(each is still for each in structures) and not any(np.iscomplexobj(part) for part in parts)
    # not where much lies behind the joint: a `SharedStiffness` has to read that, too
    shares = alike and 16 * len(orders) * n_rel**2 > DENSE_BYTES and len(still.mass) <= 2 * n_rel
    rates, load = omega * np.array(orders, np.float64), excitation_amplitude * first.load_harmonic
    with regular(f"at {omega / (2.0 * np.pi):.6g} Hz, at one of its harmonics, or at rest"):
        static_stiffness, static_force, static_response, static_offset = _static(still, relative)
        if shares:
            moving, force, rows, offset = _condense_shared(still, at, rates, load)
        else:
            moving, force, rows, offset = _condense_each(structures, at, rates, orders, load)
    amplitudes = np.zeros((n_rel, len(orders)), complex)
    amplitudes[:, :1] = force[:, None]
    return CondensedStructure(
        static_stiffness=static_stiffness,
        moving=moving,
        force_h=from_complex(static_force, amplitudes),
        static_response=static_response,
        dynamic_response=rows[:, :-1],
        static_offset=static_offset,
        harmonic_offset=offset[:-1],
        drive=rows[0, -1] if orders else np.zeros(n_rel, complex),
        drive_offset=complex(offset[-1]),
    )


@lru_cache(maxsize=2)
def _static(linear: LinearModel, relative: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """As `Condensed`, of the static structure, which is the same at all frequencies."""
    found = condense(
        np.real(linear.stiffness), np.array(relative, np.intp), linear.load_static, np.real(linear.response)
    )
    return tuple(np.ascontiguousarray(np.real(part), np.float64) for part in found)


Moving = tuple[DenseStiffness | SharedStiffness, ComplexArray, ComplexArray, ComplexArray]
"""Z_r; F_r (n_rel,) of harmonic 1; responses and then `F^H x` per u, (H, n_response + 1, n_rel), and with u = 0 in
harmonic 1, (n_response + 1,)."""


def _condense_each(
    structures: tuple[LinearModel, ...],
    relative: IntArray,
    rates: FloatArray,
    orders: tuple[int, ...],
    load: ComplexArray,
) -> Moving:
    """A matrix for each harmonic, at the rates n w (H,), rad/s. load (n,): of harmonic 1, N."""
    n_rel, n_rows, exponents = relative.size, len(structures[0].response) + 1, 1j * rates[:, None, None]
    stiffness, rows = (np.empty((len(orders), n, n_rel), complex) for n in (n_rel, n_rows))
    force, offset = np.zeros(n_rel, complex), np.zeros(n_rows, complex)
    for linear in dict.fromkeys(structures[1:]):
        # all harmonics of a structure at once: a third of the time for a slider
        places = np.array([place for place, each in enumerate(structures[1:]) if each is linear])
        loads = np.where(np.array(orders)[places, None] == 1, load, 0.0)
        responses = np.broadcast_to(linear.response, (len(places), *linear.response.shape))
        seen = np.concatenate([responses, loads.conj()[:, None]], axis=1)
        found = condense(dynamic_stiffness(linear, exponents[places], ...), relative, loads, cast("Matrix", seen))
        stiffness[places], rows[places] = found.stiffness, found.rows
        if orders[places[0]] == 1:
            force, offset = found.force[0], found.offset[0]
    return DenseStiffness(stiffness), force, rows, offset


def _condense_shared(linear: LinearModel, relative: IntArray, rates: FloatArray, load: ComplexArray) -> Moving:
    """As `_condense_each`, of a real structure, with matrices shared by all harmonics."""
    others = np.setdiff1d(np.arange(load.size), relative)
    exponents: ComplexArray = np.asarray(1j * rates[:, None, None], complex)
    rows = np.vstack([linear.response, load.conj()])
    inner, to_pairs = (dynamic_stiffness(linear, exponents, np.ix_(others, at)) for at in (others, relative))
    compliance = cast("ComplexArray", np.linalg.inv(inner))
    by_pairs = rows[:, relative] - rows[:, others] @ compliance @ to_pairs
    behind = compliance[0] @ load[others]
    force = load[relative] - dynamic_stiffness(linear, 1j * float(rates[0]), np.ix_(relative, others)) @ behind
    return SharedStiffness(linear, relative, rates, compliance), force, by_pairs, rows[:, others] @ behind


def condensed_at(
    structures: Sequence[LinearModel], exponents: ComplexArray, relative: IntArray, loads: ComplexArray
) -> tuple[FloatArray, DenseStiffness | RingStiffness, ComplexArray]:
    """Z_r (n_rel, n_rel) of the first structure, real, and of the others, and F_r (1 + H, n_rel), in motions exp(s t).

    exponents (1 + H,): s, 1/s. loads (1 + H, n): N.
    """
    each = [*zip(structures, exponents.tolist(), loads, strict=True)]
    if isinstance(structures[0], RingStructure):
        rings = cast("Sequence[RingStructure]", structures)
        motions = [(motion_of(of, rate, relative), load) for of, rate, load in each]
        # less the forces by which the others, that move under the load, push the pairs
        force = np.array([(load - of.force(of.behind(load)))[relative] for of, load in motions])
        return *stiffness_in_motions(rings, exponents, relative), force
    found = [condense(dynamic_stiffness(of, rate, ...), relative, load) for of, rate, load in each]
    moving = DenseStiffness(np.array([one.stiffness for one in found[1:]]))
    return np.real(found[0].stiffness), moving, np.array([one.force for one in found])


# --- all displacements, and their change with the frequency ---


def whole_motion(
    linear: LinearModel, exponent: complex, relative: IntArray, load: ComplexArray, moved: ComplexArray
) -> ComplexArray:
    """All displacements (n, ...), m, whose relative ones are `moved` (n_rel, ...), m, under a load (n, ...), N.

    Both change with exp(s t); exponent: s, 1/s, `i n w` in harmonic n.
    Raises SingularStructureError where the structure with a stuck joint is singular.
    """
    given = np.zeros(load.shape, complex)
    given[relative] = moved
    of = motion_of(linear, exponent, relative)
    with regular(f"at {abs(exponent) / (2.0 * np.pi):.6g} Hz"):
        return given + of.behind(load - of.force(given))


@dataclass(frozen=True)
class FrequencySlope:
    """Derivatives by the frequency, rad/s, at given relative displacements u and contact forces.

    force (n_rel, 2H+1): of `Z_r u - F_r`, N. product: of `F^H x` in harmonic 1, N m. response (n_response,): of the
    responses in harmonic 1, m. slip_work (n_contact,): of that of the pairs, J, where they are masses.
    """

    force: FloatArray
    product: complex
    response: ComplexArray
    slip_work: FloatArray


def frequency_slope(
    model: ReducedModel, omega: float, excitation_amplitude: float, orders: tuple[int, ...], displacement_h: FloatArray
) -> FrequencySlope:
    """Change of a structure with the frequency; arguments as in `build_structure`, and u (n_rel, 2H+1), m.

    With the change `A' = i n C - 2 n^2 w M` of the dynamic stiffness and all displacements x under given u,

        x_i' = -A_ii^-1 (A' x)_i,      (Z_r u - F_r)' = (A' x)_r + A_ri x_i'.

    A difference of two condensations is not accurate: behind a joint that sticks A_ii is nearly singular close to the
    resonance that is followed.
    """
    relative, moving = model.contact.relative, to_complex(displacement_h)
    force, product = np.zeros((relative.size, len(orders)), complex), 0.0 + 0.0j
    response = np.zeros(len(model.response_names), complex)
    for place, n in enumerate(orders):
        linear, rate = model.harmonic_structure(n), 1j * n * omega
        load = (excitation_amplitude if n == 1 else 0.0) * linear.load_harmonic
        of, x = motion_of(linear, rate, relative), np.zeros(load.size, complex)
        x[relative] = moving[:, place]
        with regular(f"at {n * omega / (2.0 * np.pi):.6g} Hz"):
            x += of.behind(load - of.force(x))
            slope = 1j * n * of.times("damping", x) - 2.0 * n**2 * omega * of.times("mass", x)
            turned = of.behind(-slope)
        force[:, place] = (slope + of.force(turned))[relative]
        if n == 1:
            product, response = complex(load.conj() @ turned), of.times("response", turned)
    still = np.zeros(relative.size), np.zeros(model.contact.n_contact)
    return FrequencySlope(from_complex(still[0], force), product, response, still[1])
