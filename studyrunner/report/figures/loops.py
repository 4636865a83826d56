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
from studyrunner.report.drawing import Drawing, Missing, add_legend, line_style, new_panels
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.scene_pairs import last_depth, tells_depth
from studyrunner.report.reading.units import Scale, scale_for

_MOST_PAIRS = 3
_TITLE = "Fretting loops"
_NO_MOTION = 1e-15
"""m. A range below this is round-off."""
_TANGENTS = ("tangent_1", "tangent_2")
_LABEL_WIDTH = 25


@dataclass(frozen=True)
class _Directions:
    """The tangents in words. labels: what stands in place of {} is a displacement or a force. told: for the caption."""

    labels: tuple[str, str]
    told: str

    def label(self, tangent: str, quantity: str, scale: Scale) -> str:
        """Label of an axis, in lines that fit a panel."""
        words = scale.label(self.labels[_TANGENTS.index(tangent)].format(quantity))
        return textwrap.fill(words, _LABEL_WIDTH, break_on_hyphens=False)


# By the model of the scene, as its pages define them.
_OF_MODEL = {
    "dovetail_sector": _Directions(
        ("axial {}", "{} along the flank"),
        "Positive is axially to the trailing edge, along the flank outwards; displacements are those of the blade"
        " relative to the disk",
    )
}
_LONE_TANGENT = _Directions(("tangential {}", "tangential {}"), "")
_OF_FILE = _Directions(("{} along tangent 1", "{} along tangent 2"), "Tangents 1 and 2 are those of the scene")


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
    if not result.has("loop_displacement", "loop_force"):
        sentence = f"Add the contact pairs to see to [outputs] loops, for instance loops = [{_deepest(result)}]."
        yield Missing("fretting_loops", _TITLE, sentence)
        return
    point = result.shown_point()
    pairs = kept_loops(result, point)
    if not pairs:
        sentence = "The file holds no loops of the point shown: add contact pairs to [outputs] loops."
        yield Missing("fretting_loops", _TITLE, sentence)
        return
    order = sorted(pairs, key=lambda pair: -_wear(result, point, pair))
    loops = [_read_loop(result, point, pair) for pair in sorted(order[:_MOST_PAIRS])]
    others = sorted(order[_MOST_PAIRS:])
    left_out = f"The file also holds the loops of {_tell_pairs(others)}" if others else ""
    tail = as_sentences(f"Pairs shown at {result.describe(point)}", left_out)
    ends = [result.cycle_label(0), result.cycle_label(-1)][: len(result.cycles)]
    directions = _find_directions(result, loops)
    drawings = (
        _draw_fretting(loops, directions, ends, tail),
        _draw_normal(loops, ends, tail),
        _draw_motion(loops, directions, ends, tail),
    )
    for drawing in drawings:
        if drawing is not None:
            yield drawing


def _find_directions(result: Result, loops: Sequence[_Loop]) -> _Directions:
    """What the tangents are called: by the scene where it is known, else by their numbers."""
    return _directions(result, any("tangent_2" in loop.force or "tangent_2" in loop.displacement for loop in loops))


def _directions(result: Result, both: bool) -> _Directions:
    if not both:
        return _LONE_TANGENT
    return _OF_MODEL.get(str(result.study.get("scene", {}).get("model", "")), _OF_FILE)


def component_labels(result: Result, both: bool) -> dict[str, str]:
    """The components of a loop in words; in place of {} stands a displacement or a force. both: whether a pair has
    two tangents.
    """
    return {"normal": "normal {}", **dict(zip(_TANGENTS, _directions(result, both).labels, strict=True))}


def _deepest(result: Result) -> int:
    """The pair that is worn most at the shown point; the first where the file does not say."""
    pairs = result.dataset["contact"].values
    if not tells_depth(result):
        return int(pairs[0])
    return int(pairs[np.argmax(np.nan_to_num(last_depth(result, result.shown_point())))])


