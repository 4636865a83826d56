"""What the page holds of the root in three dimensions: faces, views, and which pairs tell the values at their nodes."""

from __future__ import annotations

import numpy as np

from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.scene_pairs import of_shown_scene, pairs_of_scene
from studyrunner.report.root.painting import body_colours
from studyrunner.report.root.simplified import simplify
from studyrunner.report.root.surface import RootSurface, read_root
from studyrunner.report.root.views import View, find_views

MOST_FACES = 15_000
"""Faces beside those in contact that the page takes, if they fit."""

_CHARACTERS_A_FACE = 56.0  # with its nodes, of which there are about as many
_FRACTION = 0.25
_BESIDE = 0.3

_MOST_PAIRS = 10_000


def build_root_numbers(result: Result, limit: float, notes: list[str]) -> dict[str, object] | None:
    """Faces and views as the script on the page reads them; None where there are none to draw, or too many.

    They take a quarter of `limit`, characters of text, at most, those in contact aside.

    `nodes`, m, three numbers each; `faces`, four nodes each; `body` and `flank` of each face; `seen`: bits of the views
    that show a face; of `contact`: `nodes`, `pairs` and `weights`, `columns` of them for each node, and `normals`; all
    of these as `encode_floats` has them. `well_seen`: m, the depth that is well seen.
    """
    n_pairs = result.dataset.sizes["contact"]
    if n_pairs > _MOST_PAIRS:
        notes.append(f"The contact is not on this page in three dimensions: it has {n_pairs} pairs.")
        return None
    shown = of_shown_scene(result)
    surface = read_root(shown)
    if surface is None:
        return None
    n_faces, surface = (
        len(surface.faces),
        simplify(surface, min(MOST_FACES, int(_FRACTION * limit / _CHARACTERS_A_FACE))),
    )
    if len(surface.faces) < n_faces:
        notes.append(f"The mesh is drawn with {len(surface.faces)} of its {n_faces} faces; those in contact are whole.")
    views = find_views(shown, surface)
    seen = sum(view.faces.astype(int) << number for number, view in enumerate(views))
    contact = surface.contact
    return {
        "nodes": encode_floats(surface.nodes),
        "faces": encode_floats(surface.faces),
        "body": encode_floats(surface.body),
        "flank": encode_floats(contact.flank),
        "seen": encode_floats(seen),
        "bodies": list(surface.bodies),
        "colours": list(body_colours(surface.bodies)),
        "mesh": surface.is_mesh,
        "contact": {
            "nodes": encode_floats(contact.nodes),
            "columns": int(contact.pairs.shape[1]),
            "pairs": encode_floats(pairs_of_scene(result, result.shown_point())[contact.pairs]),
            "weights": encode_floats(contact.weights),
            "normals": encode_floats(contact.normals),
        },
        "well_seen": surface.well_seen,
        "views": [
            {
                "title": view.title,
                "body": view.body,
                "eye": np.round(view.to_eye, 6).tolist(),
                "up": np.round(view.up, 6).tolist(),
                "leading": _beside(surface, view),
            }
            for view in views
        ],
    }


def _beside(surface: RootSurface, view: View) -> list[float] | None:
    """A place (3,), m, beside the leading edge, off the contact surface; None where the edge is not known."""
    if view.leading is None:
        return None
    flank = surface.faces[(surface.body == view.body) & (surface.contact.flank == view.flank)]
    away = view.leading - surface.nodes[flank].mean(axis=(0, 1))
    beside: list[float] = (view.leading + _BESIDE * away).tolist()
    return beside
