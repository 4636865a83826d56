"""What the page holds of the root in three dimensions: faces, views, and which pairs tell the values at their nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from studyrunner.report.page.data import encode_floats
from studyrunner.report.root.painting import body_colours
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.views import find_views
from studyrunner.result.scene_pairs import axes_of_scenes, of_shown_scene, pairs_of_scene
from studyrunner.result.view import Result

_MOST_FACES, _MOST_PAIRS = 15_000, 10_000
"""Faces, and contact pairs, that the page draws in three dimensions."""


def build_root_numbers(result: Result, notes: list[str]) -> dict[str, Any] | None:
    """Faces and views as the script on the page reads them; None where there are none to draw, or too many.

    `nodes`, m, three numbers each; `faces`, four nodes each; `body` and `flank` of each face; `seen`: bits of the views
    that show a face; of `contact`: `nodes`, `pairs` and `weights`, `columns` of them for each node, and `normals`; all
    of these as `encode_floats` has them. `well_seen`: m, the depth that is well seen. `scene`: index along the axes
    along which scenes differ, of the one that is drawn.
    """
    n_pairs = result.dataset.sizes["contact"]
    if n_pairs > _MOST_PAIRS:
        notes.append(f"The contact is not on this page in three dimensions: it has {n_pairs} pairs.")
        return None
    shown = of_shown_scene(result)
    whole = read_root(shown)
    if whole is None:
        return None
    surface = whole.near_contact(_MOST_FACES)
    if len(surface.faces) < len(whole.faces):
        notes.append(
            f"In three dimensions are {len(surface.faces)} of {len(whole.faces)} faces, those near the contact."
        )
    views, contact = find_views(shown, surface), surface.contact
    pairs = pairs_of_scene(result, result.shown_point())[contact.pairs]
    return {
        "nodes": encode_floats(surface.nodes),
        "faces": encode_floats(surface.faces),
        "body": encode_floats(surface.body),
        "flank": encode_floats(contact.flank),
        "seen": encode_floats(sum(view.faces.astype(int) << number for number, view in enumerate(views))),
        "bodies": list(surface.bodies),
        "colours": list(body_colours(surface.bodies)),
        "contact": {
            "nodes": encode_floats(contact.nodes),
            "columns": int(contact.pairs.shape[1]),
            "pairs": encode_floats(pairs),
            "weights": encode_floats(contact.weights),
            "normals": encode_floats(contact.normals),
        },
        "well_seen": surface.well_seen,
        "scene": {name: result.shown_point()[name] for name in axes_of_scenes(result)},
        "views": [
            {
                "title": view.title,
                "body": view.body,
                "eye": np.round(view.to_eye, 6).tolist(),
                "up": np.round(view.up, 6).tolist(),
            }
            for view in views
        ],
    }
