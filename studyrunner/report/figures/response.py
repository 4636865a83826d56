"""How the joint vibrates: response over frequency (Fig. 9 of the paper), modes, loops of pairs (Figs. 13 to 15)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import studyrunner.accessor  # noqa: F401  (registers Dataset.fretwear)
from studyrunner.report import panels as plot
from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.flanks import JOINT_WORDS
from studyrunner.report.panels import COLOURS, FloatArray
from studyrunner.report.selection import Course, choose, find_course, labelled
from studyrunner.result.pairs import has_depths, last_depth
from studyrunner.result.view import NO_VOLUME, Point, Result
from studyrunner.units import Scale, scale_for

_MOST_LINES, _MOST_RESPONSES, _MOST_FOLDS, _MOST_MODES, _MOST_PAIRS = 3, 3, 12, 6, 3
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_BEFORE = "worn_cycle"
_WORN: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (5, 1.5)), "marker": "s", "markersize": 4.5}
_LABEL_WIDTH = 25
_NO_MOTION = 1e-15  # m; a range below this is round-off
_TANGENTS = ("tangent_1", "tangent_2")

_Curves = dict[int, tuple[FloatArray, FloatArray]]
"""Of each pair x and y (n_ends, n_phases + 1), closed, in SI, at the first and at the last cycle count."""


# --- over the frequency, and the amplitude of a mode ---


def draw_responses(result: Result) -> Drawn:
    """Amplitude of the first harmonic over frequency, a panel a response: of the new and of the shown worn joint."""
    course, curves = find_course(result, "frequency"), result.recomputed.get("response")
    if course is None and curves is None:
        said = "The study has one frequency: give several under [axes] frequency"
        return f"{result.no_worn_response or said}."
    if course is not None and result.cycles[0] != 0.0:
        return "The file holds no new joint: add 0 to slow_time.outputs."
    if curves is not None:
        curves = curves.sel(response=list(result.responses))
    n_panels = min(len(result.responses), _MOST_RESPONSES)
    figure, panels = plot.new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    unit = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
    sizes = [each["response_amplitude"].isel(cycle=0).values for each in (result.dataset, curves) if each is not None]
    scale, peaks, left_out = scale_for(unit, *sizes), list[str](), ("", "")
    for number, panel in reversed(list(enumerate(panels[:, 0]))):
        new, left_out = _draw_new(result, panel, course, scale, number) if course else ([], left_out)
        peaks = new + (_draw_recomputed(panel, curves, scale, number) if curves is not None else [])
        plot.set_from_zero(panel)
        panel.set_ylabel(scale.label(f"amplitude of {result.responses[number]}"))
    panels[-1, 0].set_xlabel("excitation frequency (Hz)")
    return (
        figure,
        f"Largest amplitude of the first harmonic of {result.responses[0]}: {'; '.join(filter(None, peaks))}",
        f"One joint, {curves.attrs['title']}: its response curve at that wear, without further wear" if curves else "",
        f"{curves.attrs['how']}" if curves else "",
        f"Without the curve of the worn joint: {result.no_worn_response}" if result.no_worn_response else "",
        "More responses are in the file" if len(result.responses) > n_panels else "",
        *left_out,
    )


def _draw_new(
    result: Result, panel: Axes, course: Course, scale: Scale, number: int
) -> tuple[list[str], tuple[str, str]]:
    """Lines of a response of the new joint; their peaks in words, and sentences about what failed or is left out."""
    # how a joint wears makes no difference to the new one: NaN where a scheme has found no state
    alike = [axis for axis in _OF_WEAR if axis in result.axes]
    choice = choose(result, ["frequency", *alike], _MOST_LINES, first=(_BEFORE, "sweep", "excitation_amplitude"))
    own = result.dataset["response_amplitude"].isel(cycle=0, response=number).max(alike)
    lines = [own.isel(point, missing_dims="ignore").values[course.index] for point in choice.points]
    peaks = []
    for place, (line, (point, label)) in enumerate(zip(lines, choice, strict=True)):
        text = label if _BEFORE in result.varying else ", ".join(filter(None, (label, "new joint")))
        at, values = course.values, scale(line)
        if result.has("branch"):
            # open where the sweep has jumped
            jumps = np.flatnonzero(np.diff(course.read(result, "branch", {**result.shown, **point})) != 0) + 1
            at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan)
        # the second colour is that of the worn joint
        panel.plot(at, values, **course.line_style(place + (place > 0)), label=text)
        peaks.append(_show_peak(scale, line, course.values, text))
    if result.has("exact_response_amplitude"):
        exact = course.read(result, "exact_response_amplitude", result.shown)[:, 0, number]
        if np.isfinite(exact).any():
            panel.plot(course.values, scale(exact), color="0.5", linewidth=5, alpha=0.45, zorder=1, label="exact")
    fold = result.dataset.get("fold_frequency")
    if fold is not None and "sweep" in fold.dims:
        for style, sweep in zip(("--", ":", "--"), fold["sweep"].values.tolist(), strict=False):
            values, label = fold.sel(sweep=sweep).values, f"fold, sweep {sweep}: jump to another branch"
            for frequency in np.unique(values[np.isfinite(values)])[:_MOST_FOLDS]:
                panel.axvline(frequency, color="0.4", linewidth=0.9, linestyle=style, label=label)
    return peaks, (plot.mark_failed(panel, course.values, np.isnan(lines)), choice.sentence)


def _draw_recomputed(panel: Axes, curves: xr.Dataset, scale: Scale, number: int) -> list[str]:
    """Lines of a response computed again, of the worn joint and where it is there of the new one; their peaks."""
    frequency, peaks = curves["frequency"].values, []
    for cycle in range(curves.sizes["cycle"]):
        is_new = curves.sizes["cycle"] > 1 and cycle == 0
        values = curves["response_amplitude"].isel(cycle=cycle, response=number).values
        label, look = ("new joint", plot.line_style(0)) if is_new else (str(curves.attrs["title"]), _WORN)
        error = curves["response_error"].isel(cycle=cycle).values * values
        plot.add_line(panel, frequency, scale(values), scale(error), label=label, **look)
        peaks.append(_show_peak(scale, values, frequency, label))
    return peaks


def _show_peak(scale: Scale, values: FloatArray, frequency: FloatArray, text: str) -> str:
    if np.isnan(values).all():
        return ""
    top = int(np.nanargmax(values))
    return labelled(f"{scale.show(float(values[top]))} at {frequency[top]:.6g} Hz", text)


def draw_after_wear(result: Result) -> Drawn:
    """Amplitude of each point after its own wear, beside that of the new joint; nothing where no point wears."""
    course = find_course(result, "frequency")
    wears = not result.has("worn_volume") or float(np.nanmax(result.worn, initial=0.0)) > NO_VOLUME
    if course is None or len(result.cycles) == 1 or not wears:
        return None
    choice = choose(result, ["frequency"], _MOST_LINES)
    amplitudes = [course.read(result, "response_amplitude", point)[..., 0] for point in choice.points]
    scale, (figure, panel) = scale_for("m", *amplitudes), plot.new_panel(3.4)
    first = "new joint" if result.cycles[0] == 0.0 else f"each after its own {result.cycle_label(0)}"
    panel.plot(course.values, scale(amplitudes[0][:, 0]), color="0.5", linewidth=1.0, label=first)
    for number, (amplitude, label) in enumerate(zip(amplitudes, choice.labels, strict=True)):
        text = ", ".join(filter(None, (label, f"each after its own {result.cycle_label(-1)}")))
        look = course.line_style(number) | {"linestyle": "none"}
        panel.plot(course.values, scale(amplitude[:, -1]), **look, label=text)
    plot.set_from_zero(panel)
    panel.set_ylabel(scale.label(f"amplitude of {result.responses[0]}"))
    course.set_axis(panel)
    return figure, choice.sentence


def draw_mode(result: Result, name: str) -> Drawn:
    """Natural frequency or damping ratio of modes over the amplitude with error bars, a line for each wear state."""
    course = find_course(result, "modal_amplitude")
    if course is None:
        return "The study has one amplitude: give several under [axes] modal_amplitude."
    choice = choose(result, ["modal_amplitude"], _MOST_MODES, first=("cycle", "mode", "sweep"))
    figure, panel = plot.new_panel(3.6)
    values = np.array([course.read(result, name, point) for point in choice.points])
    for number, (point, label) in enumerate(choice):
        error = course.read(result, f"{name}_error", point) if result.has(f"{name}_error") else None
        if np.isfinite(values[number]).any():
            look = course.line_style(number) | {"label": label or "mode"}
            plot.add_line(panel, course.values, values[number], error, **look)
    panel.set(xlabel=course.label, ylabel="natural frequency (Hz)" if name == "natural_frequency" else "damping ratio")
    plot.set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        plot.set_log(panel.yaxis, low, high, percent=True)
    return figure, plot.mark_failed(panel, course.values, np.isnan(values)), choice.sentence


# --- through a period ---


def draw_fretting(result: Result) -> Drawn:
    """Tangential force over tangential displacement, one row a direction."""
    loops = _read_loops(result)
    if not loops:
        depth = last_depth(result, result.shown) if has_depths(result) else np.zeros(1)
        deepest = int(result.dataset["contact"].values[np.argmax(np.nan_to_num(depth))])
        return f"Add pairs to [outputs] loops, as loops = [{deepest}], or use study-report --loops {deepest}."
    rows: dict[str, _Curves] = {}
    for name in _TANGENTS:
        curves = {
            pair: (_centred(loop, "displacement", name), _centred(loop, "force", name)) for pair, loop in loops.items()
        }
        if any(np.any(force) for _, force in curves.values()):
            rows[name] = curves
    if not rows:
        return None
    words = _words(result, len(rows))
    labels = [(f"displacement, {words[name]}", f"force, {words[name]}") for name in rows]
    figure = _draw_loops(result, list(rows.values()), ("m", "N"), labels)
    return figure, _describe_drift(result, loops, words), _how_made(result, loops)


def draw_normal(result: Result) -> Drawn:
    """Normal force through a period."""
    loops, curves = _read_loops(result), _Curves()
    for pair, loop in loops.items():
        force = loop["force"].sel(component="normal").transpose("cycle", "phase").values
        if np.isfinite(force).all() and force.any():
            curves[pair] = np.broadcast_to(np.degrees(loop["phase"].values), force.shape), force
    if not curves:
        return None
    figure = _draw_loops(result, [curves], ("°", "N"), [("phase", "normal force")])
    for panel in figure.axes:
        panel.set(xlim=(0, 360), xticks=[0, 90, 180, 270, 360])
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]) if panel.dataLim.ymin < 0.0 else 0.0)
    return figure, _how_made(result, loops)


def draw_motion(result: Result) -> Drawn:
    """Path of the relative displacement in the contact plane; nothing where pairs have one tangent only."""
    loops, curves = _read_loops(result), _Curves()
    for pair, loop in loops.items():
        if loop["displacement"].sel(component=list(_TANGENTS)).notnull().all():
            first, second = (_centred(loop, "displacement", name) for name in _TANGENTS)
            curves[pair] = first, second
    if not any(np.any(second) for _, second in curves.values()):
        return None
    first_label, second_label = (f"displacement, {each}" for each in _words(result, 2).values())
    figure = _draw_loops(result, [curves], ("m", "m"), [(first_label, second_label)])
    for panel in figure.axes:
        panel.set_aspect("equal", adjustable="datalim")
    return figure, _how_made(result, loops)


def find_loops(result: Result, point: Point) -> list[int]:
    """Contact pairs whose loops the file holds at a point: those that the study asked for, without those of NaN."""
    if not result.has("loop_displacement", "loop_force"):
        return []
    listed = result.study.get("outputs", {}).get("loops")
    pairs = [int(pair) for pair in result.dataset["contact"].values]
    wanted = [pair for pair in pairs if pair in listed] if isinstance(listed, list) and listed else pairs
    force = result.at("loop_force", point, 0).sel(contact=wanted)
    return [int(pair) for pair in wanted if force.sel(contact=pair).notnull().any()]


def _read_loops(result: Result) -> dict[int, xr.Dataset]:
    """Loops of the most worn pairs at the first and last count: those computed again, or those of the file."""
    point, source = result.shown, result.recomputed.get("loops")
    if source is None and find_loops(result, point):
        source = result.dataset[["loop_displacement", "loop_force"]].isel(point)
    if source is None:
        return {}
    pairs = [int(pair) for pair in source["contact"].values if source["loop_force"].sel(contact=pair).notnull().any()]
    if has_depths(result):
        worn = dict(zip(result.dataset["contact"].values.tolist(), last_depth(result, point).tolist(), strict=True))
        pairs.sort(key=lambda pair: -np.nan_to_num(worn.get(pair, 0.0)))
    ends = source.isel(cycle=[0, -1] if source.sizes["cycle"] > 1 else [0])
    return {pair: ends.fretwear.loop(pair) for pair in sorted(pairs[:_MOST_PAIRS])}


def _words(result: Result, n_directions: int) -> dict[str, str]:
    """The tangents in words: by the scene where it is known, else by their numbers."""
    named = JOINT_WORDS.get(str(result.study.get("scene", {}).get("model")), ("tangent 1", "tangent 2"))
    return dict(zip(_TANGENTS, named, strict=True)) if n_directions > 1 else dict.fromkeys(_TANGENTS, "tangential")


def _centred(loop: xr.Dataset, what: str, component: str) -> FloatArray:
    """Closed courses (n_ends, n) about their means over the period; zero where they are round-off, or there is none."""
    values = loop[what].sel(component=component).transpose("cycle", "phase").values
    away = values - values[:, :-1].mean(axis=1, keepdims=True)
    return np.where(np.ptp(values, axis=1, keepdims=True) >= _NO_MOTION, away, 0.0)


def _describe_drift(result: Result, loops: Mapping[int, xr.Dataset], words: Mapping[str, str]) -> str:
    """How far the mean of each pair has moved along each tangent between the two cycle counts."""
    if len(result.cycles) < 2:
        return ""
    said = []
    for pair, loop in loops.items():
        means = loop["displacement"].isel(phase=slice(-1)).mean("phase")
        drift = {name: float(means.sel(component=name).diff("cycle").values[0]) for name in _TANGENTS}
        drift = {name: each * (abs(each) >= _NO_MOTION) for name, each in drift.items() if np.isfinite(each)}
        length = scale_for("m", *drift.values())
        said.append(f"pair {pair} " + ", ".join(f"{length.show(each)} {words[name]}" for name, each in drift.items()))
    return f"The mean displacement drifts between the two counts by: {'; '.join(said)}"


def _how_made(result: Result, loops: Mapping[int, xr.Dataset]) -> str:
    """How loops of a worn joint were computed again, or which of the file are not shown."""
    if "loops" in result.recomputed:
        return str(result.recomputed["loops"].attrs["how"])
    others = ", ".join(str(pair) for pair in find_loops(result, result.shown) if pair not in loops)
    return f"The file also holds loops of the pairs {textwrap.shorten(others, 40)}" if others else ""


def _draw_loops(
    result: Result, rows: Sequence[_Curves], units: tuple[str, str], labels: Sequence[tuple[str, str]]
) -> Figure:
    """One column a pair, one row a set of curves; a marker where the period begins, an arrow its way."""
    ends = [result.cycle_label(0), result.cycle_label(-1)]
    values = [[pair[which] for curves in rows for pair in curves.values()] for which in (0, 1)]
    scales = [scale_for(unit, *each) for unit, each in zip(units, values, strict=True)]
    if units[0] == units[1]:
        scales = 2 * [scale_for(units[0], *values[0], *values[1])]
    figure, panels = plot.new_panels(len(rows), len(rows[0]), 0.5 + 2.7 * len(rows))
    for row, (curves, texts) in enumerate(zip(rows, labels, strict=True)):
        across, upright = (
            textwrap.fill(scale.label(text), _LABEL_WIDTH, break_on_hyphens=False)
            for scale, text in zip(scales, texts, strict=True)
        )
        for panel, (pair, (x_of_ends, y_of_ends)) in zip(panels[row], curves.items(), strict=True):
            for number, (x, y) in enumerate(zip(scales[0](x_of_ends), scales[1](y_of_ends), strict=True)):
                look = plot.line_style(number) | {"markevery": [0], "label": ends[number]}
                panel.plot(x, y, **look)
                if units[0] == "m" and np.ptp(x) + np.ptp(y) > 0.0:
                    # where the line goes fastest on paper
                    at = int(np.argmax(np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(y) / (np.ptp(y) or 1.0))))
                    way: dict[str, Any] = {"arrowstyle": "-|>", "color": look["color"], "lw": 0.0, "mutation_scale": 15}
                    panel.annotate("", (x[at + 1], y[at + 1]), (x[at], y[at]), arrowprops=way, annotation_clip=False)
            panel.set_title(f"pair {pair}" if row == 0 else "")
            panel.locator_params(nbins=5)
            panel.set(xlabel=across, ylabel=upright)
        plot.label_outer(panels[row : row + 1])
    return figure
