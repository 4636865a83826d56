"""The linear structure at one frequency, condensed on the relative displacements of the contact pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np

from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray, LinearModel, Matrix, ReducedModel
from solver.structure.fourier import from_complex, to_complex
from solver.structure.harmonic_stiffness import DenseStiffness, HarmonicStiffness, SharedStiffness

DENSE_BYTES = 2e6
"""Bytes of the matrices of all harmonics up to which a product with each matrix is fastest (cache of the processor)."""

KEPT_STRUCTURES = 8
"""Condensed structures of a case in its cache. A wear history with its errors uses six."""


@dataclass(frozen=True, eq=False)
class CondensedStructure:
    """`Z_r u + lambda = F_r` for each harmonic, Eq. (8), and the responses as functions of u.

    The `n_rel` relative displacements u are ordered pair by pair: closing, tangent 1, tangent 2, as far as they exist.

    - static_stiffness (n_rel, n_rel): static Z_r, N/m.
    - moving: Z_r at the H harmonics above the static one.
    - static_force (n_rel,): static F_r, N.
    - harmonic_force (n_rel,): complex F_r of harmonic 1, N, for the actual excitation amplitude.
    - static_response (n_response, n_rel), dynamic_response (H, n_response, n_rel): responses per relative displacement.
    - static_offset (n_response,), harmonic_offset (n_response,) complex: responses to the loads with u = 0, m.
    - drive (n_rel,), drive_offset: complex; `drive . u + drive_offset` is `conj(F) . x`, N m, of the harmonic load F
      and the displacements x.
    """

    static_stiffness: FloatArray
    moving: HarmonicStiffness
    static_force: FloatArray
    harmonic_force: ComplexArray
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

    def force_h(self) -> FloatArray:
        """Reduced force F_r of Eq. (8), (n_rel, 2H+1), N."""
        amplitudes = np.zeros((self.static_force.size, len(self.dynamic_response)), complex)
        if amplitudes.shape[1]:
            amplitudes[:, 0] = self.harmonic_force
        return from_complex(self.static_force, amplitudes)

    def apply(self, displacement_h: FloatArray) -> FloatArray:
        """`Z_r u` of Eq. (8), N, (n_rel, 2H+1) from u (n_rel, 2H+1), m."""
        return from_complex(self.static_stiffness @ displacement_h[:, 0], self.moving.apply(displacement_h))

    def apply_roughly(self, displacement_h: FloatArray) -> FloatArray:
        """`Z_r u` to at least three digits in less time, for directions of Newton's method.

        A product takes 0.088 ms (48 pairs, 9 harmonics) and 3.9 ms (336 pairs, 13 harmonics), `apply` 0.133 and 7.8.
        """
        # a joint that slides as a whole moves far: the static part in double precision
        return from_complex(self.static_stiffness @ displacement_h[:, 0], self.moving.single.apply(displacement_h))

    def response_h(self, displacement_h: FloatArray) -> FloatArray:
        """Responses (n_response, 2H+1), m, from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        amplitudes = np.matmul(self.dynamic_response, moving)[:, :, 0].T
        if amplitudes.shape[1]:
            amplitudes[:, 0] += self.harmonic_offset
        return from_complex(self.static_response @ displacement_h[:, 0] + self.static_offset, amplitudes)

    def input_work(self, displacement_h: FloatArray) -> float:
        """Work of the excitation over a period, N m, from u (n_rel, 2H+1), m."""
        if not len(self.dynamic_response):
            return 0.0
        return float(-np.pi * np.imag(self.drive @ to_complex(displacement_h)[:, 0] + self.drive_offset))


def relative_indices(contact: ContactInterface) -> tuple[IntArray, IntArray]:
    """Indices (n_rel,) of the relative displacements in the linear model and component indices `3 pair + component`."""
    components = np.flatnonzero(contact.dofs.ravel() >= 0)
    return contact.dofs.ravel()[components], components


