"""How the joint vibrates: response over frequency (Fig. 9 of the paper), loops of pairs (Figs. 13 to 15)."""

import textwrap
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

import studyrunner.accessor  # noqa: F401  (registers Dataset.fretwear)
from solver.outcome import absolute
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import COLOURS, Drawn, FloatArray
from studyrunner.report.selection import Course, choose, find_course, labelled
from studyrunner.result.opening import pairs_with_loops
from studyrunner.result.pairs import directions_in_words, last_depth
from studyrunner.result.view import NO_MOTION, Point, Result
from studyrunner.units import scale_for

_MOST_LINES, _MOST_RESPONSES, _MOST_PAIRS = 3, 3, 3
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_BEFORE = "worn_cycle"
_WORN: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (5, 1.5)), "marker": "s", "markersize": 4.5}
_EXACT: dict[str, Any] = {"color": "0.5", "linewidth": 5, "alpha": 0.45, "zorder": 1}
_LABEL_WIDTH = 25
_TANGENTS = ("tangent_1", "tangent_2")
_UNITS = {"phase": "°", "displacement": "m", "force": "N"}
# of each figure what its rows show over what: signal and component
_ROWS: dict[str, tuple[tuple[tuple[str, str], tuple[str, str]], ...]] = {
    "fretting_loops": tuple((("displacement", name), ("force", name)) for name in _TANGENTS),
    "normal_load": ((("phase", ""), ("force", "normal")),),
    "pair_motion": ((("displacement", _TANGENTS[0]), ("displacement", _TANGENTS[1])),),
}


# --- over the frequency ---


@dataclass(frozen=True)
class _Line:
    """Amplitudes (n, n_responses), SI, at frequencies (n,), Hz; error (n,): relative."""

    label: str
    at: FloatArray
    values: FloatArray
    look: dict[str, Any]
    error: FloatArray | None = None


def draw_responses(result: Result) -> Drawn:
    """Amplitude of the first harmonic over frequency, a panel a response: of the new and of the shown worn joint."""
    course, curves = find_course(result, "frequency"), result.recomputed.get("response")
    if course is None and curves is None:
        remedy = "The study has one frequency: give several under [axes] frequency"
        return f"{result.no_worn_response or remedy}."
    if course is not None and result.cycles[0] != 0.0:
        return "The file holds no new joint: add 0 to slow_time.outputs."
    if result.has("sector_amplitude"):
        # of a ring the sectors that vibrate most
        most = result.dataset["response_amplitude"].isel(cycle=0).max(result.axes).fillna(0.0).values
        result = replace(result, dataset=result.dataset.isel(response=np.argsort(-most, kind="stable")))
    lines, failed, left_out = _new_joint(result, course) if course else ([], np.zeros((0, 0), np.bool_), "")
    lines += _recomputed(curves.sel(response=list(result.responses))) if curves is not None else []
    n_panels, crosses = min(len(result.responses), _MOST_RESPONSES), ""
    figure, panels = plot.new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    unit = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
    scale, peaks = scale_for(unit, *(line.values for line in lines)), []
    for line in lines:
        first = line.values[:, 0]
        for number, panel in enumerate(panels[:, 0]):
            values = scale(line.values[:, number])
            error = None if line.error is None else absolute(line.error, values)
            plot.add_line(panel, line.at, values, error, label=line.label, **line.look)
        if line.look is not _EXACT and np.isfinite(first).any():
            top = int(np.nanargmax(first))
            marks: dict[str, Any] = {"marker": "o", "ms": 8, "mfc": "none", "zorder": 4, "label": "_peak"}
            panels[0, 0].plot(line.at[top], scale(first[top]), color=line.look["color"], **marks)
            peaks.append(labelled(f"{scale.show(float(first[top]))} at {line.at[top]:.6g} Hz", line.label))
    for panel, name in zip(panels[:, 0], result.responses, strict=False):
        crosses = plot.mark_failed(panel, course.values, failed) if course else ""
        plot.set_from_zero(panel)
        panel.set_ylabel(scale.label(f"amplitude of {name}"))
    panels[-1, 0].set_xlabel("excitation frequency (Hz)")
    return (
        figure,
        str(curves.attrs["how"]) if curves else "",
        f"One joint, {curves.attrs['title']}: its response curve at that wear, without further wear" if curves else "",
        f"Points: largest amplitude of the first harmonic of {result.responses[0]}, {'; '.join(peaks)}",
        f"Without the curve of the worn joint: {result.no_worn_response}" if result.no_worn_response else "",
        "More responses are in the file" if len(result.responses) > n_panels else "",
        crosses,
        left_out,
    )


