"""Pictures of the root: where it wears, slips and opens; the sector with its frequencies (Fig. 2)."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from studyrunner.report import drawing as plot
from studyrunner.report import root as mesh
from studyrunner.report.drawing import COLOURS, Drawn, FloatArray
from studyrunner.report.figures.pairs import largest_pair
from studyrunner.result.pairs import NO_DEPTH, has_depths, last_depth
from studyrunner.result.view import Result
from studyrunner.units import Scale, scale_for, show_number

OF_SECTOR = (*mesh.MESH, "mesh_part", "natural_frequency")
"""Variables that the figure of the sector shows."""

_MOST_CLOSE_UPS, _MOST_PAIRS, _MOST_FACES = 2, 20_000, 60_000
_SIDES, _MOST_PIECES = 8, 20_000
"""Pieces along a side of a face in contact, whose colour runs from node to node, and of all such faces."""


def _read_surface(result: Result) -> mesh.RootSurface | None:
    """The surface as it is drawn; None without a mesh, or with too many pairs to see each."""
    surface = mesh.read_root(result) if result.dataset.sizes["contact"] <= _MOST_PAIRS else None
    return None if surface is None else surface.near_contact(_MOST_FACES)


def draw_root(result: Result) -> Drawn:
    """The worn shape of the shown point, coloured with its wear depth; the mean pressure where nothing is worn."""
    shown, surface = result.shown, _read_surface(result)
    if surface is None or not (has_depths(result) or result.has("mean_pressure")):
        return None
    last, depth = result.last_reached(shown), last_depth(result, shown)
    name, values, units = "wear depth", depth, "m"
    if result.has("mean_pressure") and not float(depth.max()) > NO_DEPTH:
        name, values, units = "mean pressure", result.at("mean_pressure", shown, last).values, "Pa"
    if not np.isfinite(values).all():
        return None
    factor, scale = surface.exaggeration(float(depth.max())), scale_for(units, values)
    return (
        _paint(surface, surface.worn(depth, factor), values, scale, name),
        f"{name.capitalize()} after {result.cycle_label(last)}",
        f"Largest: {largest_pair(result, values, scale)}" if values.max() > 0.0 else "",
        f"The wear depth is taken off each surface, {show_number(factor)} times exaggerated" if factor > 1.0 else "",
    )


def draw_fraction(result: Result, name: str) -> Drawn:
    """Fraction of the period in which pairs slip, or are open, at the shown point: a large amplitude."""
    values, surface = np.asarray(result.at(name, result.shown).values, dtype=float), _read_surface(result)
    if surface is None:
        return None
    if not np.isfinite(values).all():
        return "No point has a state."
    label, scale = f"fraction of the period {'in slip' if name == 'slip_fraction' else 'open'}", scale_for("1", values)
    largest = f"Largest: {largest_pair(result, values, scale)}" if values.max() > 0.0 else ""
    return _paint(surface, surface.nodes, values, scale, label), label.capitalize(), largest


def _paint(surface: mesh.RootSurface, nodes: FloatArray, of_pairs: FloatArray, scale: Scale, label: str) -> Figure:
    """The root with these nodes, and its contact surfaces from close by, coloured by values of the pairs in SI."""
    views = mesh.find_views(surface)
    close_ups = views[:-1][:_MOST_CLOSE_UPS]
    ratios = [1.0] + [2.0] * len(close_ups)
    figure, (panels,) = plot.new_panels(1, len(ratios), 3.4, width_ratios=ratios)
    norm = Normalize(0.0, scale(float(of_pairs.max())).item() or 1.0)
    at_nodes = np.full(len(nodes), np.nan)
    at_nodes[surface.contact_nodes] = scale(of_pairs[surface.pairs])
    touch, corners, shades = surface.flank >= 0, nodes[surface.faces], mpl.colormaps[mpl.rcParams["image.cmap"]]
    body = mesh.rgb(surface.bodies, surface.body)
    for panel, view in zip(panels, [views[-1], *close_ups], strict=True):
        others, contact = view.faces & ~touch, view.faces & touch
        pieces, values, n_of_each = _in_pieces(corners[contact], at_nodes[surface.faces[contact]])
        colours = np.concatenate([body[others], shades(norm(values))[:, :3]])
        middles = np.concatenate([corners[others], corners[contact].repeat(n_of_each, axis=0)]).mean(axis=1)
        seen = np.concatenate([corners[others], pieces])
        mesh.paint_faces(panel, seen, colours, view, middles, len(pieces))
        mesh.draw_scale_bar(panel, nodes[np.unique(surface.faces[view.faces])], view)
        panel.set_title(view.title)
    plot.add_colour_bar(figure, panels, norm, scale.label(label), fraction=0.05, panchor=False)
    return figure


def _in_pieces(corners: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, int]:
    """Faces (n, 4, 3) in pieces, those of a face together, the value in the middle of each from those at the corners
    (n, 4), and the number of pieces of a face.
    """
    n_sides = max(1, min(_SIDES, int(np.sqrt(_MOST_PIECES / max(1, len(corners))))))
    row, column = np.divmod(np.arange(n_sides**2), n_sides)
    u, v = (row[:, None] + np.array([0, 1, 1, 0])) / n_sides, (column[:, None] + np.array([0, 0, 1, 1])) / n_sides
    weights = np.stack([(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v], axis=-1)
    pieces = np.einsum("pck,fkx->fpcx", weights, corners)
    return pieces.reshape(-1, 4, 3), np.einsum("pck,fk->fp", weights, values).ravel() / 4.0, n_sides**2


def draw_sector(result: Result) -> Drawn:
    """The natural frequencies over the nodal diameter, a line a mode, and the mesh beside them where there is one."""
    has_mesh = result.has(*mesh.MESH)
    ratios = [1.0, 1.7] if has_mesh else [1.0]
    figure, (panels,) = plot.new_panels(1, len(ratios), 4.0, width_ratios=ratios)
    if has_mesh:
        nodes, faces, parts = mesh.read_mesh(result)
        names, body = np.unique(parts, return_inverse=True)
        view = mesh.from_aslant(nodes, len(faces))
        mesh.paint_faces(panels[0], nodes[faces], mesh.rgb(tuple(names.tolist()), body), view)
        mesh.draw_scale_bar(panels[0], nodes, view)
    panel, modes = panels[-1], result.dataset["natural_frequency"].transpose("nodal_diameter", "mode")
    for number, mode in enumerate(modes.values.T):
        style = {"linewidth": 0.8, "markersize": 3.5, "marker": plot.line_style(number)["marker"], "color": "0.35"}
        style |= {"markerfacecolor": COLOURS[0], "label": f"_mode {number + 1}"}
        panel.plot(modes["nodal_diameter"].values, mode, **style)
    plot.set_from_zero(panel, float(np.nanmax(modes.values)))
    panel.set(xlabel="nodal diameter", ylabel="natural frequency (Hz)")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    text = f"With the joint stuck, {modes.sizes['mode']} modes, the lowest at {np.nanmin(modes.values):.4g} Hz"
    of = f"Of the sector at {result.describe(result.shown, result.fixed)}" if result.fixed else ""
    diameter = result.study.get("scene", {}).get("nodal_diameter")
    if not isinstance(diameter, int) or "frequency" not in result.dataset.coords:
        return figure, text, of
    ends = [float(end(result.dataset["frequency"].values)) for end in (np.min, np.max)]
    star: dict[str, Any] = {"marker": "*", "markersize": 11, "label": "this study", "clip_on": False, "zorder": 5}
    panel.plot([diameter, diameter], ends, color=COLOURS[1], **star)
    span = " to ".join(dict.fromkeys(f"{each:.6g}" for each in ends))
    return figure, f"{text}. Star: this study, {span} Hz at nodal diameter {diameter}", of
