"""Faces in space on paper: seen from afar, those nearer to the eye over those behind.

By hand: `mplot3d` leaves a wide margin, and draws both sides of a face alike.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.views import View

BODIES = ("#d9b38c", "#9ecae1", "#c7c7c7", "#b5d99c")
"""Colours of the bodies in their order; their lightness differs, in print as well."""

_INSIDE = 0.42
_EDGEWAYS = 1e-9
_NAMED = {"blade": "#9ecae1", "disk": "#d9b38c"}


def body_colours(names: tuple[str, ...]) -> tuple[str, ...]:
    """One colour a body; blade and disk have those of the other pictures of the mesh."""
    return tuple(_NAMED.get(name.lower(), BODIES[number % len(BODIES)]) for number, name in enumerate(names))


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
    right, up, to_eye = view.frame
    seen = np.stack([nodes @ right, nodes @ up], axis=1) * 1e3
    order = np.argsort(nodes[faces].mean(axis=1) @ to_eye, kind="stable")
    panel.add_collection(
        PolyCollection(
            list(seen[faces[order]]),
            facecolors=shade(colours, nodes, faces, to_eye)[order],
            edgecolors="0.25" if lines else "none",
            linewidths=lines,
            # smooth edges of neighbouring faces would let what is behind them shine through
            antialiaseds=lines > 0.0,
            rasterized=True,
        )
    )
    panel.set_aspect("equal")
    panel.autoscale_view()
    panel.grid(visible=False)
    panel.set_axis_off()


def paint_edges(panel: Axes, nodes: NDArray[np.float64], faces: NDArray[np.int64], view: View) -> None:
    """The outline of faces (n, 4): their edges that are those of a single one of them."""
    right, up, _ = view.frame
    seen = np.stack([nodes @ right, nodes @ up], axis=1) * 1e3
    panel.add_collection(
        LineCollection(list(seen[outline(faces)]), colors="black", linewidths=0.8, linestyles=(0, (4, 2)))
    )


def outline(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (n_edges, 2) of faces (n_faces, 4) that belong to a single one of them."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count == 1])


def shade(
    colours: NDArray[np.float64], nodes: NDArray[np.float64], faces: NDArray[np.int64], to_eye: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Colours (n, 3) of faces, darker where they turn away from the eye, grey where their inner side is seen."""
    normals = face_normals(nodes, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    turned = normals @ to_eye
    lit = colours * (0.55 + 0.45 * np.abs(turned))[:, None]
    return np.where((turned < -_EDGEWAYS)[:, None], _INSIDE, lit)


def rgb(names: tuple[str, ...], which: NDArray[np.int64]) -> NDArray[np.float64]:
    """Colours (n, 3) of these names and places among them (n,)."""
    return np.array([to_rgb(name) for name in names])[which]


def draw_scale_bar(panel: Axes, nodes: NDArray[np.float64], view: View) -> None:
    """A bar of a round length under what is seen, in place of axes."""
    right, up, _ = view.frame
    seen = np.stack([nodes @ right, nodes @ up], axis=1) * 1e3
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
