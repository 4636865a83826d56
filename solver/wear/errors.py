"""Estimated errors of a history of wear or of missions, from its difference to another solution.

An adaptive history is compared with its reference solution, a history with given steps with the adaptive history. An
error is inf where it is not known: where the other solution has no value, or an error that enters is not known. It is
NaN where the history has no value.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.accuracy.refinement import DIFFERENCE_SAFETY
from solver.model import FloatArray
from solver.outcome import absolute, in_whole
from solver.wear.slow_time import Solution
from solver.wear.undecided import exchanged, undecided_from

PAIR_OVER_VOLUME = 2.0
"""Relative error of the depth of a pair over that of the worn volume, at least, where four or more pairs wear. With 1
deep pairs of the dovetail are outside of their errors by 2.7 (mu = 0.3) to 3.2 times (212.5 Hz, 48 pairs, explicit).
With 1 the depths of spheres and blocks are told 0.7 times as wrong."""

CROSSING_WINDOW = 0.5
"""Fraction of the cycle count from which on the largest difference is the error: histories with an event at different
counts cross each other (dovetail, 211.25 Hz, steps of 2000 cycles: else a quarter of the true error at the crossing).
Later differences are not used: an error does not depend on the length of the study. With 0.25 and 0.75, and
`RTOL_RATIO` 1.5 and 3, told errors of slider, blocks and sphere are 0.7 to 2.9 times as large."""


@dataclass(frozen=True)
class HistoryError:
    """Estimated errors of a history at its counts; inf where not known, NaN beyond the end of the history.

    worn_volume, response, wear_rate (n_output,): relative; of the volume 0 where nothing has worn.
    wear_depth, dissipated_energy (n_output, n_contact): m, J/m2. excitation_frequency (n_output,): Hz.
    """

    worn_volume: FloatArray
    wear_depth: FloatArray
    dissipated_energy: FloatArray
    response: FloatArray
    wear_rate: FloatArray
    excitation_frequency: FloatArray


@dataclass(frozen=True)
class Compared:
    """Values of a history and of another solution at equal counts.

    counts (n,): ascending. values, reference: as of `Course.read`; the latter empty where there is no other solution.
    follows: whether the frequency of the excitation follows the structure.
    undecided: count from which on it is not known whether a pair goes on to wear (`undecided_from`), inf if never.
    """

    counts: FloatArray
    values: Mapping[str, Any]
    reference: Mapping[str, Any]
    follows: bool = False
    undecided: float = math.inf

    def other(self, name: str) -> Any:
        """Values of the other solution."""
        return self.reference.get(name, np.full_like(self.values[name], np.nan))


def compare(
    solution: Solution,
    counts: FloatArray,
    *,
    given: bool = False,
    follows: bool = False,
    part: Callable[[dict[str, Any]], dict[str, Any]] = lambda values: values,
) -> tuple[Compared, HistoryError]:
    """A history beside the solution that it is compared with at ascending counts (n,), and its errors there.

    given: whether its steps are given, so that the other solution is an adaptive history. follows: as in `Compared`.
    part: what is compared of the values of both.
    """
    course, other = solution.course, solution.compared
    if given and other is not None and other.state is not None:
        adaptive, error = compare(other, counts, follows=follows)
        both = Compared(counts, course.read(counts), other.course.read(counts), follows, adaptive.undecided)
        return both, error_of_given_steps(both, error, course.area)
    known = None if given or other is None or not other.course.nodes else other.course
    undecided = math.inf if known is None else undecided_from(course, known)
    both, steps = (
        Compared(at, part(course.read(at)), {} if known is None else part(known.read(at)), follows, undecided)
        for at in (counts, course.counts)
    )
    return both, history_error(both, steps, course.area)


def history_error(outputs: Compared, steps: Compared, area: FloatArray) -> HistoryError:
    """Errors of an adaptive history, from its difference to the reference solution.

    outputs, steps: both solutions at the counts to report, the first 0, and at the ends of the steps.
    area (n_contact,): m2.
    """
    values, depth, volume = outputs.values, outputs.values["wear_depth"], outputs.values["wear_depth"] @ area
    differences = zip(_differences(outputs, area), _differences(steps, area), strict=True)
    error, of_pairs, heat, response, wear_rate = (
        DIFFERENCE_SAFETY * np.maximum(here, _largest_before(steps.counts, there, outputs.counts))
        for here, there in differences
    )
    # harmonics, sweep and steps have nothing to do with each other: the worst case is their sum, also where both
    # solutions agree by chance; what the sweep leaves wrong in the first rate acts on what this rate has worn
    by_resolution = values["resolution_error"][0]
    by_sweep = values["wear_rate_error"][0] - by_resolution if math.isfinite(by_resolution) else 0.0
    worn_at_first = np.minimum(values["wear_rate"][0] * outputs.counts, volume)
    at_start = absolute(by_resolution, volume) + absolute(by_sweep, worn_at_first)
    error = np.maximum(error, at_start + values["local"])
    error = np.where(outputs.counts > outputs.undecided, np.inf, error)
    # a pair that agrees with the reference solution better than the volume does so by chance (dovetail, 211.25 Hz: else
    # 5 of 24 deep pairs are outside of their errors, by seven times); the error of the volume is smaller than that of
    # its independent pairs by the root of the number of equal pairs that would share the volume
    squares = ((depth * area) ** 2).sum(axis=1)
    n_equal = np.divide(volume**2, squares, out=np.ones_like(squares), where=squares > 0.0)
    of_pair = np.minimum(PAIR_OVER_VOLUME, np.sqrt(n_equal)) * _over(error, volume)
    of_pairs = np.maximum(of_pairs, absolute(of_pair[:, None], depth)) + exchanged(values, "wear_depth")
    # also where nothing wears: the wear rate is known as the slip is
    of_heat = np.maximum(of_pair, values["wear_rate_error"][0])
    heat = np.maximum(heat, absolute(of_heat[:, None], values["dissipated_energy"]))
    heat = heat + exchanged(values, "dissipated_energy")
    response = np.maximum(response, _change_within(volume, error, steps, area))
    frequency = _frequency_error(outputs, DIFFERENCE_SAFETY, np.zeros_like(volume))
    return _completed(outputs, HistoryError(error, of_pairs, heat, response, wear_rate, frequency), area)


def error_of_given_steps(outputs: Compared, adaptive: HistoryError, area: FloatArray) -> HistoryError:
    """Errors of a history with given steps: its difference to the adaptive history, and the errors of the latter."""
    volume, of_pairs, heat, response, wear_rate = _differences(outputs, area)
    error = HistoryError(
        _added(volume, absolute(adaptive.worn_volume, outputs.other("wear_depth") @ area)),
        _added(of_pairs, adaptive.wear_depth),
        _added(heat, adaptive.dissipated_energy),
        # both relative errors of the adaptive history are nearly those of this one: their values are as large
        _added(response, adaptive.response),
        _added(wear_rate, adaptive.wear_rate),
        _frequency_error(outputs, 1.0, adaptive.excitation_frequency),
    )
    return _completed(outputs, error, area)


def _completed(outputs: Compared, error: HistoryError, area: FloatArray) -> HistoryError:
    """Errors whose worn volume, m3, becomes relative; NaN beyond the end of the history."""
    values, depth = outputs.values, outputs.values["wear_depth"]
    volume, unknown = depth @ area, np.isinf(error.worn_volume)
    reached, unworn = np.isfinite(volume), (outputs.counts == 0.0) | (volume <= 0.0)

    def of_state(name: str, change: FloatArray) -> FloatArray:
        # an unworn state has errors of its own, from states with more harmonics; a worn one is as unknown as its depths
        larger = np.where(unworn, values[name], np.where(unknown, np.inf, np.maximum(values[name], change)))
        return np.where(reached, larger, np.nan)

    # what has not worn is known to have worn nothing
    of_pairs, of_heat = (
        np.where(reached[:, None], np.where(unknown[:, None], np.where(grown > 0.0, np.inf, 0.0), known), np.nan)
        for grown, known in ((depth, error.wear_depth), (values["dissipated_energy"], error.dissipated_energy))
    )
    return HistoryError(
        np.where(reached, _over(error.worn_volume, volume), np.nan),
        of_pairs,
        of_heat,
        of_state("response_error", error.response),
        of_state("wear_rate_error", error.wear_rate),
        error.excitation_frequency,
    )


def reach_target(
    solution: Solution, end: float, compare_at: Callable[[FloatArray], tuple[Compared, HistoryError]]
) -> tuple[float, float]:
    """Count up to `end` at which a history has reached its target, NaN if never, and its error: its difference to that
    of the other solution, or the time that the error of the wear takes, if longer. compare_at: as `compare`.
    """
    course, other, reached = solution.course, solution.compared, solution.course.reached
    if course.target is None or not reached <= end:
        return math.nan, math.nan
    if other is None:
        return reached, math.inf
    target, by_interpolation = course.target, course.reach(course.target)[1]
    both, error = compare_at(np.array([0.0, reached]))
    depth, weights = both.values["wear_depth"][1], course.area
    wrong = float(error.worn_volume[1] * (depth @ weights))
    if target.quantity == "wear_depth":
        # any pair may have the largest depth within its error
        weights = np.arange(depth.size) == depth.argmax()
        wrong = float((depth + error.wear_depth[1]).max(initial=0.0) - depth.max(initial=0.0))
    last_rate = course.nodes[-1].rate.reshape(-1, depth.size).sum(axis=0)
    rate = min(float(rates @ weights) for rates in (both.values["depth_rate"][1], last_rate))
    by_wear = 0.0 if wrong == 0.0 else wrong / rate if rate > 0.0 else math.inf
    apart = abs(other.course.reach(target)[0] - reached)
    found = max(by_wear, DIFFERENCE_SAFETY * apart if math.isfinite(apart) else 0.0) + by_interpolation
    return reached, math.inf if math.isnan(found) else found


def _frequency_error(both: Compared, safety: float, known: FloatArray) -> FloatArray:
    """Error (n,), Hz, of the frequency of the excitation: its difference times `safety`, and the error of the other."""
    of_states = both.values.get("excitation_frequency_error", np.zeros(len(both.counts)))
    if not both.follows:
        return np.asarray(of_states)
    return np.asarray(np.maximum(of_states, _added(safety * _apart(both, "excitation_frequency"), known)))


def _largest_before(at: FloatArray, differences: FloatArray, counts: FloatArray) -> FloatArray:
    """Largest difference (n_output, ...) from `CROSSING_WINDOW` times each count up to this count; 0 if none.

    at (n,): ascending counts of the differences (n, ...).
    """
    first = np.searchsorted(at, CROSSING_WINDOW * counts, "left")
    last = np.searchsorted(at, counts, "right")
    return np.array([differences[one:other].max(axis=0, initial=0.0) for one, other in zip(first, last, strict=True)])


def _change_within(volume: FloatArray, error: FloatArray, steps: Compared, area: FloatArray) -> FloatArray:
    """Relative change (n,) of the response while the worn volume (n,), m3, passes the values within its error (n,), m3:
    a state is not known better than the depths with which it vibrates. steps: the history at the ends of its steps.
    """
    worn = steps.values["wear_depth"] @ area
    response, worn = steps.values["response"][np.isfinite(worn)], worn[np.isfinite(worn)]
    change = np.zeros_like(volume)
    for place in np.flatnonzero(np.isfinite(error)) if worn.size > 1 else ():
        low, high = volume[place] - error[place], volume[place] + error[place]
        ends = np.array([np.interp([volume[place], low, high], worn, each) for each in response.T])
        size, passed = np.linalg.norm(ends[:, 0]), response[(worn > low) & (worn < high)].T
        if size > 0.0:
            change[place] = np.linalg.norm(np.hstack([ends, passed]) - ends[:, :1], axis=0).max() / size
    return change


def _apart(both: Compared, name: str) -> FloatArray:
    """Difference (n, ...) of a value; inf where the other solution has none, NaN beyond the end of the history."""
    own, other = both.values[name], both.other(name)
    return np.where(np.isnan(other) & ~np.isnan(own), np.inf, np.abs(own - other))


def _differences(both: Compared, area: FloatArray) -> tuple[FloatArray, ...]:
    """Differences (n, ...) of worn volume, m3, depths, m, energies, J/m2, response, the larger one of first harmonic
    and peak, and wear rate, both relative.
    """
    apart, more = _apart(both, "wear_depth"), both.values["wear_depth"] >= both.other("wear_depth")
    # of the sums, or of independent pairs where pairs differ in both directions, so that the sums agree by chance
    volume = in_whole(np.where(more, apart * area, -apart * area))
    first, peak = (
        _over(np.linalg.norm(_apart(both, name), axis=1), np.linalg.norm(both.values[name], axis=1))
        for name in ("response", "response_peak")
    )
    response, wear_rate = np.maximum(first, peak), _over(_apart(both, "wear_rate"), both.values["wear_rate"])
    return volume, apart, _apart(both, "dissipated_energy"), response, wear_rate


def _added(difference: FloatArray, error: FloatArray) -> FloatArray:
    """Difference to another solution (n, ...) and the error of that, which beyond its end has neither."""
    return np.where(np.isinf(difference), np.inf, difference + error)


def _over(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Ratio (n,) of two quantities, 0 where the second is not above 0."""
    return np.asarray(np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0.0))
