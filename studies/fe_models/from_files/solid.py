"""The mesh of a deck in SI units, each element with its material."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from solver.model import IntArray
from studies.fe_models.deck.mesh import Deck
from studies.fe_models.from_files.parameters import MaterialTable, Parameters
from studies.fe_models.units import Units
from studies.finite_element.element_matrices import Material
from studies.finite_element.solid_mesh import ElementGroup, SolidMesh
from studies.scene_error import SceneError

_NONE = Material(0.0, 0.0, 0.0)  # of a mesh whose matrices come from elsewhere


def build_solid_mesh(deck: Deck, parameters: Parameters, units: Units) -> SolidMesh:
    """Elements of a deck and their nodes, m; nodes of no element are left out.

    Materials are those of the study, else of the deck; none are needed where the study names matrices. A table of nodes
    has no elements, and all its nodes are there.

    Raises SceneError where the deck has no elements, or some have no material.
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
            raise SceneError(
                "material",
                f"{np.count_nonzero(left)} elements of {deck.path} have none, as element {block.numbers[left][0]}",
                "give *SOLID SECTION with *ELASTIC and *DENSITY in the deck, or `material` in the study",
            )
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
