"""Stiffness, mass, damping and constant forces with the node and direction of every row, and how they are put together.

A reader gives the entries of each matrix by labels, a number for each node and dof. What is common to all programs
follows here: one order of the rows, both triangles, and what cannot be.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn, TextIO

import numpy as np
import pandas as pd
import scipy.sparse as sp

from solver.model_from_matrices import find_asymmetry
from studies.fe_models.files import FloatArray, IntArray, library_errors, shown, to_float
from studies.scene_error import SceneError

NAMES = ("stiffness", "mass", "damping", "load")
"""Matrices of a model, and constant forces."""

_LARGEST_DOFS = 5_000_000
_MOST_NODES = 2**40  # numbers that fit into a label, negative ones as well
_DOFS = 64  # labels of one node
_HELD = 1e35  # a stiffness on the diagonal above it is a boundary condition (Abaqus writes 1e36)
_ASYMMETRY = 1e-6  # of two entries: what text with few digits leaves


@dataclass(frozen=True)
class Matrices:
    """Matrices of a model, in units of its files, rows by node, then direction.

    stiffness, mass, damping (n_dof, n_dof): real symmetric, both triangles; the mass may be singular. node (n_dof,):
    numbers; negative ones are internal nodes of Abaqus. direction (n_dof,): 0, 1, 2 along x, y, z; others are
    rotations, or coordinates of no place. code: "calculix", "abaqus", "nastran", "ansys" or "table", for messages. load
    (n_dof, n_cases): constant forces. damping, load: None where the files have none.
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    node: IntArray
    direction: IntArray
    files: tuple[str, ...]
    code: str
    damping: sp.csr_array | None = None
    load: FloatArray | None = None


@dataclass(frozen=True)
class Entries:
    """Entries (m,) of a matrix or, with the columns 0, of forces. file: for messages. rows, columns: labels."""

    file: str
    rows: IntArray
    columns: IntArray
    values: FloatArray


def wrong(file: str, found: str, remedy: str) -> NoReturn:
    """Raises the SceneError about a file with a matrix."""
    raise SceneError("matrices", f"{shown(file)}: {found}", remedy)


def label(node: IntArray, dof: IntArray, file: str) -> IntArray:
    """Labels (m,) of nodes and their dofs, from 1, or 0 for a coordinate of no place. Raises SceneError."""
    if node.size and (np.abs(node).max() > _MOST_NODES or dof.min() < 0 or dof.max() >= _DOFS):
        at = int(np.flatnonzero((np.abs(node) > _MOST_NODES) | (dof < 0) | (dof >= _DOFS))[0])
        wrong(file, f"dof {dof[at]} of node {node[at]}", f"give numbers of at most ten digits, and dofs below {_DOFS}")
    return np.asarray(_DOFS * node + dof, dtype=np.int64)


def number_modes(node: IntArray, dof: IntArray) -> IntArray:
    """Nodes (m,) of rows; those of node 0 with dof 0, each a coordinate of no place, have -1, -2 and so on."""
    of_mode = (node == 0) & (dof == 0)
    return np.where(of_mode, -np.cumsum(of_mode), node).astype(np.int64)


def entries_of_tables(
    found: Mapping[str, Any], files: Mapping[str, Path], rows: IntArray | None = None
) -> dict[str, Entries]:
    """Entries of matrices, dense or sparse, and forces by name.

    rows (2, n_dof): node and dof of each of their rows; None where a table of them is among the files. Raises
    SceneError.
    """
    first = source = next(iter(files.values())).name
    if rows is None and "rows" not in files:
        wrong(first, "no table of its rows", "give job_rows.csv with node and dof of each row")
    if rows is None:
        path = files["rows"]
        with library_errors(path, "pandas", "pandas", "matrices"):
            table = pd.read_csv(path, skipinitialspace=True)
        if not {"node", "dof"} <= set(table) or any(table[name].dtype.kind != "i" for name in ("node", "dof")):
            remedy = "give a line for each row of the matrices, 0 and 0 for a mode"
            wrong(path.name, "no columns node and dof of whole numbers", remedy)
        source, rows = path.name, table[["node", "dof"]].to_numpy(dtype=np.int64).T
    node, dof = rows
    labels = label(number_modes(node, dof), dof, source)
    if np.unique(labels).size < labels.size:
        wrong(first, "a dof has two rows", "give node and dof of each row once")
    names = {name: files[name if name in files else "matrices"].name for name in found}
    return {name: _entries_of_table(names[name], matrix, labels) for name, matrix in found.items()}


