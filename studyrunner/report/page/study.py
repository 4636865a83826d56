"""What the page tells of the study: the answer, how the points ended, its axes, its scene."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

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


class Ended(NamedTuple):
    """Points that ended in one way: how many, what that means and what may help, and the first of them, a line each."""

    points: str
    sentence: str
    lines: list[str]


class StudyFacts(NamedTuple):
    """The study in words. text: the effective study, None where the file has none."""

    answer: tuple[tuple[str, str], ...]
    ends: str
    endings: list[Ended]
    facts: list[tuple[str, str]]
    text: str | None


def describe_study(result: Result) -> StudyFacts:
    """What was studied and how it ended."""
    numbers = Counter(result.dataset["outcome"].values.ravel().tolist())
    endings = [
        Ended(
            count(numbers[number], "point"),
            " ".join((ending.sentence, *advise_ended(result, number))),
            describe_ended(result, number),
        )
        for number, ending in sorted(result.endings.items())
        if numbers[number] and number != CONVERGED
    ]
    text = str(result.dataset.attrs["study"]) if "study" in result.dataset.attrs else None
    return StudyFacts(summary_rows(summarise(result)), tell_ends(result), endings, _facts(result), text)


def _facts(result: Result) -> list[tuple[str, str]]:
    """Names and values: axes, drawn inputs, slow time, blocks, scene, versions."""
    attributes, cycles = result.dataset.attrs, result.cycles
    facts = [(name.replace("_", " "), _axis_values(result, name)) for name in result.axes]
    for name, drawn in result.dataset.coords.items():
        if str(name).startswith(DRAWN):
            scale = scale_for(str(drawn.attrs.get("units", "")), drawn.values)
            low, high = (scale.show(float(end), 4) for end in (drawn.min(), drawn.max()))
            facts.append((f"drawn: {str(name).removeprefix(DRAWN).replace('_', ' ')}", f"{low} to {high}"))
    if not result.has_modes:
        first, last = (show_cycles(float(each), result.counted) for each in (cycles[0], cycles[-1]))
        kept = f"{first} to {last}, {np.count_nonzero(~np.isnan(cycles))} kept"
        facts.append((result.counted, kept if len(cycles) > 1 else first))
    if result.blocks is not None:
        facts.append(("blocks", ", ".join(map(str, result.blocks["block"].values))))
    n_pairs = count(result.dataset.sizes["contact"], "contact pair")
    responses = f", response {', '.join(result.responses)}" if result.responses else ""
    facts.append(("scene", f"{result.study.get('scene', {}).get('model') or 'unknown'}: {n_pairs}{responses}"))
    named = {"source": "source", "versions": "versions", "scene_sha256": "hash of the scene"}
    return facts + [(label, str(attributes[name])) for name, label in named.items() if name in attributes]


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
