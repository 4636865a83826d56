"""All Fourier coefficients and time signals of a periodic state, of every displacement of the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.structure.condensation import relative_indices, whole_motion
from solver.structure.fourier import derivative, from_complex, to_complex
from solver.structure.joint import Joint


@dataclass(frozen=True)
class PeriodicMotion:
    """A periodic motion of a joint: Fourier coefficients, complex, and signals at N times of a period.

    Harmonic k is Re(value exp(i k omega t)); the first coefficient is the mean, which is real.

    - frequency, excitation_amplitude: Hz, N.
    - orders (H+1,): harmonics, 0 first.
    - displacement (n, H+1): all displacements of the model, m.
    - response (n_response, H+1): reported responses, m.
    - relative_displacement (n_contact, 3, H+1): of the pairs, m: closing, first and second tangent.
    - contact_force (n_contact, 3, H+1): N, compression positive.
    - time (N,): s, from 0 on: the samples at which the contact law is applied.
    - displacement_t, velocity_t (n, N), response_t (n_response, N): m and m/s, sums of the Fourier series.
    - contact_force_t (n_contact, 3, N): N, by the contact law; means over a time step for masses on rigid ground.
    - status_t (n_contact, N): 0 open, 1 sticking, 2 slipping.
    - residual: scaled residual of the balance, dimensionless: above the tolerance the motion is no solution.
    """

    frequency: float
    excitation_amplitude: float
    orders: IntArray
    displacement: ComplexArray
    response: ComplexArray
    relative_displacement: ComplexArray
    contact_force: ComplexArray
    time: FloatArray
    displacement_t: FloatArray
    velocity_t: FloatArray
    response_t: FloatArray
    contact_force_t: FloatArray
    status_t: IntArray
    residual: float


def periodic_motion(joint: Joint, at: Evaluation) -> PeriodicMotion:
    """The motion of a state. A joint's displacements behind its pairs follow from the condensation of each harmonic."""
    basis = joint.basis
    moved = joint.to_relative(at.displacement_h)
    displacement_h = _all_displacements(joint, moved)
    response_h = joint.structure.response_h(moved)
    rates = joint.omega * np.array(basis.orders, np.float64)
    return PeriodicMotion(
        frequency=joint.omega / (2.0 * np.pi),
        excitation_amplitude=joint.excitation_amplitude,
        orders=np.array((0, *basis.orders), np.int64),
        displacement=_coefficients(displacement_h),
        response=_coefficients(response_h),
        relative_displacement=_coefficients(joint.to_pairs(moved)),
        contact_force=_coefficients(at.force_h),
        time=np.asarray(joint.law.sample_step * np.arange(basis.n_samples)),
        displacement_t=displacement_h @ basis.synthesis,
        velocity_t=derivative(displacement_h, rates) @ basis.synthesis,
        response_t=response_h @ basis.synthesis,
        contact_force_t=at.force_t.copy(),
        status_t=at.status_t.copy(),
        residual=at.scaled_residual(),
    )


def _coefficients(values_h: FloatArray) -> ComplexArray:
    return np.concatenate([values_h[..., :1].astype(np.complex128), to_complex(values_h)], axis=-1)


def _all_displacements(joint: Joint, moved: FloatArray) -> FloatArray:
    """Displacements (n, 2H+1), m, of the whole model from the relative displacements (n_rel, 2H+1), m."""
    relative, _ = relative_indices(joint.contact)
    found = []
    for order, amplitude in zip((0, *joint.basis.orders), _coefficients(moved).T, strict=True):
        linear = joint.model.harmonic_structure(order)
        none = np.zeros(len(linear.mass), np.complex128)
        load = {0: linear.load_static + none, 1: joint.excitation_amplitude * linear.load_harmonic}.get(order, none)
        found.append(whole_motion(linear, 1j * order * joint.omega, relative, load, amplitude))
    return from_complex(np.real(found[0]), np.array(found[1:]).reshape(-1, len(found[0])).T)
