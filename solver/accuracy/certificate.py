"""The certificate of a state: by how much the reported motion and force violate the equations of the problem.

The numbers are computed from the reported state alone. The samples of a period obey the contact law by construction,
their Fourier series only up to the harmonics that are cut off. The truncation error is not measured, see
`solver.accuracy.refinement`. The certificate finds a force 1e-5 off, a harmonic left out, friction that drives, a
friction coefficient 10 % too large (15 % too small), slip that does not repeat by 2 % of the friction limit.
"""

from dataclasses import dataclass, replace

import numpy as np

from solver.contact.coulomb import OTHER, friction_limit
from solver.harmonic_balance.dlft import Evaluation
from solver.model import BoolArray, FloatArray
from solver.packing import packable
from solver.settings import NEGLIGIBLE, ROUND_OFF, SMALL
from solver.structure.fourier import build_basis
from solver.structure.joint import Joint

VIOLATION_LIMITS = {
    "penetration": 0.1,
    **dict.fromkeys(("cone_violation", "energy_error"), 0.05),
    **dict.fromkeys(("tension", "periodicity_error"), 1e-3),
}
"""Limits of the violations. Largest ones of good states with 3 to 41 harmonics: penetration 0.08 (vibro-impact with one
harmonic, which is far off, 0.13; underplatform damper 0.04), cone 0.018, energy 0.01 (unstable ring 0.016), others
below 1e-6."""


@packable
@dataclass(frozen=True)
class Certificate:
    """Violations of one state, all dimensionless; 0 is perfect. The first six have limits.

    residual: scaled residual of the equilibrium of motion and force, the mean forces included.
    penetration: of the series of the motion, also between the samples, over the largest vibration in the joint, so that
        a large mean closing hides nothing.
    tension, cone_violation: of the samples, and of the Fejer mean of the series (the mean of its truncations), over the
        largest normal force and friction limit. The Fejer kernel is positive and the friction cone is convex: so the
        overshoot of a truncated friction force, 18 % of its limit for any number of harmonics, is no violation.
    energy_error: work of the excitation, minus the work of the damping, minus the friction work of the slip as it
        wears, over the largest of these works and, times `SMALL`, of the elastic work and of the work that the
        excitation could do at most.
    periodicity_error: change of the tangential state over a period over the largest friction limit.
    response_error, wear_rate_error: estimated relative truncation errors, NaN where not estimated.
    """

    residual: float
    penetration: float
    tension: float
    cone_violation: float
    energy_error: float
    periodicity_error: float
    response_error: float = float("nan")
    wear_rate_error: float = float("nan")

    def failures(self, tolerance: float) -> dict[str, tuple[float, float]]:
        """Value and limit of each violation above its limit; NaN counts as such. tolerance: of the scaled residual."""
        # twice the tolerance: a state evaluated again from its harmonics has lost some digits to round-off
        limits = {"residual": 2.0 * max(tolerance, ROUND_OFF)} | VIOLATION_LIMITS
        values = ((name, getattr(self, name), limit) for name, limit in limits.items())
        return {name: (value, limit) for name, value, limit in values if not value <= limit}

    def sentence(self, tolerance: float) -> str:
        """The violations above their limits, with their values, in words for the user."""
        failed = self.failures(tolerance).items()
        return "; ".join(
            f"{name.replace('_', ' ')} {value:.2g}, more than {most:.2g}" for name, (value, most) in failed
        )


NOT_CERTIFIED = Certificate(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan)
"""Certificate of a state that is not reported."""


def certify(joint: Joint, evaluation: Evaluation) -> Certificate:
    """Certificate of an evaluated state, without truncation errors and stability, which need other states."""
    force_t, friction, law = evaluation.force_t, joint.contact.friction, joint.law
    rubs = (evaluation.status_t != OTHER).all(axis=1)
    largest = force_t[:, 0].max(axis=1, initial=0.0) * rubs
    normal = float(largest.max(initial=0.0))
    # without friction there is no limit to compare with: any tangential force is too much
    limit = float(friction_limit(friction, largest).max(initial=0.0)) if friction.any() else normal
    # weights of the Fejer mean
    weights = 1.0 - np.array([0.0, *joint.basis.orders]) / (max(joint.basis.orders, default=0) + 1.0)
    both = np.concatenate([force_t, _series(joint, evaluation.force_h * np.repeat(weights, 2)[1:])], axis=2)
    both, friction = both[rubs], friction[rubs]
    excess = np.hypot(both[:, 1], both[:, 2]) - friction_limit(friction[:, None], both[:, 0])
    changed = law.change_force(evaluation)[largest > 0.0]
    # of masses
    driving = float(np.abs(evaluation.predicted_t[joint.penalty.inertial, 1:]).max(initial=0.0))
    # motion (n_contact, 3, m), m, that the contact forces cause by the stiffness of the pairs alone
    flexed = joint.to_pairs(joint.to_relative(law.motion(evaluation.force_h)))
    return Certificate(
        residual=_residual(joint, evaluation),
        penetration=_penetration(joint, evaluation, flexed, rubs & joint.contact.has_normal),
        tension=_relative(float((-both[:, 0]).max(initial=0.0)), normal),
        cone_violation=_relative(float(excess.max(initial=0.0)), limit),
        energy_error=_energy_error(joint, evaluation, flexed),
        periodicity_error=_relative(
            max(evaluation.periodicity_error, float(changed.max(initial=0.0))),
            max(limit, driving, float(np.abs(force_t[~rubs]).max(initial=0.0))),
        ),
    )


