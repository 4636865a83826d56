"""The linear structure at one frequency, condensed on the relative displacements of the contact pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.harmonics import from_complex, to_complex
from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray, Matrix, ReducedModel


@dataclass(frozen=True)
class CondensedStructure:
    """`Z_r u + lambda = F_r` per harmonic, Eq. (8), and how responses follow from u.

    `n_rel` relative displacements, in the order pair by pair: closing, tangent 1, tangent 2, those that exist.

    static_stiffness (n_rel, n_rel): N/m. dynamic_stiffness (H, n_rel, n_rel) complex: harmonics 1..H, N/m.
    static_force (n_rel,): N. harmonic_force (n_rel,) complex: N, harmonic 1, for the actual excitation amplitude.
    static_response (n_response, n_rel), dynamic_response (H, n_response, n_rel): responses per relative displacement.
    static_offset (n_response,), harmonic_offset (n_response,) complex: responses to the loads with u = 0, m.
    """

    static_stiffness: FloatArray
    dynamic_stiffness: ComplexArray
    static_force: FloatArray
    harmonic_force: ComplexArray
    static_response: FloatArray
    dynamic_response: ComplexArray
    static_offset: FloatArray
    harmonic_offset: ComplexArray

    def force_h(self) -> FloatArray:
        """Reduced force F_r (n_rel, 2H+1), N."""
        amplitudes = np.zeros((self.static_force.size, self.dynamic_stiffness.shape[0]), complex)
        if amplitudes.shape[1]:
            amplitudes[:, 0] = self.harmonic_force
        return from_complex(self.static_force, amplitudes)

    def apply(self, displacement_h: FloatArray) -> FloatArray:
        """`Z_r u`, N, (n_rel, 2H+1) from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        force = np.matmul(self.dynamic_stiffness, moving)[:, :, 0].T
        return from_complex(self.static_stiffness @ displacement_h[:, 0], force)

    def response_h(self, displacement_h: FloatArray) -> FloatArray:
        """Responses (n_response, 2H+1), m, from u (n_rel, 2H+1), m."""
        moving = np.ascontiguousarray(to_complex(displacement_h).T)[:, :, None]
        amplitudes = np.matmul(self.dynamic_response, moving)[:, :, 0].T
        if amplitudes.shape[1]:
            amplitudes[:, 0] += self.harmonic_offset
        return from_complex(self.static_response @ displacement_h[:, 0] + self.static_offset, amplitudes)


def relative_indices(contact: ContactInterface) -> tuple[IntArray, IntArray]:
    """Indices of the relative displacements in the linear model, (n_rel,), and their slots `3 pair + component`."""
    slots = np.flatnonzero(contact.dofs.ravel() >= 0)
    return contact.dofs.ravel()[slots], slots


def build_structure(
    model: ReducedModel, omega: float, excitation_amplitude: float, n_harmonics: int
) -> CondensedStructure:
    """Dynamic stiffness `K + i n w C - (n w)^2 M` of every harmonic, condensed; omega in rad/s, amplitude in N.

    Raises numpy.linalg.LinAlgError where the structure with its joint held is singular at a harmonic.
    """
    relative, _ = relative_indices(model.contact)
    still = model.linear[0]
    static = condense(np.real(still.stiffness), relative, still.load_static)
    n_response = still.response.shape[0]
    stiffness = np.empty((n_harmonics, relative.size, relative.size), complex)
    response = np.empty((n_harmonics, n_response, relative.size), complex)
    force, offset = np.zeros(relative.size, complex), np.zeros(n_response, complex)
    for harmonic in range(1, n_harmonics + 1):
        linear, conjugate = model.harmonic_structure(harmonic)
        frequency = harmonic * omega
        full = linear.stiffness + 1j * frequency * linear.damping - frequency**2 * linear.mass
        share = excitation_amplitude if harmonic == 1 else 0.0
        moving = condense(full, relative, share * linear.load_harmonic)
        rows = linear.response @ moving.motion
        stiffness[harmonic - 1] = moving.stiffness.conj() if conjugate else moving.stiffness
        response[harmonic - 1] = rows.conj() if conjugate else rows
        if harmonic == 1:
            force, offset = moving.force, linear.response @ moving.held_motion
            if conjugate:
                force, offset = force.conj(), offset.conj()
    return CondensedStructure(
        static_stiffness=np.real(static.stiffness),
        dynamic_stiffness=stiffness,
        static_force=np.real(static.force),
        harmonic_force=force,
        static_response=np.real(still.response @ static.motion),
        dynamic_response=response,
        static_offset=np.real(still.response @ static.held_motion),
        harmonic_offset=offset,
    )


@dataclass(frozen=True)
class Condensed:
    """A matrix (n, n) and a load (n,) reduced to the relative displacements u (n_rel,).

    stiffness (n_rel, n_rel): Schur complement, N/m. force (n_rel,): reduced load, N. motion (n, n_rel): all
    displacements that follow a unit u. held_motion (n,): displacement under the load with u = 0, m.
    """

    stiffness: Matrix
    force: Matrix
    motion: Matrix
    held_motion: Matrix


def condense(full: Matrix, relative: IntArray, load: Matrix) -> Condensed:
    """Static condensation of one (dynamic) stiffness; raises numpy.linalg.LinAlgError where the rest is singular."""
    n = full.shape[0]
    internal = np.setdiff1d(np.arange(n), relative)
    motion: Matrix = np.zeros_like(full, shape=(n, relative.size))
    motion[relative, np.arange(relative.size)] = 1.0
    held_motion = np.zeros(n, np.result_type(full, load))
    stiffness: Matrix = full[np.ix_(relative, relative)]
    force: Matrix = load[relative]
    if internal.size:
        right = np.column_stack([full[np.ix_(internal, relative)], load[internal]])
        solved = np.linalg.solve(full[np.ix_(internal, internal)], right)
        motion[internal], held_motion[internal] = -solved[:, :-1], solved[:, -1]
        coupling = full[np.ix_(relative, internal)]
        stiffness = stiffness + coupling @ motion[internal]
        force = force - coupling @ held_motion[internal]
    return Condensed(stiffness, force, motion, held_motion)
