"""Meshes of files: decks, meshes of Gmsh by meshio (formats 2.2 and 4.1, text and binary), tables of nodes.

A table of nodes stands beside reduced matrices in place of a mesh: node, x, y, z and sets, names with blanks between
them; of nodes that touch area, normal_x, normal_y, normal_z out of the body, and perhaps gap, negative for an
interference. All are in the units of the model.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from studies.fe_models.cdb import read_cdb
from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.model import deck_of_arrays
from studies.fe_models.deck.read import read_deck
from studies.fe_models.files import IntArray, library_errors
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

_PLACE = ["x", "y", "z"]
_CONTACT = ["area", "normal_x", "normal_y", "normal_z", "gap"]
_COLUMNS = ["node", *_PLACE, "sets"]


def read_mesh_file(path: Path) -> Deck:
    """The mesh of a file by its ending: .inp (CalculiX, Abaqus), .msh (Gmsh), .cdb (ANSYS), or a table of nodes, .csv.

    Hexahedra of 8 nodes in .msh and .cdb are read as C3D8I, the project's own. Of .msh, nodes and solid elements are
    numbered from 1 as they stand in the file; a physical group gives a set of its nodes, and one of volumes a set of
    its elements as well. Raises SceneError about "model".
    """
    readers = {".inp": read_deck, ".msh": _read_gmsh, ".cdb": read_cdb, ".csv": _read_node_table}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise SceneError("model", f"{path.name} is no mesh that is known", "give .inp, .msh, .cdb or .csv")
    return reader(path)


def _read_gmsh(path: Path) -> Deck:
    """The mesh of a .msh file, whether all of it belongs to physical groups or not. Raises SceneError."""
    with library_errors(path, "meshio", "meshio", "model"):
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

        # meshio 5.3.5 lists no tags of entities without a physical group, and then refuses the list as too short; the
        # named groups are in the sets as well
        with patch.object(_gmsh41, "_read_elements", read_elements):
            return _gmsh_deck(path.name, meshio.read(path, file_format="gmsh"), topological_dimension)


def _gmsh_deck(name: str, mesh: Any, dimensions: Mapping[str, int]) -> Deck:
    points = np.asarray(mesh.points, dtype=np.float64)
    blocks: list[tuple[str, IntArray, IntArray]] = []
    node_sets: list[tuple[str, IntArray]] = []
    element_sets: list[tuple[str, IntArray]] = []
    numbered: dict[bytes, int] = {}
    for place, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data, dtype=np.int64) + 1
        numbers = None
        if dimensions[block.type] == _SOLID:
            if block.type not in _KINDS:
                remedy = "mesh with tetrahedra, wedges and hexahedra, Mesh.SecondOrderIncomplete = 1"
                raise SceneError("model", f"{name} has elements of type {block.type}", remedy)
            # format 2.2 writes an element once for each of its groups
            before = len(numbered)
            numbers = np.array([numbered.setdefault(row.tobytes(), len(numbered) + 1) for row in nodes], dtype=np.int64)
            new, first = np.unique(numbers, return_index=True)
            blocks.append((_KINDS[block.type], new[new > before], nodes[first[new > before]]))
        for group, members in _groups(mesh, place, len(nodes)):
            node_sets.append((group, np.unique(nodes[members])))
            if numbers is not None:
                element_sets.append((group, numbers[members]))
    return deck_of_arrays(name, (np.arange(1, len(points) + 1), points), blocks, node_sets, element_sets)


def _groups(mesh: Any, place: int, n_cells: int) -> Iterator[tuple[str, IntArray]]:
    """Physical groups that cells of a block belong to, and which of its cells."""
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
            yield name, members


def _read_node_table(path: Path) -> Deck:
    """The table as a deck without elements. Raises SceneError about "model"."""
    with library_errors(path, "pandas", "pandas", "model"):
        table = pd.read_csv(path, skipinitialspace=True)
        missing = [name for name in _COLUMNS if name not in table]
        if missing:
            listed = f"{', '.join(_COLUMNS)} and, of nodes in contact, {', '.join(_CONTACT)}"
            raise SceneError("model", f"{path.name} has no column {missing[0]}", f"give {listed}")
        table = table.sort_values("node")
        places = table[_PLACE].to_numpy(dtype=np.float64)
        contact = table.reindex(columns=_CONTACT).to_numpy(dtype=np.float64, copy=True)
        numbers = table["node"].to_numpy()
    whole = numbers.dtype.kind == "i" and len(np.unique(numbers)) == len(numbers)
    if not whole or not np.isfinite(places).all():
        found = f"{path.name}: a node or a coordinate is no number, or a node is there twice"
        raise SceneError("model", found, "give a line for each node")
    sets: dict[str, list[int]] = {}
    for number, names in zip(numbers.tolist(), table["sets"].fillna("").astype(str), strict=True):
        for name in names.upper().split():
            sets.setdefault(name, []).append(number)
    with np.errstate(divide="ignore", invalid="ignore"):
        contact[:, 1:4] /= np.linalg.norm(contact[:, 1:4], axis=1, keepdims=True)
    node_sets = {name: np.array(members, dtype=np.int64) for name, members in sets.items()}
    return Deck(path.name, numbers.astype(np.int64), places, (), node_sets, contact_nodes=contact)