def build_structure(
    model: ReducedModel, omega: float, excitation_amplitude: float, orders: tuple[int, ...]
) -> CondensedStructure:
    """Condense the dynamic stiffness `K + i n w C - (n w)^2 M`, Eq. (1), at the harmonics n to Z_r of Eq. (8).

    omega: w, rad/s. excitation_amplitude: N, in harmonic 1. orders: harmonics above the static one, ascending.
    Raises numpy.linalg.LinAlgError where the structure with its joint held is singular at a harmonic.
    """
    relative, _ = relative_indices(model.contact)
    still = model.linear[0]
    first = model.harmonic_structure(1) if orders else still
    n, n_rel = len(still.mass), relative.size
    # not where much lies behind the joint: a `SharedStiffness` has to read that, too
    shares = 16 * len(orders) * n_rel**2 > DENSE_BYTES and n <= 2 * n_rel
    real = not any(np.iscomplexobj(part) for part in (still.mass, still.damping, still.stiffness, still.response))
    if shares and first is still and real and not model.nodal_diameter:
        moving = _condense_shared(still, relative, omega * np.array(orders, np.float64), excitation_amplitude)
    else:
        moving = _condense_each(model, relative, omega, excitation_amplitude, orders)
    return CondensedStructure(**_static(still, tuple(relative.tolist())), **moving)


@lru_cache(maxsize=2)
def _static(linear: LinearModel, relative: tuple[int, ...]) -> dict[str, Any]:
    """The static attributes of a `CondensedStructure`, which are the same at all frequencies."""
    chosen = np.array(relative, np.intp)
    found = condense(np.real(linear.stiffness), chosen, linear.load_static)
    rows = np.real(linear.response)[:, relative_first(len(linear.mass), chosen)]
    of_pairs, of_others = np.split(rows, [chosen.size], axis=1)
    return {
        "static_stiffness": np.asarray(np.real(found.stiffness)),
        "static_force": np.asarray(np.real(found.force)),
        "static_response": np.asarray(np.real(of_pairs - of_others @ found.behind)),
        "static_offset": np.asarray(np.real(of_others @ found.held)),
    }


def _condense_each(
    model: ReducedModel, relative: IntArray, omega: float, excitation_amplitude: float, orders: tuple[int, ...]
) -> dict[str, Any]:
    """The other attributes, with a matrix for each harmonic; arguments as in `build_structure`."""
    n_rel, n_response = relative.size, model.linear[0].response.shape[0]
    every = relative_first(len(model.linear[0].mass), relative)
    stiffness = np.empty((len(orders), n_rel, n_rel), complex)
    response = np.empty((len(orders), n_response, n_rel), complex)
    (force, drive), offset, drive_offset = np.zeros((2, n_rel), complex), np.zeros(n_response, complex), 0.0 + 0.0j
    for linear, places in by_structure(model, orders):
        harmonics = np.array(orders)[places]
        load = np.where(harmonics[:, None] == 1, excitation_amplitude, 0.0) * linear.load_harmonic[every]
        found = _condense_ordered(dynamic_stiffness(linear, omega * harmonics, every, every), n_rel, load)
        stiffness[places] = found.stiffness
        of_pairs, of_others = linear.response[:, every[:n_rel]], linear.response[:, every[n_rel:]]
        response[places] = of_pairs - of_others @ found.behind
        if harmonics[0] == 1:
            force, offset = found.force[0], of_others @ found.held[0]
            drive = load[0, :n_rel].conj() - load[0, n_rel:].conj() @ found.behind[0]
            drive_offset = complex(load[0, n_rel:].conj() @ found.held[0])
    return {
        "moving": DenseStiffness(stiffness),
        "harmonic_force": force,
        "dynamic_response": response,
        "harmonic_offset": offset,
        "drive": drive,
        "drive_offset": drive_offset,
    }


def _condense_shared(
    linear: LinearModel, relative: IntArray, rates: FloatArray, excitation_amplitude: float
) -> dict[str, Any]:
    """As `_condense_each`, of a real structure, with matrices shared by all harmonics, at the rates n w (H,), rad/s."""
    others = relative_first(len(linear.mass), relative)[relative.size :]
    compliance = cast("ComplexArray", np.linalg.inv(dynamic_stiffness(linear, rates, others, others)))
    coupling = dynamic_stiffness(linear, rates, others, relative)
    load, rows = excitation_amplitude * linear.load_harmonic, linear.response
    # effect of a unit load on the displacements behind the joint, on the responses and on the work of the excitation
    seen = rows[:, others] @ compliance
    by_load = load[others].conj() @ compliance[0]
    held = compliance[0] @ load[others]
    return {
        "moving": SharedStiffness(linear, relative, others, rates, compliance),
        "harmonic_force": load[relative] - dynamic_stiffness(linear, rates[:1], relative, others)[0] @ held,
        "dynamic_response": rows[:, relative] - seen @ coupling,
        "harmonic_offset": rows[:, others] @ held,
        "drive": load[relative].conj() - by_load @ coupling[0],
        "drive_offset": complex(load[others].conj() @ held),
    }


