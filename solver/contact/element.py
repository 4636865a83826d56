"""What a contact law is to a joint: the law of some pairs through one period, its derivatives, and what it remembers.

A law maps the *predicted* force p of a pair to the contact force lambda and the motion `u = (p - lambda) / eps`, Eqs.
(9)-(12). `march` does so for the samples of a period, and `sample_tangents` has its derivative at a sample: with the
state `x = p - lambda = eps u`, A the derivative of x by p and B that by x at the sample before. All else follows; a law
replaces what it computes faster, or what is different for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.contact.coulomb import OTHER, STICK, friction_limit
from solver.model import BoolArray, ComplexArray, FloatArray, IntArray
from solver.outcome import check

if TYPE_CHECKING:
    from solver.structure.fourier import FourierBasis
    from solver.structure.penalty import Penalty

Tangents = tuple[FloatArray, FloatArray, FloatArray]
"""Derivatives by the harmonics of the predicted force: of those of the contact force (n, 3m, 3m), dimensionless, and of
the slip work (n, 3m); and by the friction coefficient: of the harmonics of the contact force, N, and of the slip work,
J, one after the other (n, 3m + 1)."""


@dataclass(frozen=True)
class Marched:
    """Contact forces and states of n pairs under a predicted force, at N samples of the last period.

    - predicted_t, force_t (n, 3, N): N, compression positive; tangential ones of masses are means over the steps.
      force_h (n, 3, m): harmonics of the contact force, N.
    - state_t (n, 2, N+1): tangential state, over `state_stiffness` the slip, m.
    - start (n, 2): state at the start of the first period, N; of masses the velocity at the start, m/s.
    - slid (n,): whether the pair slid there on the way from another state (`slow_slide`).
    - status_t (n, N): SEPARATED, STICK or SLIP; OTHER of a law without these. periods (n,): number of periods marched.
    - periodicity_error: change of the tangential state over the last period, N.
    - slip_work (n,): integral of normal force times slip distance over a period, J.
    - inner (n, q): what a law knows at the end of the period beside its state, perhaps with zeros behind it; q = 0 of
      friction.
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
    inner: FloatArray

    @property
    def stuck(self) -> BoolArray:
        """Pairs (n,) that stick during the whole period and transmit the predicted force."""
        # the start of a period that was marched more than once may depend on the force
        return np.asarray((self.status_t == STICK).all(axis=1) & (self.periods == 1) & ~self.slid)

    @property
    def change(self) -> FloatArray:
        """Size of the change of the tangential state over the period (n,), N; of masses their way, m."""
        return np.asarray(np.hypot(*(self.state_t[:, :, -1] - self.state_t[:, :, 0]).T))

    def at(self, places: IntArray) -> Marched:
        """Those of some pairs (k,)."""
        of_pairs = (each.name for each in fields(Marched) if each.name != "periodicity_error")
        own: dict[str, Any] = {name: getattr(self, name)[places] for name in of_pairs}
        return Marched(**own, periodicity_error=self.periodicity_error)


@dataclass(frozen=True)
class SampledLaw:
    """Derivative of the law of p pairs at N samples, in blocks (N, p, 3, 3) of the pairs:

        by_force dlambda + by_motion du + by_speed dv = by_last_motion du' + by_last_speed dv' + by_inner dz',
        dz = inner_by_motion du + kept dz'.

    A prime marks the sample before. Velocities are in m per sample. Inner states z (q,) that a law may have: by_inner
    (N, p, 3, q), inner_by_motion (N, p, q, 3), kept (N, p, q).
    """

    by_force: FloatArray
    by_motion: FloatArray
    by_speed: FloatArray
    by_last_motion: FloatArray
    by_last_speed: FloatArray
    by_inner: FloatArray
    inner_by_motion: FloatArray
    kept: FloatArray


