"""The contact law of all pairs of a joint through one period, its exact derivative, and the motion that goes with it.

Alternating frequency-time method: predicted force to samples, contact law, contact force back to harmonics. Pairs are
*elastic*, at displacement level with the motion `(p - lambda) / eps`, Eqs. (9)-(15) (`elastic_pairs`), or *inertial*,
masses directly on rigid ground that move by Newton's law (`sliding_masses`). `solver.structure.penalty` chooses.

For disturbances in time, the derivative is also given at the samples of a period. Let `p = lambda + x`, with the state
`x = eps u` of an elastic pair, A the derivative of x with respect to p, and B that with respect to x at the sample
before. Then `(1 - A) eps du - A dlambda = B eps du'`. For a mass `dlambda = T_p dp + T_v dv' + T_l mu dlambda_N` with
the derivatives T of its steps, and `dp = dlambda + gain dv - loss dv'`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.coulomb import SEPARATED, SLIP, STICK, friction_limit, mean_normal_force, mean_normal_tangent
from solver.contact.elastic_pairs import MOST_PERIODS, Period, by_columns, march_period, march_tangent, new_period
from solver.contact.sliding_masses import Masses, march_masses, mass_slopes, mass_tangent, step_gains
from solver.contact.slow_slide import Path, slide_along, slide_tangent
from solver.model import BoolArray, ComplexArray, ContactInterface, FloatArray, IntArray
from solver.settings import ROUND_OFF

if TYPE_CHECKING:
    from solver.structure.fourier import FourierBasis
    from solver.structure.penalty import Penalty


@dataclass(frozen=True)
class Marched:
    """Contact forces and states of the pairs under a predicted force, at N samples of the last period.

    - predicted_t, force_t (n_contact, 3, N): N, compression positive; tangential ones of inertial pairs are means over
      the steps. force_h (n_contact, 3, m): harmonics of the contact force, N.
    - state_t (n_contact, 2, N+1): tangential state, N of elastic and m of inertial pairs.
    - start (n_contact, 2): state at the start of the first period, N; of inertial pairs the velocity at the start, m/s.
    - slid (n_contact,): whether the pair slid there on the way from another state (`slow_slide`).
    - status_t (n_contact, N): SEPARATED, STICK or SLIP. periods (n_contact,): number of periods marched.
    - periodicity_error: change of the tangential state over the last period, N.
    - slip_work (n_contact,): integral of normal force times slip distance over a period, J.
    """

    predicted_t: FloatArray
    force_t: FloatArray
    force_h: FloatArray
    state_t: FloatArray
    start: FloatArray
    slid: BoolArray
    status_t: IntArray
    periods: IntArray
    periodicity_error: float
    slip_work: FloatArray

    @property
    def stuck(self) -> BoolArray:
        """Pairs (n_contact,) that stick during the whole period and transmit the predicted force."""
        # the start of a period that was marched more than once may depend on the force
        return np.asarray((self.status_t == STICK).all(axis=1) & (self.periods == 1) & ~self.slid)


@dataclass(frozen=True)
class ContactLaw:
    """The law of the pairs of a joint at one frequency omega, rad/s.

    friction_coefficient: (n_contact,). Harmonics are on the axis of length m = 2H+1. The tangential history
    (n_contact, 2), m, is the corrected slip X_T of an elastic pair and the mean position of an inertial one.
    """

    penalty: Penalty
    friction_coefficient: FloatArray
    contact: ContactInterface
    basis: FourierBasis
    omega: float

    @property
    def sample_step(self) -> float:
        """Time between two samples, s."""
        return 2.0 * np.pi / (self.omega * self.basis.n_samples)

    @cached_property
    def rate_dependent(self) -> bool:
        """Whether the law depends on velocities: where masses sit on rigid ground."""
        return bool(self.penalty.inertial.any())

    @property
    def masses(self) -> Masses:
        """The pairs as masses; elastic ones without meaning."""
        return Masses(self.penalty.mass, self.penalty.drag, self.contact.line, self.sample_step)

    # --- forces ---

    def march(self, predicted_h: FloatArray, history: FloatArray, first: FloatArray | None = None) -> Marched:
        """March all pairs through the period under a predicted force (n_contact, 3, m), N.

        first (n_contact, 3, N): predicted force, N, from which it has slowly come; None where it was always the same.
        """
        basis, inertial, penalty = self.basis, self.penalty.inertial, self.penalty
        predicted_t = predicted_h @ basis.synthesis
        predicted_t[inertial, 1:] = (predicted_h[inertial, 1:] * basis.step_mean) @ basis.synthesis
        start, slid = history * penalty.tangential[:, None], np.zeros(len(history), bool)
        if first is not None:
            path = Path(first, predicted_t, self.friction_coefficient, start)
            start = start.copy()
            slide_along(np.flatnonzero(~inertial), path, start)
            slid = (start != path.state).any(axis=1)
        period = new_period(predicted_t, self.friction_coefficient, start)
        limit = friction_limit(self.friction_coefficient, np.maximum(predicted_t[:, 0].max(axis=1), 0.0))
        # a hundredth of the usual tolerance of the residual, 1e-8, so that the residual does not show the change
        if not inertial.all():
            periodicity = 0.1 * ROUND_OFF * float(limit.max(initial=0.0))
            march_period(np.flatnonzero(~inertial), period, periodicity, MOST_PERIODS)
        if self.rate_dependent:
            march_masses(np.flatnonzero(inertial), period, self.masses)
        force_h = period.force_t @ basis.analysis
        force_h[inertial, 1:] /= basis.step_mean
        force_h[:, 0] = mean_normal_force(predicted_t) @ basis.analysis
        return Marched(
            predicted_t=predicted_t,
            force_t=period.force_t,
            force_h=force_h,
            state_t=period.state_t,
            start=period.start,
            slid=slid,
            status_t=period.status_t,
            periods=period.periods,
            periodicity_error=float(period.change.max(initial=0.0)),
            slip_work=period.slip_work / self.state_stiffness,
        )

    def period(self, at: Marched) -> Period:
        """The period that a march has left, for derivatives."""
        marched = at.predicted_t, self.friction_coefficient, at.start, at.force_t, at.state_t, at.status_t
        return Period(*marched, at.periods, at.slip_work, at.slip_work)

    def friction_work(self, at: Marched) -> FloatArray:
        """Work that friction dissipates in a period (n_contact,), J. Friction is at its limit during slip."""
        return friction_limit(self.friction_coefficient, at.slip_work)

    def tangent(
        self, at: Marched, history: FloatArray | None = None, first: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Exact derivatives by the harmonics of the predicted force of each pair, with the periodicity and, where the
        history and the `first` force of `march` are given, the way from there.

        Returns those of the harmonics of the contact force (n_contact, 3m, 3m), dimensionless, and of the slip work
        (n_contact, 3m), m. Entries of displacements that a pair does not have are without meaning.
        """
        contact, basis, inertial = self.contact, self.basis, self.penalty.inertial
        n_contact, size, stuck = contact.n_contact, 3 * len(basis.synthesis), at.stuck
        tangent, work_tangent = np.zeros((n_contact, size, size)), np.zeros((n_contact, size))
        # an open pair transmits nothing
        switching = ~(stuck | (at.status_t == SEPARATED).all(axis=1))
        slides = switching & (contact.dofs[:, 1:] >= 0).any(axis=1)
        starts = np.zeros((n_contact, 2, size))
        if first is not None and history is not None:
            path = Path(first, at.predicted_t, self.friction_coefficient, history * self.penalty.tangential[:, None])
            slide_tangent(np.flatnonzero(at.slid), path, basis.synthesis, starts)
        period, out = self.period(at), (tangent, work_tangent)
        basis_t, analysis_h = (part.T.copy() for part in (basis.synthesis, basis.analysis))
        by_column_t = by_columns(basis_t)
        if not inertial.all():
            march_tangent(np.flatnonzero(slides & ~inertial), period, starts, by_column_t, analysis_h, out)
        if self.rate_dependent:
            pairs, means = np.flatnonzero(slides & inertial), by_columns(basis_t * basis.step_mean)
            slopes, analysis = mass_slopes(pairs, period, self.masses), analysis_h / basis.step_mean[:, None]
            mass_tangent(pairs, period, slopes, self.sample_step, by_column_t, means, analysis, out)
        closing = np.flatnonzero(contact.has_normal & switching)
        mean_normal_tangent(closing, at.predicted_t, basis_t, analysis_h, tangent)
        tangent[stuck] = np.eye(size)
        return tangent, work_tangent / self.state_stiffness[:, None]

    # --- motion ---

    def motion(self, correction: FloatArray) -> FloatArray:
        """Motion (n_contact, 3, m, ...), m, relative to `origin`, from predicted less contact force, N, Eq. (12)."""
        return _scaled(correction, self.compliance)

    def force(self, motion: FloatArray) -> FloatArray:
        """Predicted less contact force (n_contact, 3, m), N, of a motion, m, Eqs. (10), (12); undoes `motion`."""
        return _scaled(motion, 1.0 / self.compliance)

    @cached_property
    def compliance(self) -> ComplexArray:
        """Displacement per force (n_contact, 3, H+1), m/N, in each harmonic: 1 / eps, or that of the marched masses."""
        penalty, inertial, orders = self.penalty, self.penalty.inertial, np.array(self.basis.orders, np.float64)
        found: ComplexArray = np.repeat((1.0 + 0.0j) / penalty.stiffness[:, :, None], orders.size + 1, axis=2)
        if orders.size:
            angle = np.pi * orders / self.basis.n_samples
            mass, drag, mean = (part[inertial, None] for part in (penalty.mass, penalty.drag, penalty.mean))
            impedance = 2j * mass * np.sin(angle) / self.sample_step + drag * np.cos(angle)
            moving = np.sin(angle) / angle / (1j * self.omega * orders * impedance)
            found[inertial, 1:] = np.concatenate([1.0 / mean, moving], axis=1)[:, None, :]
        return found

    def origin(self, history: FloatArray) -> FloatArray:
        """Mean tangential position (n_contact, 2), m, without mean force: the history of inertial pairs."""
        return np.where(self.penalty.inertial[:, None], history, 0.0)

    # --- tangential history ---

    @property
    def state_stiffness(self) -> FloatArray:
        """Tangential state over slip (n_contact,), N/m; 1 for inertial pairs."""
        return np.where(self.penalty.inertial, 1.0, self.penalty.tangential)

    def final_history(self, at: Marched, displacement_h: FloatArray) -> FloatArray:
        """Tangential history that a state leaves; displacement_h (n_contact, 3, m): its motion, m."""
        at_end = at.state_t[:, :, -1] / self.state_stiffness[:, None]
        return np.where(self.penalty.inertial[:, None], displacement_h[:, 1:, 0], at_end)

    def started_from(self, at: Marched, history: FloatArray) -> FloatArray:
        """The history (n_contact, 2), m, with which the periods of a state begin after the way from another history."""
        return np.where(at.slid[:, None], at.start / self.state_stiffness[:, None], history)

    def history_from(self, other: Penalty, history: FloatArray, mean: FloatArray, last: FloatArray) -> FloatArray:
        """The history of a state with another penalty.

        A pair that becomes inertial begins at its mean position (n_contact, 2), m, one that becomes elastic at its
        position `last` at the end of the period.
        """
        inertial = self.penalty.inertial
        changed = np.where(inertial[:, None], mean, last)
        return np.where((other.inertial == inertial)[:, None], history, changed)

    # --- masses on rigid ground: ratcheting, and harmonics above the highest one ---

    def drift(self, at: Marched) -> FloatArray:
        """Distance (n_contact, 2), m, by which inertial pairs move on in a period; 0 for elastic pairs."""
        return np.where(self.penalty.inertial[:, None], at.state_t[:, :, -1] - at.state_t[:, :, 0], 0.0)

    def change_force(self, at: Marched) -> FloatArray:
        """Change of the tangential state over the period (n_contact,), N; of a drift the mean force of drag."""
        change = np.hypot(*(at.state_t[:, :, -1] - at.state_t[:, :, 0]).T)
        drag = self.penalty.drag * self.omega / (2.0 * np.pi)
        return np.asarray(np.where(self.penalty.inertial, drag, 1.0) * change)

    def driving_force(self, at: Marched) -> float:
        """Largest force, N, that drives a sliding mass; 0 without masses."""
        return float(np.abs(at.predicted_t[self.penalty.inertial, 1:]).max(initial=0.0))

    def tail(self, at: Marched, basis: FourierBasis) -> FloatArray:
        """Friction on masses in other harmonics (n_contact, 3, 2k+1), N; 0 for elastic pairs."""
        inertial = self.penalty.inertial
        force_h = np.zeros((inertial.size, 3, basis.analysis.shape[1]))
        force_h[inertial, 1:] = at.force_t[inertial, 1:] @ basis.analysis / basis.step_mean
        return force_h

    def beyond_series(self, at: Marched, pairs: list[int], series_t: FloatArray) -> FloatArray:
        """Tangential motion of masses (n, 2, N), m, in harmonics that their series (n, 2, N), m, lacks, half a step
        before the samples.
        """
        added = np.where(self.penalty.inertial[pairs, None, None], at.state_t[pairs, :, :-1] - series_t, 0.0)
        return np.asarray(added - added.mean(axis=2, keepdims=True))