def dynamic_stiffness(linear: LinearModel, rates: FloatArray, rows: IntArray, columns: IntArray) -> ComplexArray:
    """Rows and columns of `K + i r C - r^2 M`, (H, n_rows, n_columns), N/m, at the rates r (H,), rad/s."""
    at, rate = np.ix_(rows, columns), rates[:, None, None]
    mass, damping, stiffness = linear.mass[at], linear.damping[at], linear.stiffness[at]
    if any(np.iscomplexobj(part) for part in (stiffness, damping, mass)):
        return cast("ComplexArray", stiffness + 1j * rate * damping - rate**2 * mass)
    full = np.empty((rates.size, rows.size, columns.size), complex)
    full.real, full.imag = stiffness - rate**2 * mass, rate * damping
    return full


def whole_motion(
    linear: LinearModel, exponent: complex, relative: IntArray, load: ComplexArray, moved: ComplexArray
) -> ComplexArray:
    """All displacements (n, ...), m, whose relative ones are `moved` (n_rel, ...), m, under a load (n, ...), N.

    For motions and loads with exp(s t), s the `exponent`, 1/s: `i n w` in harmonic n of a periodic motion.
    Raises numpy.linalg.LinAlgError where the structure with its joint held is singular.
    """
    every, n_rel = relative_first(len(linear.mass), relative), relative.size
    others, whole = every[n_rel:], np.zeros(load.shape, complex)
    whole[relative] = moved
    if others.size:
        at = np.ix_(others, every)
        rows = linear.stiffness[at] + exponent * linear.damping[at] + exponent**2 * linear.mass[at]
        whole[others] = np.linalg.solve(rows[:, n_rel:], load[others] - rows[:, :n_rel] @ moved)
    return whole


def by_structure(model: ReducedModel, orders: tuple[int, ...]) -> Iterator[tuple[LinearModel, IntArray]]:
    """Each linear model with the indices of its harmonics in `orders`."""
    seen = [model.harmonic_structure(harmonic) for harmonic in orders]
    for number, linear in enumerate(seen):
        same = [other is linear for other in seen]
        if same.index(True) == number:
            yield linear, np.flatnonzero(same)


class Condensed(NamedTuple):
    """Matrices (..., n, n) and loads (..., n) reduced to the relative displacements u (n_rel,).

    - stiffness (..., n_rel, n_rel): Schur complement, N/m.
    - force (..., n_rel): reduced load, N.
    - behind (..., n_i, n_rel): the other displacements, ascending, for a unit u, with the sign reversed.
    - held (..., n_i): the other displacements under the load with u = 0, m.
    """

    stiffness: Matrix
    force: Matrix
    behind: Matrix
    held: Matrix


def condense(full: Matrix, relative: IntArray, load: Matrix) -> Condensed:
    """Condensation of stiffnesses `full` (..., n, n), N/m, and loads (..., n), N, on some displacements (n_rel,).

    Raises numpy.linalg.LinAlgError where the block of the other displacements is singular.
    """
    every = relative_first(full.shape[-1], relative)
    return _condense_ordered(full[..., every[:, None], every], relative.size, load[..., every])


def relative_first(n: int, relative: IntArray) -> IntArray:
    """Indices (n,) of all displacements, the relative ones first, then the others, ascending."""
    others = np.ones(n, bool)
    others[relative] = False
    return np.concatenate([relative, np.flatnonzero(others)])


def _condense_ordered(full: Matrix, n_rel: int, load: Matrix) -> Condensed:
    """As `condense`, of matrices whose first n_rel displacements are the relative ones."""
    right = np.concatenate([full[..., n_rel:, :n_rel], load[..., n_rel:, None]], axis=-1)
    solved = cast("Matrix", np.linalg.solve(full[..., n_rel:, n_rel:], right))
    back = full[..., :n_rel, n_rel:] @ solved
    return Condensed(
        full[..., :n_rel, :n_rel] - back[..., :-1],
        load[..., :n_rel] - back[..., -1],
        solved[..., :-1],
        solved[..., -1],
    )
