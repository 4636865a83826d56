"""Matrices of CalculiX: `*FREQUENCY, SOLVER=MATRIXSTORAGE` writes job.sti, job.mas and job.dof.

The first two have lines "row column value", from 1, the upper triangle column by column. The third has a line
"node.direction" for every row, which is no number: 10.1 is not 10.10.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.matrices.columns import read_columns
from studies.fe_models.matrices.matrices import (
    LARGEST_DOFS,
    FloatArray,
    IntArray,
    Matrices,
    Triplets,
    sorted_dofs,
    symmetric,
    wrong,
)

Columns = tuple[IntArray, IntArray, FloatArray]


def read_calculix(stiffness: Path, mass: Path, dofs: Path) -> Matrices:
    """Matrices of a .sti, a .mas and a .dof file. Raises SceneError about "matrices"."""
    node, direction = read_columns(dofs, ".", (int, int))
    n_dof = node.size
    if n_dof > LARGEST_DOFS:
        wrong(dofs.name, f"{n_dof} dofs", f"reduce the model to at most {LARGEST_DOFS}")
    if node.min() < 1 or direction.min() < 1 or direction.max() > 3:
        at = int(np.flatnonzero((node < 1) | (direction < 1) | (direction > 3))[0])
        found = f"line {at + 1} is {node[at]}.{direction[at]}"
        wrong(dofs.name, found, "export displacements only: directions 1 to 3")
    read = []
    for path in (stiffness, mass):
        rows, columns, values = read_columns(path, " ", (int, int, float))
        if min(rows.min(), columns.min()) < 1:
            wrong(path.name, "a row or column below 1", "export it again")
        size = int(max(rows.max(), columns.max()))
        if size == 2 * n_dof:
            found = f"{size} rows for {n_dof} dofs in {dofs.name}, written for a nodal diameter"
            wrong(path.name, found, "export without *SELECT CYCLIC SYMMETRY MODES, and with CYCMPC=INACTIVE")
        if size != n_dof:
            found = f"{size} rows for {n_dof} dofs in {dofs.name}"
            wrong(path.name, found, "give the three files of one run, each of them whole")
        read.append(symmetric(Triplets(rows - 1, columns - 1, values), n_dof, path.name))
    files = (stiffness.name, mass.name, dofs.name)
    return sorted_dofs(Matrices(read[0], read[1], node, direction - 1, files, "calculix"))
