"""The mesh of a model, whatever program wrote it."""

from __future__ import annotations

from pathlib import Path

from studies.fe_models.deck.mesh import Deck
from studies.fe_models.deck.read import read_deck
from studies.fe_models.libraries.meshes import read_library_mesh
from studies.fe_models.node_table import read_node_table
from studies.scene_error import SceneError


def read_mesh_file(path: Path) -> Deck:
    """The mesh of a file by its ending: .inp (CalculiX, Abaqus), .msh (Gmsh), .cdb (ANSYS), or a table of nodes, .csv.

    Raises SceneError about "model": another ending, a library that is not installed, or what is wrong in the file.
    """
    suffix = path.suffix.lower()
    if suffix == ".inp":
        return read_deck(path)
    if suffix in (".msh", ".cdb"):
        return read_library_mesh(path)
    if suffix == ".csv":
        return read_node_table(path)
    raise SceneError("model", f"{path.name} is no mesh that is known", "give .inp, .msh, .cdb or .csv")