def _new_joint(result: Result, course: Course) -> tuple[list[_Line], NDArray[np.bool_], str]:
    """Lines of the new joint, open where the sweep jumps; where each has failed; a sentence on what is left out."""
    # how a joint wears makes no difference to the new one: NaN where a scheme has found no state
    alike = [axis for axis in _OF_WEAR if axis in result.axes]
    choice = choose(result, ["frequency", *alike], _MOST_LINES, first=(_BEFORE, "sweep", "excitation_amplitude"))
    unworn = result.dataset["response_amplitude"].isel(cycle=0).max(alike)
    lines, failed = [], []
    for place, (point, label) in enumerate(choice):
        others = {name: index for name, index in point.items() if name != "frequency"}
        values = unworn.isel(others, missing_dims="ignore").transpose("frequency", "response").values[course.index]
        failed.append(np.isnan(values[:, 0]))
        at = course.values
        if result.has("branch"):
            jumps = np.flatnonzero(np.diff(course.read("branch", point)[0]) != 0) + 1
            at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan, axis=0)
        text = label if _BEFORE in result.varying else ", ".join(filter(None, (label, "new joint")))
        # the second colour is that of the worn joint
        lines.append(_Line(text, at, values, course.line_style(place + (place > 0))))
    if result.has("exact_response_amplitude"):
        exact = course.read("exact_response_amplitude", result.shown)[0, :, 0]
        lines += [_Line("exact", course.values, exact, _EXACT)] if np.isfinite(exact).any() else []
    return lines, np.array(failed), choice.sentence


def _recomputed(curves: xr.Dataset) -> list[_Line]:
    """Lines computed again, of the worn joint and where it is there of the new one."""
    lines = []
    for cycle in range(curves.sizes["cycle"]):
        is_new, curve = curves.sizes["cycle"] > 1 and cycle == 0, curves.isel(cycle=cycle)
        label, look = ("new joint", plot.line_style(0)) if is_new else (str(curves.attrs["title"]), _WORN)
        values, error = (curve[f"response_{each}"].values for each in ("amplitude", "error"))
        lines.append(_Line(label, curves["frequency"].values, values, look, error))
    return lines


# --- through a period ---


def find_loops(result: Result, point: Point) -> list[int]:
    """Contact pairs whose loops the file holds at a point: those that the study asked for, without those of NaN."""
    if not result.has("loop_displacement", "loop_force"):
        return []
    pairs = pairs_with_loops(result.dataset) or result.dataset["contact"].values.tolist()
    force = result.at("loop_force", point, 0).sel(contact=pairs)
    return [pair for pair in pairs if force.sel(contact=pair).notnull().any()]


