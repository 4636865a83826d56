"""The linear structure at one frequency, condensed on the relative displacements of the contact pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np

from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray, LinearModel, Matrix, ReducedModel
from solver.structure.fourier import from_complex, to_complex
from solver.structure.harmonic_stiffness import DenseStiffness, HarmonicStiffness, share_matrices
from solver.structure.identity import Identity
from solver.structure.options import STRUCTURE
from solver.structure.rough_forms import multiply_roughly


@dataclass(frozen=True)
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
        """Stiffness (H, n_rel, n_rel), N/m, at the harmonics above the static one."""
        return self.moving.dense

    @property
    def n_harmonics(self) -> int:
        """Number H of harmonics above the static one."""
        return len(self.dynamic_response)

    def force_h(self) -> FloatArray:
        """Reduced force F_r of Eq. (8), (n_rel, 2H+1), N."""
        amplitudes = np.zeros((self.static_force.size, self.n_harmonics), complex)
        if amplitudes.shape[1]:
            amplitudes[:, 0] = self.harmonic_force
        return from_complex(self.static_force, amplitudes)

    def apply(self, displacement_h: FloatArray) -> FloatArray:
        """`Z_r u` of Eq. (8), N, (n_rel, 2H+1) from u (n_rel, 2H+1), m."""
        force = self.moving.apply(displacement_h)
        return from_complex(self.static_stiffness @ displacement_h[:, 0], force)

    def apply_roughly(self, displacement_h: FloatArray) -> FloatArray:
        """`Z_r u` to at least three digits in less time, for directions of Newton's method."""
        static = np.ascontiguousarray(self.static_stiffness)
        return multiply_roughly(static, self.moving.rough, np.ascontiguousarray(displacement_h))

    def response_h(self, displacement_h: FloatArray) -> FloatArray:
        """Responses (n_response, 2H+1), m, from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        amplitudes = np.matmul(self.dynamic_response, moving)[:, :, 0].T
        if amplitudes.shape[1]:
            amplitudes[:, 0] += self.harmonic_offset
        return from_complex(self.static_response @ displacement_h[:, 0] + self.static_offset, amplitudes)

    def input_work(self, displacement_h: FloatArray) -> float:
        """Work of the excitation over a period, N m, from u (n_rel, 2H+1), m."""
        if not self.n_harmonics:
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

    Parameters
    ----------
    model : ReducedModel
        Matrices, loads and contact pairs.
    omega : float
        Angular frequency w, rad/s.
    excitation_amplitude : float
        Amplitude, N.
    orders : tuple of int
        Harmonics above the static one, ascending, beginning with 1. The excitation acts in harmonic 1.

    Raises
    ------
    numpy.linalg.LinAlgError
        The structure with its joint held is singular at a harmonic.
    """
    relative, _ = relative_indices(model.contact)
    still = model.linear[0]
    static = _static(Identity(still), tuple(relative.tolist()))
    first = model.harmonic_structure(1)[0] if orders else still
    n_bytes = 16 * len(orders) * relative.size**2
    small = n_bytes <= max(STRUCTURE.dense_bytes, _shared_bytes(len(still.mass), relative.size, len(orders)))
    if not small and first is still and _is_real(still) and not model.nodal_diameter:
        moving = _condense_shared(still, relative, omega * np.array(orders, np.float64), excitation_amplitude)
    else:
        moving = _condense_each(model, relative, omega, excitation_amplitude, orders)
    return CondensedStructure(
        static_stiffness=np.real(static.stiffness),
        static_force=np.real(static.force),
        static_response=np.real(still.response @ static.motion),
        static_offset=np.real(still.response @ static.held_motion),
        **vars(moving),
    )


def _shared_bytes(n: int, n_rel: int, n_harmonics: int) -> int:
    """Bytes that a product with a `SharedStiffness` reads: many where much lies behind the joint."""
    behind = n - n_rel
    return 24 * (n + behind) * n_rel + 16 * n_harmonics * behind**2


