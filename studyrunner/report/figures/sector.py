"""The sector mesh and its natural frequencies over the nodal diameter (Fig. 2 of the paper)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import COLOURS, line_style, new_panels, set_from_zero
from studyrunner.report.root.painting import body_colours, draw_scale_bar, paint_faces, rgb
from studyrunner.report.root.surface import MESH
from studyrunner.report.root.views import from_aslant
from studyrunner.result.view import Result, as_sentences

OF_SECTOR = (*MESH, "mesh_part", "natural_frequency")
"""Variables that the figure shows."""


def draw_sector(result: Result) -> Drawn:
    """The natural frequencies, and the mesh beside them where the file holds one."""
    if not result.has("natural_frequency") and "natural_frequencies" not in result.again:
        return "Use study-report --natural-frequencies, or add natural_frequency to [outputs] variables."
    has_mesh = result.has(*MESH)
    ratios = [1.0, 1.7] if has_mesh else [1.0]
    figure, panels = new_panels(1, len(ratios), 4.0, width_ratios=ratios)
    return figure, as_sentences(
        _draw_mesh(result, panels[0, 0]) if has_mesh else "",
        _draw_frequencies(result, panels[0, -1]),
        f"Of the sector at {result.describe(result.shown_point(), result.fixed)}" if result.fixed else "",
    )


def _draw_frequencies(result: Result, panel: Axes) -> str:
    """Frequencies (nodal_diameter, mode) over the nodal diameter, one line a mode; what is seen."""
    source = result.again.get("natural_frequencies", result.dataset)
    frequencies = source["natural_frequency"].transpose("nodal_diameter", "mode").values
    diameters = source["nodal_diameter"].values
    for number, mode in enumerate(frequencies.T):
        style = {"linewidth": 0.8, "markersize": 3.5, "marker": line_style(number)["marker"]}
        panel.plot(diameters, mode, color="0.35", markerfacecolor=COLOURS[0], label=f"_mode {number + 1}", **style)
    set_from_zero(panel, float(np.nanmax(frequencies)))
    panel.set(xlabel="nodal diameter", ylabel="natural frequency (Hz)")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    text = f"With the joint stuck, {frequencies.shape[1]} modes, the lowest at {np.nanmin(frequencies):.4g} Hz"
    diameter = result.study.get("scene", {}).get("nodal_diameter")
    if not isinstance(diameter, int) or "frequency" not in result.dataset.coords:
        return text
    low, high = (float(end(result.dataset["frequency"].values)) for end in (np.min, np.max))
    star: dict[str, Any] = {"marker": "*", "markersize": 11, "label": "this study", "clip_on": False, "zorder": 5}
    panel.plot([diameter, diameter], [low, high], color=COLOURS[1], **star)
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
    span = f"{low:.6g} Hz" if low == high else f"{low:.6g} to {high:.6g} Hz"
    return f"{text}. Star: this study, {span} at nodal diameter {diameter}"


def _draw_mesh(result: Result, panel: Axes) -> str:
    """Outer faces of the mesh, seen from aslant; what is seen."""
    nodes = np.stack([result.read(f"mesh_{axis}").values for axis in "xyz"], axis=1)
    quads = result.read("mesh_quad").values
    parts = result.read("mesh_part").values.astype(str) if result.has("mesh_part") else np.full(len(quads), "sector")
    names, body = np.unique(parts, return_inverse=True)
    view = from_aslant(nodes, len(quads))
    paint_faces(panel, nodes, quads, rgb(body_colours(tuple(names.tolist())), body), view)
    draw_scale_bar(panel, nodes, view)
    return f"Outer faces of the mesh of one sector ({', '.join(names)}; {len(quads)} faces, {len(nodes)} nodes)"