@dataclass(frozen=True)
class Element(ABC):
    """The law of k pairs of a joint at one frequency omega, rad/s. All arrays are of these pairs.

    places (k,): the pairs among all of the joint. penalty: eps. friction_coefficient (k,). dofs (k, 3): as in
    `ContactInterface`. Harmonics are on the axis of length m = 2H+1. history (k, `n_history`): what a pair remembers
    from one state to the next, m: by default the slip of its state.
    """

    places: IntArray
    penalty: Penalty
    friction_coefficient: FloatArray
    dofs: IntArray
    basis: FourierBasis
    omega: float

    @property
    def rate_dependent(self) -> bool:
        """Whether the law depends on velocities: that of masses."""
        return bool(self.penalty.inertial.any())

    @property
    def n_history(self) -> int:
        """Length of the history of a pair."""
        return 2

    def rubbing(self, friction: FloatArray) -> Element:
        """The law with other friction coefficients of all pairs of the joint (n_contact,)."""
        return replace(self, friction_coefficient=friction[self.places])

    def own(self, history: FloatArray) -> FloatArray:
        """The history of these pairs in that of all of the joint."""
        return history[self.places, : self.n_history]

    @property
    def sample_step(self) -> float:
        """Time between two samples, s."""
        return 2.0 * np.pi / (self.omega * self.basis.n_samples)

    @cached_property
    def compliance(self) -> ComplexArray:
        """Displacement per force (k, 3, H+1), m/N, in each harmonic: 1 / eps."""
        return np.repeat((1.0 + 0.0j) / self.penalty.stiffness[:, :, None], len(self.basis.orders) + 1, axis=2)

    @property
    def state_stiffness(self) -> FloatArray:
        """Tangential state over slip (k,), N/m; 1 of masses, whose state is a displacement."""
        return np.where(self.penalty.inertial, 1.0, self.penalty.tangential)

    def motion(self, correction: FloatArray) -> FloatArray:
        """Motion (k, 3, m, ...), m, relative to `origin`, from predicted less contact force, N, Eq. (12)."""
        return _scaled(correction, self.compliance)

    def motion_transposed(self, weight: FloatArray) -> FloatArray:
        """The transpose of `motion`, as a real matrix, times (k, 3, m)."""
        return _scaled(weight, self.compliance.conj())

    def force(self, motion: FloatArray) -> FloatArray:
        """Predicted less contact force (k, 3, m), N, of a motion, m, Eqs. (10), (12); undoes `motion`."""
        return _scaled(motion, 1.0 / self.compliance)

    @abstractmethod
    def march(self, predicted_h: FloatArray, history: FloatArray, before_t: FloatArray | None, /) -> Marched:
        """The period under a predicted force p (k, 3, m), N: the contact force lambda at its samples, by the relative
        displacement `u = (p - lambda) / eps`, which is 0 where a pair without wear just closes. The force in a
        direction that a pair does not have is p.

        before_t (k, 3, N): predicted force, N, from which it has slowly come; None where it was always the same.
        """

    def marched(self, predicted_t: FloatArray, force_t: FloatArray, **others: Any) -> Marched:
        """What a march has left: predicted and contact force (k, 3, N), N, and others than those of a law without
        friction, which remembers nothing.
        """
        k, _, n = predicted_t.shape
        nothing: dict[str, Any] = {
            "force_h": force_t @ self.basis.analysis,
            "state_t": np.zeros((k, 2, n + 1)),
            "start": np.zeros((k, 2)),
            "slid": np.zeros(k, bool),
            "status_t": np.full((k, n), OTHER),
            "periods": np.ones(k, np.int64),
            "periodicity_error": 0.0,
            "slip_work": np.zeros(k),
            "inner": np.zeros((k, 0)),
        }
        return Marched(predicted_t, force_t, **{**nothing, **others})

    def tangent(self, at: Marched, history: FloatArray | None = None, before_t: FloatArray | None = None) -> Tangents:
        """Exact derivatives by predicted force and friction coefficient, with the periodicity, and with the way from
        history and force of `march`, where these are given. Entries of displacements that a pair does not have are
        without meaning.
        """
        k, size = len(at.start), 3 * at.force_h.shape[2]
        out = np.zeros((k, size, size)), np.zeros((k, size)), np.zeros((k, size + 1))
        self.switching_tangent(at, history, before_t, out)
        out[0][at.stuck] = np.eye(size)
        return out

    def switching_tangent(self, at: Marched, _: FloatArray | None, __: FloatArray | None, out: Tangents, /) -> None:
        """`tangent` of pairs that neither stick nor stand open during the whole period, into `out`. By default from
        `sample_tangents`, without slip work.
        """
        own, carried = self.sample_tangents(at)
        synthesis, analysis = self.basis.synthesis, self.basis.analysis
        (n_samples, k), size = own.shape[:2], 3 * len(synthesis)
        # the first period from no change of the state, the second from that with which it repeats
        state, passed = np.zeros((k, 3, size)), np.broadcast_to(np.eye(2), (k, 2, 2))
        for each in carried:
            passed = each @ passed
        for period in range(2):
            for n in range(n_samples):
                by_force = np.kron(np.eye(3), synthesis[:, n])
                before, state = state, own[n] @ by_force
                state[:, 1:] += carried[n] @ before[:, 1:]
                if period:
                    changed = (by_force - state)[:, :, None, :] * analysis[n][:, None]
                    out[0][:] += changed.reshape(k, size, size)
            if not period:
                state[:, 1:] = np.linalg.pinv(np.eye(2) - passed) @ state[:, 1:]

    @abstractmethod
    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:
        """A (n, k, 3, 3) and B (n, k, 2, 2) at every `stride`-th sample; the normal force is that at the sample."""

    def sampled(self, at: Marched, pairs: IntArray) -> SampledLaw:
        """Derivative at the samples for disturbances in time of some of the k pairs (p,).

        With `p = lambda + x` it is `(1 - A) eps du - A dlambda = B eps du'`.
        """
        own, carried = self.sample_tangents(at)
        eps, there = self.penalty.stiffness[pairs, None, :], self.dofs[pairs] >= 0
        # a displacement that does not exist has no disturbance of the force
        passed = np.where(there[:, :, None] & there[:, None, :], own[:, pairs], -np.eye(3) * ~there[:, :, None])
        last = np.zeros((len(own), pairs.size, 3, 3))
        last[:, :, 1:, 1:] = carried[:, pairs]
        none, inner = np.zeros_like(last), np.zeros((*last.shape[:3], 0))
        on_inner = inner, inner.swapaxes(2, 3), inner[:, :, 0]
        return SampledLaw(-passed, (np.eye(3) - passed) * eps, none, last * eps, none.copy(), *on_inner)

    def friction_work(self, at: Marched) -> FloatArray:
        """Work that the law dissipates in a period (k,), J: by default that of friction, at its limit during slip."""
        return friction_limit(self.friction_coefficient, at.slip_work)

    # --- what a state leaves to the next one ---

    def origin(self, history: FloatArray) -> FloatArray:
        """Mean tangential position (k, 2), m, without mean force: of masses their history, else 0."""
        return np.where(self.penalty.inertial[:, None], history[:, :2], 0.0)

    def started_from(self, _: Marched, history: FloatArray, /) -> FloatArray:
        """The history with which the periods of a state begin after the way from another history."""
        return history

    def relieved(self, history: FloatArray, _: FloatArray, /) -> FloatArray:
        """History of a state without some tangential force (k, 2), N."""
        return history

    def final_history(self, at: Marched, motion: FloatArray, /) -> FloatArray:
        """History that a state leaves; motion (k, 3, m): of it, m. Of masses it is their mean position."""
        slip = at.state_t[:, :, -1] / self.state_stiffness[:, None]
        return np.where(self.penalty.inertial[:, None], motion[:, 1:, 0], slip)

    def begun_at(self, mean: FloatArray, last: FloatArray) -> FloatArray:
        """History of pairs that had another law, whose state had a mean position and a `last` one at its end, both
        (k, 2), m.
        """
        begun = np.where(self.penalty.inertial[:, None], mean, last)
        return np.pad(begun, ((0, 0), (0, self.n_history - last.shape[1])))

    # --- only masses move on in a period, and have harmonics above the highest one ---

    def change_force(self, at: Marched) -> FloatArray:
        """Change of the tangential state over the period (k,), N; of masses that move on the mean force of the drag."""
        over_drift = np.where(self.penalty.inertial, self.penalty.drag * self.omega / (2.0 * np.pi), 1.0)
        return np.asarray(over_drift * at.change)

    def tail(self, at: Marched, basis: FourierBasis) -> FloatArray:
        """Contact force on masses in other harmonics (k, 3, 2j+1), N."""
        force_h = np.zeros((len(at.start), 3, basis.analysis.shape[1]))
        moves = self.penalty.inertial
        force_h[moves, 1:] = at.force_t[moves, 1:] @ basis.analysis / basis.step_mean
        return force_h

    def beyond_series(self, at: Marched, series_t: FloatArray) -> FloatArray:
        """Tangential motion of masses (k, 2, N), m, in harmonics that the series (k, 2, N), m, lacks, half a step
        before the samples.
        """
        added = np.where(self.penalty.inertial[:, None, None], at.state_t[:, :, :-1] - series_t, 0.0)
        return np.asarray(added - added.mean(axis=2, keepdims=True))


def numbers_of_pairs(law: Any, name: str, shape: tuple[int, ...]) -> FloatArray:
    """A field of a frozen `PairLaw` as numbers (k, *shape), which it then holds, from these, from those of one pair for
    all of them, or from one number.

    Raises ValueError where the shape does not fit, or a number is negative or not finite.
    """
    given, whole = np.asarray(getattr(law, name), np.float64), (len(law.pairs), *shape)
    check(name, given.shape in (whole, shape, ()), f"give a number or shape {whole} instead of {given.shape}")
    check(name, bool((np.isfinite(given) & (given >= 0.0)).all()), "give finite numbers of at least 0")
    object.__setattr__(law, name, np.array(np.broadcast_to(given, whole)))
    return np.asarray(getattr(law, name))


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
