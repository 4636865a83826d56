"""Meshes of Gmsh by meshio, formats 2.2 and 4.1, text and binary. Runs in the process of `libraries.process`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from studies.fe_models.deck.mesh import IntArray
from studies.fe_models.libraries.meshes import pack_mesh
from studies.fe_models.libraries.process import Arrays
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


def read_arrays(path: Path) -> Arrays:
    """The mesh of a .msh file as `pack_mesh` packs it. Raises SceneError, or whatever meshio raises or does."""
    import meshio
    from meshio._mesh import topological_dimension

    # meshio 5.3.5 knows the order of their nodes, but cannot hold them for want of their dimension
    for missing in ("wedge15", "pyramid13"):
        topological_dimension.setdefault(missing, _SOLID)
    mesh = meshio.read(path, file_format="gmsh")
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError("model", f"{path.name} has points of another shape than (n, 3)", "write a mesh in space")
    blocks: dict[str, list[tuple[IntArray, IntArray]]] = {}
    node_sets: dict[str, list[IntArray]] = {}
    element_sets: dict[str, list[IntArray]] = {}
    n_solid = 0
    for place, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data, dtype=np.int64) + 1
        if nodes.size and nodes.min() < 1:
            raise SceneError("model", f"{path.name}: an element has a node that does not exist", "write it again")
        solid = topological_dimension[block.type] == _SOLID
        numbers = np.arange(n_solid + 1, n_solid + 1 + len(nodes))
        if solid:
            if block.type not in _KINDS:
                remedy = "mesh with tetrahedra, wedges and hexahedra, Mesh.SecondOrderIncomplete = 1"
                raise SceneError("model", f"{path.name} has elements of type {block.type}", remedy)
            blocks.setdefault(_KINDS[block.type], []).append((numbers, nodes))
            n_solid += len(nodes)
        for name, members in _groups(mesh, place, len(nodes)):
            node_sets.setdefault(name, []).append(np.unique(nodes[members]))
            if solid:
                element_sets.setdefault(name, []).append(numbers[members])
    return pack_mesh(
        np.arange(1, len(points) + 1),
        points,
        {kind: (np.concatenate([n for n, _ in b]), np.concatenate([e for _, e in b])) for kind, b in blocks.items()},
        {name: np.unique(np.concatenate(parts)) for name, parts in node_sets.items()},
        {name: np.concatenate(parts) for name, parts in element_sets.items()},
    )


def _groups(mesh: Any, place: int, n_cells: int) -> list[tuple[str, IntArray]]:
    """Named groups that cells of a block belong to, and which of its cells."""
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
