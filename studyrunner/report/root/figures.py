"""Pictures of the root: where it wears, slips and opens, and the disk that the sector is one of."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import MAP, FloatArray, add_colour_bar, new_panel, new_panels
from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.painting import body_colours, draw_scale_bar, paint_edges, paint_faces, rgb
from studyrunner.report.root.surface import RootSurface, known_counts, read_root
from studyrunner.report.root.views import View, find_views
from studyrunner.result.scene_pairs import NO_DEPTH, depths, tells_depth
from studyrunner.result.units import Scale, scale_for, show_number
from studyrunner.result.view import Result, as_sentences

_MOST_CLOSE_UPS, _FEWEST_SECTORS = 2, 3
_MOST_PAIRS, _MOST_FACES, _MOST_OF_DISK = 20_000, 60_000, 300_000
_TO_EYE, _FADED = np.array([0.35, 0.25, 1.0]), 0.45  # the disk: direction to the eye, paleness of the other sectors


@dataclass(frozen=True)
class _Picture:
    """What is painted on the root. depth, values (n_contact,): m; in SI. factor: by which the depth is exaggerated."""

    surface: RootSurface
    views: tuple[View, ...]
    depth: FloatArray
    values: FloatArray
    scale: Scale
    label: str
    factor: float = 1.0

    @property
    def close_ups(self) -> list[View]:
        """Views of contact surfaces of the outer body from close by."""
        return [view for view in self.views if view.flank >= 0 and view.body == self.views[0].body][:_MOST_CLOSE_UPS]

    @property
    def wears(self) -> bool:
        """Whether there is a depth to be seen."""
        return float(self.depth.max()) > NO_DEPTH


def _read_surface(result: Result) -> RootSurface | None:
    """The surface as it is drawn; None without a mesh, or with too many pairs to tell apart."""
    surface = read_root(result) if result.dataset.sizes["contact"] <= _MOST_PAIRS else None
    return None if surface is None else surface.near_contact(_MOST_FACES)


def draw_root(result: Result) -> Drawn:
    """The worn shape of the shown point, coloured with its wear depth; the mean pressure where nothing is worn."""
    shown, surface = result.shown_point(), _read_surface(result)
    fields = {"wear_depth": depths(result, shown)} if tells_depth(result) else {}
    fields |= {name: result.at(name, shown).values for name in ("mean_pressure",) if result.has(name)}
    known = known_counts(fields) if fields else np.zeros(0, int)
    if surface is None or not known.size:
        return None
    last = int(known[-1])
    depth = fields["wear_depth"][last] if "wear_depth" in fields else np.zeros(result.dataset.sizes["contact"])
    worn = float(depth.max()) > NO_DEPTH
    name = "wear_depth" if worn or "mean_pressure" not in fields else "mean_pressure"
    values, label = fields[name][last], name.replace("_", " ")
    scale = scale_for("m" if name == "wear_depth" else "Pa", values)
    factor = surface.exaggeration(float(depth.max())) if worn else 1.0
    picture = _Picture(surface, find_views(result, surface), depth, values, scale, label, factor)
    pair = result.dataset["contact"].values[int(np.argmax(values))]
    return _paint(picture), as_sentences(
        f"{label.capitalize()} {result.when(last, 'after')}",
        f"Largest: {scale.show(float(values.max()))} at pair {pair}" if float(values.max()) > 0.0 else "",
        f"The wear depth, of both surfaces together, is taken off each surface, {show_number(factor)} times exaggerated"
        if worn
        else "",
        "Dashed: the edge of the contact surface before" if picture.close_ups and worn else "",
    )


def draw_fraction(result: Result, name: str) -> Drawn:
    """Fraction of the period in which pairs slip, or are open, at the shown point: a large amplitude."""
    values, surface = np.asarray(result.at(name, result.shown_point()).values, dtype=float), _read_surface(result)
    if surface is None:
        return None
    if not np.isfinite(values).all():
        return "No point has a state."
    label = f"fraction of the period {'in slip' if name == 'slip_fraction' else 'open'}"
    nothing = np.zeros(len(values))
    picture = _Picture(surface, find_views(result, surface), nothing, values, scale_for("1", values), label)
    pair = result.dataset["contact"].values[int(np.argmax(values))]
    largest = f"Largest: {values.max():.3g} at pair {pair}" if values.max() > 0.0 else "No pair does"
    return _paint(picture), as_sentences(label.capitalize(), largest)


def _paint(picture: _Picture) -> Figure:
    """The root as a whole, and the contact surfaces of its outer body from close by."""
    ratios = [1.0] + [2.0] * len(picture.close_ups)
    figure, rows = new_panels(1, len(ratios), 3.4, width_ratios=ratios)
    panels = rows[0]
    norm = Normalize(0.0, picture.scale(float(picture.values.max())).item() or 1.0)
    for panel, view in zip(panels, [picture.views[-1], *picture.close_ups], strict=True):
        _paint_view(panel, picture, view, norm)
        panel.set_title(view.title)
    add_colour_bar(figure, panels, norm, picture.scale.label(picture.label), fraction=0.05, panchor=False)
    return figure


def _paint_view(panel: Axes, picture: _Picture, view: View, norm: Normalize) -> None:
    surface, at_nodes = picture.surface, np.full(len(picture.surface.nodes), np.nan)
    at_nodes[surface.contact.nodes] = surface.contact.values(picture.values)
    worn, faces = surface.worn(picture.depth, picture.factor), surface.faces[view.faces]
    own = surface.contact.flank[view.faces] >= 0
    colours = rgb(body_colours(surface.bodies), surface.body[view.faces])
    colours[own] = mpl.colormaps[MAP](norm(picture.scale(at_nodes[faces[own]].mean(axis=1))))[:, :3]
    paint_faces(panel, worn, faces, colours, view)
    if view.flank >= 0 and picture.wears:
        looked_at = view.faces & (surface.contact.flank == view.flank)
        paint_edges(panel, surface.nodes, surface.faces[looked_at], view)
    if view.leading is not None:
        _name_leading_edge(panel, surface.nodes[np.unique(faces)], view, view.leading)
    draw_scale_bar(panel, worn[np.unique(faces)], view)


def _name_leading_edge(panel: Axes, nodes: FloatArray, view: View, edge: FloatArray) -> None:
    """The words at the side of the picture where the leading edge (3,), m, is, with a line to it."""
    at, middle, seen = (view.seen(each) for each in (edge, nodes.mean(axis=0), nodes))
    size = float(np.ptp(seen[:, 0]))
    text = at + [np.sign(at[0] - middle[0]) * 0.02 * size, -0.28 * size]
    line = {"arrowstyle": "-", "lw": 0.8, "shrinkB": 0}
    panel.annotate("leading edge", (at[0], at[1]), (text[0], text[1]), ha="center", va="top", arrowprops=line)


def draw_disk(result: Result) -> Drawn:
    """The disk of all sectors, that of the mesh in full colour (Fig. 2a); only faces that look to the eye are drawn.

    None where the study names no sectors about z, or their faces are too many.
    """
    scene, surface = result.study.get("scene", {}), _read_surface(result)
    number = scene.get("n_sectors")
    if scene.get("model") != "dovetail_sector" or not isinstance(number, int) or surface is None:
        return None
    if number < _FEWEST_SECTORS or number * len(surface.faces) > _MOST_OF_DISK:
        return None
    to_eye = _TO_EYE / np.linalg.norm(_TO_EYE)
    view = View("", np.ones(1, np.bool_), to_eye, np.array([1.0, 0.0, 0.0]), -1, -1)
    own = rgb(body_colours(surface.bodies), surface.body)
    nodes, faces, colours = [], [], []
    for sector, angle in enumerate(2.0 * np.pi * np.arange(number) / number):
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        nodes.append(surface.nodes @ turn.T)
        faces.append(surface.faces + sector * len(surface.nodes))
        colours.append(own if sector == 0 else own + (1.0 - own) * _FADED)
    all_nodes, all_faces, all_colours = np.concatenate(nodes), np.concatenate(faces), np.concatenate(colours)
    looking = face_normals(all_nodes, all_faces) @ to_eye > 0.0
    figure, panel = new_panel(4.6)
    paint_faces(panel, all_nodes, all_faces[looking], all_colours[looking], view, lines=0.0)
    return figure, as_sentences(
        f"The {number} sectors of the disk, that of the mesh in full colour",
        f"Axis of rotation: z, towards the reader; parts: {', '.join(surface.bodies)}",
    )