def draw_loops(result: Result, name: str) -> Drawn:
    """A column a pair, of the most worn ones, a row a direction; a mark where the period begins, an arrow its way.

    Where the file has no loops, a sentence in place of the fretting loops; None where nothing moves.
    """
    depth = last_depth(result, result.shown)
    worn = dict(zip(result.dataset["contact"].values.tolist(), np.nan_to_num(depth).tolist(), strict=True))
    there, source = find_loops(result, result.shown), result.recomputed.get("loops")
    how = "" if source is None else str(source.attrs["how"])
    if source is not None:
        force = source["loop_force"]
        there = [int(pair) for pair in source["contact"].values if force.sel(contact=pair).notnull().any()]
    elif there:
        source = result.dataset[["loop_displacement", "loop_force"]].isel(result.shown)
    else:
        deepest = max(worn, key=lambda pair: worn[pair])
        remedy = f"Add pairs to [outputs] loops, as loops = [{deepest}], or use study-report --loops {deepest}."
        return remedy if name == "fretting_loops" else None
    pairs = sorted(sorted(there, key=lambda pair: -worn.get(pair, 0.0))[:_MOST_PAIRS])
    others = ", ".join(str(pair) for pair in there if pair not in pairs)
    how = how or (f"The file also holds loops of the pairs {textwrap.shorten(others, 40)}" if others else "")
    ends = source.isel(cycle=[0, -1] if source.sizes["cycle"] > 1 else [0])
    loops = [ends.fretwear.loop(pair) for pair in pairs]
    moving = [row for row in _ROWS[name] if any(_signal(loop, row[1]).any() for loop in loops)]
    if not moving:
        return None
    titles, labels = [f"pair {pair}" for pair in pairs], [result.cycle_label(0), result.cycle_label(-1)]
    figure, panels = plot.new_panels(len(moving), len(pairs), 0.5 + 2.7 * len(moving))
    scales = {
        what: scale_for(
            unit, *(_signal(loop, each) for row in moving for each in row if each[0] == what for loop in loops)
        )
        for what, unit in _UNITS.items()
    }
    for line, row in zip(panels, moving, strict=True):
        texts = (scales[each[0]].label(_word(result, each, moving)) for each in row)
        xlabel, ylabel = (textwrap.fill(text, _LABEL_WIDTH, break_on_hyphens=False) for text in texts)
        for panel, loop, title in zip(line, loops, titles, strict=True):
            x, y = (scales[each[0]](_signal(loop, each)) for each in row)
            for number, label in enumerate(labels[: len(x)]):
                _draw_loop(panel, x[number], y[number], plot.line_style(number) | {"markevery": [0], "label": label})
            panel.locator_params(nbins=5)
            panel.set(xlabel=xlabel, ylabel=ylabel, title=title if row is moving[0] else "")
            if name == "normal_load":
                panel.set(xlim=(0, 360), xticks=[0, 90, 180, 270, 360], ylim=(min(0.0, float(y.min())), None))
            elif name == "pair_motion":
                panel.set_aspect("equal", adjustable="datalim")
        plot.label_outer(line[None])
    return figure, how


def _signal(loop: xr.Dataset, each: tuple[str, str]) -> FloatArray:
    """A closed signal (n_ends, n), about its mean over the period but for the normal force; 0 where there is none."""
    what, component = each
    if what == "phase":
        return np.broadcast_to(np.degrees(loop["phase"].values), (loop.sizes["cycle"], loop.sizes["phase"]))
    values = loop[what].sel(component=component).transpose("cycle", "phase").values
    if component == "normal":
        return np.asarray(np.nan_to_num(values))
    away = values - values[:, :-1].mean(axis=1, keepdims=True)
    return np.where(np.ptp(values, axis=1, keepdims=True) >= NO_MOTION, away, 0.0)


def _word(result: Result, each: tuple[str, str], rows: list[Any]) -> str:
    """A signal in words; its tangent by the scene where that is known."""
    what, component = each
    if component not in _TANGENTS:
        return f"{component} {what}".strip()
    named = directions_in_words(result) or ("tangent 1", "tangent 2")
    alone = len({tangent for row in rows for _, tangent in row}) == 1
    return f"{what}, {'tangential' if alone else named[_TANGENTS.index(component)]}"


def _draw_loop(panel: Axes, x: FloatArray, y: FloatArray, look: dict[str, Any]) -> None:
    panel.plot(x, y, **look)
    if x[0] == x[-1] and np.ptp(x) + np.ptp(y) > 0.0:
        # where the line goes fastest on paper
        at = int(np.argmax(np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(y) / (np.ptp(y) or 1.0))))
        way: dict[str, Any] = {"arrowstyle": "-|>", "color": look["color"], "lw": 0.0, "mutation_scale": 15}
        panel.annotate("", (x[at + 1], y[at + 1]), (x[at], y[at]), arrowprops=way, annotation_clip=False)
