"""The sector mesh and its natural frequencies over the nodal diameter (Fig. 2 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from studyrunner.report.drawing import COLOURS, Drawing, Missing, line_style, new_panels, set_from_zero
from studyrunner.report.root.painting import body_colours, draw_scale_bar, paint_faces, rgb
from studyrunner.report.root.surface import MESH
from studyrunner.report.root.views import from_aslant
from studyrunner.result.view import Result, as_sentences

OF_SECTOR = (*MESH, "mesh_part", "natural_frequency")
"""Variables that the figure shows."""

_TITLE = "Sector and its natural frequencies"


def draw_sector(result: Result) -> Iterator[Drawing | Missing]:
    """Mesh and frequencies side by side; what the file does not hold is left out, with the output to ask for."""
    mesh, frequencies = result.has(*MESH), result.has("natural_frequency")
    lacking = [name for name, held in (("natural_frequency", frequencies), ("mesh", mesh)) if not held]
    if lacking:
        sentence = f"Add {' and '.join(lacking)} to [outputs] variables. Only bundled sector scenes have them."
        yield Missing("natural_frequencies" if not frequencies else "mesh", _TITLE, sentence)
    if not mesh and not frequencies:
        return
    ratios = [ratio for ratio, held in ((1.0, mesh), (1.7, frequencies)) if held]
    figure, (panels,) = new_panels(1, len(ratios), 4.0, width_ratios=ratios)
    text = as_sentences(
        _draw_mesh(result, panels[0]) if mesh else "",
        _draw_frequencies(result, panels[-1]) if frequencies else "",
        f"Of the sector at {result.describe(result.shown_point(), result.fixed)}" if result.fixed else "",
    )
    yield Drawing("natural_frequencies" if frequencies else "mesh", _TITLE, text, figure)


def _draw_frequencies(result: Result, panel: Axes) -> str:
    """Frequencies (nodal_diameter, mode) over the nodal diameter, one line a mode; what is seen."""
    frequencies = result.read("natural_frequency").transpose("nodal_diameter", "mode").values
    diameters = result.dataset["nodal_diameter"].values
    for number, mode in enumerate(frequencies.T):
        style = {"linewidth": 0.8, "markersize": 3.5, "marker": line_style(number)["marker"]}
        panel.plot(diameters, mode, color="0.35", markerfacecolor=COLOURS[0], **style)
    set_from_zero(panel, float(np.nanmax(frequencies)))
    panel.set_xlabel("nodal diameter")
    panel.set_ylabel("natural frequency (Hz)")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    text = f"With the joint stuck, {frequencies.shape[1]} modes, the lowest at {np.nanmin(frequencies):.4g} Hz"
    diameter = result.study.get("scene", {}).get("nodal_diameter")
    if not isinstance(diameter, int) or "frequency" not in result.dataset.coords:
        return text
    studied = result.dataset["frequency"].values
    low, high = float(studied.min()), float(studied.max())
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
    names = tuple(dict.fromkeys(parts.tolist()))
    view, body = from_aslant(nodes, len(quads)), np.array([names.index(part) for part in parts.tolist()])
    paint_faces(panel, nodes, quads, rgb(body_colours(names), body), view)
    draw_scale_bar(panel, nodes, view)
    return f"Outer faces of the mesh of one sector ({', '.join(names)}; {len(quads)} faces, {len(nodes)} nodes)"
