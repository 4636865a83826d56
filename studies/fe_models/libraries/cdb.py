"""Meshes of ANSYS (`CDWRITE, DB, model, cdb`) by ansys-mapdl-reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from studies.fe_models.deck.mesh import Deck, IntArray
from studies.fe_models.libraries.cdb_commands import CdbCommands, read_commands
from studies.fe_models.libraries.errors import library_errors
from studies.fe_models.libraries.meshes import build_deck
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
_PASSED_OVER = (151, 152, 153, 154, 156, 200)
"""Elements without a stiffness of their own: surface effects, and those that only mesh."""

_TARGETS, _CONTACTS = range(169, 171), range(171, 179)

_HEADER = 10  # numbers of an element before its nodes


def read_cdb(path: Path) -> Deck:
    """The mesh of a .cdb file with the displacements that it holds. Raises SceneError."""
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "model"):
        from ansys.mapdl import reader

        commands = read_commands(path)
        return _deck(path, reader.Archive(str(path), parse_vtk=False), commands)


def _deck(path: Path, archive: Any, commands: CdbCommands) -> Deck:
    if np.any(archive.node_angles):
        found = f"{path.name} has nodes with coordinate systems of their own"
        raise SceneError("model", found, "write it with NROTAT to the global one: its directions are x, y and z")
    rows: dict[str, list[tuple[int, IntArray]]] = {}
    passed: set[int] = set()
    materials: set[int] = set()
    for element in archive.elem:
        number = int(element[1])
        kind = commands.kinds.get(number)
        if kind is None:
            found = f"{path.name} has elements of the type {number}, which neither ET nor ETBLOCK gives"
            raise SceneError("model", found, "write it again with CDWRITE,DB,file,cdb")
        if kind in _PASSED_OVER:
            passed.add(kind)
            continue
        if kind in _TARGETS or kind in _CONTACTS:
            name = f"{'TARGE' if kind in _TARGETS else 'CONTA'}{kind}"
            remedy = "delete these elements (EDELE), and name the surfaces in `contact` of the study"
            raise commands.places[number].wrong(f"contact elements ({name})", remedy)
        if kind not in _TYPES:
            known = ", ".join(f"{name}" for name in sorted(_TYPES))
            raise commands.places[number].wrong(f"elements of type {kind}", f"use solid elements: {known}")
        # without any midside node an element is written by its corners
        name, chosen = _sort_out(np.trim_zeros(np.asarray(element[_HEADER:], dtype=np.int64)[: _TYPES[kind]], "b"))
        if not name or chosen.min() < 1:
            remedy = "mesh with whole hexahedra, wedges and tetrahedra, with all their midside nodes or none"
            raise SceneError("model", f"{path.name}: element {int(element[8])} has an unusual shape", remedy)
        rows.setdefault(name, []).append((int(element[8]), chosen))
        materials.add(int(element[0]))
    several = f"{path.name} has materials {' and '.join(map(str, sorted(materials)))}, of which the study gives one"
    return build_deck(
        path.name,
        (np.asarray(archive.nnum, dtype=np.int64), np.asarray(archive.nodes, dtype=np.float64)[:, :3]),
        {name: (np.array([n for n, _ in found]), np.stack([e for _, e in found])) for name, found in rows.items()},
        {name: np.asarray(members, dtype=np.int64) for name, members in archive.node_components.items()},
        {name: np.asarray(members, dtype=np.int64) for name, members in archive.element_components.items()},
        commands.boundaries,
        tuple(f"Elements of type {kind} are passed over." for kind in sorted(passed)),
        (several,) if len(materials) > 1 else (),
    )


def _sort_out(nodes: IntArray) -> tuple[str, IntArray]:
    """Kind and nodes of an element; "" where it is a pyramid, or some of its midside nodes are missing."""
    for name, chosen, equal in _BRICK.get(nodes.size, ()):
        if all(nodes[one] == nodes[other] for one, other in equal):
            return name, nodes[list(chosen)]
    corners = nodes[: 8 if nodes.size in _BRICK else 4]
    return (_WHOLE.get(nodes.size, "") if np.unique(corners).size == corners.size else ""), nodes
