"""Values of the contact pairs for the page: maps and loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.figures.loops import component_labels
from studyrunner.report.page.kept import Kept, encode_kept, encode_values, fit_points, read_kept, tell_kept
from studyrunner.report.page.panels import build_panels
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.scene_pairs import axes_of_scenes, first_points

MAPS = ("mean_pressure", "wear_depth", "open_fraction", "slip_range")
"""Variables of the contact pairs that the page draws as maps."""

LAST_DEPTH = "wear_depth_last"
"""Drawn in place of the wear depth where the file has that of the last count alone."""

LOOPS = ("loop_displacement", "loop_force")

_FEWEST_MAP_CYCLES = 11
_FEWEST_LOOP_CYCLES = 11
_MOST_PHASES = 64
_MOST_SCENES = 100


def has_maps(result: Result) -> bool:
    """Whether there is anything to draw at the contact pairs."""
    return bool(result.held.any()) and any(map(result.has, (*MAPS, LAST_DEPTH)))


def build_maps(result: Result, cycles: NDArray[np.int64], floats: float, notes: list[str]) -> dict[str, object] | None:
    """Values of the contact pairs; None where the file or the page holds none.

    `points` and `cycles`, places in those of the page, of most `variables`; the depth of the last count has its own.
    `panels`: of each scene, see `build_panels`; of the shown one alone where scenes are many. `scenes`: axes along
    which scenes differ, the last one fastest.
    """
    if not has_maps(result):
        return None
    names, n_pairs = [name for name in MAPS if result.has(name)], result.dataset.sizes["contact"]
    content: dict[str, object] = {"points": [], "cycles": []}
    variables: dict[str, object] = {}
    if "wear_depth" not in names and result.has(LAST_DEPTH):
        kept = fit_points(result, np.zeros(1, np.int64), n_pairs, floats, 1)
        floats -= n_pairs * len(kept.points)
        tell_kept("Wear depths", kept, kept.cycles, result, notes)
        own = {"points": kept.points.tolist(), "cycles": [len(cycles) - 1]}
        if len(kept.points):
            variables[LAST_DEPTH] = {**encode_kept(result, LAST_DEPTH, kept), **own}
            content = dict(own)
    if names:
        kept = fit_points(result, cycles, len(names) * n_pairs, floats, _FEWEST_MAP_CYCLES)
        tell_kept("Maps", kept, cycles, result, notes)
        content = {"points": kept.points.tolist(), "cycles": np.searchsorted(cycles, kept.cycles).tolist()}
        variables |= {name: encode_kept(result, name, kept) for name in names if len(kept.points)}
    if not variables:
        return None
    scenes = [result.axes.index(name) for name in axes_of_scenes(result)]
    points = list(first_points(result))
    if len(points) > _MOST_SCENES:
        notes.append(f"Maps are on this page for one of {len(points)} scenes, the one that is shown first.")
        shown = [result.shown_point()[result.axes[axis]] for axis in scenes]
        panels = [
            build_panels(result, each) if [each[result.axes[a]] for a in scenes] == shown else [] for each in points
        ]
    else:
        panels = [build_panels(result, each) for each in points]
    return {**content, "scenes": scenes, "panels": panels, "variables": variables}


def build_loops(
    result: Result, cycles: NDArray[np.int64], floats: float, notes: list[str]
) -> tuple[dict[str, object] | None, float]:
    """Loops of the pairs that the file holds, and the floats that they take; None where there are none."""
    if not result.has(*LOOPS) or not result.held.any():
        return None, 0.0
    first = int(np.flatnonzero(result.held)[0])
    force = read_kept(result.dataset["loop_force"], Kept(np.array([first]), cycles[:1]))
    held = np.flatnonzero(np.isfinite(force).any(axis=(0, 1, 3, 4)))
    if not len(held):
        return None, 0.0
    sizes = result.dataset.sizes
    stride = -(-sizes["phase"] // _MOST_PHASES)
    phases = -(-sizes["phase"] // stride)
    each = len(LOOPS) * len(held) * phases * sizes["component"]
    kept = fit_points(result, cycles, each, floats, _FEWEST_LOOP_CYCLES)
    tell_kept("Loops", kept, cycles, result, notes)
    if not len(kept.points):
        return None, 0.0
    components = [str(name) for name in result.dataset["component"].values]
    # a pair without a second tangent holds NaN or zero there
    second = force[..., components.index("tangent_2")] if "tangent_2" in components else np.zeros(1)
    labels = component_labels(result, both=bool(np.nan_to_num(second).any()))
    content = {
        "points": kept.points.tolist(),
        "cycles": np.searchsorted(cycles, kept.cycles).tolist(),
        "contacts": result.dataset["contact"].values[held].tolist(),
        "widest": _widest(result, held),
        "phases": phases,
        "components": components,
        "labels": [labels.get(name, f"{name} {{}}") for name in components],
        "variables": {
            name: encode_values(variable, read_kept(variable, kept)[:, :, held, ::stride])
            for name, variable in ((name, result.dataset[name]) for name in LOOPS)
        },
    }
    return content, float(each * len(kept.points) * len(kept.cycles))


def _widest(result: Result, held: NDArray[np.int64]) -> int:
    """Which of the pairs moves furthest in the point that is shown first, unworn: the others may well stick."""
    loops = result.dataset["loop_displacement"].isel({"cycle": 0, "contact": held, **result.shown_point()})
    moved = np.ptp(loops.transpose("contact", "phase", "component").values, axis=1)
    return int(np.argmax(np.nan_to_num(moved).max(axis=1)))