def _relative(violation: float, size: float) -> float:
    """Violation over a reference size; a violation of 0 stays 0 where the size is 0, too."""
    if violation == 0.0:
        return 0.0
    return violation / size if size > 0.0 else float("inf")


def _series(joint: Joint, values_h: FloatArray) -> FloatArray:
    """Values (..., 4 N) of a series (..., m): at the samples alone its violations are too small."""
    finer = build_basis(joint.basis.orders, 4 * joint.basis.n_samples)
    return np.asarray(values_h @ finer.synthesis)


def _residual(joint: Joint, evaluation: Evaluation) -> float:
    """Scaled residual of the reported state, or that of Newton's iteration where larger."""
    motion = joint.motion(evaluation)
    left = joint.structure.apply(motion) + joint.to_relative(evaluation.force_h) - joint.structure.force_h
    # at an unbounded resonance the forces are small differences of large ones: error that round-off may hide
    parts = np.abs(joint.structure.static_stiffness) @ np.abs(motion[:, 1:])
    hidden = np.finfo(float).eps * float(np.linalg.norm(parts)) / evaluation.scale[1]
    return max(evaluation.scaled_residual(), replace(evaluation, residual=left).scaled_residual(), hidden)


def _penetration(joint: Joint, evaluation: Evaluation, flexed: FloatArray, pairs: BoolArray) -> float:
    """Largest penetration of some pairs (n_contact,) over the largest vibration: the relative one, or the elastic one
    by the contact forces.
    """
    closing = evaluation.displacement_h[:, 0].copy()
    closing[:, 0] -= joint.contact.gap + evaluation.wear_depth
    depth = _series(joint, closing[pairs])
    sizes = [NEGLIGIBLE * np.abs(flexed[..., 0])]  # as in `_amplitude`
    for values_h in (evaluation.displacement_h, flexed):
        vibrating = values_h.copy()
        vibrating[..., 0] = 0.0
        sizes.append(np.linalg.norm(_series(joint, vibrating), axis=1))
    return _relative(float(depth.max(initial=0.0)), max(float(each.max(initial=0.0)) for each in sizes))


def _work(joint: Joint, force: FloatArray, motion: FloatArray) -> float:
    """Work over a period, J, of a force on a motion, both (..., m)."""
    turned = motion[..., 2::2] * force[..., 1::2] - motion[..., 1::2] * force[..., 2::2]
    return float(np.pi * (turned * np.array(joint.basis.orders)).sum())


def _amplitude(values_h: FloatArray) -> FloatArray:
    """Size (...) of the vibration in a series (..., m), at least a small fraction of its mean."""
    round_off = NEGLIGIBLE * np.abs(values_h[..., 0])
    return np.asarray(np.maximum(np.linalg.norm(values_h[..., 1:], axis=-1), round_off))


def _energy_error(joint: Joint, evaluation: Evaluation, flexed: FloatArray) -> float:
    """Energy imbalance of a period over the largest work in it."""
    motion, force = joint.motion(evaluation), joint.to_relative(evaluation.force_h)
    load = joint.structure.force_h
    excitation, damping, contact = (_work(joint, each, motion) for each in (load, joint.structure.apply(motion), force))
    dissipation = float(joint.law.friction_work(evaluation).sum())
    elastic = np.pi * float((_amplitude(evaluation.force_h) * _amplitude(flexed)).sum())
    # largest possible work of the excitation: away from a resonance its actual work is almost zero
    apparent = np.pi * float((_amplitude(load) * _amplitude(motion)).sum())
    size = max(abs(excitation), abs(damping), abs(contact), dissipation, SMALL * max(elastic, apparent))
    return _relative(abs(excitation - damping - dissipation), size)
