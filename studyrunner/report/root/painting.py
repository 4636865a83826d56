"""Faces in space on paper: seen from afar, those nearer to the eye over those behind.

By hand: `mplot3d` leaves a wide margin, and draws both sides of a face alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.views import View

# colours of the bodies in their order: their lightness differs, in print as well
_BODIES, _NAMED = ("#d9b38c", "#9ecae1", "#c7c7c7", "#b5d99c"), {"blade": "#9ecae1", "disk": "#d9b38c"}
_INSIDE, _EDGEWAYS = 0.42, 1e-9


def body_colours(names: tuple[str, ...]) -> tuple[str, ...]:
    """One colour a body; blade and disk have those of the other pictures of the mesh."""
    return tuple(_NAMED.get(name.lower(), _BODIES[number % len(_BODIES)]) for number, name in enumerate(names))


def rgb(names: tuple[str, ...], which: NDArray[np.int64]) -> NDArray[np.float64]:
    """Colours (n, 3) of these names and places among them (n,)."""
    return np.array([to_rgb(name) for name in names])[which]


def paint_faces(
    panel: Axes,
    nodes: NDArray[np.float64],
    faces: NDArray[np.int64],
    colours: NDArray[np.float64],
    view: View,
    *,
    lines: float = 0.2,
) -> None:
    """Faces (n, 4) with their colours (n, 3) as seen in a view, darker where they turn away from the eye, in mm.

    The inner side of a face, which is seen where a mesh is cut, is grey. lines: width of the edges, points; 0 for none.
    """
    _, _, to_eye = view.frame
    order = np.argsort(nodes[faces].mean(axis=1) @ to_eye, kind="stable")
    normals = face_normals(nodes, faces)
    turned = normals @ to_eye / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    lit = np.where((turned < -_EDGEWAYS)[:, None], _INSIDE, colours * (0.55 + 0.45 * np.abs(turned))[:, None])
    painted = PolyCollection(
        list(view.seen(nodes)[faces[order]]),
        facecolors=lit[order],
        edgecolors="0.25" if lines else "none",
        linewidths=lines,
        # smooth edges of neighbouring faces would let what is behind them shine through
        antialiaseds=lines > 0.0,
        rasterized=True,
    )
    panel.add_collection(painted)
    panel.set_aspect("equal")
    panel.autoscale_view()
    panel.grid(visible=False)
    panel.set_axis_off()


def paint_edges(panel: Axes, nodes: NDArray[np.float64], faces: NDArray[np.int64], view: View) -> None:
    """The outline of faces (n, 4): their edges that are those of a single one of them."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    look: dict[str, Any] = {"colors": "black", "linewidths": 0.8, "linestyles": (0, (4, 2))}
    panel.add_collection(LineCollection(list(view.seen(nodes)[unique[count == 1]]), **look))


def draw_scale_bar(panel: Axes, nodes: NDArray[np.float64], view: View) -> None:
    """A bar of a round length under what is seen, in place of axes."""
    seen = view.seen(nodes)
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float((high - low).max())
    if not size > 0.0:
        return
    length = 10.0 ** np.floor(np.log10(0.4 * size))
    length *= max(factor for factor in (1.0, 2.0, 5.0) if factor * length <= 0.4 * size or factor == 1.0)
    bottom = low[1] - 0.05 * size
    panel.fill_between([low[0], low[0] + length], bottom - 0.006 * size, bottom + 0.006 * size, color="0.1", lw=0.0)
    panel.text(low[0] + 0.5 * length, bottom - 0.02 * size, f"{length:g} mm", ha="center", va="top")
    panel.set_ylim(bottom - 0.1 * size, high[1] + 0.02 * size)
