"""The summary of a result: for the command, the page and notebooks; as data, and in at most nine rows."""

import math
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from solver.outcome import COMPLETE, SENSITIVE_ERROR, Outcome
from studyrunner.kinds.wear.kind import OWN_STEPS
from studyrunner.result.opening import as_history, describe_outcome
from studyrunner.result.pairs import contact_pairs
from studyrunner.result.view import Result
from studyrunner.summary.findings import LEAST_ERROR, Finding, where_is
from studyrunner.summary.measured import about_measured
from studyrunner.system.progress import count
from studyrunner.units import scale_for, show_number, show_percent

MOST_ROWS, MOST_COLUMNS = 9, 100

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""

_LARGEST = 100.0
"""Size, m, of a model without a mesh: masses on springs that are usual in textbooks move by some 10 m."""

_OF_TITANIUM = 2e-13  # wear coefficient of Ti-6Al-4V, 1/Pa, where the friction coefficient is 0.5
_FAST = 10.0  # how many times it is pointed out
_MOST_FAILURES = 2
_WIDTH, _LONGEST = 12, 240
_NUMBER = re.compile(r"(?<=\d) (?=\S)")
_PLAIN = str.maketrans({"±": "+-", "³": "3", "²": "2", "µ": "u", "√": " sqrt ", "\N{NO-BREAK SPACE}": " "})

ADVICE = {
    Outcome.TIME_LIMIT: "--retry-failed continues with a larger solver.time_limit",
    Outcome.RESONANCE_LOST: "Try another range in loading.between, or another axes.sweep",
    Outcome.UNSTABLE: "Try another axes.sweep",
    Outcome.STEP_TOO_LONG: 'Try scheme = "adaptive", or a smaller step',
    Outcome.SENSITIVE: "[scatter] shows how far the worn volume scatters",
    Outcome.NO_FINAL_STATE: "Try an end in slow_time.cycles or slow_time.until",
    **dict.fromkeys((Outcome.START_FAILED, Outcome.BRANCH_LOST), "Try another axes.sweep"),
}
"""What may help, by outcome."""

OF_GIVEN_NUMBERS = dict.fromkeys(
    (Outcome.START_FAILED, Outcome.BRANCH_LOST, Outcome.INACCURATE, Outcome.CERTIFICATE_FAILED),
    'Try "auto" in place of numbers of harmonics and samples',
)
"""What may help where harmonics and samples are numbers."""

