"""The mesh of a deck in SI units, each element with its material; rotation, cut faces and clamps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from solver.model import BoolArray, FloatArray, IntArray
from studies.fe_models.checks import rotation_of_deck
from studies.fe_models.deck.contents import Deck
from studies.fe_models.from_files.parameters import AxisTable, MaterialTable, Parameters
from studies.fe_models.from_files.selections import Selections
from studies.fe_models.model_files import Units
from studies.finite_element.cut_faces import CutFaces, CyclicAxis, find_cut_faces, match_cut_faces
from studies.finite_element.element_matrices import Material
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.solid_mesh import ElementGroup, Rotation, SolidMesh
from studies.scene_error import SceneError

_NONE = Material(0.0, 0.0, 0.0)  # of a mesh whose matrices come from elsewhere


def build_solid_mesh(deck: Deck, parameters: Parameters, units: Units) -> SolidMesh:
    """Elements of a deck and their nodes, m; nodes of no element are left out, but of a table of nodes.

    Materials are those of the study, else of the deck; none are needed where the study names matrices. Raises
    SceneError where the deck has no elements, or some have no material.
    """
    if deck.contact_nodes is not None:
        return SolidMesh(deck.coordinates * units.length, deck.node_numbers, ())
    if not deck.blocks:
        raise SceneError("model", f"{deck.path} has no solid elements", "give a deck with the mesh")
    numbers = np.unique(np.concatenate([block.nodes.ravel() for block in deck.blocks]))
    coordinates = deck.coordinates[deck.rows_of_nodes(numbers)] * units.length
    materials = list(_materials(deck, parameters, units))
    groups = []
    for block in deck.blocks:
        left = np.ones(len(block.numbers), dtype=np.bool_)
        # the last section of an element holds
        for name, elements, material in reversed(materials):
            own = left & np.isin(block.numbers, elements)
            if own.any():
                nodes = np.searchsorted(numbers, block.nodes[own]).astype(np.int64)
                groups.append(ElementGroup(block.kind, nodes, block.numbers[own], material, name))
            left &= ~own
        if left.any():
            found = f"{np.count_nonzero(left)} elements of {deck.path} have none, as element {block.numbers[left][0]}"
            remedy = "give *SOLID SECTION with *ELASTIC and *DENSITY in the deck, or `material` in the study"
            raise SceneError("material", found, remedy)
    return SolidMesh(coordinates, numbers, tuple(groups))


def _materials(deck: Deck, parameters: Parameters, units: Units) -> Iterator[tuple[str, IntArray, Material]]:
    """Label, element numbers and material; where an element has several the last one holds."""
    given, everything = parameters.material, np.concatenate([block.numbers for block in deck.blocks])
    needed = parameters.matrices is None and not isinstance(given, MaterialTable)
    if not needed:
        whole = _own(given) if isinstance(given, MaterialTable) else _NONE
        yield "", everything, whole
    for section in deck.sections:
        found = deck.materials.get(section.material)
        values = None if found is None else (found.young, found.poisson, found.density)
        if needed and found is not None and found.problem and not isinstance(given, dict):
            raise SceneError("model", found.problem, "give one isotropic law, or `material` in the study")
        elements = deck.element_sets[section.element_set]
        if not needed:
            yield section.element_set, elements, whole
        elif values is not None and None not in values:
            young, poisson, density = (float(value or 0.0) for value in values)
            yield section.element_set, elements, Material(young * units.stress, poisson, density * units.density)
        elif not isinstance(given, dict):
            raise SceneError(
                "material",
                f"{section.material} in {deck.path} lacks Young's modulus, Poisson's ratio or density",
                "give *ELASTIC and *DENSITY in the deck, or `material` in the study",
            )
    if isinstance(given, dict):
        for name, table in given.items():
            elements = deck.element_sets.get(name.strip().upper(), np.empty(0, dtype=np.int64))
            if elements.size == 0:
                known = ", ".join(sorted(deck.element_sets)[:6]) or "none"
                raise SceneError(
                    "material", f'there is no set of elements "{name}" in {deck.path}', f"give one of {known}"
                )
            yield name.strip().upper(), elements, _own(table)


def _own(table: MaterialTable) -> Material:
    return Material(table.young_modulus, table.poisson_ratio, table.density)


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


def find_cyclic_axis(deck: Deck, parameters: Parameters, units: Units) -> CyclicAxis | None:
    """Axis and number of sectors that the study gives, else those of the deck; None of no sector.

    Raises SceneError where there is one without the other.
    """
    n_sectors = parameters.n_sectors
    if n_sectors is None and deck.cyclic is not None:
        n_sectors = deck.cyclic.n_sectors
    if n_sectors is None:
        for key in ("cut_faces", "next_sector"):
            if getattr(parameters, key):
                raise SceneError("n_sectors", "missing", f"give the number of sectors with {key}")
        return None
    found = _axis(deck, parameters, units)
    if found is None:
        rotation = find_rotation(deck, parameters, units)
        if rotation is None:
            raise SceneError("axis", "missing", "give {point, direction} of the axis of the cyclic structure")
        found = rotation.point, rotation.axis
    return CyclicAxis(n_sectors, *found)


def find_cut(
    selections: Selections, parameters: Parameters, axis: CyclicAxis | None, contacts: Sequence[ContactSurfaces]
) -> CutFaces | None:
    """Cut faces that the study names, else those of the deck, else all nodes that are images; None of no sector.

    contacts: nodes of those with the next sector are on no cut face that is found.

    Raises SceneError where they are not one sector apart.
    """
    if axis is None:
        return None
    deck, mesh = selections.deck, selections.mesh
    names = _cut_names(deck) if parameters.cut_faces is None else [parameters.cut_faces]
    if not names:
        across = [surface.nodes for each in contacts if each.sector for surface in (each.first, each.second)]
        return find_cut_faces(mesh, axis, np.concatenate([np.empty(0, dtype=np.int64), *across]))
    sides = ([selections.nodes(pair[side], "cut_faces") for pair in names] for side in (0, 1))
    first, second = (np.unique(np.concatenate(each)) for each in sides)
    return match_cut_faces(mesh, axis, first, second)


def find_clamped(selections: Selections, parameters: Parameters) -> BoolArray | None:
    """Displacements (n_nodes, 3) of the nodes that the study clamps; None where the deck says what is held.

    Raises SceneError where a set does not exist.
    """
    if parameters.clamp is None:
        return None
    held = np.zeros((selections.mesh.n_nodes, 3), dtype=np.bool_)
    for name in parameters.clamp:
        held[selections.nodes(name, "clamp")] = True
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


def _cut_names(deck: Deck) -> list[tuple[str, str]]:
    named = () if deck.cyclic is None else deck.cyclic.ties
    return [(tie.dependent, tie.independent) for tie in deck.ties if tie.cyclic and (not named or tie.name in named)]
