"""Estimated error of a life: of the cycle count, or the number of missions, at which a history reaches its target."""

from __future__ import annotations

import math

from solver.accuracy.history_error import HISTORY_SAFETY
from solver.model import FloatArray
from solver.settings import Quantity


def target_error(at: float, reference: float, wear_error: float, rate: float) -> float:
    """Error of a life, in the unit of the counts.

    The larger one of the difference to the reference solution and of the time that the error of the wear takes.

    Parameters
    ----------
    at, reference
        Counts at which the history and its reference solution reach the target; inf or NaN where the latter does not.
    wear_error
        Estimated error of the wear at the target: of the depth, m, or of the volume, m3.
    rate
        Growth of this wear per count, from the target on.
    """
    by_wear = 0.0 if wear_error == 0.0 else wear_error / rate if rate > 0.0 else math.inf
    apart = abs(reference - at)
    return max(by_wear, HISTORY_SAFETY * apart if math.isfinite(apart) else 0.0)


def error_of_wear(quantity: Quantity, depth: FloatArray, depth_error: FloatArray, volume_error: float) -> float:
    """Error of the wear that is compared with a target.

    Of the largest depth, m, which any pair may have within its error; else of the worn volume, m3, of which a resonance
    is a function.

    depth, depth_error (n_contact,): m. volume_error: m3.
    """
    if quantity == "wear_depth":
        return float((depth + depth_error).max(initial=0.0) - depth.max(initial=0.0))
    return volume_error