def kept_loops(result: Result, point: dict[str, int]) -> list[int]:
    """Contact pairs whose loops the file holds at a point: those that the study asked for, without those of NaN."""
    listed = result.study.get("outputs", {}).get("loops")
    pairs = [int(pair) for pair in result.dataset["contact"].values]
    wanted = [pair for pair in pairs if pair in listed] if isinstance(listed, list) and listed else pairs
    force = result.at("loop_force", point, 0).sel(contact=wanted)
    held = np.isfinite(force.values).any(axis=tuple(force.get_axis_num(name) for name in ("phase", "component")))
    return [pair for pair, kept in zip(wanted, held, strict=True) if kept]


def _tell_pairs(pairs: Sequence[int]) -> str:
    shown = ", ".join(str(pair) for pair in pairs[:8])
    return f"{'pair' if len(pairs) == 1 else 'pairs'} {shown}" + (", ..." if len(pairs) > 8 else "")


def _wear(result: Result, point: dict[str, int], pair: int) -> float:
    """What pairs are chosen by: wear depth at the end, m; all the same where the file holds none."""
    if not result.has("wear_depth"):
        return 0.0
    return float(np.nan_to_num(result.at("wear_depth", point, -1).sel(contact=pair).values))


def _read_loop(result: Result, point: dict[str, int], pair: int) -> _Loop:
    ends = [0, -1] if len(result.cycles) > 1 else [0]
    names = ["loop_displacement", "loop_force"]
    loop: xr.Dataset = result.dataset[names].isel({**point, "cycle": ends}).fretwear.loop(pair)
    components = [str(name) for name in loop["component"].values]

    def split(name: str) -> dict[str, NDArray[np.float64]]:
        values = loop[name].transpose("component", "cycle", "phase").values
        # A component that the pair does not have is NaN, or zero throughout.
        return {
            component: array
            for component, array in zip(components, values, strict=True)
            if np.isfinite(array).all() and array.any()
        }

    return _Loop(pair, np.asarray(loop["phase"].values, dtype=float), split("displacement"), split("force"))


def _draw_fretting(loops: Sequence[_Loop], directions: _Directions, ends: Sequence[str], tail: str) -> Drawing | None:
    """Tangential force over tangential displacement, one row a direction (Fig. 13)."""
    rows = [name for name in _TANGENTS if any(name in loop.displacement and name in loop.force for loop in loops)]
    if not rows:
        return None
    length = scale_for("m", *(loop.displacement[name] for loop in loops for name in rows if name in loop.displacement))
    load = scale_for("N", *(loop.force[name] for loop in loops for name in rows if name in loop.force))

    def draw(panel: Axes, loop: _Loop, row: int) -> None:
        name = rows[row]
        if name in loop.displacement and name in loop.force:
            _draw_ends(panel, length(_centred(loop.displacement[name])), load(_centred(loop.force[name])), ends)
        panel.set_xlabel(directions.label(name, "displacement", length))
        panel.set_ylabel(directions.label(name, "force", load))

    figure = _grid(loops, len(rows), draw, ends)
    text = as_sentences(
        "Tangential force over relative displacement through a period, each about its mean: the area inside is the"
        " energy of friction",
        directions.told,
        _tell_drift(loops, directions, ends),
        tail,
    )
    return Drawing("fretting_loops", _TITLE, text, figure)


def _draw_normal(loops: Sequence[_Loop], ends: Sequence[str], tail: str) -> Drawing | None:
    """Normal force through a period (Fig. 14)."""
    loops = [loop for loop in loops if "normal" in loop.force]
    if not loops:
        return None
    load = scale_for("N", *(loop.force["normal"] for loop in loops))

    def draw(panel: Axes, loop: _Loop, _row: int) -> None:
        phase = np.broadcast_to(np.degrees(loop.phase), loop.force["normal"].shape)
        _draw_ends(panel, phase, load(loop.force["normal"]), ends, arrows=False)
        panel.set_xticks([0, 90, 180, 270, 360])
        panel.set_xlim(0, 360)
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]) if loop.force["normal"].min() < 0.0 else 0.0)
        panel.set_xlabel("phase (°)")
        panel.set_ylabel(load.label("normal force"))

    figure = _grid(loops, 1, draw, ends)
    open_part = [f"pair {loop.pair} {_open_fraction(loop)}" for loop in loops]
    text = as_sentences(
        f"Normal force through a period; where it is zero the pair is open: {', '.join(open_part)}",
        tail,
    )
    return Drawing("normal_load", "Normal load through a period", text, figure)


