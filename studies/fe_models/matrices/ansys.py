"""Matrices of ANSYS: the .full file of a modal analysis, by ansys-mapdl-reader (the project's extra "ansys")."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.libraries.process import read_by_library
from studies.fe_models.matrices.matrices import LARGEST_DOFS, Matrices, Triplets, sorted_dofs, symmetric, wrong


def read_ansys(path: Path) -> Matrices:
    """Matrices of a .full file, without the rows that ANSYS holds. Raises SceneError about "matrices"."""
    arrays = read_by_library("full", path, "matrices")
    node, direction = arrays["node"], arrays["direction"]
    n_dof = node.size
    if not 0 < n_dof <= LARGEST_DOFS:
        wrong(path.name, f"{n_dof} dofs", f"give a model of 1 to {LARGEST_DOFS}")
    if direction.min() < 0 or direction.max() > 2 or node.min() < 1:
        at = int(np.flatnonzero((direction < 0) | (direction > 2) | (node < 1))[0])
        found = f"node {node[at]} has the dof {direction[at] + 1}"
        wrong(path.name, found, "export a model of solid elements: UX, UY and UZ")
    read = []
    for name in ("stiffness", "mass"):
        triplets = Triplets(arrays[f"{name}_rows"], arrays[f"{name}_columns"], arrays[f"{name}_values"])
        read.append(symmetric(triplets, n_dof, path.name))
    return sorted_dofs(Matrices(read[0], read[1], node, direction, (path.name,), "ansys"))
