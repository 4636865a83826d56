"""Error against run time: how far every setting of a result file is from the exact answer, or from the finest setting.

An error below `RESOLVED` times the uncertainty of the reference says nothing about the setting: it is called not
resolved, and nothing is concluded from it but that the setting is at most as wrong as both together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studyrunner.report.precision.settings import (
    ADAPTIVE,
    AUTO,
    EXPLICIT,
    KEYS,
    OF_TIME,
    Setting,
    family,
)
from studyrunner.report.reading.result import NO_VOLUME

FloatArray = NDArray[np.float64]

RESOLVED = 3.0
"""An error counts from so many times the uncertainty of the reference on."""

QUANTITIES = {"volume": "final worn volume", "response": "response at the end"}
"""What is compared, in words."""

ROUND_OFF = 1e-12
"""Smaller relative errors are none."""


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    setting: None for the exact answer. worn: final worn volume, m3. uncertainty: relative, of each of `QUANTITIES`,
    infinite where nothing is known of it. difference: largest relative difference to the settings that are coarser by
    one value of one key; NaN where there is none.
    """

    setting: Setting | None
    worn: float
    uncertainty: Mapping[str, float]
    difference: Mapping[str, float]


@dataclass(frozen=True)
class Point:
    """One point of the axes that are no settings: what each setting gave there.

    label: the point in words, empty where nothing but settings varies. cycles: at the end. settings: with their rows in
    `computed` and `values`, the same at all points. computed (n_setting,): whether to the last cycle. values
    (n_setting, more): `run_time` in CPU seconds, `error_estimate` and `response_error` relative, `harmonics_used` and
    `samples_used` by the last state, `step_limit` in cycles, `rtol` in effect, `worn_volume`
    (n_setting, n_cycle) in m3 and `response_amplitude` (n_setting, n_cycle, n_response) in m; NaN where the file does
    not say. failures: words of the outcomes of what was not computed. exact: the exact worn volume and amplitude, None
    where the file holds none.
    """

    label: str
    cycles: float
    settings: Mapping[Setting, int] = field(repr=False)
    computed: NDArray[np.bool_] = field(repr=False)
    values: Mapping[str, FloatArray] = field(repr=False)
    failures: Mapping[Setting, str]
    exact: tuple[FloatArray, FloatArray] | None = field(repr=False)

    @cached_property
    def results(self) -> list[Setting]:
        """Settings that were computed to the last cycle."""
        return [setting for setting, row in self.settings.items() if self.computed[row]]

    @cached_property
    def finest(self) -> Setting | None:
        """The finest setting that has a result; None where no setting has one.

        It has the most harmonics, then the most samples, then the smallest tolerances; of those, the adaptive scheme
        with the smallest `rtol` or the implicit one with the smallest step, whichever estimates the smaller error; the
        explicit one with the smallest step where there is no other.
        """
        if not self.results:
            return None
        ranks = {setting: self._rank(setting) for setting in self.results}
        best = [setting for setting, rank in ranks.items() if rank == max(ranks.values())]
        adaptive = [setting for setting in best if setting.scheme == ADAPTIVE]
        fixed = [setting for setting in best if setting.scheme not in (ADAPTIVE, EXPLICIT)]
        chosen = [min(adaptive, key=lambda setting: setting.rtol or 0.0)] if adaptive else []
        if fixed or not adaptive:
            chosen.append(min(fixed or best, key=lambda setting: setting.step or 0.0))
        return min(chosen, key=lambda setting: _or_inf(self.number("error_estimate", setting)))

    @cached_property
    def reference(self) -> Reference | None:
        """The exact answer, or the finest setting; None where no setting has a result."""
        if self.finest is None:
            return None
        if self.exact is not None:
            nothing, unknown = dict.fromkeys(QUANTITIES, 0.0), dict.fromkeys(QUANTITIES, math.nan)
            return Reference(None, float(self.exact[0][-1]), nothing, unknown)
        return _describe_finest(self, self.finest)

    @cached_property
    def errors(self) -> dict[str, FloatArray]:
        """Errors (n_setting,) against the reference, see `compare`; NaN for the reference itself."""
        if self.reference is None:
            return {name: np.full(len(self.settings), np.nan) for name in (*QUANTITIES, "course")}
        errors = self.compare(self.reference.setting)
        return {name: np.where(self.compared, error, np.nan) for name, error in errors.items()}

    @cached_property
    def compared(self) -> NDArray[np.bool_]:
        """Which settings are compared with the reference (n_setting,)."""
        reference = None if self.reference is None else self.reference.setting
        others: NDArray[np.bool_] = np.array([setting != reference for setting in self.settings])
        return self.computed & others

    @cached_property
    def measured(self) -> pd.DataFrame:
        """A row for each `Setting` but the reference, the quickest first: its `errors`, `run_time` in CPU seconds.

        `volume_resolved`, `response_resolved`: whether an error is clearly more than the uncertainty of the reference.
        """
        table = pd.DataFrame(self.errors, index=pd.Index(list(self.settings), dtype=object))
        table["run_time"] = self.values["run_time"]
        for name in QUANTITIES:
            table[f"{name}_resolved"] = table[name] >= RESOLVED * self.uncertainty(name)
        return table[self.compared].sort_values("run_time", kind="stable")

    @cached_property
    def quantities(self) -> tuple[str, ...]:
        """What there is to compare; not the wear where there is none, or where the file does not hold it."""
        return tuple(name for name in QUANTITIES if np.isfinite(self.errors[name]).any())

    @property
    def differs(self) -> bool:
        """Whether anything but round-off depends on the setting."""
        return any(self.clear_errors(name).size for name in self.quantities)

    def number(self, name: str, setting: Setting) -> float:
        """One of `values` of a setting."""
        return float(self.values[name][self.settings[setting]])

    def clear_errors(self, quantity: str) -> FloatArray:
        """Errors that are numbers and more than round-off."""
        errors = self.errors[quantity]
        return errors[(errors > ROUND_OFF) & (errors < np.inf)]

    def resolves(self, quantity: str) -> bool:
        """Whether some error is clearly more than the uncertainty of the reference, and not all are the same."""
        errors = self.clear_errors(quantity)
        least = max(RESOLVED * self.uncertainty(quantity), ROUND_OFF)
        known = self.measured[quantity].fillna(0.0)
        return bool(errors.size) and errors.max() >= least and known.max() - known.min() > least / RESOLVED

    def uncertainty(self, quantity: str) -> float:
        """Of the reference."""
        return float("inf") if self.reference is None else self.reference.uncertainty[quantity]

    def front(self, quantity: str, scheme: str | None = None) -> pd.DataFrame:
        """Settings than which no quicker one is as exact; of all schemes, or of one.

        An error that is not resolved counts as the smallest that would be.
        """
        own = [scheme in (None, setting.scheme) for setting in self.measured.index]
        errors = self.measured[quantity].clip(lower=RESOLVED * self.uncertainty(quantity))
        return pareto_front(self.measured[own], errors[own])

    def compare(self, against: Setting | None) -> dict[str, FloatArray]:
        """Relative errors (n_setting,) against one setting, or against the exact answer; NaN where there is nothing.

        Returns
        -------
        dict
            `volume`: of the final worn volume; infinite where the answer wears nothing. `course`: largest difference of
            the worn volume at any cycle count, over the final worn volume. `response`: of the last amplitudes, all
            responses in one norm.
        """
        own, amplitude = self.values["worn_volume"], self.values["response_amplitude"][:, -1]
        if against is None and self.exact is not None:
            worn, response = self.exact[0], self.exact[1][-1]
        else:
            place = self.settings[against or Setting()]
            worn, response = own[place], amplitude[place]
        # of nothing there is no fraction: what wears all the same is infinitely wrong
        volume, course = np.where(own[:, -1] > NO_VOLUME, np.inf, np.nan), np.full(len(own), np.nan)
        if worn[-1] > NO_VOLUME:
            difference = np.abs(own - worn) / worn[-1]
            volume, course = difference[:, -1], difference.max(axis=1)
        size = float(np.linalg.norm(response))
        away = np.linalg.norm(amplitude - response, axis=-1) / (size if size > 0.0 else np.nan)
        return {"volume": volume, "course": course, "response": away}

    def _rank(self, setting: Setting) -> tuple[float, ...]:
        """Harmonics, samples and tolerances as numbers, the highest the finest.

        Where numbers and "auto" are compared, automatic ones rank by what the last state took.
        """
        numbers = []
        for key in ("harmonics", "samples"):
            value = getattr(setting, key)
            if value == AUTO:
                mixed = any(getattr(other, key) != AUTO for other in self.settings)
                value = np.nan_to_num(self.number(f"{key}_used", setting)) if mixed else 0.0
            numbers.append(float(value or 0.0))
        rtol = (setting.rtol or 0.0) if AUTO in (setting.harmonics, setting.samples) else 0.0
        return (*numbers, -(setting.tolerance or 0.0), -rtol)