def _entries_of_table(file: str, matrix: object, labels: IntArray) -> Entries:
    try:
        found = sp.coo_array(matrix if sp.issparse(matrix) else np.atleast_2d(np.asarray(matrix)))
    except (ValueError, TypeError) as error:
        wrong(file, f"a matrix is damaged ({shown(str(error))})", "write it again")
    if found.shape == (1, labels.size) and labels.size > 1:
        found = found.T.tocoo()
    if found.shape[0] != labels.size or found.shape[1] not in (1, labels.size):
        shape = " x ".join(str(length) for length in found.shape)
        wrong(file, f"{shape} entries for {labels.size} rows", "give node and dof of each row, in their order")
    if np.iscomplexobj(found.data):
        wrong(file, "complex numbers", "give real matrices with both cut faces, or a scene file with nd/<k>")
    vector = found.shape[1] == 1 and labels.size > 1
    columns = np.zeros_like(found.col) if vector else labels[found.col]
    return Entries(file, labels[found.row], columns.astype(np.int64), found.data.astype(np.float64))


def assemble(parts: Mapping[str, Entries], files: tuple[str, ...], code: str) -> Matrices:
    """The matrices of entries by name: "stiffness" and "mass"; "damping" and "load" may be missing.

    Raises SceneError where entries are not finite or not symmetric, or rows are held or too many.
    """
    square = {name: each for name, each in parts.items() if name != "load"}
    for name in ("stiffness", "mass"):
        if name not in square or not square[name].values.size:
            wrong(files[0], f"no {name} in the file", "write stiffness and mass")
    given = np.concatenate([part for each in square.values() for part in (each.rows, each.columns)])
    labels = np.sort(pd.unique(given))  # by hash: entries are many more than labels
    if labels.size > _LARGEST_DOFS:
        wrong(files[0], f"{labels.size} dofs", f"reduce the model to at most {_LARGEST_DOFS}")
    found = {name: _symmetric(each, labels) for name, each in square.items()}
    if held := int(np.count_nonzero(found["stiffness"].diagonal() > _HELD)):
        what = f"{held} entries of the diagonal are 1e36: boundary conditions were active at export"
        wrong(parts["stiffness"].file, what, "remove them in the step that writes the matrices")
    node, direction = labels // _DOFS, labels % _DOFS - 1
    load = _forces(parts["load"], labels) if "load" in parts else None
    return Matrices(found["stiffness"], found["mass"], node, direction, files, code, found.get("damping"), load)


def _symmetric(entries: Entries, labels: IntArray) -> sp.csr_array:
    """The matrix of a triangle of entries, or of both where any is there twice; its own order need not be ours."""
    file, values, n = entries.file, entries.values, labels.size
    if not np.isfinite(values).all():
        wrong(file, "an entry is not a finite number", "export it again")
    places = np.searchsorted(labels, entries.rows), np.searchsorted(labels, entries.columns)
    matrix = sp.csr_array((values, places), shape=(n, n))
    if matrix.nnz < values.size:
        wrong(file, f"{values.size - matrix.nnz} entries are given twice", "export it again")
    twin = matrix.T.tocsr()
    # entries that may be 0 stand in both triangles, beside those of the diagonal
    stored = sp.csr_array((np.ones(matrix.nnz, dtype=bool), matrix.indices, matrix.indptr), shape=(n, n))
    if stored.multiply(stored.T).nnz > np.count_nonzero(places[0] == places[1]):
        if wrongly := find_asymmetry(matrix, _ASYMMETRY):
            both = " and ".join(f"dof {labels[at] % _DOFS} of node {labels[at] // _DOFS}" for at in wrongly)
            found = f"the matrix is not symmetric between {both}"
            wrong(file, found, "export it without damping, gyroscopic terms and friction")
        return sp.csr_array((matrix + twin) / 2)
    return sp.csr_array(matrix + twin - sp.diags_array(matrix.diagonal()))


def _forces(entries: Entries, labels: IntArray) -> FloatArray:
    """Forces (n_dof, n_cases), a column for each load case. Raises SceneError where a row is none of the matrices."""
    acting = entries.values != 0.0
    rows, cases = entries.rows[acting], np.unique(entries.columns[acting], return_inverse=True)[1]
    if not np.isfinite(entries.values).all() or not np.isin(rows, labels).all():
        wrong(entries.file, "a force is not finite, or on a dof that the matrices do not have", "export it again")
    found = np.zeros((labels.size, cases.max(initial=0) + 1))
    np.add.at(found, (np.searchsorted(labels, rows), cases), entries.values[acting])
    return found


def read_fixed(file: TextIO, length: int, form: tuple[str, str]) -> FloatArray:
    """Numbers (length,) of fixed width in the next lines of a file. form: how many stand in a line, and their width.

    Raises ValueError where some are missing.
    """
    each, width = int(form[0] or 1), int(form[1])
    lines = list(islice(file, -(-length // each)))
    fields = " ".join(lines).split()
    if len(fields) != length:  # they touch; scipy writes narrower ones than it says
        text = "".join(line.rstrip("\r\n").ljust(each * width) for line in lines)[: length * width]
        fields = [text[at : at + width].strip() for at in range(0, len(text), width)]
    values = np.array([to_float(field) for field in fields])
    if len(values) < length or np.isnan(values).any():
        raise ValueError(f"{length - np.count_nonzero(np.isfinite(values))} of {length} numbers are missing")
    return values
