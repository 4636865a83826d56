"""Meshes of files: decks, meshes of Gmsh and ANSYS, tables of nodes.

A table of nodes stands beside reduced matrices in place of a mesh: node, x, y, z and sets, names with blanks between
them; of nodes that touch area, normal_x, normal_y, normal_z out of the body, and perhaps gap, negative for an
interference. All are in the units of the model.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from studies.fe_models.cdb import read_cdb
from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.read import read_deck
from studies.fe_models.files import library_errors
from studies.fe_models.gmsh import read_gmsh
from studies.scene_error import SceneError

_PLACE = ["x", "y", "z"]
_CONTACT = ["area", "normal_x", "normal_y", "normal_z", "gap"]
_COLUMNS = ["node", *_PLACE, "sets"]


def read_mesh_file(path: Path) -> Deck:
    """The mesh of a file by its ending: .inp (CalculiX, Abaqus), .msh (Gmsh), .cdb (ANSYS), or a table of nodes, .csv.

    Hexahedra of 8 nodes in .msh and .cdb are read as C3D8I, the project's own. Of .msh, nodes and solid elements are
    numbered from 1 as they stand in the file; a physical group gives a set of its nodes, and one of volumes a set of
    its elements as well. Raises SceneError about "model".
    """
    reader = {".inp": read_deck, ".msh": read_gmsh, ".cdb": read_cdb, ".csv": _read_node_table}.get(path.suffix.lower())
    if reader is None:
        raise SceneError("model", f"{path.name} is no mesh that is known", "give .inp, .msh, .cdb or .csv")
    return reader(path)


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