def pareto_front(runs: pd.DataFrame, errors: pd.Series) -> pd.DataFrame:
    """Runs, the quickest first, whose error is smaller than that of every quicker one; NaN never is."""
    ordered = runs.assign(_error=errors).dropna(subset="_error").sort_values(["run_time", "_error"])
    least = ordered["_error"].cummin().shift(fill_value=np.inf)
    return ordered[ordered["_error"] < least].drop(columns="_error")


def _describe_finest(point: Point, finest: Setting) -> Reference:
    """The finest setting as reference."""
    best = {name: values[point.settings[finest]] for name, values in point.values.items()}
    errors = point.compare(finest)
    nearest = [point.settings[setting] for setting in _neighbours(finest, point.results)]
    most = {name: float(np.fmax.reduce(errors[name][nearest], initial=math.nan)) for name in QUANTITIES}
    volume = float(best["error_estimate"])
    volume = volume if math.isfinite(volume) else most["volume"]
    response = _response_uncertainty(best, volume)
    response = response if math.isfinite(response) else most["response"]
    uncertainty = {"volume": _or_inf(volume), "response": _or_inf(response)}
    return Reference(finest, float(best["worn_volume"][-1]), uncertainty, most)


def _response_uncertainty(best: Mapping[str, FloatArray], volume: float) -> float:
    """That of the truncated harmonics and that of the worn volume, which changes the response as it did lately.

    NaN where the file does not say enough.
    """
    worn, response = best["worn_volume"], best["response_amplitude"]
    if not worn[-1] > NO_VOLUME:
        return float(best["response_error"])
    before, size = np.flatnonzero(worn < worn[-1]), float(np.linalg.norm(response[-1]))
    if not before.size or size == 0.0:
        return math.nan
    grown = 1.0 - worn[before[-1]] / worn[-1]
    changed = float(np.linalg.norm(response[-1] - response[before[-1]])) / size
    return float(best["response_error"] + changed / grown * volume)


def _neighbours(finest: Setting, settings: Sequence[Setting]) -> list[Setting]:
    """For each key the next coarser setting that differs in it only; for the scheme, the implicit one of least step."""
    found = []
    for key in KEYS[1:]:
        own, finer = getattr(finest, key), 1.0 if key in ("harmonics", "samples") else -1.0
        if isinstance(own, float):
            like = [setting for setting in family(settings, finest, key) if isinstance(getattr(setting, key), float)]
            values = {finer * getattr(setting, key): setting for setting in like}
            found += [values[value] for value in sorted(values) if value < finer * own][-1:]
    if finest.scheme == ADAPTIVE:
        fixed = [each for each in family(settings, finest, *OF_TIME) if each.scheme not in (ADAPTIVE, EXPLICIT)]
        found += sorted(fixed, key=lambda setting: setting.step or 0.0)[:1]
    return found


def _or_inf(value: float) -> float:
    return float(value) if math.isfinite(value) else math.inf
