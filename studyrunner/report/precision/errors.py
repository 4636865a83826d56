"""Error against run time: how far every setting of a result file is from the exact answer, or from the finest setting.

An error below `RESOLVED` times the uncertainty of the reference says nothing about the setting: it is called not
resolved, and nothing is concluded from it but that the setting is at most as wrong as both together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from studyrunner.report.figures.volume import NO_VOLUME
from studyrunner.report.precision.settings import (
    ADAPTIVE,
    AUTO,
    EXPLICIT,
    KEYS,
    Failure,
    Run,
    Runs,
    Setting,
    read_runs,
    varying_keys,
)
from studyrunner.report.reading.result import Result

RESOLVED = 3.0
"""An error counts from so many times the uncertainty of the reference on."""

_ROUND_OFF = 1e-12

VOLUME, RESPONSE = "volume", "response"
QUANTITIES = (VOLUME, RESPONSE)


@dataclass(frozen=True)
class Reference:
    """What errors are measured against. Uncertainties and differences are relative.

    setting: None for the exact answer. volume, response: uncertainty of the final worn volume and of the response
    there, infinite where nothing is known of it. volume_difference, response_difference: largest difference to the
    settings that are coarser by one value of one key; NaN where there is none.
    """

    run: Run = field(repr=False)
    setting: Setting | None
    volume: float
    response: float
    volume_difference: float = float("nan")
    response_difference: float = float("nan")

    @property
    def wears(self) -> bool:
        """Whether anything is worn at the end."""
        return bool(self.run.worn[-1] > NO_VOLUME)

    def uncertainty(self, quantity: str) -> float:
        """Of worn volume or response."""
        return float(getattr(self, quantity))


@dataclass(frozen=True)
class Measured:
    """One setting at one point against the reference; relative errors, NaN where there is nothing to compare.

    volume: of the final worn volume; infinite where the reference wears nothing. course: largest difference of the worn
    volume at any cycle count, over the final worn volume. response: of the amplitudes at the last cycle count.
    """

    setting: Setting
    run_time: float
    volume: float
    course: float
    response: float
    volume_resolved: bool
    response_resolved: bool
    oscillates: bool

    def error(self, quantity: str) -> float:
        """Of worn volume or response."""
        return float(getattr(self, quantity))

    def resolved(self, quantity: str) -> bool:
        """Whether that error is clearly more than the uncertainty of the reference."""
        return bool(getattr(self, f"{quantity}_resolved"))


@dataclass(frozen=True)
class Point:
    """One point of the axes that are no settings.

    measured: all settings but the reference, the quickest first. reference: None where no setting has a result.
    """

    runs: Runs = field(repr=False)
    reference: Reference | None
    measured: tuple[Measured, ...]

    @property
    def label(self) -> str:
        """The point in words."""
        return self.runs.label

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Settings without a result."""
        return self.runs.failures

    @property
    def quantities(self) -> tuple[str, ...]:
        """What there is to compare; not the wear where there is none, or where the file does not hold it."""
        return tuple(name for name in QUANTITIES if any(np.isfinite(item.error(name)) for item in self.measured))

    @property
    def differs(self) -> bool:
        """Whether anything but round-off depends on the setting."""
        return any(_ROUND_OFF < item.error(name) < np.inf for name in self.quantities for item in self.measured)

    def line(self, scheme: str | None, quantity: str) -> tuple[Measured, ...]:
        """The settings of one scheme with an error that is a number, the quickest first."""
        own = (item for item in self.measured if item.setting.scheme == scheme)
        return tuple(item for item in own if np.isfinite(item.error(quantity)))

    def front(self, quantity: str, scheme: str | None = None) -> tuple[Measured, ...]:
        """Settings than which no quicker one is as exact; of all schemes, or of one.

        An error that is not resolved counts as the smallest that would be.
        """
        assert self.reference is not None
        floor = RESOLVED * self.reference.uncertainty(quantity)
        schemes = {item.setting.scheme for item in self.measured} if scheme is None else {scheme}
        items = [item for item in self.measured if item.setting.scheme in schemes]
        return pareto_front(items, [max(item.error(quantity), floor) for item in items])


