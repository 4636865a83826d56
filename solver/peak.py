"""The largest magnitude of the responses over a period."""

from __future__ import annotations

import numpy as np

from solver.balance import Evaluation
from solver.harmonics import build_basis
from solver.joint import Joint
from solver.model import FloatArray

PEAK_POINTS = 1024  # in a period, at which the largest response is looked for


def largest_responses(joint: Joint, evaluation: Evaluation) -> FloatArray:
    """Largest magnitudes over a period of the responses (n_response,), m, the static ones included."""
    response_h = joint.structure.response_h(joint.to_relative(evaluation.displacement_h))
    return np.asarray(np.abs(response_h @ build_basis(joint.basis.orders, PEAK_POINTS).synthesis).max(axis=1))
