"""Estimated errors of a wear history, from its difference to the reference solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.model import FloatArray
from solver.settings import Scheme


@dataclass(frozen=True)
class HistoryError:
    """Estimated errors of a history at its counts; inf where nothing confirms it.

    worn_volume (n_output,): relative; 0 where nothing has worn.
    wear_depth (n_output, n_contact): m.
    response, wear_rate (n_output,): relative, of the state at a count.
    """

    worn_volume: FloatArray
    wear_depth: FloatArray
    response: FloatArray
    wear_rate: FloatArray


@dataclass(frozen=True)
class Met:
    """Difference of a history and its reference solution at all counts where both were compared.

    cycles (n,): ascending counts.
    differences (n,): sum over all pairs of area times difference of depth, m3; NaN beyond the end of the reference
        solution.
    """

    cycles: FloatArray
    differences: FloatArray

    def largest_before(self, counts: FloatArray) -> FloatArray:
        """Largest difference (n_output,), m3, from `crossing_window` times each count up to this count; 0 if none.

        Two histories in which an event happens at different counts cross each other. At the crossing their difference
        is small and is no measure of the error.
        """
        known = np.isfinite(self.differences)
        at, differences = self.cycles[known], self.differences[known]
        first = np.searchsorted(at, ACCURACY.crossing_window * counts, "left")
        last = np.searchsorted(at, counts, "right")
        return np.array([differences[one:other].max(initial=0.0) for one, other in zip(first, last, strict=True)])


def history_error(
    counts: FloatArray,
    fine: Mapping[str, Any],
    reference: Mapping[str, Any],
    met: Met,
    area: FloatArray,
    scheme: Scheme,
) -> HistoryError:
    """Errors of a history.

    Parameters
    ----------
    counts
        (n_output,), ascending, the first 0.
    fine, reference
        Values of both solutions at the counts, from `solver.wear.output.DenseOutput.read`.
    met
        Differences of both solutions at more counts.
    area
        (n_contact,), m2.
    scheme
        Scheme of the history.
    """
    depth, volume = fine["wear_depth"], fine["wear_depth"] @ area
    difference = ACCURACY.history_safety * np.abs(depth - reference["wear_depth"])
    error = np.fmax(difference @ area, ACCURACY.history_safety * met.largest_before(counts))
    # the error of the start state remains, even where later states agree by chance
    at_start = np.fmax(_start_error(fine, reference, area), fine["wear_rate_error"][0])
    error = np.fmax(error, np.where(volume > 0.0, at_start, 0.0) * volume)
    # the local errors of Euler steps have one sign and add up
    error = np.fmax(error, (1.0 if scheme == "adaptive" else ACCURACY.history_safety) * fine["local"])
    reached = np.isfinite(volume)
    unknown = reached & ~np.isfinite(difference).all(axis=1)
    relative = np.divide(error, volume, out=np.zeros_like(volume), where=volume > 0.0)
    relative[unknown & (volume > 0.0)] = np.inf
    relative[~reached] = np.nan
    # the rest of the error of the volume is shared by the pairs in proportion to their depth
    rest = relative - np.divide(difference @ area, volume, out=np.zeros_like(volume), where=volume > 0.0)
    with np.errstate(invalid="ignore"):
        of_pairs = difference + np.where(depth > 0.0, rest[:, None] * depth, 0.0)
    of_pairs[unknown] = np.where(depth[unknown] > 0.0, np.inf, 0.0)
    # an unworn state has errors of its own, from states with more harmonics
    unworn = (counts == 0.0) | (volume <= 0.0)
    response, rate = (
        np.where(unworn, fine[name], np.where(unknown, np.inf, np.fmax(fine[name], apart)))
        for name, apart in (
            ("response_error", _response_change(fine, reference)),
            ("wear_rate_error", _rate_change(fine, reference)),
        )
    )
    return HistoryError(relative, of_pairs, response, rate)


def _start_error(fine: Mapping[str, Any], reference: Mapping[str, Any], area: FloatArray) -> float:
    """Relative difference of the wear rates of both start states, pair by pair; 0 where nothing wears."""
    rate, other = fine["depth_rate"][0] * area, reference["depth_rate"][0] * area
    whole = float(rate.sum())
    return float(np.abs(rate - other).sum()) / whole if whole > 0.0 and np.isfinite(other).all() else 0.0


def _response_change(fine: Mapping[str, Any], reference: Mapping[str, Any]) -> FloatArray:
    """Relative difference (n_output,) of the responses: the larger one of first harmonic and peak."""
    found = np.zeros(len(fine["response"]))
    for name in ("response", "response_peak"):
        size = np.linalg.norm(fine[name], axis=1)
        apart = np.linalg.norm(fine[name] - reference[name], axis=1)
        found = np.fmax(found, np.divide(apart, size, out=np.zeros_like(size), where=size > 0.0))
    return found


def _rate_change(fine: Mapping[str, Any], reference: Mapping[str, Any]) -> FloatArray:
    """Relative difference (n_output,) of the wear rates."""
    rate, other = fine["wear_rate"], reference["wear_rate"]
    return np.asarray(np.divide(np.abs(rate - other), rate, out=np.zeros_like(rate), where=rate > 0.0))
