"""Matrices of Abaqus: `*MATRIX GENERATE, STIFFNESS, MASS` writes job_STIF1.mtx and job_MASS1.mtx.

Lines are "node, dof, node, dof, value" (FORMAT=MATRIX INPUT), one triangle or both. Internal nodes are negative. A dof
that a boundary condition holds has 1e36 on its diagonal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.matrices.columns import LONGEST_LINE, read_columns
from studies.fe_models.matrices.labels import from_labels
from studies.fe_models.matrices.matrices import LARGEST_FILE, Matrices, check_held, symmetric, wrong
from studies.fe_models.text.read_errors import check_file


def read_abaqus(stiffness: Path, mass: Path) -> Matrices:
    """Matrices of two .mtx files in the format of *MATRIX INPUT. Raises SceneError about "matrices"."""
    labels: list[np.ndarray] = []
    values: list[np.ndarray] = []
    for path in (stiffness, mass):
        _check_format(path)
        columns = read_columns(path, ",", (int, int, int, int, float), "*")
        labels.append(np.stack(columns[:4], axis=1))
        values.append(columns[4])
    files = (stiffness.name, mass.name)
    found = from_labels(labels[0], labels[1], values[0], values[1], files)
    read = symmetric(found.stiffness, found.node.size, stiffness.name)
    check_held(read, stiffness.name)
    if np.any(found.node == 0):
        wrong(stiffness.name, "a node with the number 0", "export it again, FORMAT=MATRIX INPUT")
    return Matrices(
        read, symmetric(found.mass, found.node.size, mass.name), found.node, found.direction, files, "abaqus"
    )


def _check_format(path: Path) -> None:
    """Raises SceneError where the lines are "row column value" (FORMAT=COORDINATE), without nodes."""
    check_file(path, LARGEST_FILE, "matrices")
    with path.open(encoding="latin-1") as file:
        for number, text in enumerate(iter(lambda: file.readline(LONGEST_LINE), ""), 1):
            if text.strip() and not text.startswith(("*", "%")):
                if len(text.replace(",", " ").split()) == 3:
                    found = f"line {number} has a row, a column and a value (FORMAT=COORDINATE), and no node"
                    wrong(path.name, found, "write *MATRIX OUTPUT, STIFFNESS, MASS, FORMAT=MATRIX INPUT")
                return
