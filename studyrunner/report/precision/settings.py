"""Numerical settings that a result file compares."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import show_number

KEYS = ("scheme", "step", "harmonics", "samples", "tolerance", "rtol")
"""Axes along which only the numbers change and not what is computed."""

OF_TIME = ("scheme", "step", "rtol")
"""Those of the steps on slow time."""

AUTO = "auto"
ADAPTIVE = "adaptive"
FINAL = "final"
EXPLICIT = "explicit"


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
        if value is None:
            return "\N{EN DASH}"
        return value if isinstance(value, str) else show_number(value, 4)

    def describe(self, keys: tuple[str, ...] = KEYS) -> str:
        """Those values that there are, in words."""
        given = [key for key in keys if getattr(self, key) is not None]
        return ", ".join(self.words(key) if key == "scheme" else f"{key} {self.words(key)}" for key in given)

    def without(self, *keys: str) -> Setting:
        """The same with some keys left open: equal for settings that differ in these only."""
        return replace(self, **dict.fromkeys(keys))


def family(settings: Iterable[Setting], like: Setting, *keys: str) -> list[Setting]:
    """Those that differ from `like` in these keys only."""
    return [setting for setting in settings if setting.without(*keys) == like.without(*keys)]


def varying_keys(result: Result) -> tuple[str, ...]:
    """Settings that the file has several values of."""
    return tuple(key for key in KEYS if key in result.varying)


def list_settings(result: Result) -> dict[Setting, int]:
    """All settings, each with the number of its first place among the values of `KEYS`, the last axis fastest.

    A setting holds no value that it does not use: the file may have it at several places.
    """
    keys = [name for name in result.axes if name in KEYS]
    by_depth = result.study.get("slow_time", {}).get("largest_depth") is not None
    solver = result.study.get("solver", {})
    found: dict[Setting, int] = {}
    axes = ([_value(key, value) for value in result.dataset[key].values] for key in keys)
    for place, given in enumerate(itertools.product(*axes)):
        values: dict[str, object] = dict(zip(keys, given, strict=True))
        scheme = values.get("scheme")
        if scheme in (ADAPTIVE, FINAL) or (scheme == EXPLICIT and by_depth):
            values["step"] = None
        if result.cycles[-1] == 0.0:
            # only unworn states: no scheme takes a step
            scheme = values["scheme"] = values["step"] = None
        automatic = AUTO in [values.get(key, solver.get(key, AUTO)) for key in ("harmonics", "samples")]
        if scheme not in (ADAPTIVE, FINAL) and not automatic:
            values["rtol"] = None
        found.setdefault(Setting(**values), place)  # type: ignore[arg-type]
    return found


def _value(key: str, value: object) -> float | str:
    """A value along an axis; numbers beside "auto" are texts in the file."""
    text = str(value)
    return text if key == "scheme" or text == AUTO else float(text)
