"""Meshes that other libraries read, as decks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from studies.fe_models.deck.mesh import NODES_OF_KIND, Boundary, Deck, ElementBlock, FloatArray, IntArray
from studies.scene_error import SceneError


def read_library_mesh(path: Path) -> Deck:
    """A mesh of Gmsh (.msh, with the extra "meshio") or ANSYS (.cdb, with the extra "ansys"): elements and sets.

    Nodes that belong to no solid element are left out. Of .msh, node numbers are the places of nodes in the file and
    element numbers count its solid elements, both from 1; a physical group gives a set of its nodes, and one of volumes
    a set of its elements as well. Hexahedra of 8 nodes are read as C3D8I, the project's own.

    Raises SceneError about "model": where the extra is missing, or the file cannot be read or has what is not acted
    upon.
    """
    if path.suffix.lower() == ".cdb":
        from studies.fe_models.libraries.cdb import read_cdb

        return read_cdb(path)
    from studies.fe_models.libraries.gmsh import read_gmsh

    return read_gmsh(path)


def build_deck(
    name: str,
    nodes: tuple[IntArray, FloatArray],
    blocks: Mapping[str, tuple[IntArray, IntArray]],
    node_sets: Mapping[str, IntArray],
    element_sets: Mapping[str, IntArray],
    boundaries: tuple[Boundary, ...] = (),
    notes: tuple[str, ...] = (),
    unassembled: tuple[str, ...] = (),
) -> Deck:
    """A deck of node numbers (n,) with coordinates (n, 3), and numbers and nodes of elements by kind.

    Raises SceneError where a number is there twice, a node is missing, or there are no solid elements.
    """
    order = np.argsort(nodes[0], kind="stable")
    numbers, coordinates = nodes[0][order], nodes[1][order]
    found: list[ElementBlock] = []
    for kind in NODES_OF_KIND:
        if kind in blocks:
            by_number = np.argsort(blocks[kind][0], kind="stable")
            found.append(ElementBlock(kind, *(part[by_number] for part in blocks[kind])))
    if not found:
        raise SceneError("model", f"{name} has no solid elements", "write the volumes of the mesh")
    used = np.unique(np.concatenate([block.nodes.ravel() for block in found]))
    elements = np.sort(np.concatenate([block.numbers for block in found]))
    if np.any(numbers[1:] == numbers[:-1]) or np.any(elements[1:] == elements[:-1]):
        raise SceneError("model", f"{name} has a node or element number twice", "write it again")
    if not np.isin(used, numbers).all():
        missing = np.setdiff1d(used, numbers)[0]
        raise SceneError("model", f"{name}: an element has the node {missing}, which does not exist", "write it again")
    keep = np.isin(numbers, used)
    if not np.isfinite(coordinates[keep]).all():
        raise SceneError("model", f"{name}: a coordinate is not a finite number", "write it again")
    return Deck(
        path=name,
        node_numbers=numbers[keep],
        coordinates=coordinates[keep],
        blocks=tuple(found),
        node_sets={key.strip().upper(): np.intersect1d(members, used) for key, members in node_sets.items()},
        element_sets={key.strip().upper(): np.intersect1d(members, elements) for key, members in element_sets.items()},
        boundaries=boundaries,
        notes=notes,
        unassembled=unassembled,
    )
