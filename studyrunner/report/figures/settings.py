"""Numerical settings that a result file compares: how far each is from the exact answer, or from the finest setting."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.report.panels import FloatArray
from studyrunner.result.units import show_number
from studyrunner.result.view import NO_VOLUME, Result

KEYS = ("scheme", "step", "harmonics", "samples", "tolerance", "rtol")
"""Axes along which only the numbers change and not what is computed."""

QUANTITIES = {"volume": "final worn volume", "response": "response at the end"}
"""What is compared, in words."""

RESOLVED = 3.0
"""An error counts from so many times the uncertainty of the reference on."""

_ROUND_OFF = 1e-12
_AUTO, _OWN_STEPS, _EXPLICIT = "auto", ("adaptive", "final"), "explicit"
_VALUES = ("run_time", "error_estimate", "response_error", "harmonics_used", "samples_used")


@dataclass(frozen=True)
class Setting:
    """Values of `KEYS`; None where the file has no such axis or the setting does not use it."""

    scheme: str | None = None
    step: float | None = None
    harmonics: float | str | None = None
    samples: float | str | None = None
    tolerance: float | None = None
    rtol: float | None = None

    def words(self, key: str) -> str:
        """One value as text; a dash where there is none."""
        value = getattr(self, key)
        return "\N{EN DASH}" if value is None else value if isinstance(value, str) else show_number(value, 4)

    def describe(self) -> str:
        """Those values that there are, in words."""
        given = [key for key in KEYS if getattr(self, key) is not None]
        return ", ".join(self.words(key) if key == "scheme" else f"{key} {self.words(key)}" for key in given)


@dataclass(frozen=True)
class ComparedPoint:
    """One point of the axes that are no settings: what each setting gave there.

    label: the point in words, empty where nothing but settings varies. computed (n_setting,): whether to the last
    count. values (n_setting,): `run_time` in CPU seconds and what else the file says of the last count. worn
    (n_setting,): m3. response (n_setting, n_response): m. exact: worn volume and response, None where the file holds
    none.
    """

    label: str
    settings: tuple[Setting, ...]
    computed: NDArray[np.bool_] = field(repr=False)
    values: Mapping[str, FloatArray] = field(repr=False)
    worn: FloatArray = field(repr=False)
    response: FloatArray = field(repr=False)
    exact: tuple[float, FloatArray] | None = field(repr=False)

    @cached_property
    def reference(self) -> int | None:
        """Row of the finest setting that has a result; None where the exact answer is known, or nothing is.

        It has the most harmonics, then the most samples, then the smallest tolerances, and of those the smallest
        estimated error of the worn volume.
        """
        rows = np.flatnonzero(self.computed).tolist()
        return None if self.exact is not None or not rows else int(max(rows, key=self._rank))

    def _rank(self, row: int) -> tuple[float, ...]:
        """As numbers, the highest the finest; automatic ones rank by what the last state took."""
        setting, error = self.settings[row], self.values["error_estimate"][row]
        used = [
            np.nan_to_num(self.values[f"{key}_used"][row]) if value == _AUTO else float(value or 0.0)
            for key, value in (("harmonics", setting.harmonics), ("samples", setting.samples))
        ]
        error = error if math.isfinite(error) and setting.scheme != _EXPLICIT else math.inf
        return (*used, -(setting.tolerance or 0.0), -error, -(setting.rtol or 0.0), -(setting.step or 0.0))

    @cached_property
    def uncertainty(self) -> dict[str, float]:
        """Of the reference, relative, by its own estimates; 0 of the exact answer, infinite where not known."""
        if self.reference is None:
            return dict.fromkeys(QUANTITIES, 0.0 if self.exact is not None else math.inf)
        known = [float(self.values[name][self.reference]) for name in ("error_estimate", "response_error")]
        return {name: each if math.isfinite(each) else math.inf for name, each in zip(QUANTITIES, known, strict=True)}

    @cached_property
    def errors(self) -> dict[str, FloatArray]:
        """Relative errors (n_setting,) against the reference; NaN for the reference itself and what was not computed.

        `volume`: infinite where the answer wears nothing; `response`: all responses in one norm.
        """
        if self.exact is None and self.reference is None:
            return {name: np.full(len(self.settings), np.nan) for name in QUANTITIES}
        worn, response = self.exact or (float(self.worn[self.reference]), self.response[self.reference])
        volume = np.where(self.worn > NO_VOLUME, np.inf, np.nan)
        if worn > NO_VOLUME:
            volume = np.abs(self.worn - worn) / worn
        away = np.linalg.norm(self.response - response, axis=-1) / (float(np.linalg.norm(response)) or np.nan)
        compared = self.computed & (np.arange(len(self.settings)) != self.reference)
        return {"volume": np.where(compared, volume, np.nan), "response": np.where(compared, away, np.nan)}

    def is_clear(self, quantity: str) -> NDArray[np.bool_]:
        """Which errors (n_setting,) are clearly more than round-off and the uncertainty of the reference."""
        least = max(RESOLVED * self.uncertainty[quantity], _ROUND_OFF)
        return np.asarray((self.errors[quantity] >= least) & np.isfinite(self.errors[quantity]))

    def front(self, quantity: str, scheme: str | None = None) -> list[int]:
        """Rows of settings, of all schemes or of one, than which no quicker one is as exact; the quickest first.

        An error that is not resolved counts as the smallest that would be.
        """
        errors = np.maximum(self.errors[quantity], RESOLVED * self.uncertainty[quantity])
        own = [row for row, each in enumerate(self.settings) if scheme in (None, each.scheme)]
        own = [row for row in own if np.isfinite(errors[row])]
        own.sort(key=lambda row: (self.values["run_time"][row], errors[row]))
        least = np.minimum.accumulate([math.inf, *(errors[row] for row in own)])
        return [row for row, before in zip(own, least, strict=False) if errors[row] < before]


def compare_settings(result: Result) -> tuple[ComparedPoint, ...]:
    """What the settings of a file cost and how wrong they are, at all points of the axes that are no settings.

    Empty where the file does not compare at least two with a third one, or with the exact answer. Schemes alone are
    compared with the exact answer only.
    """
    varying = [key for key in KEYS if key in result.varying]
    alone = set(varying) <= {"scheme"} and not result.has("exact_worn_volume")
    if alone or result.blocks is not None or not result.has("worn_volume", "response_amplitude"):
        return ()
    keys, others = ([name for name in result.axes if (name in KEYS) == each] for each in (True, False))
    settings = _list_settings(result, keys)
    rows, n_points = list(settings.values()), math.prod(result.dataset.sizes[name] for name in others)

    def table(values: xr.DataArray) -> FloatArray:
        """Values (n_points, n_setting, ...)."""
        own = values.isel(cycle=-1, missing_dims="ignore").transpose(*others, *keys, ...)
        return np.asarray(own.values, dtype=float).reshape(n_points, -1, *own.shape[len(result.axes) :])[:, rows]

    outcome = result.dataset["outcome"]
    unknown = xr.full_like(outcome, np.nan, float)
    held = (*_VALUES, "worn_volume", "response_amplitude", "exact_worn_volume", "exact_response_amplitude")
    read = {name: table(result.read(name) if result.has(name) else unknown) for name in held}
    computed = table(outcome.copy(data=result.computed)) == 1.0
    points = []
    for number, place in enumerate(itertools.product(*(range(result.dataset.sizes[name]) for name in others))):
        exact = float(read[held[-2]][number, 0]), np.atleast_1d(read[held[-1]][number, 0])
        point = ComparedPoint(
            label=result.describe(dict(zip(others, place, strict=True)), set(result.varying) - set(KEYS)),
            settings=tuple(settings),
            computed=computed[number],
            values={name: read[name][number] for name in _VALUES},
            worn=read["worn_volume"][number],
            response=read["response_amplitude"][number],
            exact=exact if all(np.isfinite(each).all() for each in exact) else None,
        )
        points.append(point)
    most = max(int(np.isfinite(point.errors[name]).sum()) for point in points for name in QUANTITIES)
    return tuple(points) if most > 1 else ()


def _list_settings(result: Result, keys: list[str]) -> dict[Setting, int]:
    """All settings, each with the number of its first place among the values of `keys`, the last axis fastest.

    A setting holds no value that it does not use: the file may have it at several places.
    """
    by_depth = result.study.get("slow_time", {}).get("largest_depth") is not None
    solver = result.study.get("solver", {})
    found: dict[Setting, int] = {}
    axes = ([_value(key, value) for value in result.dataset[key].values] for key in keys)
    for place, given in enumerate(itertools.product(*axes)):
        setting = Setting(**dict(zip(keys, given, strict=True)))  # type: ignore[arg-type]
        if setting.scheme in _OWN_STEPS or (setting.scheme == _EXPLICIT and by_depth):
            setting = replace(setting, step=None)
        if result.cycles[-1] == 0.0:
            # only unworn states: no scheme takes a step
            setting = replace(setting, scheme=None, step=None)
        automatic = [getattr(setting, key) or solver.get(key, _AUTO) for key in ("harmonics", "samples")]
        if setting.scheme not in _OWN_STEPS and _AUTO not in automatic:
            setting = replace(setting, rtol=None)
        found.setdefault(setting, place)
    return found


def _value(key: str, value: object) -> float | str:
    """A value along an axis; numbers beside "auto" are texts in the file."""
    text = str(value)
    return text if key == "scheme" or text == _AUTO else float(text)
