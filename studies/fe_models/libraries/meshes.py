"""Meshes as arrays on their way from the process of a library, and as decks behind it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from studies.fe_models.deck.mesh import NODES_OF_KIND, Deck, ElementBlock, FloatArray, IntArray
from studies.fe_models.libraries.process import Arrays, read_by_library
from studies.scene_error import SceneError

_MOST_SETS = 10_000


def read_library_mesh(path: Path) -> Deck:
    """A mesh of Gmsh (.msh, with the extra "meshio") or ANSYS (.cdb, with the extra "ansys"): elements and sets.

    Nodes that belong to no solid element are left out. Of .msh, node numbers are the places of nodes in the file and
    element numbers count its solid elements, both from 1; a named group gives a set of its nodes, and one of volumes a
    set of its elements as well. Hexahedra of 8 nodes are read as C3D8I, the project's own.

    Raises
    ------
    SceneError
        About "model": where the extra is missing, or the file cannot be read or has other elements.
    """
    arrays = read_by_library("cdb" if path.suffix.lower() == ".cdb" else "gmsh", path, "model")
    return _build_deck(path.name, arrays)


def pack_mesh(
    nodes: IntArray,
    coordinates: FloatArray,
    blocks: Mapping[str, tuple[IntArray, IntArray]],
    node_sets: Mapping[str, IntArray],
    element_sets: Mapping[str, IntArray],
    notes: tuple[str, ...] = (),
) -> Arrays:
    """A mesh as arrays: node numbers (n,) and coordinates (n, 3), numbers and nodes of elements by kind, sets."""
    arrays: Arrays = {"nodes": nodes, "coordinates": coordinates, "notes": np.array(notes, dtype=str)}
    for kind, (numbers, used) in blocks.items():
        arrays[f"numbers_{kind}"], arrays[f"nodes_{kind}"] = numbers, used
    for what, sets in (("node_set", node_sets), ("element_set", element_sets)):
        if len(sets) > _MOST_SETS:
            raise SceneError("model", f"{len(sets)} sets", f"keep at most {_MOST_SETS}")
        arrays[f"names_{what}"] = np.array(list(sets), dtype=str)
        for place, members in enumerate(sets.values()):
            arrays[f"{what}_{place}"] = members
    return arrays


def _build_deck(name: str, arrays: Arrays) -> Deck:
    order = np.argsort(arrays["nodes"], kind="stable")
    numbers, coordinates = arrays["nodes"][order].astype(np.int64), arrays["coordinates"][order].astype(np.float64)
    blocks: list[ElementBlock] = []
    for kind in NODES_OF_KIND:
        if f"numbers_{kind}" in arrays:
            found = arrays[f"numbers_{kind}"].astype(np.int64)
            by_number = np.argsort(found, kind="stable")
            blocks.append(ElementBlock(kind, found[by_number], arrays[f"nodes_{kind}"][by_number].astype(np.int64)))
    if not blocks:
        raise SceneError("model", f"{name} has no solid elements", "write the volumes of the mesh")
    used = np.unique(np.concatenate([block.nodes.ravel() for block in blocks]))
    elements = np.sort(np.concatenate([block.numbers for block in blocks]))
    if np.any(numbers[1:] == numbers[:-1]) or np.any(elements[1:] == elements[:-1]):
        raise SceneError("model", f"{name} has a node or element number twice", "write it again")
    if not np.isin(used, numbers).all():
        missing = np.setdiff1d(used, numbers)[0]
        raise SceneError("model", f"{name}: an element has the node {missing}, which does not exist", "write it again")
    if not np.isfinite(coordinates).all():
        raise SceneError("model", f"{name}: a coordinate is not a finite number", "write it again")
    keep = np.isin(numbers, used)
    sets: dict[str, dict[str, IntArray]] = {}
    for what, existing in (("node_set", used), ("element_set", elements)):
        sets[what] = {
            str(set_name).strip().upper(): np.intersect1d(arrays[f"{what}_{place}"].astype(np.int64), existing)
            for place, set_name in enumerate(arrays[f"names_{what}"])
        }
    return Deck(
        path=name,
        node_numbers=numbers[keep],
        coordinates=coordinates[keep],
        blocks=tuple(blocks),
        node_sets=sets["node_set"],
        element_sets=sets["element_set"],
        notes=tuple(map(str, arrays["notes"])),
    )
