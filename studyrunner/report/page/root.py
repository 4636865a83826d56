"""What the page holds of the root in three dimensions: faces, views, and which pairs tell the values at their nodes."""

from __future__ import annotations

import numpy as np

from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.reading.result import Result
from studyrunner.report.root.painting import body_colours
from studyrunner.report.root.simplified import simplify
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.views import find_views

MOST_FACES = 15_000
"""Faces beside those in contact that the page takes."""

_MOST_CONTACT_FACES = 20_000


def build_root_numbers(result: Result, notes: list[str]) -> dict[str, object] | None:
    """Faces and views as the script on the page reads them; None where there are none to draw, or too many.

    `nodes`, m, three numbers each; `faces`, four nodes each; `body` and `flank` of each face; `seen`: bits of the views
    that show a face; of `contact`: `nodes`, `pairs` and `weights`, `columns` of them for each node, and `normals`; all
    of these as `encode_floats` has them. `well_seen`: m, the depth that is well seen.
    """
    surface = read_root(result)
    if surface is None:
        return None
    if np.count_nonzero(surface.contact.flank >= 0) > _MOST_CONTACT_FACES:
        notes.append("The root is not on this page in three dimensions: it has too many faces in contact.")
        return None
    n_faces, surface = len(surface.faces), simplify(surface, MOST_FACES)
    if len(surface.faces) < n_faces:
        notes.append(f"The mesh is drawn with {len(surface.faces)} of its {n_faces} faces; those in contact are whole.")
    views = find_views(result, surface)
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
            "pairs": encode_floats(contact.pairs),
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
                "leading": None if view.leading is None else view.leading.tolist(),
            }
            for view in views
        ],
    }
