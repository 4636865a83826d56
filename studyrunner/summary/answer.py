"""The summary of a result: for the command, the page and notebooks; as data, and in at most nine lines."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner.result.certainty import Certainty, advise_ended, certainty_of, ended_points
from studyrunner.result.opening import as_history
from studyrunner.result.pairs import contact_pairs
from studyrunner.result.view import COMPLETE_WORDS, Result
from studyrunner.summary.findings import (
    Life,
    MeshChange,
    ModeRange,
    MostWear,
    NothingWore,
    Vibration,
    compare_meshes,
    describe_samples,
    mode_ranges,
    most_wear,
    shortest_life,
    vibration_of,
    where_is,
)
from studyrunner.system.progress import count
from studyrunner.units import show_percent

MOST_LINES = 9

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""

_MOST_FAILURES, _MOST_MODES = 2, 4
_WIDTH, _LONGEST = 12, 240
_PLAIN = str.maketrans({"±": "+-", "³": "3", "²": "2", "µ": "u", "√": " sqrt ", "\N{NO-BREAK SPACE}": " "})


@dataclass(frozen=True)
class Failure:
    """Points that ended in one way but `converged`."""

    word: str
    is_complete: bool  # computed to the end, and uncertain only
    n_points: int
    sentence: str
    advice: str
    where: str  # the first of these points in words, empty where the study has one point
    reason: str  # its message

    @property
    def text(self) -> str:
        """What it means, what may help, and the first of the points."""
        cut = len(self.reason) > _LONGEST
        reason = f"{self.reason[:_LONGEST].rsplit(' ', 1)[0]} ..." if cut else self.reason
        first = ": ".join(filter(None, (self.where, reason)))
        said = (self.sentence, self.advice, f"First: {first}" if self.where else reason[:1].upper() + reason[1:])
        return ". ".join(filter(None, said))


@dataclass(frozen=True)
class Summary:
    """What came out. `print` shows its `lines`."""

    n_points: int
    n_complete: int  # computed to the end
    counted: str  # "cycles" or "missions"
    failures: tuple[Failure, ...]  # of each way to fail
    certainty: Certainty | None
    wear: MostWear | NothingWore | None = None  # None where it is not known or not asked for
    samples: str = ""  # with [scatter]: range and median of the worn volumes
    ranking: str = ""  # which input decides
    vibration: Vibration | None = None
    life: Life | None = None  # with a target
    mesh: MeshChange | None = None  # where meshes can be compared
    modes: tuple[ModeRange, ...] = ()
    stuck_frequency: float = math.nan  # Hz, of the joint that sticks; NaN where there is none, or several
    doubts: tuple[str, ...] = ()  # sentences on values that are hardly what was meant

    def __str__(self) -> str:
        """The summary as text."""
        return "\n".join(self.lines)

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines of plain text: label and text of each row."""
        return tuple(f"{label:<{_WIDTH}}{text}".translate(_PLAIN) for label, text in self.rows)

    @property
    def rows(self) -> tuple[tuple[str, str], ...]:
        """Label and text, in the order in which an engineer asks: the answer, failures, certainty."""
        wear, vibration, rows = self.wear, self.vibration, list[tuple[str, str]]()
        stuck = f"first resonance {self.stuck_frequency:.4g} Hz when all pairs stick"
        stuck = stuck if math.isfinite(self.stuck_frequency) else ""
        if isinstance(wear, NothingWore):
            rows.append(("wear", f"{wear.text} ({stuck})" if stuck else wear.text))
        elif isinstance(wear, MostWear):
            label = "most wear" if wear.n_compared > 1 else "wear"
            rows.append(("wear", self.samples) if self.samples else (label, wear.text(self.counted)))
            rows.append(("input", self.ranking))
            at = f" in the sample that wears most ({wear.where})" if self.samples else ""
            rows.append(("deepest", wear.deepest.text + at))
            shares = ", ".join(f"{name} {show_percent(share)}" for name, share in wear.blocks)
            rows.append(("blocks", shares and f"share of the wear: {shares}"))
        elif self.certainty is not None and self.certainty.of == "worn volume":
            rows.append(("wear", "no worn volume is known within 50 %"))
        if vibration is not None:
            wears = isinstance(wear, MostWear)
            text = vibration.text(wears, self.n_points == 1)
            rows.append((vibration.followed or "response", f"{text}; {stuck}" if wears and stuck else text))
        rows += [(f"mode {mode.number}", mode.text) for mode in self.modes[:_MOST_MODES]]
        rows.append(("life", self.life.text(self.counted) if self.life else ""))
        rows.append(("mesh", self.mesh.text if self.mesh else ""))
        for each in self.failures[:_MOST_FAILURES]:
            of = f"{each.n_points} of {count(self.n_points, 'point')}: " if self.n_points > 1 else ""
            rows.append(("uncertain" if each.is_complete else "failed", f"{of}{each.text}"))
        if left := self.failures[_MOST_FAILURES:]:
            n_left = count(sum(each.n_points for each in left), "more point")
            rows.append(("uncertain" if left[0].is_complete else "failed", f"{n_left} in other ways"))
        rows.append(("beware", next(iter(self.doubts), "")))
        rows = [(label, text) for label, text in rows if text][: MOST_LINES - 1]
        return (*rows, *([("certainty", self.certainty.sentence)] if self.certainty else []))


def summary(dataset: xr.Dataset) -> Summary:
    """The summary of a result, as `open_result` gives it; variables are read some points at a time."""
    history, blocks = as_history(dataset)
    return summarise(Result(Path(str(dataset.encoding.get("source", "result"))), history, blocks=blocks))


def summarise(result: Result) -> Summary:
    """The summary of a result that is opened for the report."""
    numbers = result.computed.size, int(result.computed.sum()), result.counted, _failures(result)
    if result.has_modes:
        return Summary(*numbers, certainty_of(result), modes=mode_ranges(result))
    wear = most_wear(result)
    of_scenes = result.dataset["stuck_frequency"].values if result.has("stuck_frequency") else np.array(math.nan)
    stuck = float(of_scenes) if of_scenes.ndim == 0 else math.nan
    return Summary(
        *numbers,
        certainty_of(result, wore=not isinstance(wear, NothingWore)),
        wear,
        *(describe_samples(result) if isinstance(wear, MostWear) else ("", "")),
        vibration_of(result, wear),
        shortest_life(result),
        compare_meshes(result),
        stuck_frequency=stuck,
        doubts=tuple(filter(None, (_not_small(result), _in_radians(result, stuck), _too_few_counts(result)))),
    )


def _failures(result: Result) -> tuple[Failure, ...]:
    numbers, counts = np.unique(result.dataset["outcome"].values, return_counts=True)
    found = []
    for number, n_points in zip(numbers.tolist(), counts.tolist(), strict=True):
        ending = result.endings[number]
        if ending.word == "converged":
            continue
        point, reason = next(ended_points(result, number))
        sentence = re.split(r"[.:](?:\s|$)", ending.sentence)[0] or ending.word
        where = where_is(result, point) if result.varying else ""
        # what the message of a sensitive one holds is no result
        reason = "" if ending.word == "sensitive" else reason
        is_complete, advice = ending.word in COMPLETE_WORDS, advise_ended(result, number).rstrip(".")
        found.append(Failure(ending.word, is_complete, n_points, sentence, advice, where, reason))
    return tuple(sorted(found, key=lambda each: (each.is_complete, -each.n_points)))


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
