"""Stiffness and mass with the node and direction of every row, and how they come out of triplets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from studies.fe_models.text.read_errors import shown
from studies.scene_error import SceneError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LARGEST_FILE = 2**32
"""Bytes of one file with a matrix."""

LARGEST_ENTRIES = 2**27
"""Entries of one triangle: 3 GiB as triplets."""

LARGEST_DOFS = 5_000_000
"""Rows of a matrix."""

HELD = 1e35
"""A stiffness on the diagonal above it is no stiffness but a boundary condition (Abaqus writes 1e36)."""


@dataclass(frozen=True)
class Matrices:
    """Unreduced stiffness and mass of a model, in units of its files.

    Attributes
    ----------
    stiffness, mass
        (n_dof, n_dof) real symmetric, both triangles. The mass may be singular.
    node
        (n_dof,) node number of every row. Negative ones are internal nodes of Abaqus.
    direction
        (n_dof,) 0, 1 or 2: displacement along x, y or z.
    files
        Names of the files.
    code
        "calculix", "abaqus", "nastran" or "ansys".
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    node: IntArray
    direction: IntArray
    files: tuple[str, ...]
    code: str


@dataclass(frozen=True)
class Triplets:
    """Entries (m,) of a matrix as a file has them: rows and columns from 0, and values."""

    rows: IntArray
    columns: IntArray
    values: FloatArray


def wrong(file: str, found: str, remedy: str) -> NoReturn:
    """Raises the SceneError about a file with a matrix."""
    raise SceneError("matrices", f"{shown(file)}: {found}", remedy)


def symmetric(triplets: Triplets, n_dof: int, file: str) -> sp.csr_array:
    """The matrix (n_dof, n_dof) of entries that stand for both triangles, or of both where any is there twice.

    A triangle in the order of the code need not be one in the order of the rows.

    Raises
    ------
    SceneError
        Where an entry is not finite, stands there twice, or the matrix is not symmetric.
    """
    rows, columns, values = triplets.rows, triplets.columns, triplets.values
    if not np.isfinite(values).all():
        wrong(file, "an entry is not a finite number", "export it again")
    matrix = sp.csr_array((values, (rows, columns)), shape=(n_dof, n_dof))
    if matrix.nnz < values.size:
        wrong(file, f"{values.size - matrix.nnz} entries are given twice", "export it again")
    twin = matrix.T.tocsr()
    if _have_entry_in_common(sp.triu(matrix, 1, "csr"), sp.triu(twin, 1, "csr")):
        difference = abs(matrix - twin)
        if difference.nnz and difference.max() > 1e-6 * abs(values).max():
            wrong(file, "the matrix is not symmetric", "export it without damping, gyroscopic terms and friction")
        return sp.csr_array((matrix + twin) / 2)
    return sp.csr_array(matrix + twin - sp.diags_array(matrix.diagonal()))


def _have_entry_in_common(one: sp.csr_array, other: sp.csr_array) -> bool:
    """Whether an entry, which may be 0, stands in both matrices."""
    patterns = [sp.csr_array((np.ones(a.nnz, dtype=bool), a.indices, a.indptr), shape=a.shape) for a in (one, other)]
    return bool(patterns[0].multiply(patterns[1]).nnz)


def check_held(stiffness: sp.csr_array, file: str) -> None:
    """Raises SceneError where boundary conditions were active when the stiffness was written."""
    n_held = int(np.count_nonzero(stiffness.diagonal() > HELD))
    if n_held:
        found = f"{n_held} entries of the diagonal are 1e36: boundary conditions were active at export"
        wrong(file, found, "remove them in the step that writes the matrices")


def sorted_dofs(matrices: Matrices) -> Matrices:
    """The same with rows by node, then direction; of a node none is twice. Raises SceneError."""
    order = np.lexsort((matrices.direction, matrices.node))
    node, direction = matrices.node[order], matrices.direction[order]
    again = np.flatnonzero((node[1:] == node[:-1]) & (direction[1:] == direction[:-1]))
    if again.size:
        found = f"dof {direction[again[0]] + 1} of node {node[again[0]]} has two rows"
        wrong(matrices.files[0], found, "export the matrices again")
    if np.array_equal(order, np.arange(order.size)):
        return matrices
    stiffness, mass = (sp.csr_array(item[order][:, order]) for item in (matrices.stiffness, matrices.mass))
    return Matrices(stiffness, mass, node, direction, matrices.files, matrices.code)
