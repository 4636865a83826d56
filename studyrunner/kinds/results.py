"""From what the solver returns to the variables of a result: what histories, missions and modes have in common."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.settings import WearTarget
from studyrunner.units import show_count


def first_harmonic(response: NDArray[np.complex128]) -> dict[str, NDArray[np.float64]]:
    """Variables of the first harmonic of the response, in the shape of the response."""
    return {"response_amplitude": np.abs(response), "response_phase": np.angle(response)}


def deepest(depth: NDArray[np.float64], error: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Variables of the deepest pair at each count, m, from depths (n_counts, n_contact) and their errors."""
    pair = np.nan_to_num(depth).argmax(axis=1)[:, None]
    of_deepest = np.take_along_axis(error, pair, axis=1)[:, 0]
    return {"wear_depth_max": depth.max(axis=1, initial=0.0), "wear_depth_max_error": of_deepest}


def motion_of_sectors(n_sectors: int, response: NDArray[np.complex128]) -> dict[str, NDArray[np.float64]]:
    """How the sectors of a ring vibrate: variables from responses (..., n_response), sector by sector."""
    first = response.reshape(*response.shape[:-1], n_sectors, -1)[..., 0]
    amplitude = np.abs(first)
    with np.errstate(invalid="ignore"):  # where nothing moves
        magnification = amplitude.max(axis=-1) / amplitude.mean(axis=-1)
    return {"sector_amplitude": amplitude, "sector_phase": np.angle(first), "amplitude_magnification": magnification}


def wear_of_sectors(
    n_sectors: int, depth: NDArray[np.float64], area: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """How the sectors of a ring wear: variables from depths (n_counts, n_contact), m, and areas, m2, of the pairs."""
    worn = depth.reshape(len(depth), n_sectors, -1)
    volume = (worn * area.reshape(n_sectors, -1)).sum(axis=-1)
    return {"sector_worn_volume": volume, "sector_wear_depth": worn.max(axis=-1)}


def describe_target(until: WearTarget | None, reached: float, counted: str, *, whole: bool) -> str:
    """That the target of a history was not reached, or that what comes after it is not computed; else empty.

    reached: count at which it was reached, else NaN. counted: what that counts. whole: whether all counts are computed.
    """
    if until is None or (whole and not math.isnan(reached)):
        return ""
    if math.isnan(reached):
        return f"{until.quantity} stays below {until.value:g}"
    return f"at its target at {counted} {show_count(round(reached))}: later {counted}s are not computed"


def named(names: Sequence[str], own: Mapping[str, Any], source: object) -> dict[str, Any]:
    """Variables by name: those of `own`, the others as the attributes of what the solver has returned."""
    return {name: own[name] if name in own else getattr(source, name) for name in names}
