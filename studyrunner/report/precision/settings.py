"""Numerical settings that a result file compares, and what was computed with each of them."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import show_number

FloatArray = NDArray[np.float64]

KEYS = ("scheme", "step", "harmonics", "samples", "tolerance", "rtol")
"""Axes along which only the numbers change and not what is computed."""

AUTO = "auto"
ADAPTIVE = "adaptive"
EXPLICIT = "explicit"
IMPLICIT = "implicit"


@dataclass(frozen=True)
class Setting:
    """Values of `KEYS`; None where the file has no such axis or the setting does not use it."""

    scheme: str | None = None
    step: float | None = None
    harmonics: int | str | None = None
    samples: int | str | None = None
    tolerance: float | None = None
    rtol: float | None = None

    def words(self, key: str) -> str:
        """One value as text; a dash where there is none."""
        value = getattr(self, key)
        if value is None:
            return "\N{EN DASH}"
        return value if isinstance(value, str) else show_number(float(value), 4)

    def describe(self, keys: tuple[str, ...] = KEYS) -> str:
        """Those values that there are, in words."""
        given = [key for key in keys if getattr(self, key) is not None]
        said = [self.words(key) if key == "scheme" else f"{key} {self.words(key)}" for key in given]
        return ", ".join(said)

    def without(self, *keys: str) -> Setting:
        """The same with some keys left open: equal for settings that differ in these only."""
        return replace(self, **dict.fromkeys(keys))

    @property
    def automatic(self) -> bool:
        """Whether harmonics or samples are chosen by the state, to `rtol`."""
        return AUTO in (self.harmonics, self.samples)


@dataclass(frozen=True)
class Run:
    """What one setting computed at one point, to tolerance.

    run_time: CPU seconds. cycles (n_cycle,). worn (n_cycle,): worn volume, m3. response (n_cycle, n_response):
    amplitude, m. error_estimate, response_error: relative, of the last worn volume and of the last response; NaN where
    the file does not say. used: harmonics and samples of the last state, 0 where the file does not say.
    step_limit: predicted largest stable explicit step, cycles. rtol: in effect, whether it is an axis or not; NaN where
    the file does not say.
    """

    setting: Setting
    run_time: float
    cycles: FloatArray
    worn: FloatArray
    response: FloatArray
    error_estimate: float
    response_error: float
    used: tuple[float, float]
    oscillates: bool
    step_limit: float
    rtol: float


@dataclass(frozen=True)
class Failure:
    """A setting that has no result at one point, and the word of its outcome."""

    setting: Setting
    word: str


@dataclass(frozen=True)
class Runs:
    """All settings at one point of the other axes.

    label: the point in words, empty where nothing but settings varies. exact: run of the exact answer, None where the
    file holds none.
    """

    place: Mapping[str, int]
    label: str
    runs: tuple[Run, ...]
    failures: tuple[Failure, ...]
    exact: Run | None

    @property
    def outcomes(self) -> Counter[str]:
        """How many settings failed, by the word of their outcome."""
        return Counter(failure.word for failure in self.failures)


def varying_keys(result: Result) -> tuple[str, ...]:
    """Settings that the file has several values of."""
    return tuple(key for key in KEYS if key in result.varying)


def read_runs(result: Result) -> tuple[Runs, ...]:
    """All points of the axes that are no settings. A setting that the file holds several times is taken once."""
    reader = _Reader(result)
    others = [name for name in result.axes if name not in KEYS]
    found = []
    for indices in itertools.product(*(range(result.dataset.sizes[name]) for name in others)):
        place = dict(zip(others, indices, strict=True))
        varying = [name for name in others if name in result.varying]
        label = result.describe(place, varying) if varying else ""
        runs, failures = {}, {}
        for whole in reader.settings(place):
            setting = reader.setting(whole)
            if setting in runs or setting in failures:
                continue
            if result.computed[tuple(whole.values())]:
                runs[setting] = reader.run(setting, whole)
            else:
                number = int(result.dataset["outcome"].values[tuple(whole.values())])
                failures[setting] = Failure(setting, result.endings[number].word)
        found.append(Runs(place, label, tuple(runs.values()), tuple(failures.values()), reader.exact(place)))
    return tuple(found)


class _Reader:
    """The variables of a file that are compared, read whole once."""

    def __init__(self, result: Result) -> None:
        self.result = result
        self.keys = [name for name in result.axes if name in KEYS]
        self.solver = result.study.get("solver", {})
        self.by_depth = result.study.get("slow_time", {}).get("largest_depth") is not None
        n_response = len(result.responses)
        self.worn = self._values("worn_volume", (len(result.cycles),))
        self.response = self._values("response_amplitude", (len(result.cycles), n_response))
        self.exact_worn = self._values("exact_worn_volume", (len(result.cycles),))
        self.exact_response = self._values("exact_response_amplitude", (len(result.cycles), n_response))
        self.time = self._values("run_time", ())
        self.error = self._values("error_estimate", ())
        self.limit = self._values("step_limit", ())
        self.oscillates = self._values("oscillates", ())
        self.response_error = self._values("response_error", (len(result.cycles),))
        self.harmonics_used = self._values("harmonics_used", (len(result.cycles),))
        self.samples_used = self._values("samples_used", (len(result.cycles),))

    def _values(self, name: str, shape: tuple[int, ...]) -> FloatArray:
        """Values (axes..., *shape); NaN where the file does not hold the variable."""
        result = self.result
        if result.has(name):
            return np.asarray(result.read(name).values, dtype=float)
        return np.broadcast_to(np.nan, (*result.computed.shape, *shape))

    def settings(self, place: Mapping[str, int]) -> Iterator[dict[str, int]]:
        """Places of all settings at a point, in the order of the axes."""
        sizes = (range(self.result.dataset.sizes[name]) for name in self.keys)
        for indices in itertools.product(*sizes):
            whole = {**place, **dict(zip(self.keys, indices, strict=True))}
            yield {name: whole[name] for name in self.result.axes}

    def setting(self, whole: Mapping[str, int]) -> Setting:
        """The setting at a place, without the values that it does not use."""
        values: dict[str, object] = {key: self._value(key, whole[key]) for key in self.keys}
        scheme = values.get("scheme")
        if self.result.cycles[-1] == 0.0:
            # only unworn states: no scheme takes a step
            values["scheme"] = values["step"] = None
        if scheme == ADAPTIVE or (scheme == EXPLICIT and self.by_depth):
            values["step"] = None
        resolution = [values.get(key, self.solver.get(key, AUTO)) for key in ("harmonics", "samples")]
        if values["scheme"] != ADAPTIVE and AUTO not in resolution:
            values["rtol"] = None
        return Setting(**values)  # type: ignore[arg-type]

    def _value(self, key: str, index: int) -> float | int | str:
        value = self.result.dataset[key].values[index]
        if key == "scheme":
            return str(value)
        if key in ("harmonics", "samples"):
            return AUTO if str(value) == AUTO else int(value)
        return float(value)

    def run(self, setting: Setting, whole: Mapping[str, int]) -> Run:
        """What was computed at a place."""
        at = tuple(whole.values())
        return Run(
            setting=setting,
            run_time=float(self.time[at]),
            cycles=self.result.cycles,
            worn=self.worn[at],
            response=self.response[at],
            error_estimate=float(self.error[at]),
            response_error=float(self.response_error[at][-1]),
            used=(_or_zero(self.harmonics_used[at][-1]), _or_zero(self.samples_used[at][-1])),
            oscillates=bool(self.oscillates[at] == 1.0),
            step_limit=float(self.limit[at]),
            rtol=self.result.study_number("solver", "rtol") if setting.rtol is None else setting.rtol,
        )

    def exact(self, place: Mapping[str, int]) -> Run | None:
        """The exact answer at a point, the same for all settings; None where it is not known."""
        at = tuple(next(self.settings(place)).values())
        worn, response = self.exact_worn[at], self.exact_response[at]
        if not (np.isfinite(worn).all() and np.isfinite(response).all()):
            return None
        return Run(Setting(), 0.0, self.result.cycles, worn, response, 0.0, 0.0, (0.0, 0.0), False, np.nan, np.nan)


def _or_zero(value: float) -> float:
    return float(value) if np.isfinite(value) else 0.0
