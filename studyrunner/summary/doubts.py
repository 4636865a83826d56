"""What of a result is hardly what was meant: wear that is not small, frequencies in the wrong unit. Never a refusal."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from studyrunner.result.view import Result

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""

_ONE_PLACE = 1e-6  # of the side of a square: pairs that are no farther apart say nothing of the size of their surface


def doubts(result: Result) -> tuple[str, ...]:
    """Lines on what came out: wear that is not small, frequencies that are far above the resonance."""
    return tuple(filter(None, (_not_small(result), _in_radians(result))))


def _not_small(result: Result) -> str:
    """Where wear is not small against the contact, as the method assumes.

    The reference takes the depth of the wear for "very small compared with the dimension of the structures in contact",
    so that mass, stiffness and the places of the pairs stay as they were designed.
    """
    if not result.has("largest_wear_depth"):
        return ""
    ratios = np.where(result.computed, result.read("largest_wear_depth").values, 0.0) / contact_width(result)
    largest = np.nanmax(np.nan_to_num(ratios))
    if largest <= SMALL:
        return ""
    place = np.unravel_index(int(np.nanargmax(ratios)), ratios.shape)
    point = result.point_at(place)
    return (
        f"the method assumes shallow wear, but the depth is {largest:.2g} of the contact width at"
        f" {result.describe(point)}: take fewer cycles, and check that wear_coefficient is in 1/Pa"
    )


def _in_radians(result: Result) -> str:
    """Frequencies that are all far above the first resonance, and near it if they are in rad/s."""
    first = result.stuck_frequency
    if math.isnan(first) or "frequency" not in result.axes:
        return ""
    values = result.dataset["frequency"].values / (2.0 * math.pi)
    if not (2.0 * math.pi * values.min() > 2.0 * first and 0.5 * first < values.max() and values.min() < 2.0 * first):
        return ""
    return f"all frequencies are far above the first resonance, {first:.6g} Hz: are they in rad/s?"


def contact_width(result: Result) -> float:
    """The shorter side of the narrowest contact surface, m, as a rectangle of its area and its second moment.

    A rectangle of length L has `L^2 / 12` times its area as second moment about the middle. Strips, whose length is in
    no position, are as wide as their row is long; without positions, and for a single pair, the side of a square. Where
    scenes differ, that of the scene of the point that is shown; inf where the file has no areas.
    """
    if not result.has("contact_area"):
        return math.inf
    point = result.shown_point()
    area = np.asarray(result.at("contact_area", point).values, dtype=float)
    position = np.full((len(area), 3), np.nan)
    if result.has("contact_x", "contact_y", "contact_z"):
        position = np.stack([result.at(f"contact_{axis}", point).values for axis in "xyz"], axis=1)
    surfaces = np.zeros(len(area))
    if result.has("contact_surface"):
        surfaces = result.at("contact_surface", point).values
    there = np.isfinite(area)
    return min(
        _width(position[own], area[own]) for own in (there & (surfaces == one) for one in np.unique(surfaces[there]))
    )


def _width(position: NDArray[np.float64], area: NDArray[np.float64]) -> float:
    """The same of one surface: position (n, 3), m, and area (n,), m2, of its pairs."""
    whole = float(area.sum())
    if not np.isfinite(position).all():
        return math.sqrt(whole)
    apart = position - area @ position / whole
    length = math.sqrt(12.0 * float(np.linalg.eigvalsh((apart.T * area) @ apart)[-1]) / whole)
    # pairs of no length are at one place
    return min(length, whole / length) if length > _ONE_PLACE * math.sqrt(whole) else math.sqrt(whole)
