"""The penalty of each pair and the formulation that suits it, from the scene alone.

Both formulations are exact for any penalty as the number of harmonics grows; at a finite number they are as good as the
harmonics of the *predicted* force that are left out are small. With the structure's stiffness `Z_n` these are
`(1 - E_n / Z_n) lambda_n`, where E_n is the penalty as it acts on the displacement: eps at displacement level,
`i n w eps` at velocity level. So

- a pair on an elastic joint, whose stiffness no longer changes with frequency, is taken at displacement level with eps
  near that stiffness: nearly nothing is left out;
- a mass that sits directly on a slider (`Z_n` near `-(n w)^2 m`) is taken at velocity level, where stops are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model import BoolArray, FloatArray, ReducedModel
from solver.structure import condense, relative_indices

INERTIAL = 2.0  # ratio of the stiffness at twice the rate to that at the rate: 1 for a spring, 4 for a mass
STATIC_SHARE = 1e-6  # of the static stiffness: what holds the mean position of a pair at velocity level


@dataclass(frozen=True)
class Penalty:
    """normal (n_contact,): N/m. tangential (n_contact,): N/m, at velocity level N s/m. at_velocity (n_contact,).

    mean (n_contact,): N/m, holds the mean tangential position of pairs at velocity level: their friction force alone
    leaves it undetermined while they stick. It is so small that it does not hold one that slips.
    """

    normal: FloatArray
    tangential: FloatArray
    at_velocity: BoolArray
    mean: FloatArray


def build_penalty(model: ReducedModel, omega: float, n_harmonics: int) -> Penalty:
    """Penalty from the condensed `K + s^2 M` at the real rate s of the first harmonic left out, `(H + 1) omega`.

    At a real rate the structure has no resonances: it shows an elastic joint its stiffness and a slider its mass.
    """
    rate = (n_harmonics + 1) * omega
    size, twice = _stiffness_at(model, rate), _stiffness_at(model, 2.0 * rate)
    at_velocity = twice[:, 1] > INERTIAL * size[:, 1]
    return Penalty(
        normal=size[:, 0],
        tangential=np.where(at_velocity, size[:, 1] / rate, size[:, 1]),
        at_velocity=at_velocity,
        mean=STATIC_SHARE * size[:, 1],
    )


def _stiffness_at(model: ReducedModel, rate: float) -> FloatArray:
    """Diagonal of the condensed `K + s^2 M` at each pair, normal and (larger) tangential, (n_contact, 2), N/m.

    The diagonal is what a pair shows that moves alone. Measured on the dovetail sector at resonance: three times as
    much takes four times the Newton iterations, half as much takes as many, all within 1 % in the response.
    """
    relative, slots = relative_indices(model.contact)
    linear, _ = model.harmonic_structure(1)
    full = linear.stiffness + rate**2 * linear.mass
    reduced = condense(full, relative, np.zeros(full.shape[0])).stiffness
    size = np.zeros((model.contact.n_contact, 2))
    np.maximum.at(size, (slots // 3, np.minimum(slots % 3, 1)), np.real(np.diag(reduced)))
    # a pair without such a displacement, or one that nothing resists, still needs a number to divide by
    return np.where(size > 0.0, size, 1.0)


def static_penalty(penalty: Penalty) -> Penalty:
    """The same penalty for a static state, which has no velocity: every pair at displacement level."""
    stiffness = np.where(penalty.at_velocity, penalty.mean / STATIC_SHARE, penalty.tangential)
    return Penalty(penalty.normal, stiffness, np.zeros_like(penalty.at_velocity), penalty.mean)
