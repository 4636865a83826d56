"""Accuracy of the worn volumes of a file in sentences: known to rtol or less well, ended early, and why.

Words, numbers and advice are those of the summary of a run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from studyrunner.advice import Used, advise, advise_error
from studyrunner.percent import show_percent, show_rtol
from studyrunner.report.reading.result import Point, Result
from studyrunner.report.reading.units import show_cycles
from studyrunner.system.progress import count

_MOST_NAMED = 10
_AUTO = "auto"
_OF_ADVICE = ("scheme", "sweep", "harmonics", "samples", "rtol")


def tell_volumes(result: Result) -> str:
    """Number of worn volumes known to rtol, the worst with its place, and advice.

    Empty where the file has no errors.
    """
    if not result.tells_volumes:
        return ""
    known = result.computed & np.isfinite(result.errors)
    several = np.unique(result.rtol[np.isfinite(result.rtol)])
    aim = f"rtol = {show_rtol(float(several[0]))}" if several.size == 1 else "their rtol"
    n_known, n_less = int(np.count_nonzero(result.known)), int(np.count_nonzero(result.above))
    text = f"The worn volume of {n_known} of {count(known.size, 'point')} is known to {aim}"
    text += f", of {n_less} less well" if n_less else ""
    n_short = int(np.count_nonzero(~result.computed))
    text += f", {n_short} not computed to the end" if n_short else ""
    n_unknown = int(np.count_nonzero(result.computed & ~known))
    text += f", of {n_unknown} it was never estimated" if n_unknown else ""
    if not known.any():
        return f"{text}."
    # each is held against its own rtol: one that is above it is worse than any that is not
    worst = np.where(result.above if n_less else known, result.errors, -1.0)
    place = tuple(int(index) for index in np.unravel_index(int(np.argmax(worst)), worst.shape))
    where = f", at {result.describe(_point(result, place))}" if result.varying else ""
    text += f"; the worst is known to {show_error(result, place)}{where}."
    return f"{text} What may help: {advise_volume(result, place)}." if n_less else text


def show_error(result: Result, place: tuple[int, ...]) -> str:
    """Error of the worn volume of a point as text: "2.6 %"."""
    return show_percent(float(result.errors[place]), float(result.rtol[place]))


def tell_ends(result: Result) -> str:
    """Numbers of points that were computed to the end, ended early, or have no state."""
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    n_early = int(np.count_nonzero(result.held & ~result.computed))
    text = f"{count(n_points, 'point')}, {n_computed} computed to the end"
    text += f", {n_early} ended early and hold what was computed until then" if n_early else ""
    n_without = n_points - n_computed - n_early
    return f"{text}, {n_without} without a result." if n_without else f"{text}."


def describe_ended(result: Result, number: int) -> list[str]:
    """The first points that ended in this way, each with cycle, error and message."""
    found = np.argwhere(result.dataset["outcome"].values == number)
    messages = result.dataset["message"].values if result.has("message") else None
    lines = []
    for index in found[:_MOST_NAMED]:
        place = tuple(index.tolist())
        said = "" if messages is None else str(messages[place])
        if result.held[place] and result.counted[:-1] not in said:
            error = float(result.errors[place])
            end = (
                ""
                if result.computed[place]
                else f"computed up to {show_cycles(float(result.last_cycle[place]), result.counted)}"
            )
            known = f"worn volume known to {show_error(result, place)}" if np.isfinite(error) and error > 0.0 else ""
            said = ", ".join(filter(None, (end, known, said)))
        where = result.describe(_point(result, place))
        lines += [f"{where}: {said}"] if said else []
    if len(found) > _MOST_NAMED and lines:
        lines.append(f"and {len(found) - _MOST_NAMED} more")
    return lines


def advise_ended(result: Result, number: int) -> list[str]:
    """Advice for the points that ended in this way: a sentence for each group of settings."""
    found = np.argwhere(result.dataset["outcome"].values == number)
    # advice depends on a few axes: one point for each of their values
    axes = [place for place, name in enumerate(result.axes) if name in _OF_ADVICE]
    _, first = np.unique(found[:, axes], axis=0, return_index=True)
    texts = [advise_point(result, tuple(found[row].tolist())) for row in sorted(first.tolist())]
    return [text for text in dict.fromkeys(texts) if text]


def advise_point(result: Result, place: tuple[int, ...]) -> str:
    """Advice for a point whose outcome is not `converged`; empty where there is none."""
    ending = result.endings[int(result.dataset["outcome"].values[place])]
    return advise(ending.word, settings_of(result, place))


def advise_volume(result: Result, place: tuple[int, ...]) -> str:
    """What would make the error of the worn volume of a point smaller, in a few words."""
    rates: list[float] = []
    if result.has("wear_rate_error"):
        rates = result.at("wear_rate_error", _point(result, place)).values.tolist()
    return advise_error(float(result.errors[place]), rates, settings_of(result, place))


def settings_of(result: Result, place: tuple[int, ...]) -> Used:
    """Settings of a point, as far as the file tells."""
    dataset, point = result.dataset, _point(result, place)
    solver: Mapping[str, Any] = result.study.get("solver", {})
    slow_time: Mapping[str, Any] = result.study.get("slow_time", {})

    def of(key: str) -> Any:
        return dataset[key].values[point[key]] if key in point else solver.get(key, _AUTO)

    def words(key: str) -> tuple[str, ...]:
        return tuple(str(word) for word in dataset[key].values) if key in point else ()

    return Used(
        scheme=str(of("scheme")),
        sweep=str(of("sweep")),
        harmonics=_AUTO if str(of("harmonics")) == _AUTO else int(float(of("harmonics"))),
        samples=_AUTO if str(of("samples")) == _AUTO else int(float(of("samples"))),
        rtol=float(result.rtol[place]),
        schemes=words("scheme"),
        sweeps=words("sweep"),
        by_depth="largest_depth" in slow_time,
        until="until" in slow_time,
    )


def _point(result: Result, place: tuple[int, ...]) -> Point:
    return dict(zip(result.axes, place, strict=True))
