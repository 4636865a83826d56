"""Matrices of CalculiX: `*FREQUENCY, SOLVER=MATRIXSTORAGE` writes job.sti, job.mas and job.dof.

The first two have lines "row column value", from 1, the upper triangle column by column. The third has a line
"node.direction" for every row, which is no number: 10.1 is not 10.10.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.matrices.columns import read_columns
from studies.fe_models.matrices.matrices import Entries, Matrices, assemble, label, wrong


def read_calculix(stiffness: Path, mass: Path, dofs: Path) -> Matrices:
    """Matrices of a .sti, a .mas and a .dof file. Raises SceneError about "matrices"."""
    node, direction = read_columns(dofs, ".", (int, int))
    labels, n_dof = label(node, direction, dofs.name), node.size
    if np.unique(labels).size < n_dof:
        twice = int(np.flatnonzero(np.bincount(np.unique(labels, return_inverse=True)[1]) > 1)[0])
        number = np.unique(labels)[twice]
        at = int(np.flatnonzero(labels == number)[0])
        wrong(dofs.name, f"dof {direction[at]} of node {node[at]} has two rows", "export the matrices again")
    parts = {}
    for name, path in (("stiffness", stiffness), ("mass", mass)):
        rows, columns, values = read_columns(path, " ", (int, int, float))
        size = int(max(rows.max(), columns.max()))
        if size == 2 * n_dof:
            found = f"{size} rows for {n_dof} dofs in {dofs.name}, written for a nodal diameter"
            wrong(path.name, found, "export without *SELECT CYCLIC SYMMETRY MODES, and with CYCMPC=INACTIVE")
        if size != n_dof or min(rows.min(), columns.min()) < 1:
            found = f"{size} rows for {n_dof} dofs in {dofs.name}"
            wrong(path.name, found, "give the three files of one run, each of them whole")
        parts[name] = Entries(path.name, labels[rows - 1], labels[columns - 1], values)
    return assemble(parts, (stiffness.name, mass.name, dofs.name), "calculix")
