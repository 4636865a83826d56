"""Fretting loops, normal load and motion of chosen pairs through a period (Figs. 13, 14, 15 of the paper)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import studyrunner.accessor  # noqa: F401  (registers Dataset.fretwear)
from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.flanks import JOINT_WORDS
from studyrunner.report.panels import FloatArray, label_outer, line_style, new_panels
from studyrunner.result.pairs import has_depths, last_depth
from studyrunner.result.view import Result
from studyrunner.units import scale_for

_MOST_PAIRS, _LABEL_WIDTH = 3, 25
_NO_MOTION = 1e-15  # m; a range below this is round-off
_TANGENTS = ("tangent_1", "tangent_2")

_Curves = dict[int, tuple[FloatArray, FloatArray]]
"""Of each pair x and y (n_ends, n_phases + 1), closed, in SI, at the first and at the last cycle count."""


def draw_fretting(result: Result) -> Drawn:
    """Tangential force over tangential displacement, one row a direction."""
    loops = _read_loops(result)
    if not loops:
        depth = last_depth(result, result.shown_point()) if has_depths(result) else np.zeros(1)
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
    figure = _draw(result, list(rows.values()), ("m", "N"), labels)
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
    figure = _draw(result, [curves], ("°", "N"), [("phase", "normal force")])
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
    figure = _draw(result, [curves], ("m", "m"), [(first_label, second_label)])
    for panel in figure.axes:
        panel.set_aspect("equal", adjustable="datalim")
    return figure, _how_made(result, loops)


def find_loops(result: Result, point: Mapping[str, int]) -> list[int]:
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
    point, source = result.shown_point(), result.again.get("loops")
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
    if "loops" in result.again:
        return str(result.again["loops"].attrs["how"])
    others = ", ".join(str(pair) for pair in find_loops(result, result.shown_point()) if pair not in loops)
    return f"The file also holds loops of the pairs {textwrap.shorten(others, 40)}" if others else ""


def _draw(result: Result, rows: Sequence[_Curves], units: tuple[str, str], labels: Sequence[tuple[str, str]]) -> Figure:
    """One column a pair, one row a set of curves; a marker where the period begins, an arrow its way."""
    ends = [result.cycle_label(0), result.cycle_label(-1)]
    values = [[pair[which] for curves in rows for pair in curves.values()] for which in (0, 1)]
    scales = [scale_for(unit, *each) for unit, each in zip(units, values, strict=True)]
    if units[0] == units[1]:
        scales = 2 * [scale_for(units[0], *values[0], *values[1])]
    figure, panels = new_panels(len(rows), len(rows[0]), 0.5 + 2.7 * len(rows))
    for row, (curves, texts) in enumerate(zip(rows, labels, strict=True)):
        across, upright = (
            textwrap.fill(scale.label(text), _LABEL_WIDTH, break_on_hyphens=False)
            for scale, text in zip(scales, texts, strict=True)
        )
        for panel, (pair, (x_of_ends, y_of_ends)) in zip(panels[row], curves.items(), strict=True):
            for number, (x, y) in enumerate(zip(scales[0](x_of_ends), scales[1](y_of_ends), strict=True)):
                look = line_style(number) | {"markevery": [0], "label": ends[number]}
                panel.plot(x, y, **look)
                if units[0] == "m" and np.ptp(x) + np.ptp(y) > 0.0:
                    # where the line goes fastest on paper
                    at = int(np.argmax(np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(y) / (np.ptp(y) or 1.0))))
                    way: dict[str, Any] = {"arrowstyle": "-|>", "color": look["color"], "lw": 0.0, "mutation_scale": 15}
                    panel.annotate("", (x[at + 1], y[at + 1]), (x[at], y[at]), arrowprops=way, annotation_clip=False)
            panel.set_title(f"pair {pair}" if row == 0 else "")
            panel.locator_params(nbins=5)
            panel.set(xlabel=across, ylabel=upright)
        label_outer(panels[row : row + 1])
    return figure
