"""The whole disk: the sector of the mesh turned round its axis (Fig. 2a of the paper)."""

from __future__ import annotations

import numpy as np

from studyrunner.report.drawing import Drawing, new_figure
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.painting import body_colours, paint_faces, rgb
from studyrunner.report.root.simplified import simplify
from studyrunner.report.root.surface import RootSurface
from studyrunner.report.root.views import View

_MOST_FACES = 150_000
_MOST_SECTORS = 500
_FEWEST_SECTORS = 3
_TO_EYE = np.array([0.35, 0.25, 1.0])
_FADED = 0.45


def build_disk(result: Result, surface: RootSurface) -> Drawing | None:
    """The disk of all sectors, that of the mesh in full colour; None where the study names no sectors about z.

    Only faces that look to the eye are drawn.
    """
    scene = result.study.get("scene", {})
    number = scene.get("n_sectors")
    if scene.get("model") != "dovetail_sector" or not isinstance(number, int) or not surface.is_mesh:
        return None
    if not _FEWEST_SECTORS <= number <= _MOST_SECTORS:
        return None
    surface = simplify(surface, _MOST_FACES // number)
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
    figure = new_figure(4.6)
    panel = figure.subplots()
    paint_faces(panel, all_nodes, all_faces[looking], all_colours[looking], view, lines=0.0)
    text = as_sentences(
        f"The {number} sectors of the disk, that of the mesh in full colour",
        f"Axis of rotation: z, towards the reader; parts: {', '.join(surface.bodies)}",
    )
    return Drawing("whole_disk", "The whole disk", text, figure)
