"""The sector mesh and its natural frequencies over the nodal diameter (Fig. 2 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, Missing, new_figure, set_from_zero
from studyrunner.report.reading.result import Result, as_sentences

_TITLE = "Sector and its natural frequencies"
_MESH = ("mesh_x", "mesh_y", "mesh_z", "mesh_quad")
# Lightness of the two parts differs, in print as well. Further parts take them in turn.
_PARTS = {"blade": "#9ecae1", "disk": "#d9b38c"}
_FROM = np.array([0.35, -0.6, -0.72])
"""Direction to the eye, for an axis of rotation along z."""


def draw_sector(result: Result) -> Iterator[Drawing | Missing]:
    """Mesh and frequencies side by side; what the file does not hold is left out, with the output to ask for."""
    mesh, frequencies = result.has(*_MESH), result.has("natural_frequency")
    lacking = [name for name, held in (("natural_frequency", frequencies), ("mesh", mesh)) if not held]
    if lacking:
        sentence = f"Add {' and '.join(lacking)} to [outputs] variables. Only bundled sector scenes have them."
        if not frequencies or not mesh:
            yield Missing("natural_frequencies" if not frequencies else "mesh", _TITLE, sentence)
    if not mesh and not frequencies:
        return
    figure = new_figure(4.0)
    ratios = [ratio for ratio, held in ((1.0, mesh), (1.7, frequencies)) if held]
    panels = figure.subplots(1, len(ratios), squeeze=False, width_ratios=ratios)[0]
    sentences = []
    if mesh:
        sentences.append(_draw_mesh(result, panels[0]))
    if frequencies:
        sentences.append(_draw_frequencies(result, panels[-1]))
    name = "natural_frequencies" if frequencies else "mesh"
    yield Drawing(name, _TITLE, as_sentences(*sentences, "Fig. 2 of the paper"), figure)


def _draw_frequencies(result: Result, panel: Axes) -> str:
    """Frequencies (nodal_diameter, mode) over the nodal diameter, one line a mode; what is seen."""
    frequencies = result.read("natural_frequency").transpose("nodal_diameter", "mode").values
    diameters = result.dataset["nodal_diameter"].values
    for number, mode in enumerate(frequencies.T):
        marker = "os^DvPX"[number % 7]
        panel.plot(
            diameters, mode, color="0.35", linewidth=0.8, marker=marker, markersize=3.5, markerfacecolor=COLOURS[0]
        )
    set_from_zero(panel, float(np.nanmax(frequencies)))
    panel.set_xlabel("nodal diameter")
    panel.set_ylabel("natural frequency (Hz)")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    text = f"Natural frequencies of the sector with its joint stuck, {frequencies.shape[1]} modes"
    first = f"The lowest is {np.nanmin(frequencies):.5g} Hz"
    diameter = result.study.get("scene", {}).get("nodal_diameter")
    if isinstance(diameter, int) and "frequency" in result.dataset.coords:
        studied = result.dataset["frequency"].values
        low, high = float(studied.min()), float(studied.max())
        panel.plot(
            [diameter, diameter],
            [low, high],
            color=COLOURS[1],
            marker="*",
            markersize=11,
            label="this study",
            linestyle="-",
            clip_on=False,
            zorder=5,
        )
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        span = f"{low:.6g} Hz" if low == high else f"{low:.6g} to {high:.6g} Hz"
        return as_sentences(text, first, f"Star: this study, {span} at nodal diameter {diameter}")
    return as_sentences(text, first)


def _draw_mesh(result: Result, panel: Axes) -> str:
    """Outer faces of the mesh, seen from aslant, those nearer to the eye over those behind; what is seen."""
    nodes = np.stack([result.read(f"mesh_{axis}").values for axis in "xyz"], axis=1)
    quads = result.read("mesh_quad").values
    parts = result.read("mesh_part").values.astype(str) if result.has("mesh_part") else np.full(len(quads), "sector")
    right, up, to_eye = _view()
    seen = np.stack([nodes @ right, nodes @ up], axis=1) * 1e3
    corners = nodes[quads]
    order = np.argsort(corners.mean(axis=1) @ to_eye, kind="stable")
    names = list(dict.fromkeys(parts.tolist()))
    fallback = list(_PARTS.values())
    colours = {name: _PARTS.get(name, fallback[number % 2]) for number, name in enumerate(names)}
    panel.add_collection(
        PolyCollection(
            seen[quads[order]],
            facecolors=_shade([colours[name] for name in parts[order]], corners[order], to_eye),
            edgecolors="0.25",
            linewidths=0.15,
            rasterized=True,
        )
    )
    panel.set_aspect("equal")
    panel.autoscale_view()
    panel.grid(visible=False)
    panel.set_axis_off()
    _draw_scale_bar(panel, seen)
    return f"Outer faces of the mesh of one sector ({', '.join(names)}; {len(quads)} faces, {len(nodes)} nodes)"


def _view() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right and upwards on the page, and to the eye: the radial direction x of the sector is up."""
    to_eye = _FROM / np.linalg.norm(_FROM)
    radial = np.array([1.0, 0.0, 0.0])
    up = radial - (radial @ to_eye) * to_eye
    up /= np.linalg.norm(up)
    return np.cross(up, to_eye), up, to_eye


def _shade(colours: list[str], corners: NDArray[np.float64], to_eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours (n, 3) of faces (n, 4, 3), darker where they turn away from the eye."""
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    light = 0.55 + 0.45 * np.abs(normals @ to_eye)
    return np.array([to_rgb(colour) for colour in colours]) * light[:, None]


def _draw_scale_bar(panel: Axes, seen: NDArray[np.float64]) -> None:
    """A bar of a round length under the mesh, in place of axes."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float((high - low).max())
    if not size > 0.0:
        return
    length = 10.0 ** np.floor(np.log10(0.4 * size))
    length *= max(factor for factor in (1.0, 2.0, 5.0) if factor * length <= 0.4 * size or factor == 1.0)
    bottom = low[1] - 0.05 * size
    panel.plot([low[0], low[0] + length], [bottom, bottom], color="black", linewidth=2.0, solid_capstyle="butt")
    panel.text(low[0] + 0.5 * length, bottom - 0.02 * size, f"{length:g} mm", ha="center", va="top")
    panel.set_ylim(bottom - 0.1 * size, high[1] + 0.02 * size)
