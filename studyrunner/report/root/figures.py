"""Pictures of the root: where it wears, which number each pair has, and the disk that the sector is one of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from studyrunner.report.drawing import MAP, Drawing, Missing, new_figure, new_panels
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.scars import find_scar
from studyrunner.report.reading.scene_pairs import depths, tells_depth
from studyrunner.report.reading.units import Scale, scale_for, show_number
from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.disk import build_disk
from studyrunner.report.root.painting import body_colours, draw_scale_bar, paint_edges, paint_faces, rgb
from studyrunner.report.root.simplified import simplify
from studyrunner.report.root.surface import RootSurface, read_root
from studyrunner.report.root.views import View, find_views

_MOST_CLOSE_UPS = 2
_MOST_NUMBERS = 120
_MOST_PAIRS = 20_000
_MOST_FACES = 60_000
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
    yield draw_numbers(result, surface, views)
    disk = build_disk(result, surface)
    if disk is not None:
        yield disk


def _find_root(result: Result) -> tuple[RootSurface | None, tuple[View, ...]]:
    """The surface as it is drawn, and from where; None without positions, or with too many pairs to tell."""
    surface = read_root(result) if result.dataset.sizes["contact"] <= _MOST_PAIRS else None
    if surface is None:
        return None, ()
    surface = simplify(surface, _MOST_FACES)
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
        f"{label.capitalize()} {result.when(state.cycle, 'after')} at {result.describe(result.shown_point())}",
        f"Largest: {scale.show(largest)} at pair {pair}" if largest > 0.0 else "",
        f"The wear depth, of both surfaces together, is taken off each surface, {show_number(factor)} times exaggerated"
        if worn
        else "",
        "Dashed: the edge of the contact surface before" if _close_ups(views) and worn else "",
        "The file has no mesh: each pair is a patch" if not surface.is_mesh else "",
    )
    return Drawing("worn_root", "The worn root" if worn else "The root", text, figure)


def _close_ups(views: Sequence[View]) -> list[View]:
    """Views of contact surfaces of the outer body from close by."""
    return [view for view in views if view.flank >= 0 and view.body == views[0].body][:_MOST_CLOSE_UPS]


def _paint_state(
    surface: RootSurface, views: Sequence[View], state: State, factor: float, scale: Scale, label: str
) -> Figure:
    """The root and close-ups, coloured with the values of a state. factor: by which worn depths are exaggerated."""
    closer = _close_ups(views)
    drawn = [views[-1], *closer]
    figure = new_figure(3.4)
    panels = figure.subplots(1, len(drawn), squeeze=False, width_ratios=[1.0] + [2.0] * len(closer))[0]
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


def draw_numbers(result: Result, surface: RootSurface, views: Sequence[View]) -> Drawing:
    """Contact surfaces of the outer body, each looked at from the front, with the numbers of its pairs (Fig. 3b)."""
    closer = [view for view in views if view.body == views[0].body and view.flank >= 0] or list(views[:1])
    closer = closer[: 2 * _MOST_CLOSE_UPS]
    names = result.dataset["contact"].values
    figure, panels = new_panels(len(closer), 1, 1.0 + 1.5 * len(closer))
    some = False
    for panel, view in zip(panels[:, 0], closer, strict=True):
        chosen = surface.contact.flank == view.flank if view.flank >= 0 else surface.contact.flank >= 0
        faces = surface.faces[view.faces & chosen]
        front = _from_the_front(surface, view, faces)
        paint_faces(panel, surface.nodes, faces, np.ones((len(faces), 3)) * 0.9, front, lines=0.5)
        own = np.flatnonzero(np.isin(surface.contact.nodes, faces))
        pairs, first = np.unique(surface.contact.pairs[own, 0], return_index=True)
        at = surface.nodes[surface.contact.nodes[own[first]]] if surface.is_mesh else _centres(surface, pairs)
        step = -(-len(pairs) // _MOST_NUMBERS)
        some = some or step > 1
        right, up, _ = front.frame
        for pair, place in list(zip(pairs, at, strict=True))[::step]:
            panel.text(
                place @ right * 1e3,
                place @ up * 1e3,
                str(names[pair]),
                ha="center",
                va="center",
                fontsize=8,
                path_effects=[withStroke(linewidth=2.5, foreground="white")],
            )
        panel.set_title(view.title)
        _mark_directions(panel, surface.nodes[np.unique(faces)], front)
    edge = "Bold: the leading edge" if closer[0].leading is not None else "Arrow: direction of an axis"
    text = as_sentences(
        f"Number of each contact pair, as along the dimension contact: {len(names)} pairs",
        "Each surface is seen from outside its body" if surface.is_mesh else "",
        "Only some of the numbers are written" if some else "",
        edge,
    )
    return Drawing("pair_numbers", "Numbers of the contact pairs", text, figure)


def _from_the_front(surface: RootSurface, view: View, faces: NDArray[np.int64]) -> View:
    """The view of some faces along their mean normal, their longer side lying."""
    normal = face_normals(surface.nodes, faces).sum(axis=0)
    normal /= np.linalg.norm(normal)
    centred = surface.nodes[np.unique(faces)]
    centred = centred - centred.mean(axis=0)
    _, _, directions = np.linalg.svd(centred, full_matrices=False)
    up = np.cross(normal, directions[0])
    up *= -1.0 if up @ view.up < 0.0 else 1.0
    return replace(view, to_eye=normal, up=up)


def _centres(surface: RootSurface, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """Middles (n, 3) of the patches of some pairs."""
    return np.asarray(surface.nodes[surface.faces[pairs]].mean(axis=1))


def _mark_directions(panel: Axes, nodes: NDArray[np.float64], view: View) -> None:
    """The leading edge as a bold line; or, where it is not known, the axis of the mesh that runs to the right."""
    right, up, _ = view.frame
    seen = np.stack([nodes @ right, nodes @ up], axis=1) * 1e3
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float((high - low).max()) or 1.0
    if view.leading is not None:
        at_right = bool((view.leading - nodes.mean(axis=0)) @ right > 0.0)
        x = high[0] + 0.03 * size if at_right else low[0] - 0.03 * size
        panel.plot([x, x], [low[1], high[1]], color="black", linewidth=3.0, solid_capstyle="butt")
        panel.text(
            x + (0.01 if at_right else -0.01) * size,
            0.5 * (low[1] + high[1]),
            "leading edge",
            ha="left" if at_right else "right",
            va="center",
            rotation=90,
        )
    else:
        axis = int(np.argmax(np.abs(right)))
        start = np.array([low[0], low[1] - 0.05 * size])
        end = start + 0.2 * size * np.array([right[axis], up[axis]]) * np.sign(right[axis])
        panel.plot(*np.stack([start, end], axis=1), color="black", linewidth=1.0)
        panel.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops={"arrowstyle": "->", "color": "black"})
        panel.text(end[0], end[1], f" {'+' if right[axis] > 0.0 else '-'}{'xyz'[axis]}", ha="left", va="center")
    panel.margins(0.02)
    panel.set_xlim(low[0] - 0.12 * size, high[0] + 0.12 * size)
    panel.set_ylim(low[1] - 0.1 * size, high[1] + 0.05 * size)


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
            f"{label.capitalize()}, at {result.describe(point)}",
            f"Largest: {values.max():.3g} at pair {pair}" if values.max() > 0.0 else "No pair does",
            "" if surface.is_mesh else "The file has no mesh: each pair is a patch",
        )
        yield Drawing(name, title, caption, figure)
    yield draw_numbers(result, surface, views)
