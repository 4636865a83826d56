"""What the page tells of the study: its axes, its scene, how well the worn volume is known, how the points ended."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from studyrunner.coordinates import COORDINATES
from studyrunner.result.certainty import advise_ended, describe_ended, tell_ends
from studyrunner.result.points import CONVERGED
from studyrunner.result.units import scale_for, show_cycles, show_number, units_of
from studyrunner.result.view import Result
from studyrunner.statistics.samples import DRAWN
from studyrunner.summary.answer import summarise
from studyrunner.summary.lines import summary_rows
from studyrunner.system.progress import count

_MOST_VALUES = 12


@dataclass(frozen=True)
class Ended:
    """Points that ended in one way: how many, what that means and what may help, and the first of them, a line each."""

    points: str
    sentence: str
    lines: list[str]


@dataclass(frozen=True)
class StudyFacts:
    """The study in words.

    summary: how well the worn volume is known, and how many points were computed. endings: of the points of which there
    is more to say. facts: names and values. text: the effective study, None where the file has none.
    """

    answer: tuple[tuple[str, str], ...]
    summary: str
    endings: list[Ended]
    facts: list[tuple[str, str]]
    text: str | None


def describe_study(result: Result) -> StudyFacts:
    """What was studied and how it ended."""
    attributes = result.dataset.attrs
    facts = [(name.replace("_", " "), _axis_values(result, name)) for name in result.axes]
    facts += _drawn(result)
    cycles = result.cycles
    first, last = (show_cycles(float(each), result.counted) for each in (cycles[0], cycles[-1]))
    kept = f"{first} to {last}, {np.count_nonzero(~np.isnan(cycles))} kept"
    if not result.has_modes:
        facts.append((result.counted, kept if len(cycles) > 1 else first))
    if result.blocks is not None:
        facts.append(("blocks", ", ".join(map(str, result.blocks["block"].values))))
    facts.append(("scene", _scene(result)))
    named = {"source": "source", "versions": "versions", "scene_sha256": "hash of the scene"}
    facts += [(label, str(attributes[name])) for name, label in named.items() if name in attributes]
    numbers = Counter(result.dataset["outcome"].values.ravel().tolist())
    endings = [
        Ended(count(numbers[number], "point"), _with_advice(result, number), describe_ended(result, number))
        for number in sorted(result.endings)
        if numbers[number] and number != CONVERGED
    ]
    return StudyFacts(
        summary_rows(summarise(result)),
        tell_ends(result),
        endings,
        facts,
        str(attributes["study"]) if "study" in attributes else None,
    )


def _with_advice(result: Result, number: int) -> str:
    return " ".join((result.endings[number].sentence, *advise_ended(result, number)))


def _axis_values(result: Result, name: str) -> str:
    axis = result.dataset[name]
    words = axis.dtype.kind not in "fiu"
    values = [str(value) if words else show_number(float(value)) for value in axis.values]
    units = units_of(axis)
    after = f" {units}" if units else ""
    # of keys of [scene] and [wear] the file says what they are
    meaning = "" if name in COORDINATES else str(axis.attrs.get("long_name", ""))
    told = f": {meaning}" if meaning else ""
    if len(values) > _MOST_VALUES:
        return f"{values[0]} to {values[-1]}{after}, {len(values)} values{told}"
    return ", ".join(values) + after + told


def _drawn(result: Result) -> list[tuple[str, str]]:
    """Inputs that scatter: the smallest and the largest value that is drawn."""
    found = []
    for name, drawn in result.dataset.coords.items():
        if str(name).startswith(DRAWN):
            scale = scale_for(str(drawn.attrs.get("units", "")), drawn.values)
            low, high = (scale.show(float(end), 4) for end in (drawn.min(), drawn.max()))
            words = str(name).removeprefix(DRAWN).replace("_", " ")
            found.append((f"drawn: {words}", f"{low} to {high}"))
    return found


def _scene(result: Result) -> str:
    n_pairs = count(result.dataset.sizes["contact"], "contact pair")
    responses = f", response {', '.join(result.responses)}" if result.responses else ""
    model = result.study.get("scene", {}).get("model")
    return f"{model or 'unknown'}: {n_pairs}{responses}"