def _scaled(values_h: FloatArray, factor: ComplexArray) -> FloatArray:
    """Series (k, 3, m, ...) with their complex amplitudes times the factor (k, 3, H+1) of each harmonic."""
    tail = (1,) * (values_h.ndim - 3)
    real, imaginary = (part.reshape(*factor.shape, *tail) for part in (factor.real, factor.imag))
    cosine, sine = values_h[:, :, 1::2], values_h[:, :, 2::2]
    scaled = np.empty_like(values_h)
    scaled[:, :, 0] = real[:, :, 0] * values_h[:, :, 0]
    # a complex amplitude is cosine - i sine
    scaled[:, :, 1::2] = real[:, :, 1:] * cosine + imaginary[:, :, 1:] * sine
    scaled[:, :, 2::2] = real[:, :, 1:] * sine - imaginary[:, :, 1:] * cosine
    return scaled


# --- the derivative at the samples of a period ---


def sample_tangents(law: ContactLaw, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:
    """A (n, n_contact, 3, 3) and B (n, n_contact, 2, 2) of all pairs as elastic ones, at every `stride`-th sample.

    The normal state is predicted less contact force; the normal force is that at the sample, without the mean around.
    """
    predicted, status = at.predicted_t[:, :, ::stride], at.status_t[:, ::stride]
    limit = friction_limit(law.friction_coefficient[:, None], np.maximum(predicted[:, 0], 0.0))
    trial = predicted[:, 1:] - at.state_t[:, :, :-1:stride]
    size = np.hypot(trial[:, 0], trial[:, 1])
    slips = (status == SLIP) & (limit > 0.0) & (size > 0.0)
    inverse = np.divide(1.0, size, out=np.zeros_like(size), where=slips)
    unit, ratio = trial * inverse[:, None], np.where(slips, limit * inverse, status == STICK)
    carried = (np.eye(2)[:, :, None] - unit[:, :, None] * unit[:, None]) * ratio[:, None, None]
    own = np.zeros((len(status), 3, 3, status.shape[1]))
    own[:, 0, 0] = status == SEPARATED
    own[:, 1:, 1:] = np.eye(2)[:, :, None] - carried
    own[:, 1:, 0] = -(law.friction_coefficient * law.contact.has_normal)[:, None, None] * unit
    by_sample = 3, 0, 1, 2
    return np.ascontiguousarray(own.transpose(by_sample)), np.ascontiguousarray(carried.transpose(by_sample))


@dataclass(frozen=True)
class SampledLaw:
    """Derivative of the contact law of the p switching pairs at N samples, in blocks (N, p, 3, 3) of the pairs:

        by_force dlambda + by_motion du + by_speed dv = by_last_motion du' + by_last_speed dv'.

    A prime marks the sample before. Velocities are in m per sample.
    """

    by_force: FloatArray
    by_motion: FloatArray
    by_speed: FloatArray
    by_last_motion: FloatArray
    by_last_speed: FloatArray


def sampled_law(law: ContactLaw, at: Marched, pairs: IntArray) -> SampledLaw:
    """Derivative of the contact law of the switching pairs (p,) of a state."""
    n, penalty = at.status_t.shape[1], law.penalty
    own, carried = sample_tangents(law, at)
    eps = penalty.stiffness[pairs, None, :]
    there = law.contact.dofs[pairs] >= 0
    # a displacement that does not exist has no disturbance of the force
    passed = np.where(there[:, :, None] & there[:, None, :], own[:, pairs], -np.eye(3) * ~there[:, :, None])
    last = np.zeros((n, pairs.size, 3, 3))
    last[:, :, 1:, 1:] = carried[:, pairs]
    none = np.zeros_like(last)
    found = SampledLaw(-passed, (np.eye(3) - passed) * eps, none, last * eps, none.copy())
    for place in np.flatnonzero(penalty.inertial[pairs]):
        _take_mass_law(found, int(place), law, at, int(pairs[place]))
    return found


def _take_mass_law(found: SampledLaw, place: int, law: ContactLaw, at: Marched, pair: int) -> None:
    """Tangential rows of the law of a mass, in place; place: index among the switching pairs."""
    step, line = law.sample_step, int(law.contact.line[pair])
    gain, loss = step_gains(law.penalty.mass[pair], law.penalty.drag[pair], step)
    there = np.array([0, 1]) if line < 0 else np.array([line])
    rows, friction = 1 + there, float(law.friction_coefficient[pair])
    limit = friction_limit(friction, np.maximum(at.predicted_t[pair, 0], 0.0))
    slopes = mass_slopes(np.array([pair]), law.period(at), law.masses)[0][0]
    by_predicted, by_before = (slopes[:, there[:, None], first + there] for first in (0, 2))
    block = (slice(None), place, rows[:, None], rows)
    for part in (found.by_force, found.by_motion, found.by_last_motion):
        part[:, place, rows] = 0.0
    found.by_force[block] = np.eye(there.size) - by_predicted
    if law.contact.has_normal[pair]:
        found.by_force[:, place, rows, 0] = np.where(limit[:, None] > 0.0, -friction * slopes[:, there, 4], 0.0)
    found.by_speed[block] = -gain / step * by_predicted
    found.by_last_speed[block] = (by_before - loss * by_predicted) / step
