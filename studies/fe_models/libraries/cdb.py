"""Meshes of ANSYS (`CDWRITE, DB, model, cdb`) by ansys-mapdl-reader. Runs in the process of `libraries.process`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.deck.mesh import IntArray
from studies.fe_models.libraries.meshes import pack_mesh
from studies.fe_models.libraries.process import Arrays
from studies.scene_error import SceneError

# which of the nodes of an element of ANSYS are those of which kind: bricks may be collapsed to wedges or tetrahedra
_BRICK = {
    8: (
        ("C3D4", (0, 1, 2, 4), ((2, 3), (4, 5), (4, 6), (4, 7))),
        ("C3D6", (0, 1, 2, 4, 5, 6), ((2, 3), (6, 7))),
    ),
    20: (
        ("C3D10", (0, 1, 2, 4, 8, 9, 11, 16, 17, 18), ((2, 3), (4, 5), (4, 6), (4, 7))),
        ("C3D15", (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18), ((2, 3), (6, 7))),
    ),
}
_TYPES = {45: 8, 185: 8, 95: 20, 186: 20, 92: 10, 187: 10, 285: 4}
"""Numbers of nodes of the solid elements that are read, by the number in their names."""

_WHOLE = {8: "C3D8I", 20: "C3D20R", 10: "C3D10", 4: "C3D4"}
_PASSED_OVER = (151, 152, 153, 154, 156, 169, 170, 171, 172, 173, 174, 175, 176, 177, 178, 200)
"""Elements without a stiffness of their own: surface effects, targets and contacts, and those that only mesh."""

_HEADER = 10  # numbers of an element before its nodes


def read_arrays(path: Path) -> Arrays:
    """The mesh of a .cdb file as `pack_mesh` packs it. Raises SceneError, or whatever the library raises or does."""
    from ansys.mapdl import reader

    archive = reader.Archive(str(path), parse_vtk=False)
    if np.any(archive.node_angles):
        found = f"{path.name} has nodes with coordinate systems of their own"
        raise SceneError("model", found, "write it with NROTAT to the global one: its directions are x, y and z")
    types = {int(number): int(kind) for number, kind in archive.ekey}
    rows: dict[str, list[tuple[int, IntArray]]] = {}
    passed: set[int] = set()
    for element in archive.elem:
        kind = types.get(int(element[1]), 0)
        if kind in _PASSED_OVER:
            passed.add(kind)
            continue
        if kind not in _TYPES:
            known = ", ".join(f"{name}" for name in sorted(_TYPES))
            raise SceneError("model", f"{path.name} has elements of type {kind}", f"use solid elements: {known}")
        # without any midside node an element is written by its corners
        name, chosen = _sort_out(np.trim_zeros(np.asarray(element[_HEADER:], dtype=np.int64)[: _TYPES[kind]], "b"))
        if not name or chosen.min() < 1:
            remedy = "mesh with whole hexahedra, wedges and tetrahedra, with all their midside nodes or none"
            raise SceneError("model", f"{path.name}: element {int(element[8])} has an unusual shape", remedy)
        rows.setdefault(name, []).append((int(element[8]), chosen))
    return pack_mesh(
        np.asarray(archive.nnum, dtype=np.int64),
        np.asarray(archive.nodes, dtype=np.float64)[:, :3],
        {name: (np.array([n for n, _ in found]), np.stack([e for _, e in found])) for name, found in rows.items()},
        {name: np.asarray(members, dtype=np.int64) for name, members in archive.node_components.items()},
        {name: np.asarray(members, dtype=np.int64) for name, members in archive.element_components.items()},
        tuple(f"Elements of type {kind} are passed over." for kind in sorted(passed)),
    )


def _sort_out(nodes: IntArray) -> tuple[str, IntArray]:
    """Kind and nodes of an element; "" where it is a pyramid, or some of its midside nodes are missing."""
    for name, chosen, equal in _BRICK.get(nodes.size, ()):
        if all(nodes[one] == nodes[other] for one, other in equal):
            return name, nodes[list(chosen)]
    corners = nodes[: 8 if nodes.size in _BRICK else 4]
    return (_WHOLE.get(nodes.size, "") if np.unique(corners).size == corners.size else ""), nodes
