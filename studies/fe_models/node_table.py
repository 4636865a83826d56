"""Nodes of reduced matrices: a table in place of a mesh, with the columns node, x, y, z and sets.

`sets` names the sets of a node, with blanks between the names. Nodes that touch have an area and the direction out of
their body as well, area, normal_x, normal_y, normal_z, and perhaps a gap, negative for an interference; others leave
them empty. All are in the units of the model.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from studies.fe_models.deck.mesh import ContactNodes, Deck
from studies.fe_models.libraries.errors import library_errors
from studies.scene_error import SceneError

_PLACE = ["x", "y", "z"]
_CONTACT = ["area", "normal_x", "normal_y", "normal_z", "gap"]
_COLUMNS = ["node", *_PLACE, "sets"]


def read_node_table(path: Path) -> Deck:
    """The table as a deck without elements. Raises SceneError about "model"."""
    with library_errors(path, "pandas", "pandas", "model"):
        table = pd.read_csv(path, skipinitialspace=True)
        missing = [name for name in _COLUMNS if name not in table]
        if missing:
            listed = f"{', '.join(_COLUMNS)} and, of nodes in contact, {', '.join(_CONTACT)}"
            raise SceneError("model", f"{path.name} has no column {missing[0]}", f"give {listed}")
        table = table.sort_values("node")
        places = table[_PLACE].to_numpy(dtype=np.float64)
        contact = table.reindex(columns=_CONTACT).to_numpy(dtype=np.float64)
        numbers = table["node"].to_numpy()
    if numbers.dtype.kind != "i" or len(np.unique(numbers)) < len(numbers):
        raise SceneError(
            "model", f"{path.name}: a node is no whole number, or there twice", "give a line for each node"
        )
    if not np.isfinite(places).all():
        raise SceneError("model", f"{path.name}: a coordinate is not a finite number", "give x, y and z of each node")
    sets: dict[str, list[int]] = {}
    for number, names in zip(numbers.tolist(), table["sets"].fillna("").astype(str), strict=True):
        for name in names.upper().split():
            sets.setdefault(name, []).append(number)
    length = np.linalg.norm(contact[:, 1:4], axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        nodes = ContactNodes(contact[:, 0], contact[:, 1:4] / length, contact[:, 4])
    node_sets = {name: np.array(members, dtype=np.int64) for name, members in sets.items()}
    return Deck(path.name, numbers.astype(np.int64), places, (), node_sets, contact_nodes=nodes)
