"""Alternating frequency-time method: predicted force to samples, contact law, contact force back to harmonics.

The contact law of all pairs of a joint through one period, elastic and inertial pairs each by their own kernel, and the
exact derivative of the contact force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK, friction_limit, mean_normal_force, mean_normal_tangent
from solver.contact.options import CONTACT
from solver.contact.period_march import integrate_slip_work, march_period
from solver.contact.rigid_slider import march_masses
from solver.contact.tangent import march_tangent, mass_tangent
from solver.model import FloatArray, IntArray
from solver.options import COMMON
from solver.structure.joint import Joint


@dataclass(frozen=True)
class Marched:
    """Contact forces and states of the pairs under a predicted force, at N samples.

    - predicted_t (n_contact, 3, N): predicted force, N; tangential ones of inertial pairs as means over the steps.
    - force_t (n_contact, 3, N): contact force, N, compression positive; means for inertial pairs as in predicted_t.
    - force_h (n_contact, 3, m): harmonics of the contact force, N.
    - state_t (n_contact, 2, N+1): tangential state, N, beginning with the start of the period; for inertial pairs the
      displacement, m.
    - start (n_contact, 2): tangential state at the start of the first period, N; for inertial pairs the velocity at the
      start of the last period, m/s.
    - status_t (n_contact, N): SEPARATED, STICK or SLIP.
    - periods (n_contact,): number of periods that were marched.
    - periodicity_error: change of the tangential state over the last period, N.
    - slip_work (n_contact,): integral of normal force times slip distance over a period, J. Archard's wear is
      proportional to this integral, which is no work of a force (`solver.contact.archard`).
    """

    predicted_t: FloatArray
    force_t: FloatArray
    force_h: FloatArray
    state_t: FloatArray
    start: FloatArray
    status_t: IntArray
    periods: IntArray
    periodicity_error: float
    slip_work: FloatArray


def march_law(joint: Joint, predicted_h: FloatArray, history: FloatArray) -> Marched:
    """March all pairs through the period: predicted force (n_contact, 3, m), N, tangential history (n_contact, 2), m.

    Elastic pairs follow Eqs. (11)-(15), inertial pairs `solver.contact.rigid_slider`.
    """
    basis, friction = joint.basis, joint.friction_coefficient
    predicted_t = predicted_h @ basis.synthesis
    start = history * joint.penalty.tangential[:, None]
    limit = friction_limit(friction, np.maximum(predicted_t[:, 0].max(axis=1), 0.0))
    # a hundredth of the usual tolerance of the residual, 1e-8, so that the residual does not show the change
    periodicity = 0.1 * COMMON.round_off * float(limit.max(initial=0.0))
    inertial = np.flatnonzero(joint.penalty.inertial)
    if inertial.size == 0:
        force_t, state_t, status_t, periods, error = march_period(
            predicted_t, friction, start, periodicity, CONTACT.most_periods
        )
        slip_work = integrate_slip_work(force_t, state_t) / joint.penalty.tangential
        force_h = force_t @ basis.analysis
    else:
        elastic = np.flatnonzero(~joint.penalty.inertial)
        factor = joint.step_mean_factor()
        predicted_t[inertial, 1:] = (predicted_h[inertial, 1:] * factor) @ basis.synthesis
        force_t, status_t = np.zeros_like(predicted_t), np.zeros(predicted_t.shape[::2], np.int64)
        state_t = np.zeros((predicted_t.shape[0], 2, basis.n_samples + 1))
        periods = np.ones(predicted_t.shape[0], np.int64)
        error, slip_work = np.zeros(predicted_t.shape[0]), np.zeros(predicted_t.shape[0])
        force_t[elastic], state_t[elastic], status_t[elastic], periods[elastic], error[elastic] = march_period(
            predicted_t[elastic], friction[elastic], start[elastic], periodicity, CONTACT.most_periods
        )
        slip_work[elastic] = integrate_slip_work(force_t[elastic], state_t[elastic]) / joint.penalty.tangential[elastic]
        force_t[inertial], velocity_t, state_t[inertial], status_t[inertial], slip_work[inertial], error[inertial] = (
            march_masses(predicted_t[inertial], friction[inertial], *_masses(joint, inertial), joint.sample_step)
        )
        start[inertial] = velocity_t[:, :, 0]
        force_h = force_t @ basis.analysis
        force_h[inertial, 1:] /= factor
    force_h[:, 0] = mean_normal_force(predicted_t) @ basis.analysis
    return Marched(
        predicted_t=predicted_t,
        force_t=force_t,
        force_h=force_h,
        state_t=state_t,
        start=start,
        status_t=status_t,
        periods=periods,
        periodicity_error=float(error.max(initial=0.0)),
        slip_work=slip_work,
    )


def friction_work(joint: Joint, at: Marched) -> FloatArray:
    """Work that friction dissipates in a period (n_contact,), J. The friction force is at its limit during slip."""
    return friction_limit(joint.friction_coefficient, at.slip_work)


def law_tangent(joint: Joint, at: Marched) -> tuple[FloatArray, FloatArray]:
    """Exact derivatives with respect to the harmonics of the predicted force of each pair, including the periodicity.

    Returns the derivatives of the harmonics of the contact force (n_contact, 3m, 3m), dimensionless, and of the slip
    work (n_contact, 3m), m.
    """
    basis, friction, m = joint.basis, joint.friction_coefficient, joint.basis.synthesis.shape[0]
    n_contact = at.predicted_t.shape[0]
    force_tangent, slip_work_tangent = np.zeros((n_contact, 3 * m, 3 * m)), np.zeros((n_contact, 3 * m))
    has_tangent = (joint.contact.dofs[:, 1:] >= 0).any(axis=1)
    # a pair that sticks during the whole period transmits the predicted force, an open pair transmits nothing; but the
    # start of a period that was marched more than once may depend on the force
    stuck = (at.status_t == STICK).all(axis=1) & (at.periods == 1)
    switching = ~(stuck | (at.status_t == SEPARATED).all(axis=1))
    harmonics = np.arange(3 * m)
    force_tangent[np.ix_(stuck & joint.has_normal, harmonics[:m], harmonics[:m])] = np.eye(m)
    # tangential displacements that do not exist count as sticking
    force_tangent[np.ix_(stuck | ~has_tangent, harmonics[m:], harmonics[m:])] = np.eye(2 * m)
    inertial = np.flatnonzero(joint.penalty.inertial & switching)
    elastic = np.flatnonzero(~joint.penalty.inertial & has_tangent & switching)
    if elastic.size:
        force_tangent[elastic], slip_work_tangent[elastic] = march_tangent(
            at.predicted_t[elastic],
            friction[elastic],
            at.start[elastic],
            at.state_t[elastic],
            at.periods[elastic],
            joint.line[elastic],
            basis.synthesis,
            basis.analysis,
            joint.has_normal[elastic],
        )
        slip_work_tangent[elastic] /= joint.penalty.tangential[elastic, None]
    if inertial.size:
        factor = joint.step_mean_factor()
        force_tangent[inertial], slip_work_tangent[inertial] = mass_tangent(
            at.predicted_t[inertial],
            friction[inertial],
            *_masses(joint, inertial),
            joint.sample_step,
            at.start[inertial],
            basis.synthesis,
            basis.synthesis * factor[:, None],
            basis.analysis / factor,
            joint.has_normal[inertial],
        )
    normal = np.flatnonzero(joint.has_normal & switching)
    if normal.size:
        force_tangent[normal, :m, :m] = mean_normal_tangent(
            at.predicted_t[normal], basis.synthesis, basis.analysis, joint.has_normal[normal]
        )
    return force_tangent, slip_work_tangent


def _masses(joint: Joint, inertial: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Mass, drag and line of the inertial pairs, arguments of `rigid_slider.march_masses`."""
    return joint.penalty.mass[inertial], joint.penalty.drag[inertial], joint.line[inertial]
