"""Pictures of the root: where it wears, slips and opens, and the disk that the sector is one of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studyrunner.report.drawing import MAP, Drawing, Missing, new_panel, new_panels, title_at
from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.painting import body_colours, draw_scale_bar, paint_edges, paint_faces, rgb
from studyrunner.report.root.surface import RootSurface, read_root
from studyrunner.report.root.views import View, find_views
from studyrunner.result.scars import find_scar
from studyrunner.result.scene_pairs import depths, tells_depth
from studyrunner.result.units import Scale, scale_for, show_number
from studyrunner.result.view import Result, as_sentences

_MOST_CLOSE_UPS = 2
_MOST_NUMBERS = 120
_MOST_PAIRS = 20_000
_MOST_FACES, _MOST_OF_DISK = 60_000, 300_000
_FEWEST_SECTORS = 3
_TO_EYE = np.array([0.35, 0.25, 1.0])
_FADED = 0.45
_TITLES = {"slip_fraction": "Where the joint slips", "open_fraction": "Where the joint opens"}
_NO_DEPTH = 1e-15
"""m. A depth below this is round-off: it is far less than an atom."""


def draw_root(result: Result) -> Iterator[Drawing | Missing]:
    """Worn shape of the shown point, numbers of the pairs, and the whole disk.

    Nothing where `_find_root` finds none.
    """
    surface, views = _find_root(result)
    if surface is None:
        return
    state = _find_state(result)
    # of a cylinder or a sphere on a flat the scar over x shows more
    if state is not None and find_scar(result) is None:
        yield draw_state(result, surface, views, state)
    disk = _draw_disk(result, surface)
    if disk is not None:
        yield disk


def _find_root(result: Result) -> tuple[RootSurface | None, tuple[View, ...]]:
    """The surface as it is drawn, and from where; None without positions, or with too many pairs to tell."""
    surface = read_root(result) if result.dataset.sizes["contact"] <= _MOST_PAIRS else None
    if surface is None:
        return None, ()
    surface = surface.near_contact(_MOST_FACES)
    return surface, find_views(result, surface)


@dataclass(frozen=True)
class State:
    """What colours the root: the wear depth at the last cycle count, or the mean pressure where nothing is worn.

    cycle: index along `cycle`. depth, values (n_contact,): m; in the units of the result.
    """

    name: str
    cycle: int
    depth: NDArray[np.float64]
    values: NDArray[np.float64]


def _find_state(result: Result) -> State | None:
    """The state of the shown point that is drawn; None where the file holds no values of its pairs."""
    shown = result.shown_point()
    values = {"wear_depth": depths(result, shown)} if tells_depth(result) else {}
    values |= {name: result.at(name, shown).values for name in ("mean_pressure",) if result.has(name)}
    held = np.ones(len(result.cycles), dtype=np.bool_)
    for each in values.values():
        held &= np.isfinite(each).all(axis=1)
    if not values or not held.any():
        return None
    last = int(np.flatnonzero(held)[-1])
    depth = values["wear_depth"][last] if "wear_depth" in values else np.zeros(result.dataset.sizes["contact"])
    name = "wear_depth" if float(depth.max()) > _NO_DEPTH or "mean_pressure" not in values else "mean_pressure"
    return State(name, last, depth, values[name][last])


def draw_state(result: Result, surface: RootSurface, views: Sequence[View], state: State) -> Drawing:
    """The mesh, and the contact surfaces of its outer body from close by, coloured, with the worn shape exaggerated."""
    largest, worn = float(state.values.max()), float(state.depth.max()) > _NO_DEPTH
    factor = surface.exaggeration(float(state.depth.max())) if worn else 1.0
    scale = scale_for("m" if state.name == "wear_depth" else "Pa", state.values)
    label = state.name.replace("_", " ")
    figure = _paint_state(surface, views, state, factor, scale, label)
    pair = result.dataset["contact"].values[int(np.argmax(state.values))]
    text = as_sentences(
        f"{label.capitalize()} {result.when(state.cycle, 'after')}",
        f"Largest: {scale.show(largest)} at pair {pair}" if largest > 0.0 else "",
        f"The wear depth, of both surfaces together, is taken off each surface, {show_number(factor)} times exaggerated"
        if worn
        else "",
        "Dashed: the edge of the contact surface before" if _close_ups(views) and worn else "",
        "The file has no mesh: each pair is a patch" if not surface.is_mesh else "",
    )
    return Drawing("worn_root", title_at(result, "The worn root" if worn else "The root"), text, figure)


def _close_ups(views: Sequence[View]) -> list[View]:
    """Views of contact surfaces of the outer body from close by."""
    return [view for view in views if view.flank >= 0 and view.body == views[0].body][:_MOST_CLOSE_UPS]


def _paint_state(
    surface: RootSurface, views: Sequence[View], state: State, factor: float, scale: Scale, label: str
) -> Figure:
    """The root and close-ups, coloured with the values of a state. factor: by which worn depths are exaggerated."""
    closer = _close_ups(views)
    drawn = [views[-1], *closer]
    figure, (panels,) = new_panels(1, len(drawn), 3.4, width_ratios=[1.0] + [2.0] * len(closer))
    norm = Normalize(0.0, scale(float(state.values.max())).item() or 1.0)
    for panel, view in zip(panels, drawn, strict=True):
        _paint(panel, surface, view, state, factor, scale, norm)
        panel.set_title(view.title)
    figure.colorbar(ScalarMappable(norm), ax=panels, label=scale.label(label), fraction=0.05, panchor=False)
    return figure


def _paint(
    panel: Axes, surface: RootSurface, view: View, state: State, factor: float, scale: Scale, norm: Normalize
) -> None:
    at_nodes = np.full(len(surface.nodes), np.nan)
    at_nodes[surface.contact.nodes] = surface.contact.values(state.values)
    worn = surface.worn(state.depth, factor)
    faces, own = surface.faces[view.faces], surface.contact.flank[view.faces] >= 0
    colours = rgb(body_colours(surface.bodies), surface.body[view.faces])
    colours[own] = mpl.colormaps[MAP](norm(scale(at_nodes[faces[own]].mean(axis=1))))[:, :3]
    paint_faces(panel, worn, faces, colours, view)
    if view.flank >= 0 and float(state.depth.max()) > _NO_DEPTH:
        looked_at = view.faces & (surface.contact.flank == view.flank)
        paint_edges(panel, surface.nodes, surface.faces[looked_at], view)
    if view.leading is not None:
        _name_leading_edge(panel, surface.nodes[np.unique(faces)], view, view.leading)
    draw_scale_bar(panel, worn[np.unique(faces)], view)


def _name_leading_edge(panel: Axes, nodes: NDArray[np.float64], view: View, edge: NDArray[np.float64]) -> None:
    """The words at the side of the picture where the leading edge (3,), m, is, with a line to it."""
    right, up, _ = view.frame
    at, middle = (np.array([place @ right, place @ up]) * 1e3 for place in (edge, nodes.mean(axis=0)))
    size = float(np.ptp(nodes @ right)) * 1e3
    text = at + [np.sign(at[0] - middle[0]) * 0.02 * size, -0.28 * size]
    panel.annotate(
        "leading edge",
        (at[0], at[1]),
        (text[0], text[1]),
        ha="center",
        va="top",
        arrowprops={"arrowstyle": "-", "lw": 0.8, "shrinkB": 0},
    )


def _draw_disk(result: Result, surface: RootSurface) -> Drawing | None:
    """The disk of all sectors, that of the mesh in full colour (Fig. 2a); only faces that look to the eye are drawn.

    None where the study names no sectors about z, or their faces are too many.
    """
    scene = result.study.get("scene", {})
    number = scene.get("n_sectors")
    if scene.get("model") != "dovetail_sector" or not isinstance(number, int) or not surface.is_mesh:
        return None
    if number < _FEWEST_SECTORS or number * len(surface.faces) > _MOST_OF_DISK:
        return None
    to_eye = _TO_EYE / np.linalg.norm(_TO_EYE)
    view = View("", np.ones(1, np.bool_), to_eye, np.array([1.0, 0.0, 0.0]), -1, -1)
    own = rgb(body_colours(surface.bodies), surface.body)
    nodes, faces, colours = [], [], []
    for sector in range(number):
        angle = 2.0 * np.pi * sector / number
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        nodes.append(surface.nodes @ turn.T)
        faces.append(surface.faces + sector * len(surface.nodes))
        colours.append(own if sector == 0 else own + (1.0 - own) * _FADED)
    all_nodes, all_faces, all_colours = np.concatenate(nodes), np.concatenate(faces), np.concatenate(colours)
    looking = face_normals(all_nodes, all_faces) @ to_eye > 0.0
    figure, panel = new_panel(4.6)
    paint_faces(panel, all_nodes, all_faces[looking], all_colours[looking], view, lines=0.0)
    text = as_sentences(
        f"The {number} sectors of the disk, that of the mesh in full colour",
        f"Axis of rotation: z, towards the reader; parts: {', '.join(surface.bodies)}",
    )
    return Drawing("whole_disk", "The whole disk", text, figure)


def draw_mode_fractions(result: Result) -> Iterator[Drawing | Missing]:
    """Fractions of the period in which pairs slip and are open, at the shown point: a large amplitude.

    Nothing where `_find_root` finds none.
    """
    surface, views = _find_root(result)
    if surface is None:
        return
    point = result.shown_point()
    for name, title in _TITLES.items():
        if not result.has(name):
            yield Missing(name, title, result.lacks(name))
            continue
        values = np.asarray(result.at(name, point).values, dtype=float)
        if not np.isfinite(values).all():
            yield Missing(name, title, "No point has a state.")
            continue
        label = f"fraction of the period {'in slip' if name == 'slip_fraction' else 'open'}"
        state = State(name, 0, np.zeros(len(values)), values)
        figure = _paint_state(surface, views, state, 1.0, scale_for("1", values), label)
        pair = result.dataset["contact"].values[int(np.argmax(values))]
        caption = as_sentences(
            label.capitalize(),
            f"Largest: {values.max():.3g} at pair {pair}" if values.max() > 0.0 else "No pair does",
            "" if surface.is_mesh else "The file has no mesh: each pair is a patch",
        )
        yield Drawing(name, title_at(result, title), caption, figure)
