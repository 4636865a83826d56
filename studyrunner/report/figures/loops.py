"""Fretting loops, normal load and motion of chosen pairs through a period (Figs. 13, 14, 15 of the paper)."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import studyrunner.accessor  # noqa: F401  (registers Dataset.fretwear)
from studyrunner.report.drawing import Drawing, Missing, add_legend, line_style, new_panels, title_at
from studyrunner.report.figures.flanks import JOINT_WORDS
from studyrunner.result.scene_pairs import last_depth, tells_depth
from studyrunner.result.units import scale_for
from studyrunner.result.view import Result, as_sentences

_MOST_PAIRS = 3
_TITLE = "Fretting loops"
_NO_MOTION = 1e-15
"""m. A range below this is round-off."""
_TANGENTS = ("tangent_1", "tangent_2")
_LABEL_WIDTH = 25


@dataclass(frozen=True)
class _Loop:
    """A pair through a period, closed, at the first and at the last cycle count.

    displacement, force: by component (n_ends, n_phases), m and N; components that the pair does not have are left out.
    phase (n_phases,): rad.
    """

    pair: int
    phase: NDArray[np.float64]
    displacement: dict[str, NDArray[np.float64]]
    force: dict[str, NDArray[np.float64]]

    def drift(self, tangent: str) -> float:
        """Change of the mean displacement along a tangent from the first to the last cycle count, m."""
        first, *_, last = self.displacement[tangent][:, :-1].mean(axis=1)
        return float(last - first)


def draw_loops(result: Result) -> Iterator[Drawing | Missing]:
    """Figures of the pairs whose loops the file holds; a sentence where it holds none."""
    point = result.shown_point()
    pairs = find_loops(result, point) if result.has("loop_displacement", "loop_force") else []
    depth = np.zeros(result.dataset.sizes["contact"])
    if tells_depth(result):
        depth = np.nan_to_num(last_depth(result, point))
    if not pairs:
        deepest = int(result.dataset["contact"].values[np.argmax(depth)])
        sentence = f"Add the contact pairs to see to [outputs] loops, for instance loops = [{deepest}]."
        yield Missing("fretting_loops", _TITLE, sentence)
        return
    worn = dict(zip(result.dataset["contact"].values.tolist(), depth.tolist(), strict=True))
    order = sorted(pairs, key=lambda pair: -worn[pair])
    loops = [_read_loop(result, point, pair) for pair in sorted(order[:_MOST_PAIRS])]
    others = ", ".join(map(str, sorted(order[_MOST_PAIRS:])))
    tail = f"The file also holds loops of the pairs {textwrap.shorten(others, 40)}" if others else ""
    ends = [result.cycle_label(0), result.cycle_label(-1)][: len(result.cycles)]
    for draw in (_draw_fretting, _draw_normal, _draw_motion):
        drawing = draw(result, loops, ends, tail)
        if drawing is not None:
            yield drawing


def _words(result: Result, loops: Sequence[_Loop]) -> dict[str, str]:
    """The tangents in words: by the scene where it is known, else by their numbers."""
    if not any(_TANGENTS[1] in loop.force or _TANGENTS[1] in loop.displacement for loop in loops):
        return dict.fromkeys(_TANGENTS, "tangential")
    named = JOINT_WORDS.get(str(result.study.get("scene", {}).get("model")), ("tangent 1", "tangent 2"))
    return dict(zip(_TANGENTS, named, strict=True))


def find_loops(result: Result, point: dict[str, int]) -> list[int]:
    """Contact pairs whose loops the file holds at a point: those that the study asked for, without those of NaN."""
    listed = result.study.get("outputs", {}).get("loops")
    pairs = [int(pair) for pair in result.dataset["contact"].values]
    wanted = [pair for pair in pairs if pair in listed] if isinstance(listed, list) and listed else pairs
    force = result.at("loop_force", point, 0).sel(contact=wanted)
    held = np.isfinite(force.values).any(axis=tuple(force.get_axis_num(name) for name in ("phase", "component")))
    return [pair for pair, kept in zip(wanted, held, strict=True) if kept]


def _read_loop(result: Result, point: dict[str, int], pair: int) -> _Loop:
    ends = [0, -1] if len(result.cycles) > 1 else [0]
    names = ["loop_displacement", "loop_force"]
    loop: xr.Dataset = result.dataset[names].isel({**point, "cycle": ends}).fretwear.loop(pair)
    components = [str(name) for name in loop["component"].values]

    def split(name: str) -> dict[str, NDArray[np.float64]]:
        values = loop[name].transpose("component", "cycle", "phase").values
        # A component that the pair does not have is NaN, or zero throughout.
        held = [np.isfinite(array).all() and array.any() for array in values]
        return {name: array for name, array, kept in zip(components, values, held, strict=True) if kept}

    return _Loop(pair, np.asarray(loop["phase"].values, dtype=float), split("displacement"), split("force"))


def _draw_fretting(result: Result, loops: Sequence[_Loop], ends: Sequence[str], tail: str) -> Drawing | None:
    """Tangential force over tangential displacement, one row a direction (Fig. 13)."""
    rows = [name for name in _TANGENTS if any(name in loop.displacement and name in loop.force for loop in loops)]
    if not rows:
        return None
    words = _words(result, loops)
    length = scale_for("m", *(loop.displacement[name] for loop in loops for name in rows if name in loop.displacement))
    load = scale_for("N", *(loop.force[name] for loop in loops for name in rows if name in loop.force))

    def draw(panel: Axes, loop: _Loop, row: int) -> None:
        name = rows[row]
        if name in loop.displacement and name in loop.force:
            _draw_ends(panel, length(_centred(loop.displacement[name])), load(_centred(loop.force[name])), ends)
        _label(panel, length.label(f"displacement, {words[name]}"), load.label(f"force, {words[name]}"))

    text = as_sentences(
        "Tangential force over relative displacement through a period, each about its mean: the area inside is the"
        " energy of friction",
        _tell_drift(loops, words, ends),
        tail,
    )
    return Drawing("fretting_loops", title_at(result, _TITLE), text, _grid(loops, len(rows), draw, ends))


def _draw_normal(result: Result, loops: Sequence[_Loop], ends: Sequence[str], tail: str) -> Drawing | None:
    """Normal force through a period (Fig. 14)."""
    loops = [loop for loop in loops if "normal" in loop.force]
    if not loops:
        return None
    load = scale_for("N", *(loop.force["normal"] for loop in loops))

    def draw(panel: Axes, loop: _Loop, _row: int) -> None:
        phase = np.broadcast_to(np.degrees(loop.phase), loop.force["normal"].shape)
        _draw_ends(panel, phase, load(loop.force["normal"]), ends, arrows=False)
        panel.set_xlim(0, 360)
        panel.set_xticks([0, 90, 180, 270, 360])
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]) if loop.force["normal"].min() < 0.0 else 0.0)
        _label(panel, "phase (°)", load.label("normal force"))

    def open_part(loop: _Loop) -> str:
        fractions = np.mean(loop.force["normal"][:, :-1] <= 0.0, axis=1)
        return f"pair {loop.pair} " + ", then ".join(f"{100.0 * fraction:.0f} %" for fraction in fractions)

    said = f"Where the force is zero the pair is open: {', '.join(map(open_part, loops))} of the period"
    title = title_at(result, "Normal load through a period")
    return Drawing("normal_load", title, as_sentences(said, tail), _grid(loops, 1, draw, ends))


def _draw_motion(result: Result, loops: Sequence[_Loop], ends: Sequence[str], tail: str) -> Drawing | None:
    """Path of the relative displacement in the contact plane (Fig. 15); None with one tangent only."""
    loops = [loop for loop in loops if all(name in loop.displacement for name in _TANGENTS)]
    if not loops:
        return None
    words = _words(result, loops)
    length = scale_for("m", *(loop.displacement[name] for loop in loops for name in _TANGENTS))

    def draw(panel: Axes, loop: _Loop, _row: int) -> None:
        first, second = (length(_centred(loop.displacement[name])) for name in _TANGENTS)
        _draw_ends(panel, first, second, ends)
        _label(panel, *(length.label(f"displacement, {words[name]}") for name in _TANGENTS))
        panel.set_aspect("equal", adjustable="datalim")

    def extent(loop: _Loop) -> str:
        most = np.max([np.ptp(loop.displacement[name], axis=1) for name in _TANGENTS], axis=0)
        told = ["sticks" if value < _NO_MOTION else scale_for("m", value).show(float(value)) for value in most]
        return f"pair {loop.pair} {', then '.join(told)}"

    text = as_sentences(
        "Path of the relative displacement in the contact plane about its mean; a pair that sticks is a dot",
        f"Largest extent: {', '.join(map(extent, loops))}",
        tail,
    )
    title = title_at(result, "Motion of the pairs in the contact plane")
    return Drawing("pair_motion", title, text, _grid(loops, 1, draw, ends))


def _label(panel: Axes, across: str, upright: str) -> None:
    """Labels of the axes, in lines that fit a panel."""
    panel.set_xlabel(textwrap.fill(across, _LABEL_WIDTH, break_on_hyphens=False))
    panel.set_ylabel(textwrap.fill(upright, _LABEL_WIDTH, break_on_hyphens=False))


def _centred(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Closed courses (n_ends, n) about their means over the period; zero where they are round-off."""
    away = values - values[:, :-1].mean(axis=1, keepdims=True)
    return np.where(np.ptp(values, axis=1, keepdims=True) < _NO_MOTION, 0.0, away)


