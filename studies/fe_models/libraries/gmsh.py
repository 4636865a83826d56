"""Meshes of Gmsh by meshio, formats 2.2 and 4.1, text and binary."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from studies.fe_models.deck.mesh import Deck, IntArray
from studies.fe_models.libraries.errors import library_errors
from studies.fe_models.libraries.meshes import build_deck
from studies.scene_error import SceneError

# meshio's names, whose order of nodes is VTK's: for these kinds that of the decks
_KINDS = {
    "tetra": "C3D4",
    "wedge": "C3D6",
    "hexahedron": "C3D8I",
    "tetra10": "C3D10",
    "wedge15": "C3D15",
    "hexahedron20": "C3D20",
}
_SOLID = 3


def read_gmsh(path: Path) -> Deck:
    """The mesh of a .msh file, whether all of it belongs to physical groups or not. Raises SceneError."""
    with library_errors(path, "meshio", "meshio", "model"):
        return _deck(path, _read(path))


def _read(path: Path) -> Any:
    import meshio
    from meshio._mesh import topological_dimension
    from meshio.gmsh import _gmsh41

    # meshio 5.3.5 knows the order of their nodes, but cannot store them for want of their dimension
    for missing in ("wedge15", "pyramid13"):
        topological_dimension.setdefault(missing, _SOLID)
    own = _gmsh41._read_elements

    def read_elements(*given: Any) -> Any:
        cells, tags, sets = own(*given)
        return cells, {name: each for name, each in tags.items() if len(each) == len(cells)}, sets

    # meshio 5.3.5 lists no tags of entities without a physical group, and then refuses the list as too short; the named
    # groups are in the sets as well
    with patch.object(_gmsh41, "_read_elements", read_elements):
        return meshio.read(path, file_format="gmsh")


def _deck(path: Path, mesh: Any) -> Deck:
    from meshio._mesh import topological_dimension

    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError("model", f"{path.name} has points of another shape than (n, 3)", "write a mesh in space")
    blocks: dict[str, list[tuple[IntArray, IntArray]]] = {}
    node_sets: dict[str, list[IntArray]] = {}
    element_sets: dict[str, list[IntArray]] = {}
    numbered: dict[bytes, int] = {}
    for place, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data, dtype=np.int64) + 1
        if nodes.size and nodes.min() < 1:
            raise SceneError("model", f"{path.name}: an element has a node that does not exist", "write it again")
        numbers = None
        if topological_dimension[block.type] == _SOLID:
            if block.type not in _KINDS:
                remedy = "mesh with tetrahedra, wedges and hexahedra, Mesh.SecondOrderIncomplete = 1"
                raise SceneError("model", f"{path.name} has elements of type {block.type}", remedy)
            # format 2.2 writes an element once for each of its groups
            before = len(numbered)
            numbers = np.array([numbered.setdefault(row.tobytes(), len(numbered) + 1) for row in nodes], dtype=np.int64)
            new, first = np.unique(numbers, return_index=True)
            blocks.setdefault(_KINDS[block.type], []).append((new[new > before], nodes[first[new > before]]))
        for name, members in _groups(mesh, place, len(nodes)):
            node_sets.setdefault(name, []).append(np.unique(nodes[members]))
            if numbers is not None:
                element_sets.setdefault(name, []).append(numbers[members])
    return build_deck(
        path.name,
        (np.arange(1, len(points) + 1), points),
        {kind: (np.concatenate([n for n, _ in b]), np.concatenate([e for _, e in b])) for kind, b in blocks.items()},
        {name: np.unique(np.concatenate(parts)) for name, parts in node_sets.items()},
        {name: np.concatenate(parts) for name, parts in element_sets.items()},
    )


def _groups(mesh: Any, place: int, n_cells: int) -> list[tuple[str, IntArray]]:
    """Physical groups that cells of a block belong to, and which of its cells."""
    found: list[tuple[str, IntArray]] = []
    cells = mesh.cells[place]
    for name, (tag, dimension) in mesh.field_data.items():
        if name in mesh.cell_sets:
            members = mesh.cell_sets[name][place]
            members = np.empty(0) if members is None else members
        elif cells.dim == dimension and "gmsh:physical" in mesh.cell_data:
            members = np.flatnonzero(mesh.cell_data["gmsh:physical"][place] == tag)
        else:
            continue
        members = np.asarray(members, dtype=np.int64)
        if members.size and members.max() < n_cells:
            found.append((name, members))
    return found
