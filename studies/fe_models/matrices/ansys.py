"""Matrices of ANSYS: the .full file of a modal analysis, by ansys-mapdl-reader (the project's extra "ansys")."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from studies.fe_models.libraries.errors import library_errors
from studies.fe_models.matrices.matrices import LARGEST_DOFS, Matrices, Triplets, sorted_dofs, symmetric, wrong


def read_ansys(path: Path) -> Matrices:
    """Matrices of a .full file, without the rows that ANSYS holds. Raises SceneError about "matrices"."""
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "matrices"):
        reference, matrices, held = _read(path)
    node, direction = reference[:, 0].astype(np.int64), reference[:, 1].astype(np.int64)
    # held rows are in the file, empty
    free = np.array([pair not in held for pair in zip(node.tolist(), direction.tolist(), strict=True)], dtype=bool)
    node, direction = node[free], direction[free]
    n_dof = node.size
    if not 0 < n_dof <= LARGEST_DOFS:
        wrong(path.name, f"{n_dof} dofs", f"give a model of 1 to {LARGEST_DOFS}")
    if direction.min() < 0 or direction.max() > 2 or node.min() < 1:
        at = int(np.flatnonzero((direction < 0) | (direction > 2) | (node < 1))[0])
        found = f"node {node[at]} has the dof {direction[at] + 1}"
        wrong(path.name, found, "export a model of solid elements: UX, UY and UZ")
    read = []
    for matrix in matrices:
        part = matrix.tocsr()[free][:, free].tocoo()
        triplets = Triplets(part.row.astype(np.int64), part.col.astype(np.int64), part.data)
        read.append(symmetric(triplets, n_dof, path.name))
    return sorted_dofs(Matrices(read[0], read[1], node, direction, (path.name,), "ansys"))


def _read(path: Path) -> tuple[np.ndarray, tuple[Any, Any], set[tuple[int, int]]]:
    """Node and direction (n, 2) of the rows, one triangle of stiffness and mass, nodes and directions that are held."""
    from ansys.mapdl import reader

    try:
        file = reader.read_binary(str(path))
    except NotImplementedError as error:
        what = "lumped" if "lumped" in str(error) else "not symmetric"
        wrong(
            path.name,
            f"the matrices are {what}",
            "write them consistent and symmetric: LUMPM,OFF and no CORIOLIS",
        )
    if not hasattr(file, "load_km"):
        wrong(path.name, "this is no .full file", "write one: HBMAT or WRFULL before the solution")
    reference, stiffness, mass = file.load_km()
    if stiffness is None or mass is None:
        missing = "stiffness" if stiffness is None else "mass"
        wrong(path.name, f"the file has no {missing}", "write the file of a modal analysis")
    return reference, (stiffness, mass), {(int(node), int(direction)) for node, direction in file.const}