@dataclass(frozen=True)
class Precision:
    """What a result file says about the settings it compares.

    keys: settings of several values. points: in the order of the file. shared: whether the time of some point may be
    that of a march which computed other points, too.
    """

    result: Result = field(repr=False)
    keys: tuple[str, ...]
    points: tuple[Point, ...]
    shared: bool

    @property
    def schemes(self) -> tuple[str | None, ...]:
        """Schemes in the order of the file."""
        runs = [item for point in self.points for item in point.measured]
        known = [str(name) for name in self.result.dataset["scheme"].values] if "scheme" in self.result.axes else []
        present = {item.setting.scheme for item in runs}
        return tuple(name for name in (*known, None) if name in present)

    @property
    def outcomes(self) -> Counter[str]:
        """How many settings failed at how many points, by the word of their outcome."""
        counts: Counter[str] = Counter()
        for point in self.points:
            counts.update(point.runs.outcomes)
        return counts


def study_precision(result: Result) -> Precision | None:
    """What the settings of a file cost and how wrong they are; None where it does not compare at least two with a third
    one, or with the exact answer.
    """
    keys = varying_keys(result)
    if not keys or not (result.has("worn_volume") or result.has("response_amplitude")):
        return None
    points = tuple(measure(runs) for runs in read_runs(result))
    if max(len(point.measured) for point in points) < 2:
        return None
    wears = result.dataset.sizes.get("wear_coefficient", 1) > 1 and result.cycles[-1] > 0.0
    shortcuts = bool(result.study.get("solver", {}).get("shortcuts", True))
    return Precision(result, keys, points, shared=shortcuts and wears)


def measure(runs: Runs) -> Point:
    """Errors of all settings at one point."""
    reference = find_reference(runs)
    if reference is None:
        return Point(runs, None, ())
    measured = [_measure(run, reference) for run in runs.runs if run.setting != reference.setting]
    return Point(runs, reference, tuple(sorted(measured, key=lambda item: item.run_time)))


def find_reference(runs: Runs) -> Reference | None:
    """The exact answer, or the finest setting; None where no setting has a result."""
    return finest_reference(runs) if runs.exact is None else Reference(runs.exact, None, 0.0, 0.0)


def finest_reference(runs: Runs) -> Reference | None:
    """The finest setting that has a result and does not oscillate; None where no setting has a result.

    It has the most harmonics, then the most samples, then the smallest tolerances; of those, the adaptive scheme with
    the smallest `rtol` or the implicit one with the smallest step, whichever estimates the smaller error; the explicit
    one with the smallest step where there is no other.
    """
    steady = [run for run in runs.runs if not run.oscillates] or list(runs.runs)
    if not steady:
        return None
    resolution = _Resolution(steady)
    finest = max(resolution.rank(run) for run in steady)
    best = finest_in_time([run for run in steady if resolution.rank(run) == finest])
    differences = [difference(run, best) for run in _neighbours(best, steady)]
    most = [max((pair[place] for pair in differences), default=float("nan")) for place in range(len(QUANTITIES))]
    volume = best.error_estimate if np.isfinite(best.error_estimate) else most[0]
    response = _response_uncertainty(best, volume, most[1])
    return Reference(best, best.setting, _or_inf(volume), _or_inf(response), *most)


def finest_in_time(runs: Sequence[Run]) -> Run:
    """Of runs that differ in their wear steps only, the one that is nearest to the limit of small steps."""
    chosen = []
    adaptive = [run for run in runs if run.setting.scheme == ADAPTIVE]
    fixed = [run for run in runs if run.setting.scheme not in (ADAPTIVE, EXPLICIT)]
    if adaptive:
        chosen.append(min(adaptive, key=lambda run: run.setting.rtol or 0.0))
    if fixed or not adaptive:
        chosen.append(min(fixed or runs, key=lambda run: run.setting.step or 0.0))
    return min(chosen, key=lambda run: _or_inf(run.error_estimate))


def pareto_front(items: Sequence[Measured], errors: Sequence[float]) -> tuple[Measured, ...]:
    """Items, the quickest first, whose error is smaller than that of every quicker one; NaN never is."""
    found: list[Measured] = []
    least = np.inf
    for error, item in sorted(zip(errors, items, strict=True), key=lambda entry: (entry[1].run_time, entry[0])):
        if error < least:
            found.append(item)
            least = error
    return tuple(found)


