"""Error against run time of the numerical settings that a file compares; the CSV file of the figure has all of them."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from studyrunner.kinds.wear.kind import OWN_STEPS
from studyrunner.report.drawing import Drawn, FloatArray, add_legend, line_style, new_panels, set_log
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.units import show_number, show_percent

QUANTITIES = {"volume": "final worn volume", "response": "response at the end"}
"""What is compared, in words."""

RESOLVED = 3.0
"""An error counts from so many times the uncertainty of the reference on."""

_SMALLEST = 1e-12  # relative error that double precision shows
_AUTO, _EXPLICIT = "auto", "explicit"
_COMPARED = (
    *("computed", "run_time", "worn_volume", "response_amplitude", "exact_worn_volume", "exact_response_amplitude"),
    *("error_estimate", "response_error", "harmonics_used"),
)
_SHAPES, _SHAPED = "os^DvPX<>p", ("harmonics", "rtol", "samples", "tolerance", "step")
_NO_LINE: dict[str, Any] = {"linestyle": "none", "markersize": 5.5}
_RING = {**_NO_LINE, "marker": "o", "markersize": 11, "markerfacecolor": "none", "markeredgecolor": "black"}


class Setting(NamedTuple):
    """Values of `KEYS`; None where the file has no such axis or the setting does not use it."""

    scheme: str | None = None
    step: float | None = None
    harmonics: float | str | None = None
    samples: float | str | None = None
    tolerance: float | None = None
    rtol: float | None = None

    def describe(self) -> str:
        """Those values that there are, in words."""
        values = {key: value for key, value in self._asdict().items() if value is not None}
        texts = {key: value if isinstance(value, str) else show_number(value, 4) for key, value in values.items()}
        return ", ".join(text if key == "scheme" else f"{key} {text}" for key, text in texts.items())


KEYS = Setting._fields
"""Axes along which only the numbers change and not what is computed."""


@dataclass(frozen=True)
class ComparedPoint:
    """What each setting gave at one point of the other axes; arrays (n_setting,).

    label: the point in words, empty where nothing but settings varies. time: CPU s. errors: of `QUANTITIES`,
    relative, NaN for the reference itself and what was not computed; of the volume infinite where the reference wears
    nothing. reference: row of the finest setting, None where the exact answer is known, or nothing. uncertainty: of the
    reference, relative, infinite where not known.
    """

    label: str
    settings: tuple[Setting, ...]
    time: FloatArray
    errors: Mapping[str, FloatArray]
    reference: int | None
    uncertainty: Mapping[str, float]

    def is_clear(self, quantity: str) -> NDArray[np.bool_]:
        """Which errors (n_setting,) are clearly more than round-off and the uncertainty of the reference."""
        least = max(RESOLVED * self.uncertainty[quantity], _SMALLEST)
        return np.asarray((self.errors[quantity] >= least) & np.isfinite(self.errors[quantity]))

    def front(self, quantity: str, scheme: str | None = None) -> list[int]:
        """Rows of settings than which no quicker one is as exact, the quickest first."""
        errors = np.maximum(self.errors[quantity], RESOLVED * self.uncertainty[quantity])
        of_scheme = np.array([scheme in (None, each.scheme) for each in self.settings]) & np.isfinite(errors)
        rows = sorted(np.flatnonzero(of_scheme).tolist(), key=lambda row: (self.time[row], errors[row]))
        least = np.minimum.accumulate([math.inf, *errors[rows]])
        return [row for row, before in zip(rows, least, strict=False) if errors[row] < before]


def compare_settings(result: Result) -> tuple[ComparedPoint, ...]:
    """What the settings of a file cost and how wrong they are, at all points of the other axes.

    Empty without two to compare with a third one, or with the exact answer, as schemes alone are.
    """
    varying = [key for key in KEYS if key in result.varying]
    alone = set(varying) <= {"scheme"} and not result.has("exact_worn_volume")
    if alone or not result.has("worn_volume", "response_amplitude"):
        return ()
    keys, others = ([name for name in result.axes if (name in KEYS) == each] for each in (True, False))
    settings = _list_settings(result, keys)
    rows = list(settings.values())
    dataset = result.dataset.assign(computed=(result.axes, result.computed)).isel(cycle=-1, missing_dims="ignore")

    def read(name: str, at: Mapping[str, int]) -> FloatArray:
        """Values (n_setting, ...) of a point at the last count; NaN where the file has none."""
        if name not in dataset:
            return np.full(len(rows), np.nan)
        table = dataset[name].isel(at).stack(setting=keys, create_index=False).isel(setting=rows)
        return np.asarray(table.transpose("setting", ...).values, dtype=float)

    points = []
    for place in itertools.product(*(range(dataset.sizes[name]) for name in others)):
        at = dict(zip(others, place, strict=True))
        label = result.describe(at, set(result.varying) - set(KEYS))
        points.append(_compare(label, tuple(settings), {name: read(name, at) for name in _COMPARED}))
    most = max(int(np.isfinite(each).sum()) for point in points for each in point.errors.values())
    return tuple(points) if most > 1 else ()


def _compare(label: str, settings: tuple[Setting, ...], values: Mapping[str, FloatArray]) -> ComparedPoint:
    """The settings at one point. values (n_setting, ...): variables of `_COMPARED`."""

    def rank(row: int) -> tuple[float, ...]:
        """The highest of the finest setting: smallest estimated error, no explicit steps; then the most harmonics."""
        error, setting = float(values["error_estimate"][row]), settings[row]
        error = error if math.isfinite(error) and setting.scheme != _EXPLICIT else math.inf
        automatic = isinstance(setting.harmonics, str)
        harmonics = float(values["harmonics_used"][row]) if automatic else float(setting.harmonics or 0.0)
        return -error, harmonics, -(setting.step or 0.0)

    computed, worn, response = values["computed"] == 1.0, values["worn_volume"], values["response_amplitude"]
    volume_there, response_there = (values[f"exact_{name}"][0] for name in ("worn_volume", "response_amplitude"))
    reference, uncertainty = None, dict.fromkeys(QUANTITIES, 0.0)
    if not (np.isfinite(volume_there) and np.isfinite(response_there).all()):
        uncertainty = dict.fromkeys(QUANTITIES, math.inf)
        reference = max(np.flatnonzero(computed).tolist(), key=rank, default=None)
        if reference is not None:
            volume_there, response_there = worn[reference], response[reference]
            estimates = (values[name][reference] for name in ("error_estimate", "response_error"))
            known = (float(np.nan_to_num(each, nan=math.inf)) for each in estimates)
            uncertainty = dict(zip(QUANTITIES, known, strict=True))
    volume = np.where(worn > NO_VOLUME, np.inf, np.nan)
    if not volume_there <= NO_VOLUME:
        volume = np.abs(worn - volume_there) / volume_there
    away = np.linalg.norm(response - response_there, axis=-1) / (float(np.linalg.norm(response_there)) or np.nan)
    compared = computed & (np.arange(len(settings)) != reference)
    errors = {name: np.where(compared, each, np.nan) for name, each in zip(QUANTITIES, (volume, away), strict=True)}
    return ComparedPoint(label, settings, values["run_time"], errors, reference, uncertainty)


def _list_settings(result: Result, keys: list[str]) -> dict[Setting, int]:
    """All settings, without values that they do not use, each with its first place among the values of `keys`."""

    def read(key: str, value: object) -> float | str:
        # numbers beside "auto" are texts in the file
        text = str(value)
        return text if key == "scheme" or text == _AUTO else float(text)

    by_depth = result.study.get("slow_time", {}).get("largest_depth") is not None
    solver, settings = result.study.get("solver", {}), dict[Setting, int]()
    axes = ([read(key, value) for value in result.dataset[key].values] for key in keys)
    for place, given in enumerate(itertools.product(*axes)):
        setting = Setting(**dict(zip(keys, given, strict=True)))  # type: ignore[arg-type]
        if setting.scheme in OWN_STEPS or (setting.scheme == _EXPLICIT and by_depth):
            setting = setting._replace(step=None)
        if result.cycles[-1] == 0.0:
            # only unworn states: no scheme takes a step
            setting = setting._replace(scheme=None, step=None)
        automatic = [getattr(setting, key) or solver.get(key, _AUTO) for key in ("harmonics", "samples")]
        if setting.scheme not in OWN_STEPS and _AUTO not in automatic:
            setting = setting._replace(rtol=None)
        settings.setdefault(setting, place)
    return settings


def draw_precision(result: Result) -> Drawn:
    """Errors of the settings at the shown point, one column a quantity; nothing where no settings are compared."""
    where = result.describe(result.shown, set(result.varying) - set(KEYS))
    point = next((each for each in compare_settings(result) if each.label == where), None)
    if point is None:
        return None
    quantities = [name for name in QUANTITIES if point.is_clear(name).any()]
    if not quantities:
        return "Here no error is clearly larger than the uncertainty of the reference: give finer values of a key."
    figure, (panels,) = new_panels(1, len(quantities), 3.0)
    schemes = dict.fromkeys(each.scheme for each in point.settings)
    looks = map(line_style, range(len(schemes)))
    lines = {s: {key: look[key] for key in ("color", "linestyle")} for s, look in zip(schemes, looks, strict=True)}
    # the first other key that varies has the shapes
    key = next((key for key in _SHAPED if key in result.varying), "scheme")
    values = {getattr(each, key) for each in point.settings if key != "scheme"} - {None}
    ordered = sorted(values, key=lambda value: math.inf if isinstance(value, str) else value)
    shapes = dict(zip(ordered, itertools.cycle(_SHAPES), strict=False))
    markers = [shapes.get(getattr(each, key), "h") for each in point.settings]
    for panel, quantity in zip(panels, quantities, strict=True):
        _draw_panel(panel, point, quantity, lines, markers)
        panel.set(xlabel="CPU time of one point (s)", ylabel=f"error of {QUANTITIES[quantity]}")
    meaning = {scheme or "all": look for scheme, look in lines.items()}
    meaning |= {
        Setting(**{key: each}).describe(): {"marker": s, "color": "0.3", **_NO_LINE} for each, s in shapes.items()
    }
    meaning["cheapest for its error"] = _RING
    add_legend(figure, [Line2D([], [], label=label, **look) for label, look in meaning.items()])
    against = "errors are those against the exact answer"
    if point.reference is not None:
        each = (f"{show_percent(point.uncertainty[name])} ({words})" for name, words in QUANTITIES.items())
        finest = point.settings[point.reference].describe()
        against = f"errors are those against the finest setting ({finest}), known to {' and '.join(each)}"
    return figure, f"{point.label or 'Reference'}: {against}"


def _draw_panel(panel: Axes, point: ComparedPoint, quantity: str, lines: Mapping[Any, Any], markers: list[str]) -> None:
    """lines: look of each scheme. markers: of each setting."""
    errors, time, clear = point.errors[quantity], point.time, point.is_clear(quantity)
    least = RESOLVED * point.uncertainty[quantity]
    bottom = 0.5 * min(float(errors[clear].min()), *errors[(errors > _SMALLEST) & np.isfinite(errors)])
    drawn, known = np.maximum(errors, bottom), np.isfinite(errors)
    for scheme, look in lines.items():
        rows = point.front(quantity, scheme)
        panel.plot(time[rows], drawn[rows], linewidth=2.0, zorder=3, **look)
    for row in np.flatnonzero(known):
        setting = point.settings[row]
        colour = lines[setting.scheme]["color"]
        look = {"markerfacecolor": colour if clear[row] else "white", "markeredgecolor": colour, "zorder": 4}
        panel.plot(time[row], drawn[row], marker=markers[row], label=setting.describe(), **_NO_LINE, **look)
    rows = point.front(quantity)
    panel.plot(time[rows], drawn[rows], zorder=5, **_RING)
    set_log(panel.xaxis, float(time[known].min()), float(time[known].max()))
    set_log(panel.yaxis, bottom, float(errors[known].max()), percent=True)
    if 0.8 * bottom < least < math.inf:
        panel.axhspan(0.8 * bottom, least, color="0.9", zorder=0)
    panel.set_ylim(bottom=0.8 * bottom)
