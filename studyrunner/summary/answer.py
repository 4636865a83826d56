"""The summary of a result: for the command, the page and notebooks; as data, and in at most nine lines."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.result.opening import as_history
from studyrunner.result.pairs import contact_pairs
from studyrunner.result.view import COMPLETE_WORDS, Result
from studyrunner.summary.certainty import ADVICE, certainty_of, first_ended
from studyrunner.summary.findings import (
    Finding,
    compare_meshes,
    mode_ranges,
    shortest_life,
    wear_and_response,
    where_is,
)
from studyrunner.system.progress import count

MOST_LINES = 9

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""

_MOST_FAILURES, _MOST_MODES = 2, 4
_WIDTH, _LONGEST = 12, 240
_PLAIN = str.maketrans({"±": "+-", "³": "3", "²": "2", "µ": "u", "√": " sqrt ", "\N{NO-BREAK SPACE}": " "})


@dataclass(frozen=True)
class Summary:
    """What came out. `print` shows its first lines. n_complete: points computed to the end. findings: all there are."""

    n_points: int
    n_complete: int
    findings: tuple[Finding, ...]

    @property
    def values(self) -> dict[str, Mapping[str, Any]]:
        """Numbers and words of the findings by their names, as values["wear"]["worn_volume"]."""
        return {each.name: each.values for each in self.findings}

    @property
    def rows(self) -> tuple[tuple[str, str], ...]:
        """Label and text, in the order in which an engineer asks: the answer, failures, certainty."""
        rows = [(each.label, each.text) for each in self.findings]
        last = [row for row in rows[-1:] if row[0] == "certainty"]
        return (*rows[: len(rows) - len(last)][: MOST_LINES - 1], *last)

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines of plain text: label and text of each row."""
        return tuple(f"{label:<{_WIDTH}}{text}".translate(_PLAIN) for label, text in self.rows)

    def __str__(self) -> str:
        """The summary as text."""
        return "\n".join(self.lines)


def summary(dataset: xr.Dataset) -> Summary:
    """The summary of a result, as `open_result` gives it; variables are read some points at a time."""
    history, blocks = as_history(dataset)
    return summarise(Result(Path(str(dataset.encoding.get("source", "result"))), history, blocks=blocks))


def summarise(result: Result) -> Summary:
    """The summary of a result that is opened for the report."""
    of_scenes = result.dataset["stuck_frequency"].values if result.has("stuck_frequency") else np.array(math.nan)
    stuck, findings, doubts = float(of_scenes) if of_scenes.ndim == 0 else math.nan, list[Finding](), list[str]()
    if result.has_modes:
        findings += itertools.islice(mode_ranges(result), _MOST_MODES)
    else:
        findings += [*wear_and_response(result, stuck), *filter(None, (shortest_life(result), compare_meshes(result)))]
        doubts += filter(None, (_not_small(result), _in_radians(result, stuck), _too_few_counts(result)))
    wore = not any(each.name == "wear" and each.values.get("worn_volume") == 0.0 for each in findings)
    findings += [*_failures(result), *(Finding("doubt", "beware", doubt) for doubt in doubts[:1])]
    if certainty := certainty_of(result, wore=wore):
        findings.append(certainty)
    return Summary(result.computed.size, int(result.computed.sum()), tuple(findings))


def _failures(result: Result) -> Iterator[Finding]:
    """Of each way to end but `converged` what it means, what may help, and the first of the points.

    Those that failed come before those that are uncertain only; of many ways the last are counted.
    """
    numbers, counts = np.unique(result.dataset["outcome"].values, return_counts=True)
    found = []
    for number, n_points in zip(numbers.tolist(), counts.tolist(), strict=True):
        ending = result.endings[number]
        if ending.word == "converged":
            continue
        point, reason = first_ended(result, number)
        # what the message of a sensitive one holds is no result
        reason = "" if ending.word == "sensitive" else reason
        reason = f"{reason[:_LONGEST].rsplit(' ', 1)[0]} ..." if len(reason) > _LONGEST else reason
        advice, first = ADVICE.get(ending.word, ""), reason[:1].upper() + reason[1:]
        if result.varying:
            first = f"First: {': '.join(filter(None, (where_is(result, point), reason)))}"
        said = (re.split(r"[.:](?:\s|$)", ending.sentence)[0] or ending.word, advice, first)
        of = f"{n_points} of {count(result.computed.size, 'point')}: " if result.computed.size > 1 else ""
        values = {
            "n_points": n_points,
            "is_complete": ending.word in COMPLETE_WORDS,
            "reason": reason,
            "advice": advice,
        }
        label = "uncertain" if ending.word in COMPLETE_WORDS else "failed"
        found.append(Finding(ending.word, label, of + ". ".join(filter(None, said)), values))
    found.sort(key=lambda each: (each.values["is_complete"], -each.values["n_points"]))
    yield from found[:_MOST_FAILURES]
    if left := found[_MOST_FAILURES:]:
        n_left = sum(each.values["n_points"] for each in left)
        text = f"{count(n_left, 'more point')}: {', '.join(each.name.replace('_', ' ') for each in left)}"
        yield Finding("others", left[0].label, text, {"n_points": n_left})


def _not_small(result: Result) -> str:
    """Where wear is not small against the contact, as the method assumes.

    The reference takes the depth of the wear for "very small compared with the dimension of the structures in contact",
    so that mass, stiffness and the places of the pairs stay as they were designed. The width is the side of a square as
    large as the smallest contact surface.
    """
    if not result.has("largest_wear_depth"):
        return ""
    pairs = contact_pairs(result, result.shown)
    areas = [float(np.nansum(pairs.area[pairs.surface == surface])) for surface in np.unique(pairs.surface)]
    width = math.sqrt(min((area for area in areas if area > 0.0), default=math.inf))
    ratios = np.nan_to_num(np.where(result.computed, result.dataset["largest_wear_depth"].values, 0.0) / width)
    if ratios.max() <= SMALL:
        return ""
    return (
        f"the method assumes shallow wear, but the depth is {ratios.max():.2g} of the contact width at"
        f" {where_is(result, result.largest(ratios))}: take fewer cycles, and check that wear_coefficient is in 1/Pa"
    )


def _in_radians(result: Result, first: float) -> str:
    """Frequencies that are all far above the first resonance, Hz, and near it if they are in rad/s."""
    if math.isnan(first) or "frequency" not in result.axes:
        return ""
    values = result.dataset["frequency"].values / (2.0 * math.pi)
    if not (2.0 * math.pi * values.min() > 2.0 * first and 0.5 * first < values.max() and values.min() < 2.0 * first):
        return ""
    return f"all frequencies are far above the first resonance, {first:.6g} Hz: are they in rad/s?"


def _too_few_counts(result: Result) -> str:
    """Points that reach their target before the first count at which the file could hold wear."""
    if not result.has("cycles_to_target", "worn_volume") or result.dataset.sizes["cycle"] < 2:
        return ""
    at_second = result.dataset["worn_volume"].isel(cycle=1).transpose(*result.axes).values
    early = result.computed & np.isfinite(result.dataset["cycles_to_target"].values) & np.isnan(at_second)
    points = count(int(np.count_nonzero(early)), "point")
    said = f"no worn volume is stored for {points}: the target comes before the second of slow_time.outputs: give more"
    return said if early.any() else ""
