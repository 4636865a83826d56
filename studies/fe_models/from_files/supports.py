"""Rotation, cut faces and clamps of a deck."""

from __future__ import annotations

import numpy as np

from solver.model import BoolArray, FloatArray
from studies.fe_models.checks import rotation_of_deck
from studies.fe_models.deck.mesh import Boundary, Deck
from studies.fe_models.from_files.parameters import AxisTable, Parameters
from studies.fe_models.from_files.selections import Selections
from studies.fe_models.units import Units
from studies.finite_element.elements.solid_mesh import Rotation
from studies.finite_element.joint.cut_faces import CutFaces, CyclicAxis, find_cut_faces, match_cut_faces
from studies.scene_error import SceneError

_LAST_DISPLACEMENT = 3  # further degrees of freedom of a boundary condition are rotations and temperatures


def find_rotation(deck: Deck, parameters: Parameters, units: Units) -> Rotation | None:
    """Rotation that the study gives, else that of the deck, SI; None where the model stands still.

    Raises SceneError where a speed has no axis, or parts of the deck turn differently.
    """
    speed = parameters.rotation_speed
    own = None if speed is not None and parameters.axis is not None else rotation_of_deck(deck, units)
    if speed == 0.0 or (speed is None and own is None):
        return None
    axis = _axis(deck, parameters, units)
    if own is not None and parameters.axis is None:
        axis = own.point, own.axis
    if axis is None:
        raise SceneError("axis", "missing", "give {point, direction} of the axis of rotation: the deck has none")
    omega_squared = own.omega_squared if speed is None and own is not None else (np.pi * (speed or 0.0) / 30.0) ** 2
    return Rotation(omega_squared, *axis)


def find_cut(selections: Selections, parameters: Parameters, units: Units) -> CutFaces | None:
    """Cut faces that the study names, else those of the deck, else all nodes that are images; None of no sector.

    Raises SceneError where they are not one sector apart, or have no axis.
    """
    deck, mesh = selections.deck, selections.mesh
    n_sectors = parameters.n_sectors
    if n_sectors is None and deck.cyclic is not None:
        n_sectors = deck.cyclic.n_sectors
    if n_sectors is None:
        if parameters.cut_faces is not None:
            raise SceneError("n_sectors", "missing", "give the number of sectors with cut_faces")
        return None
    found = _axis(deck, parameters, units)
    if found is None:
        rotation = find_rotation(deck, parameters, units)
        if rotation is None:
            raise SceneError("axis", "missing", "give {point, direction} of the axis of the cyclic structure")
        found = rotation.point, rotation.axis
    axis = CyclicAxis(n_sectors, *found)
    places = mesh.coordinates, mesh.numbers, mesh.bodies
    names = parameters.cut_faces or _cut_names(deck)
    if names is None:
        return find_cut_faces(*places, axis)
    first, second = (selections.nodes(name, "cut_faces") for name in names)
    return match_cut_faces(*places, axis, first, second)


def find_held(selections: Selections, parameters: Parameters) -> BoolArray:
    """Displacements (n_nodes, 3) that are 0: all of the nodes that the study clamps, else those of BOUNDARY.

    Raises SceneError where the deck moves nodes.
    """
    held = np.zeros((selections.mesh.n_nodes, 3), dtype=np.bool_)
    if parameters.clamp is not None:
        for name in parameters.clamp:
            held[selections.nodes(name, "clamp")] = True
        return held
    for boundary in _boundaries(selections.deck):
        first, last = max(boundary.first_dof, 1), min(boundary.last_dof, _LAST_DISPLACEMENT)
        if first <= last and boundary.value != 0.0:
            raise SceneError(
                "clamp",
                f"{selections.deck.path} moves {boundary.name} by {boundary.value:g}",
                "hold it, or give `clamp`",
            )
        held[selections.rows(boundary.nodes), first - 1 : last] = True
    return held


def _axis(deck: Deck, parameters: Parameters, units: Units) -> tuple[FloatArray, FloatArray] | None:
    """Point, m, and direction of the axis, of unit length, that the study or the cyclic deck gives."""
    given: AxisTable | None = parameters.axis
    if given is not None:
        direction = np.array(given.direction)
        return np.array(given.point), direction / np.linalg.norm(direction)
    if deck.cyclic is None:
        return None
    start, end = deck.cyclic.axis * units.length
    return start, (end - start) / np.linalg.norm(end - start)


def _cut_names(deck: Deck) -> tuple[str, str] | None:
    named = "" if deck.cyclic is None else deck.cyclic.tie
    for tie in deck.ties:
        if tie.cyclic and named in ("", tie.name):
            return tie.dependent, tie.independent
    return None


def _boundaries(deck: Deck) -> tuple[Boundary, ...]:
    """Boundary conditions up to the step that writes matrices, which has none."""
    found = deck.boundaries
    for step in deck.steps:
        if step.equations_removed or step.parameters.get("SOLVER", "").upper() == "MATRIXSTORAGE":
            break
        found = step.boundaries if step.boundaries_replaced else (*found, *step.boundaries)
    return found
