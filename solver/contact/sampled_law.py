"""Derivative of the contact law at the samples of a period, for disturbances of a periodic state in time.

Let `p = lambda + x`, with the state `x = eps u` of an elastic pair. Let A be the derivative of x with respect to p, and
B the derivative with respect to x at the sample before (`sample_tangents`). The law of the disturbance is

    (1 - A) eps du - A dlambda = B eps du'.

For a mass on a slider (`sliding_masses`) `dlambda = T_p dp + T_v dv' + T_l mu dlambda_N` with the derivatives T of its
steps, and `dp = dlambda + gain dv - loss dv'`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, SLIP, STICK, friction_limit
from solver.contact.law import ContactLaw, Marched
from solver.contact.sliding_masses import mass_slopes, step_gains
from solver.model import FloatArray, IntArray


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
    slopes, _ = mass_slopes(at.predicted_t[pair, 1:], limit, at.start[pair], (gain, loss), line)
    by_predicted, by_before = (slopes[:, there[:, None], first + there] for first in (0, 2))
    block = (slice(None), place, rows[:, None], rows)
    for part in (found.by_force, found.by_motion, found.by_last_motion):
        part[:, place, rows] = 0.0
    found.by_force[block] = np.eye(there.size) - by_predicted
    if law.contact.has_normal[pair]:
        found.by_force[:, place, rows, 0] = np.where(limit[:, None] > 0.0, -friction * slopes[:, there, 4], 0.0)
    found.by_speed[block] = -gain / step * by_predicted
    found.by_last_speed[block] = (by_before - loss * by_predicted) / step