@lru_cache(maxsize=2)
def _static(structure: Identity, relative: tuple[int, ...]) -> Condensed:
    """Static condensation of a linear model, which is the same at all frequencies."""
    linear = cast("LinearModel", structure.objects[0])
    return condense(np.real(linear.stiffness), np.array(relative, np.intp), linear.load_static)


@dataclass(frozen=True)
class _Moving:
    """The attributes of a `CondensedStructure` for the harmonics above the static one."""

    moving: HarmonicStiffness
    harmonic_force: ComplexArray
    dynamic_response: ComplexArray
    harmonic_offset: ComplexArray
    drive: ComplexArray
    drive_offset: complex


def _condense_each(
    model: ReducedModel, relative: IntArray, omega: float, excitation_amplitude: float, orders: tuple[int, ...]
) -> _Moving:
    """Condensation with a matrix for each harmonic; arguments as in `build_structure`."""
    n_response = model.linear[0].response.shape[0]
    stiffness = np.empty((len(orders), relative.size, relative.size), complex)
    response = np.empty((len(orders), n_response, relative.size), complex)
    force, offset = np.zeros(relative.size, complex), np.zeros(n_response, complex)
    drive, drive_offset = np.zeros(relative.size, complex), 0.0 + 0.0j
    for (linear, conjugate), places in by_structure(model, orders):
        every = relative_first(len(linear.mass), relative)
        # a folded nodal diameter has conjugate matrices, not the conjugate of the sum: damping remains positive
        mass, damping, elastic, shape, rows = (
            (part.conj() if conjugate else part)[..., every]
            for part in (linear.mass, linear.damping, linear.stiffness, linear.load_harmonic, linear.response)
        )
        harmonics = np.array(orders)[places]
        full = dynamic_stiffness(elastic[every], damping[every], mass[every], omega * harmonics)
        load = np.where(harmonics[:, None] == 1, excitation_amplitude, 0.0) * shape
        moving = _condense_ordered(full, relative.size, load)
        stiffness[places] = moving.stiffness
        of_pairs, of_others = rows[:, : relative.size], rows[:, relative.size :]
        response[places] = of_pairs - of_others @ moving.behind
        if harmonics[0] == 1:
            force, offset = moving.force[0], of_others @ moving.held[0]
            drive = load[0, : relative.size].conj() - load[0, relative.size :].conj() @ moving.behind[0]
            drive_offset = complex(load[0, relative.size :].conj() @ moving.held[0])
    return _Moving(DenseStiffness(stiffness), force, response, offset, drive, drive_offset)


def _condense_shared(
    linear: LinearModel, relative: IntArray, rates: FloatArray, excitation_amplitude: float
) -> _Moving:
    """Condensation of a real structure with matrices shared by all harmonics, at the rates n w (H,), rad/s."""
    n = linear.mass.shape[0]
    internal = np.setdiff1d(np.arange(n), relative)
    rate = rates[:, None, None]

    def block(rows: IntArray, columns: IntArray) -> ComplexArray:
        stiffness, damping, mass = (
            part[rows[:, None], columns] for part in (linear.stiffness, linear.damping, linear.mass)
        )
        return cast("ComplexArray", stiffness + 1j * rate * damping - rate**2 * mass)

    compliance = cast("ComplexArray", np.linalg.inv(block(internal, internal)))
    coupling = block(internal, relative)
    load, rows = excitation_amplitude * linear.load_harmonic, linear.response
    # effect of a unit load on the displacements behind the joint, on the responses and on the work of the excitation
    seen = rows[:, internal] @ compliance
    by_load = load[internal].conj() @ compliance[0]
    held = compliance[0] @ load[internal]
    return _Moving(
        moving=share_matrices(linear, relative, internal, rates, compliance),
        harmonic_force=load[relative] - block(relative, internal)[0] @ held,
        dynamic_response=rows[:, relative] - seen @ coupling,
        harmonic_offset=rows[:, internal] @ held,
        drive=load[relative].conj() - by_load @ coupling[0],
        drive_offset=complex(load[internal].conj() @ held),
    )