def _tell_drift(loops: Sequence[_Loop], words: dict[str, str], ends: Sequence[str]) -> str:
    """How far the mean of each pair has moved along each tangent between the two cycle counts."""
    if len(ends) < 2:
        return ""
    told = []
    for loop in loops:
        names = [name for name in _TANGENTS if name in loop.displacement]
        length = scale_for("m", *(loop.drift(name) for name in names))
        parts = ", ".join(f"{length.show(loop.drift(name))} {words[name]}" for name in names)
        told += [f"pair {loop.pair} {parts}"] if parts else []
    return f"The mean displacement drifts from {ends[0]} to {ends[1]} by: {'; '.join(told)}" if told else ""


def _draw_ends(
    panel: Axes, x: NDArray[np.float64], y: NDArray[np.float64], ends: Sequence[str], *, arrows: bool = True
) -> None:
    """Lines (n_ends, n) of the first and last cycle count; a marker where the period begins, an arrow its way."""
    for number, label in enumerate(ends):
        look = line_style(number)
        panel.plot(x[number], y[number], label=label, **{**look, "markevery": [0]})
        own_x, own_y = x[number], y[number]
        if arrows and np.ptp(own_x) + np.ptp(own_y) > 0.0:
            # where the line goes fastest on paper
            pace = np.hypot(np.diff(own_x) / (np.ptp(own_x) or 1.0), np.diff(own_y) / (np.ptp(own_y) or 1.0))
            at = int(np.argmax(pace))
            way: dict[str, Any] = {"arrowstyle": "-|>", "color": look["color"], "linewidth": 0.0, "mutation_scale": 15}
            ends_of = (own_x[at + 1], own_y[at + 1]), (own_x[at], own_y[at])
            panel.annotate("", *ends_of, arrowprops=way, annotation_clip=False)


def _grid(loops: Sequence[_Loop], n_rows: int, draw: Callable[[Axes, _Loop, int], None], ends: Sequence[str]) -> Figure:
    """One column a pair; the legend below all."""
    figure, panels = new_panels(n_rows, len(loops), 0.5 + 2.7 * n_rows)
    for column, loop in enumerate(loops):
        panels[0, column].set_title(f"pair {loop.pair}")
        for row in range(n_rows):
            draw(panels[row, column], loop, row)
            if column > 0:
                panels[row, column].set_ylabel("")
            panels[row, column].locator_params(nbins=5)
    if len(ends) > 1:
        add_legend(figure)
    return figure
