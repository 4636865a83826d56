"""How well the numbers of a file are known, how points ended, and what to do about both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.advice import Used, advise, advise_error
from studyrunner.result.view import WELL_ENOUGH, Point, Result
from studyrunner.system.progress import count
from studyrunner.units import show_cycles, show_percent, show_rtol

_MOST_NAMED = 10
_LEAST = 1e-4  # relative error that is shown, of any smaller one
_AUTO = "auto"
_OF_ADVICE = ("scheme", "sweep", "harmonics", "samples", "rtol")


@dataclass(frozen=True)
class Certainty:
    """How well the numbers of a result are known. n_known, n_less, n_unknown: of points computed to the end."""

    of: str  # what, as "worn volume"
    n_points: int  # of the study
    n_known: int  # known to rtol
    n_less: int
    n_unknown: int  # never estimated
    rtol: float  # NaN where it is an axis
    worst: float  # largest relative error, NaN without one
    where: str  # its point in words
    advice: str  # what would make it smaller; empty where all are known to rtol

    @property
    def n_short(self) -> int:
        """Points that were not computed to the end."""
        return self.n_points - self.n_known - self.n_less - self.n_unknown

    @property
    def sentence(self) -> str:
        """The certainty in one sentence."""
        rtol = self.rtol if math.isfinite(self.rtol) else None
        aim = "their rtol" if rtol is None else f"rtol = {show_rtol(rtol)}"
        worst = self.worst if rtol is not None and rtol < _LEAST else max(self.worst, _LEAST)
        known = f"known within {show_percent(worst, rtol)}" if worst <= WELL_ENOUGH else "not known"
        if self.n_points == 1:
            if self.n_short:
                return f"the {self.of} is not known: the point was not computed to the end"
            return f"the {self.of} is {known} ({aim})" + (f": {self.advice}" if self.advice else "")
        text = f"{self.n_known} of {count(self.n_points, self.of)} are known within {aim}"
        text += f", {self.n_less} less well" if self.n_short and self.n_less else ""
        text += f", {self.n_short} not computed to the end" if self.n_short else ""
        text += f", {self.n_unknown} without an estimate" if self.n_unknown else ""
        if not self.worst > 0.0:
            return text
        where, advice = (f"{self.where}, " if self.where else ""), (f"; {self.advice}" if self.advice else "")
        return f"{text}; least certain: {where}{known.removeprefix('known ')}{advice}"


def certainty_of(result: Result, *, wore: bool = True) -> Certainty | None:
    """How well worn volumes, or where nothing wore responses, or modes are known; None where the file has no errors."""
    if result.has_modes:
        return _certainty(result, "point", _errors_of_modes(result))
    responses = result.has("response_error") and result.blocks is None
    has_errors = result.has("error_estimate") and np.isfinite(result.rtol).any() and result.computed.any()
    if result.wears and has_errors and (wore or not responses):
        return _certainty(result, "worn volume", result.errors)
    if responses:
        last = result.dataset["response_error"].isel(cycle=-1).transpose(*result.axes).values
        return _certainty(result, "response", last)
    return None


def _errors_of_modes(result: Result) -> NDArray[np.float64]:
    """Largest relative error of natural frequency and damping ratio; in the shape of the axes."""
    errors = np.zeros(result.computed.shape)
    for name in ("natural_frequency", "damping_ratio"):
        if result.has(name, f"{name}_error"):
            value, error = np.abs(result.dataset[name].values), result.dataset[f"{name}_error"].values
            errors = np.fmax(errors, np.where(value > 0.0, error / np.where(value > 0.0, value, 1.0), 0.0))
    return errors


def _certainty(result: Result, of: str, errors: NDArray[np.float64]) -> Certainty:
    known = result.computed & np.isfinite(errors)
    # each is compared with its own rtol: one that is above it is worse than any that is not
    above = result.computed & (errors > result.rtol)
    within = known & ~above
    several = np.unique(result.rtol[np.isfinite(result.rtol)])
    n_unknown = int(np.count_nonzero(result.computed & np.isnan(errors)))
    worst, where, advice = math.nan, "", ""
    if above.any() or known.any():
        point = result.largest(np.where(above if above.any() else known, errors, -1.0))
        place = tuple(point.values())
        worst, where = float(errors[place]), result.describe(point) if result.varying else ""
        if above.any():
            found = "set a smaller solver.rtol"
            if of == "worn volume":
                rates = result.at("wear_rate_error", point).values.tolist() if result.has("wear_rate_error") else ()
                found = advise_error(worst, rates, settings_of(result, place))
            advice = f"for {show_rtol(float(result.rtol[place]))} {found}"
    n_known, n_less = (int(np.count_nonzero(each)) for each in (within, above))
    rtol = float(several[0]) if several.size == 1 else math.nan
    return Certainty(of, errors.size, n_known, n_less, n_unknown, rtol, worst, where, advice)


def show_error(result: Result, point: Point) -> str:
    """Error of the worn volume of a point as text: "2.6 %"."""
    place = tuple(point[name] for name in result.axes)
    return show_percent(float(result.errors[place]), float(result.rtol[place]))


def describe_ends(result: Result) -> str:
    """Numbers of points that were computed to the end, ended early, or have no state."""
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    n_early = int(np.count_nonzero(result.has_values & ~result.computed))
    text = f"{count(n_points, 'point')}, {n_computed} computed to the end"
    text += f", {n_early} ended early with values up to there" if n_early else ""
    n_without = n_points - n_computed - n_early
    return f"{text}, {n_without} without a result." if n_without else f"{text}."


def list_ended(result: Result, number: int) -> dict[str, list[dict[str, int]]]:
    """Points that ended in this way, by what is to be said of each beside the outcome; the text may be empty."""
    messages = result.dataset["message"].values if result.has("message") else None
    found: dict[str, list[dict[str, int]]] = {}
    for index in np.argwhere(result.dataset["outcome"].values == number):
        place, point = tuple(index.tolist()), result.point_at(index)
        said = "" if messages is None else str(messages[place])
        if result.has_values[place] and result.counted[:-1] not in said:
            last = show_cycles(float(result.last_cycle[place]), result.counted)
            end = "" if result.computed[place] else f"computed up to {last}"
            is_known = 0.0 < result.errors[place] <= WELL_ENOUGH
            known = f"worn volume known within {show_error(result, point)}" if is_known else ""
            said = ", ".join(filter(None, (end, known, said)))
        found.setdefault(said, []).append(point)
    return found


def describe_ended(result: Result, number: int) -> list[str]:
    """The first points that ended in this way, with cycle, error and message; points with the same text in one line."""
    axes = (*result.varying, *result.fixed)
    texts = list_ended(result, number)
    lines = []
    for said, points in list(texts.items())[:_MOST_NAMED]:
        named = [result.describe(point, axes) for point in points[:_MOST_NAMED]]
        named += [f"{count(len(points) - _MOST_NAMED, 'more point')}"] if len(points) > _MOST_NAMED else []
        lines.append(": ".join(filter(None, ("; ".join(named), said))))
    left = sum(map(len, list(texts.values())[_MOST_NAMED:]))
    return [line for line in (*lines, f"and {count(left, 'more point')}" if left else "") if line]


def advise_ended(result: Result, number: int) -> list[str]:
    """Advice for the points that ended in this way: a sentence for each group of settings."""
    found = np.argwhere(result.dataset["outcome"].values == number)
    # advice depends on a few axes: one point for each of their values
    axes = [place for place, name in enumerate(result.axes) if name in _OF_ADVICE]
    _, first = np.unique(found[:, axes], axis=0, return_index=True)
    word, places = result.endings[number].word, (tuple(found[row].tolist()) for row in sorted(first.tolist()))
    return [text for text in dict.fromkeys(advise(word, settings_of(result, place)) for place in places) if text]


def settings_of(result: Result, place: tuple[int, ...]) -> Used:
    """Settings of a point, as far as the file says."""
    dataset, solver, slow_time = result.dataset, result.study.get("solver", {}), result.study.get("slow_time", {})
    of: dict[str, Any] = {"sweep": _AUTO, "harmonics": _AUTO, "samples": _AUTO, **solver}
    # missions and modes have neither step nor scheme, and what they take of their own controls its error
    of |= {"scheme": "adaptive"} | {name: dataset[name].values[index] for name, index in result.point_at(place).items()}
    harmonics, samples = (each if each == _AUTO else int(float(each)) for each in (of["harmonics"], of["samples"]))
    schemes, sweeps = (
        tuple(map(str, dataset[name].values)) if name in result.axes else () for name in ("scheme", "sweep")
    )
    # the modal amplitude of a mode is raised or lowered only
    sweeps += ("ramp",) if result.has_modes else ()
    return Used(
        scheme=str(of["scheme"]),
        sweep=str(of["sweep"]),
        harmonics=harmonics,
        samples=samples,
        rtol=float(result.rtol[place]),
        schemes=schemes,
        sweeps=sweeps,
        by_depth="largest_depth" in slow_time,
        until="until" in slow_time,
    )
