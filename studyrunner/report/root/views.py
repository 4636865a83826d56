"""From where the root is looked at: the whole, and the contact surfaces of each body from close by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.root.surface import RootSurface
from studyrunner.result.view import Result

MOST_VIEWS = 8

LEADING = {"dovetail_sector": np.array([0.0, 0.0, -1.0])}
"""Bundled scenes whose flow is known, by model: the direction to the leading edge."""

_AROUND = 0.16  # of a close-up: how much is seen around the contact surfaces, over their size
_BEFORE = 0.06  # what stands before a contact surface is cut off from here on, over the same size
_WHOLE = np.array([0.35, -0.6, -0.72])  # to the eye, where upwards is x
_ASLANT, _FROM_ABOVE = 0.55, 0.3


@dataclass(frozen=True)
class View:
    """Faces that are seen and the direction they are seen from.

    title: in words. faces (n_faces,): which are seen. to_eye, up (3,): unit vectors. body: the one in the view, -1 for
    all. flank: the contact surface that is looked at, -1 for none in particular. leading (3,): the middle of its
    leading edge, m; None where it is not known.
    """

    title: str
    faces: NDArray[np.bool_]
    to_eye: NDArray[np.float64]
    up: NDArray[np.float64]
    body: int
    flank: int
    leading: NDArray[np.float64] | None = None

    @property
    def frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Unit vectors to the right and upwards on paper, and to the eye."""
        up = self.up - (self.up @ self.to_eye) * self.to_eye
        up /= np.linalg.norm(up)
        return np.cross(up, self.to_eye), up, self.to_eye

    def seen(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places (..., 3), m, on paper (..., 2), mm."""
        right, up, _ = self.frame
        return 1e3 * np.stack([places @ right, places @ up], axis=-1)


def find_views(result: Result, surface: RootSurface) -> tuple[View, ...]:
    """Close-ups of each contact surface of each body, the outermost body first, then the whole."""
    leading = LEADING.get(str(result.study.get("scene", {}).get("model")))
    up = _upwards(surface.nodes)
    contact = surface.contact.flank >= 0
    # by where they are along the direction upwards
    height = {
        body: float((surface.nodes[np.unique(surface.faces[surface.body == body])] @ up).mean())
        for body in np.unique(surface.body[contact]).tolist()
    }
    closer = []
    for body in sorted(height, key=lambda body: -height[body]):
        own = surface.body == body
        for flank in np.unique(surface.contact.flank[own & contact]).tolist():
            title = f"{surface.bodies[body]}: {surface.flanks[flank] or 'contact'}"
            closer.append(_close_up(surface, title, body, flank, up, leading))
    return (*closer[: MOST_VIEWS - 1], from_aslant(surface.nodes, len(surface.faces)))


def from_aslant(nodes: NDArray[np.float64], n_faces: int) -> View:
    """All faces of a mesh of these nodes (n_nodes, 3), from aslant."""
    up = _upwards(nodes)
    place = int(np.argmax(np.abs(up)))
    to_eye = np.roll(_WHOLE, place) * np.where(np.arange(3) == place, up[place], 1.0)
    return View("whole mesh", np.ones(n_faces, dtype=np.bool_), to_eye / np.linalg.norm(to_eye), up, -1, -1)


def _close_up(
    surface: RootSurface,
    title: str,
    body: int,
    flank: int,
    up: NDArray[np.float64],
    leading: NDArray[np.float64] | None,
) -> View:
    """The faces of a body around its contact surfaces, without those that stand before the one looked at."""
    own = surface.body == body
    inside = surface.nodes[np.unique(surface.faces[own & (surface.contact.flank >= 0)])]
    looked_at = own & (surface.contact.flank == flank)
    normal = surface.mean_normal(looked_at)
    size = float(np.linalg.norm(np.ptp(inside, axis=0)))
    low, high = inside.min(axis=0) - _AROUND * size, inside.max(axis=0) + _AROUND * size
    centre = surface.nodes[surface.faces].mean(axis=1)
    near = ((surface.nodes >= low) & (surface.nodes <= high)).all(axis=1)[surface.faces].any(axis=1)
    on_it = surface.nodes[np.unique(surface.faces[looked_at])]
    behind = centre @ normal <= float((on_it @ normal).max()) + _BEFORE * size
    edge = None
    if leading is not None:
        along = on_it @ leading
        edge = on_it[along >= along.max() - 1e-6 * size].mean(axis=0)
    return View(title, own & near & behind | looked_at, *_aslant(normal, up), body, flank, edge)


def _upwards(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Along the longest axis of the mesh, away from the origin: outwards in a sector whose blade stands on an axis."""
    size = np.ptp(nodes, axis=0)
    up = np.zeros(3)
    place = int(np.argmax(np.round(size, 9)))
    up[place] = -1.0 if nodes[:, place].mean() < 0.0 else 1.0
    return up


def _aslant(normal: NDArray[np.float64], up: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """To the eye and upwards for a surface with this normal, looked at from a side and from above."""
    aside = np.cross(up, normal)
    if np.linalg.norm(aside) < 0.1:
        # a surface that looks upwards or downwards
        other = np.eye(3)[np.argmin(np.abs(up))]
        aside, up = np.cross(other, normal), other
    to_eye = normal + _ASLANT * aside / np.linalg.norm(aside) + _FROM_ABOVE * up
    return to_eye / np.linalg.norm(to_eye), up
