"""The linear structure at one frequency, condensed on the relative displacements of the contact pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.harmonics import from_complex, to_complex
from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray, LinearModel, Matrix, ReducedModel


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
    linear, _ = model.harmonic_structure(0)
    static, static_coupling, static_offset = condense(np.real(linear.stiffness), relative, linear.load_static)
    stiffness, force, response, offset = [], np.zeros(relative.size, complex), [], np.zeros(0, complex)
    offset = np.zeros(linear.response.shape[0], complex)
    for harmonic in range(1, n_harmonics + 1):
        linear, conjugate = model.harmonic_structure(harmonic)
        frequency = harmonic * omega
        full = linear.stiffness + 1j * frequency * linear.damping - frequency**2 * linear.mass
        load = excitation_amplitude * linear.load_harmonic if harmonic == 1 else np.zeros(full.shape[0], complex)
        reduced, coupling, reaction = condense(full, relative, load)
        rows = _response_rows(linear, relative, coupling)
        stiffness.append(reduced.conj() if conjugate else reduced)
        response.append(rows.conj() if conjugate else rows)
        if harmonic == 1:
            force = reaction[relative]
            offset = linear.response @ _held_displacement(reaction, relative)
    n_response = linear.response.shape[0]
    held = model.harmonic_structure(0)[0]
    return CondensedStructure(
        static_stiffness=static,
        dynamic_stiffness=np.array(stiffness, complex).reshape(n_harmonics, relative.size, relative.size),
        static_force=static_offset[relative],
        harmonic_force=force,
        static_response=np.real(_response_rows(held, relative, static_coupling)),
        dynamic_response=np.array(response, complex).reshape(n_harmonics, n_response, relative.size),
        static_offset=np.real(held.response @ _held_displacement(static_offset, relative)),
        harmonic_offset=offset,
    )


def condense(full: Matrix, relative: IntArray, load: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Schur complement of `full` (n, n) on `relative`, and what it takes to come back.

    Returns the reduced matrix (n_rel, n_rel); the motion (n, n_rel) that follows a unit relative displacement; and a
    vector (n,) with the condensed load at `relative` and the displacement under the load with u = 0 elsewhere.
    """
    n = full.shape[0]
    internal = np.setdiff1d(np.arange(n), relative)
    motion = np.zeros((n, relative.size), full.dtype)
    motion[relative, np.arange(relative.size)] = 1.0
    both = np.zeros(n, np.result_type(full, load))
    both[relative] = load[relative]
    reduced = full[np.ix_(relative, relative)]
    if internal.size:
        right = np.column_stack([full[np.ix_(internal, relative)], load[internal]])
        solved = np.linalg.solve(full[np.ix_(internal, internal)], right)
        motion[internal] = -solved[:, :-1]
        reduced = reduced + full[np.ix_(relative, internal)] @ motion[internal]
        both[internal] = solved[:, -1]
        both[relative] -= full[np.ix_(relative, internal)] @ both[internal]
    return reduced, motion, both


def _response_rows(linear: LinearModel, relative: IntArray, motion: Matrix) -> Matrix:
    return linear.response @ motion


def _held_displacement(both: Matrix, relative: IntArray) -> Matrix:
    held = both.copy()
    held[relative] = 0.0
    return held