def _open_fraction(loop: _Loop) -> str:
    """Fraction of the period without load at the first and the last cycle count, of the samples in the file."""
    fractions = np.mean(loop.force["normal"][:, :-1] <= 0.0, axis=1)
    return ", then ".join(f"{100.0 * fraction:.0f} %" for fraction in fractions)


def _draw_motion(loops: Sequence[_Loop], directions: _Directions, ends: Sequence[str], tail: str) -> Drawing | None:
    """Path of the relative displacement in the contact plane (Fig. 15), or through the period with one tangent only."""
    loops = [loop for loop in loops if all(name in loop.displacement for name in _TANGENTS)]
    if not loops:
        return None
    length = scale_for("m", *(loop.displacement[name] for loop in loops for name in _TANGENTS))

    def draw(panel: Axes, loop: _Loop, _row: int) -> None:
        across, along = (length(_centred(loop.displacement[name])) for name in _TANGENTS)
        _draw_ends(panel, across, along, ends)
        panel.set_xlabel(directions.label("tangent_1", "displacement", length))
        panel.set_ylabel(directions.label("tangent_2", "displacement", length))
        panel.set_aspect("equal", adjustable="datalim")

    figure = _grid(loops, 1, draw, ends)
    text = as_sentences(
        "Path of the relative displacement in the contact plane about its mean; a pair that sticks is a dot",
        directions.told,
        _tell_drift(loops, directions, ends),
        f"Largest extent: {', '.join(_tell_extent(loop) for loop in loops)}",
        tail,
    )
    return Drawing("pair_motion", "Motion of the pairs in the contact plane", text, figure)


def _centred(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Closed courses (n_ends, n) about their means over the period."""
    return np.asarray(values - values[:, :-1].mean(axis=1, keepdims=True))


def _tell_drift(loops: Sequence[_Loop], directions: _Directions, ends: Sequence[str]) -> str:
    """How far the mean of each pair has moved along each tangent between the two cycle counts."""
    if len(ends) < 2:
        return ""
    told = []
    for loop in loops:
        names = [name for name in _TANGENTS if name in loop.displacement]
        length = scale_for("m", *(loop.drift(name) for name in names))
        parts = [
            f"{length.show(loop.drift(name))} {directions.labels[_TANGENTS.index(name)].replace('{}', '').strip()}"
            for name in names
        ]
        told += [f"pair {loop.pair} {', '.join(parts)}"] if parts else []
    return f"The mean displacement drifts from {ends[0]} to {ends[1]} by: {'; '.join(told)}" if told else ""


def _tell_extent(loop: _Loop) -> str:
    """Larger of the two tangential ranges of a pair, at the first and the last cycle count."""
    extent = np.max([np.ptp(loop.displacement[name], axis=1) for name in _TANGENTS], axis=0)
    told = ["sticks" if value < _NO_MOTION else scale_for("m", value).show(float(value)) for value in extent]
    return f"pair {loop.pair} {', then '.join(told)}"


def _draw_ends(
    panel: Axes, x: NDArray[np.float64], y: NDArray[np.float64], ends: Sequence[str], *, arrows: bool = True
) -> None:
    """Lines (n_ends, n) of the first and last cycle count; a marker where the period begins, an arrow its way."""
    for number, label in enumerate(ends):
        look = line_style(number)
        panel.plot(x[number], y[number], label=label, **{**look, "markevery": [0]})
        if arrows:
            _draw_arrow(panel, x[number], y[number], look["color"])


def _draw_arrow(panel: Axes, x: NDArray[np.float64], y: NDArray[np.float64], colour: str) -> None:
    """An arrow along the line (n,) where it goes fastest on paper; none on a line that stays where it is."""
    if np.ptp(x) + np.ptp(y) == 0.0:
        return
    pace = np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(y) / (np.ptp(y) or 1.0))
    at = int(np.argmax(pace))
    way: dict[str, Any] = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.0, "mutation_scale": 15}
    panel.annotate("", (x[at + 1], y[at + 1]), (x[at], y[at]), arrowprops=way, annotation_clip=False)


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
