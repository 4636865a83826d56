"""The normal force averaged around each sample, and its tangent: what its harmonics are taken from, Eqs. (11), (12)."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.model import BoolArray, FloatArray


@njit(cache=True)
def closed_fraction(force: float, neighbour: float) -> tuple[float, float, float]:
    """Normal force of a sample over the half step towards a neighbour, and its derivatives to both predicted forces.

    Between two samples the predicted normal force is taken as linear, so the pair closes or opens where it is zero: the
    half step next to an opening counts by the closed part of the step. Without this every sample that changes its state
    is a corner in the residual, and a branch with hard impacts breaks up into small folds. `force` is positive.
    """
    if neighbour >= 0.0:
        return force, 1.0, 0.0
    fraction = force / (force - neighbour)
    # in fractions, not squares: predicted forces of pairs without preload may be as small as numbers get
    return fraction * force, fraction * (2.0 - fraction), fraction * fraction


@njit(cache=True)
def mean_normal_force(predicted_t: FloatArray) -> FloatArray:
    """Normal force (n_contact, N), N, averaged around each sample: what its harmonics are taken from."""
    n_contact, _, n_samples = predicted_t.shape
    mean = np.zeros((n_contact, n_samples))
    for pair in range(n_contact):
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            if force > 0.0:
                before, _, _ = closed_fraction(force, predicted_t[pair, 0, n - 1])
                after, _, _ = closed_fraction(force, predicted_t[pair, 0, (n + 1) % n_samples])
                mean[pair, n] = 0.5 * (before + after)
    return mean


@njit(cache=True)
def mean_normal_tangent(
    predicted_t: FloatArray, synthesis: FloatArray, analysis: FloatArray, has_normal: BoolArray
) -> FloatArray:
    """Derivative (n_contact, m, m) of the harmonics of `mean_normal_force` with respect to those of its argument."""
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    basis_t = np.ascontiguousarray(synthesis.T)
    tangent = np.zeros((n_contact, m, m))
    analysis_t = np.ascontiguousarray(analysis.T)
    rows = np.empty((n_samples, m))
    for pair in range(n_contact):
        if not has_normal[pair]:
            continue
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            rows[n] = 0.0
            if force <= 0.0:
                continue
            ahead = (n + 1) % n_samples
            _, own_before, other_before = closed_fraction(force, predicted_t[pair, 0, n - 1])
            _, own_after, other_after = closed_fraction(force, predicted_t[pair, 0, ahead])
            for j in range(m):
                rows[n, j] = 0.5 * (
                    (own_before + own_after) * basis_t[n, j]
                    + other_before * basis_t[n - 1, j]
                    + other_after * basis_t[ahead, j]
                )
        tangent[pair] = np.dot(analysis_t, rows)
    return tangent