class _Resolution:
    """Ranks of harmonics, samples and tolerances, the highest the finest.

    Where numbers and "auto" are compared, automatic ones rank by what the last state took.
    """

    def __init__(self, runs: Iterable[Run]) -> None:
        values = [(run.setting.harmonics, run.setting.samples) for run in runs]
        self.mixed = [len({value == AUTO for value in column}) > 1 for column in zip(*values, strict=True)]

    def rank(self, run: Run) -> tuple[float, ...]:
        """The higher the finer."""
        setting = run.setting
        numbers = []
        for value, used, mixed in zip((setting.harmonics, setting.samples), run.used, self.mixed, strict=True):
            if value == AUTO:
                numbers.append(used if mixed else 0.0)
            else:
                numbers.append(float(value or 0.0))
        rtol = setting.rtol if setting.automatic and setting.rtol is not None else 0.0
        return (*numbers, -(setting.tolerance or 0.0), -rtol)


def _neighbours(best: Run, runs: Sequence[Run]) -> list[Run]:
    """For each key the next coarser run that differs in it only; for the scheme, the implicit one of least step."""
    found = []
    for key in KEYS[1:]:
        own = getattr(best.setting, key)
        if not isinstance(own, int | float):
            continue
        like = [run for run in runs if run.setting.without(key) == best.setting.without(key)]
        values = {getattr(run.setting, key): run for run in like if isinstance(getattr(run.setting, key), int | float)}
        coarser = [value for value in values if (value < own if key in ("harmonics", "samples") else value > own)]
        if coarser:
            found.append(values[max(coarser) if key in ("harmonics", "samples") else min(coarser)])
    if best.setting.scheme == ADAPTIVE:
        open_keys = ("scheme", "step", "rtol")
        fixed = [run for run in runs if run.setting.without(*open_keys) == best.setting.without(*open_keys)]
        fixed = [run for run in fixed if run.setting.scheme not in (ADAPTIVE, EXPLICIT)]
        if fixed:
            found.append(min(fixed, key=lambda run: run.setting.step or 0.0))
    return found


def _measure(run: Run, reference: Reference) -> Measured:
    volume, response = difference(run, reference.run)
    course = float("nan")
    if reference.wears:
        course = float(np.abs(run.worn - reference.run.worn).max() / reference.run.worn[-1])
    return Measured(
        setting=run.setting,
        run_time=run.run_time,
        volume=volume,
        course=course,
        response=response,
        volume_resolved=volume >= RESOLVED * reference.volume,
        response_resolved=response >= RESOLVED * reference.response,
        oscillates=run.oscillates,
    )


def difference(run: Run, reference: Run) -> tuple[float, float]:
    """Relative difference of the final worn volume and of the last response amplitudes, all responses in one norm."""
    worn, true = float(run.worn[-1]), float(reference.worn[-1])
    # of nothing there is no share: what wears all the same is infinitely wrong
    volume = float("inf") if worn > NO_VOLUME else float("nan")
    if true > NO_VOLUME:
        volume = abs(worn - true) / true
    size = float(np.linalg.norm(reference.response[-1]))
    response = float(np.linalg.norm(run.response[-1] - reference.response[-1]))
    return volume, response / size if size > 0.0 else float("nan")


def _response_uncertainty(best: Run, volume: float, difference: float) -> float:
    """That of the truncated harmonics and that of the worn volume, which changes the response as it did lately.

    Where the file does not say enough: the difference to the nearest settings.
    """
    if not np.isfinite(best.response_error):
        return difference
    if not best.worn[-1] > NO_VOLUME:
        return best.response_error
    before = np.flatnonzero(best.worn < best.worn[-1])
    if not before.size:
        return difference
    grown = 1.0 - best.worn[before[-1]] / best.worn[-1]
    size = float(np.linalg.norm(best.response[-1]))
    if size == 0.0:
        return difference
    changed = float(np.linalg.norm(best.response[-1] - best.response[before[-1]])) / size
    return best.response_error + float(changed / grown) * volume


def _or_inf(value: float) -> float:
    return float(value) if np.isfinite(value) else float("inf")