_IN_SHORT = {Outcome.INACCURATE: "not all is known within rtol"}
"""What has happened, where the first of the points says it in detail."""


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
        return (*rows[: len(rows) - len(last)][: MOST_ROWS - 1], *last)

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines of plain text: label and text of each row, as wide as a terminal."""
        look: dict[str, Any] = {"width": MOST_COLUMNS, "subsequent_indent": " " * _WIDTH, "break_on_hyphens": False}
        # a number stays with its unit
        texts = ((label, _NUMBER.sub("\N{NO-BREAK SPACE}", text.translate(_PLAIN))) for label, text in self.rows)
        wrapped = (textwrap.wrap(f"{label:<{_WIDTH}}{text}", **look) for label, text in texts)
        return tuple(line.translate(_PLAIN) for lines in wrapped for line in lines)

    def __str__(self) -> str:
        return "\n".join(self.lines)


def summary(dataset: xr.Dataset) -> Summary:
    """The summary of a result, as `open_result` gives it; variables are read some points at a time."""
    history, blocks = as_history(dataset)
    return summarise(Result(Path(str(dataset.encoding.get("source", "result"))), history, blocks=blocks))


def summarise(result: Result) -> Summary:
    """The summary of a result that is opened for the report."""
    stuck = result.dataset["stuck_frequency"].values if result.has("stuck_frequency") else np.array(math.nan)
    resonance = float(stuck) if stuck.ndim == 0 else math.nan
    findings, doubts = [*result.kind.part("findings").what_came_out(result, resonance)], list[str]()
    if result.kind.counted:
        doubts += [_not_small(result), _too_far(result), _too_few_counts(result)]
    findings += about_measured(result)
    wore = not any(each.name == "wear" and each.values.get("worn_volume") == 0.0 for each in findings)
    findings += [*(Finding("doubt", "beware", doubt) for doubt in doubts if doubt), *_failures(result)]
    findings += _faster_than_metals(result)
    if certainty := certainty_of(result, wore=wore):
        findings.append(certainty)
    return Summary(result.computed.size, int(result.computed.sum()), tuple(findings))


def _failures(result: Result) -> Iterator[Finding]:
    """Of each way to end but `converged` what it means, what may help, and the first of the points.

    Those that failed come before those that are uncertain only; of many ways the last are counted.
    """
    numbers, counts = np.unique(result.dataset["outcome"].values, return_counts=True)
    tables = [cast("dict[str, Any]", result.study.get(name, {})) for name in ("solver", "axes")]
    given = any(table.get(key, "auto") != "auto" for table in tables for key in ("harmonics", "samples"))
    findings = []
    for number, n_points in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number == Outcome.CONVERGED:
            continue
        word, sentence, happened = describe_outcome(number)
        place = tuple(np.argwhere(result.dataset["outcome"].values == number)[0].tolist())
        # the volumes in the message of a point whose error is known are no results
        is_silent = not result.has("message") or (number == Outcome.SENSITIVE and np.isfinite(result.errors[place]))
        reason = "" if is_silent else str(result.dataset["message"].values[place])
        reason = f"{reason[:_LONGEST].rsplit(' ', 1)[0]} ..." if len(reason) > _LONGEST else reason
        advice = ". ".join(filter(None, (ADVICE.get(number), OF_GIVEN_NUMBERS.get(number) if given else "")))
        first, happened = reason[:1].upper() + reason[1:], _IN_SHORT.get(number, happened) if reason else happened
        is_complete = number in COMPLETE
        label = "uncertain" if is_complete else "to do" if number == Outcome.NOT_COMPUTED else "failed"
        if label == "to do":
            happened = sentence.removesuffix(".")
        elif result.varying:
            first = f"First: {': '.join(filter(None, (where_is(result, result.point_at(place)), reason)))}"
        of = f"{n_points} of {count(result.computed.size, 'point')}: " if result.computed.size > 1 else ""
        values = {"n_points": n_points, "is_complete": is_complete, "reason": reason, "advice": advice}
        findings.append(Finding(word, label, of + ". ".join(filter(None, (happened, advice, first))), values))
    findings.sort(key=lambda each: (each.values["is_complete"], -each.values["n_points"]))
    yield from findings[:_MOST_FAILURES]
    if left := findings[_MOST_FAILURES:]:
        n_left = sum(each.values["n_points"] for each in left)
        text = f"{count(n_left, 'more point')}: {', '.join(each.name.replace('_', ' ') for each in left)}"
        yield Finding("others", left[0].label, text, {"n_points": n_left})


# --- values that are hardly what was meant ---


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
    ratios = np.nan_to_num(np.where(result.has_values, result.dataset["largest_wear_depth"].values, 0.0) / width)
    if ratios.max() <= SMALL:
        return ""
    return (
        f"the method assumes shallow wear, but the depth is {ratios.max():.2g} of the contact width at"
        f" {where_is(result, result.largest(ratios))}: take fewer cycles, and check that wear_coefficient is in 1/Pa"
    )


def _too_far(result: Result) -> str:
    """A response that is larger than the model: the displacements of a linear structure have no limit."""
    if not result.has("response_amplitude"):
        return ""
    moved = result.over_points("response_amplitude", lambda values: np.nan_to_num(values).max(axis=-1))
    moved, mesh = np.where(result.has_values, moved, 0.0), [f"mesh_{axis}" for axis in "xyz" if result.has("mesh_x")]
    size = max((float(np.ptp(result.dataset[name].values)) for name in mesh), default=_LARGEST)
    if moved.max() <= size:
        return ""
    by, large = (scale_for("m", each).show(each) for each in (float(moved.max()), size))
    than = f"the {large} of the model" if mesh else f"{large}: models are smaller"
    at = where_is(result, result.largest(moved))
    return f"a response moves by {by} at {at}, more than {than}: check the unit of the excitation, N, and of the model"


def _faster_than_metals(result: Result) -> Iterator[Finding]:
    """Wear coefficients, as that of examples, with which joints wear faster than those of metal."""
    largest = float(result.dataset["wear_coefficient"].max()) if "wear_coefficient" in result.axes else 0.0
    if result.wears and (times := largest / _OF_TITANIUM) > _FAST:
        text = f"wear_coefficient {show_number(largest)} 1/Pa is {times:.2g} times the {_OF_TITANIUM:g} of Ti-6Al-4V"
        text += " with friction 0.5: give that of your materials"
        yield Finding("coefficient", "note", text, {"times_metal": times})


def _too_few_counts(result: Result) -> str:
    """Points that reach their target before the first count at which the file could hold wear."""
    if not result.has("cycles_to_target", "worn_volume") or result.dataset.sizes["cycle"] < 2:
        return ""
    no_volume = np.isnan(result.of_points("worn_volume", 1))
    early = result.computed & np.isfinite(result.dataset["cycles_to_target"].values) & no_volume
    if not early.any():
        return ""
    points = count(int(np.count_nonzero(early)), "point")
    return f"no worn volume is stored for {points}: the target comes before the second of slow_time.outputs: give more"


# --- how well the numbers are known ---


def certainty_of(result: Result, *, wore: bool = True) -> Finding | None:
    """How well worn volumes, or where nothing wore responses, or modes are known; None where the file has no errors.

    Values: n_known to rtol, n_less and n_unknown, inf or without an estimate, of the points computed to the end; worst:
    the largest relative error, NaN without one; rtol: NaN where it is an axis.
    """
    found: tuple[str, NDArray[np.float64]] | None = result.kind.part("findings").errors_of(result, wore=wore)
    if found is None:
        return None
    of, errors = found
    known, above = result.computed & np.isfinite(errors), result.computed & (errors > result.rtol)
    masks = {"n_known": known & ~above, "n_less": known & above, "n_unknown": result.computed & ~np.isfinite(errors)}
    values: dict[str, Any] = {name: int(np.count_nonzero(mask)) for name, mask in masks.items()}
    aims = np.unique(result.rtol[np.isfinite(result.rtol)])
    values |= {"of": of, "rtol": float(aims[0]) if aims.size == 1 else math.nan}
    values |= {"worst": math.nan, "where": "", "advice": ""}
    if above.any() or known.any():
        # each is compared with its own rtol: one that is above it is worse than any that is not
        point = result.largest(np.where(above if above.any() else known, errors, -1.0))
        worst = float(errors[result.place(point)])
        values |= {"worst": worst, "where": result.describe(point) if result.varying else ""}
        schemes = result.dataset["scheme"].values if of == "worn volume" and "scheme" in result.axes else OWN_STEPS
        scheme = str(schemes[point.get("scheme", 0)])
        if above.any() and math.isfinite(worst) and scheme not in OWN_STEPS:
            # with which the history is compared, so that its error is smaller
            values["advice"] = 'scheme = "adaptive"'
    return Finding("certainty", "certainty", _describe_certainty(result.computed.size, values), values)


def _describe_certainty(n_points: int, values: Mapping[str, Any]) -> str:
    of, rtol, worst = values["of"], values["rtol"], values["worst"]
    aim = "their rtol" if math.isnan(rtol) else f"rtol = {100.0 * rtol:.6g} %"
    shown = worst if rtol < LEAST_ERROR else max(worst, LEAST_ERROR)
    within = f"within {show_percent(shown, rtol)}" if shown <= SENSITIVE_ERROR else "not known"
    n_known, n_less, n_unknown = (values[name] for name in ("n_known", "n_less", "n_unknown"))
    n_short = n_points - n_known - n_less - n_unknown
    advice = f": set {values['advice']}" if values["advice"] else ""
    if n_points == 1:
        if n_short:
            return f"the {of} is not known: the point was not computed to the end"
        return f"the {of} is {within.replace('within', 'known within')} ({aim}){advice}"
    text = f"{n_known} of {count(n_points, of)} are known within {aim}"
    text += f", {n_less} less well" if n_short and n_less else ""
    text += f", {n_short} not computed to the end" if n_short else ""
    text += f", {n_unknown} not known" if n_unknown else ""
    where = ", ".join(filter(None, (values["where"], within)))
    return f"{text}; least certain: {where}{advice}" if worst > 0.0 else text