def dynamic_stiffness(stiffness: Matrix, damping: Matrix, mass: Matrix, rates: FloatArray) -> ComplexArray:
    """`K + i r C - r^2 M` (H, n, n) at the rates r (H,), rad/s."""
    rate = rates[:, None, None]
    if any(np.iscomplexobj(part) for part in (stiffness, damping, mass)):
        return cast("ComplexArray", stiffness + 1j * rate * damping - rate**2 * mass)
    full = np.empty((rates.size, *stiffness.shape), complex)
    full.real, full.imag = stiffness - rate**2 * mass, rate * damping
    return full


def _is_real(linear: LinearModel) -> bool:
    return not any(np.iscomplexobj(part) for part in (linear.mass, linear.damping, linear.stiffness, linear.response))


def by_structure(model: ReducedModel, orders: tuple[int, ...]) -> Iterator[tuple[tuple[LinearModel, bool], IntArray]]:
    """Each linear model (and whether its conjugate is meant) with the indices of its harmonics in `orders`."""
    seen = [model.harmonic_structure(harmonic) for harmonic in orders]
    for number, (linear, conjugate) in enumerate(seen):
        same = [other is linear and folded == conjugate for other, folded in seen]
        if same.index(True) == number:
            yield (linear, conjugate), np.flatnonzero(same)


@dataclass(frozen=True)
class Condensed:
    """Matrices (..., n, n) and loads (..., n) reduced to the relative displacements u (n_rel,).

    - stiffness (..., n_rel, n_rel): Schur complement, N/m.
    - force (..., n_rel): reduced load, N.
    - motion (..., n, n_rel): all displacements for a unit u.
    - held_motion (..., n): all displacements under the load with u = 0, m.
    """

    stiffness: Matrix
    force: Matrix
    motion: Matrix
    held_motion: Matrix


def condense(full: Matrix, relative: IntArray, load: Matrix) -> Condensed:
    """Condensation of static or dynamic stiffnesses on some displacements (Schur complement).

    Parameters
    ----------
    full : array (..., n, n)
        Stiffness, N/m.
    relative : array (n_rel,)
        Indices of the displacements that remain.
    load : array (..., n)
        Load, N.

    Raises
    ------
    numpy.linalg.LinAlgError
        The block of the other displacements is singular.
    """
    every = relative_first(full.shape[-1], relative)
    ordered = _condense_ordered(full[..., every[:, None], every], relative.size, load[..., every])
    motion = cast("Matrix", np.zeros((*full.shape[:-1], relative.size), full.dtype))
    motion[..., relative, np.arange(relative.size)] = 1.0
    motion[..., every[relative.size :], :] = -ordered.behind
    held_motion = np.zeros((*full.shape[:-2], full.shape[-1]), ordered.held.dtype)
    held_motion[..., every[relative.size :]] = ordered.held
    return Condensed(ordered.stiffness, ordered.force, motion, held_motion)


def relative_first(n: int, relative: IntArray) -> IntArray:
    """Indices (n,) of all displacements, the relative ones first."""
    others = np.ones(n, bool)
    others[relative] = False
    return np.concatenate([relative, np.flatnonzero(others)])


class _Ordered(NamedTuple):
    """Condensation of matrices whose first displacements are the relative ones.

    - stiffness, force: as in `Condensed`.
    - behind (..., n_i, n_rel): the other displacements for a unit u, with the sign reversed.
    - held (..., n_i): the other displacements under the load with u = 0, m.
    """

    stiffness: Matrix
    force: Matrix
    behind: Matrix
    held: Matrix


def _condense_ordered(full: Matrix, n_rel: int, load: Matrix) -> _Ordered:
    """As `condense`, of matrices whose first n_rel displacements are the relative ones."""
    right = np.concatenate([full[..., n_rel:, :n_rel], load[..., n_rel:, None]], axis=-1)
    solved = cast("Matrix", np.linalg.solve(full[..., n_rel:, n_rel:], right))
    back = full[..., :n_rel, n_rel:] @ solved
    return _Ordered(
        full[..., :n_rel, :n_rel] - back[..., :-1],
        load[..., :n_rel] - back[..., -1],
        solved[..., :-1],
        solved[..., -1],
    )
