"""Matrices without labels: MATLAB (.mat), MatrixMarket and Harwell-Boeing files; .full of ANSYS.

Node and dof of each row, in the order of the rows, are the variable `rows` (n, 2) of a .mat file, or stand beside the
files in job_rows.csv with the columns node and dof; dof 0 is a coordinate of no place, as of a mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
from scipy import io, sparse

from studies.fe_models.matrices.matrices import NAMES, IntArray, Matrices, assemble, label, of_table, wrong
from studies.fe_models.text import library_errors


def read_tables(files: Mapping[str, Path]) -> Matrices:
    """Matrices of files with one each. Raises SceneError about "matrices"."""
    found = {}
    for name in [name for name in NAMES if name in files]:
        path = files[name]
        with library_errors(path, "scipy.io", "scipy", "matrices"):
            found[name] = io.mmread(path) if path.suffix.lower() == ".mtx" else io.hb_read(path)
    return matrices_of_tables(found, files)


def read_matlab(files: Mapping[str, Path]) -> Matrices:
    """Matrices of a .mat file of any version, by the variables NAMES and `rows`. Raises SceneError about "matrices"."""
    path = files["matrices"]
    with library_errors(path, "scipy.io", "scipy", "matrices"):
        with path.open("rb") as file:
            newest = file.read(10) == b"MATLAB 7.3" or h5py.is_hdf5(path)
        found = _read_v73(path) if newest else io.loadmat(path, variable_names=[*NAMES, "rows"])
    labels = None
    if "rows" in found:
        table = np.asarray(found["rows"])
        if table.ndim != 2 or table.shape[1] != 2 or table.dtype.kind not in "iuf":
            wrong(path.name, f"rows have the shape {table.shape}", "give node and dof of each row of the matrices")
        labels = label(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), path.name)
    return matrices_of_tables({name: found[name] for name in NAMES if name in found}, files, labels)


def matrices_of_tables(found: Mapping[str, Any], files: Mapping[str, Path], labels: IntArray | None = None) -> Matrices:
    """Matrices by name whose rows have labels, or a table of them among the files. Raises SceneError."""
    names = {name: files[name if name in files else "matrices"].name for name in found}
    if labels is None and "rows" not in files:
        wrong(next(iter(names.values())), "no table of its rows", "give job_rows.csv with node and dof of each row")
    labels = _read_rows(files["rows"]) if labels is None else labels
    if np.unique(labels).size < labels.size:
        wrong(next(iter(files.values())).name, "a dof has two rows", "give node and dof of each row once")
    parts = {name: of_table(names[name], matrix, labels) for name, matrix in found.items()}
    return assemble(parts, tuple(dict.fromkeys(names.values())), "table")


def _read_rows(path: Path) -> IntArray:
    """Labels of a table with the columns node and dof. Raises SceneError."""
    with library_errors(path, "pandas", "pandas", "matrices"):
        table = pd.read_csv(path, skipinitialspace=True)
    if not {"node", "dof"} <= set(table) or any(table[name].dtype.kind != "i" for name in ("node", "dof")):
        wrong(path.name, "no columns node and dof of whole numbers", "give a line for each row of the matrices")
    return label(table["node"].to_numpy(), table["dof"].to_numpy(), path.name)


def _read_v73(path: Path) -> dict[str, Any]:
    """Variables of a .mat file of version 7.3, which is HDF5 and holds arrays transposed."""
    found: dict[str, Any] = {}
    with h5py.File(path) as file:
        for name in {*NAMES, "rows"} & set(file):
            item = file[name]
            if isinstance(item, h5py.Group):  # a sparse matrix, column by column
                places, starts = (item[part][()].astype(np.int64) for part in ("ir", "jc"))
                shape = int(item.attrs["MATLAB_sparse"]), len(starts) - 1
                found[name] = sparse.csc_array((item["data"][()], places, starts), shape=shape)
            else:
                values = item[()].T
                found[name] = values["real"] + 1j * values["imag"] if values.dtype.names else values
    return found


def read_ansys(files: Mapping[str, Path]) -> Matrices:
    """Matrices of a .full file, without the rows that ANSYS holds. Raises SceneError about "matrices"."""
    path = files["matrices"]
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "matrices"):
        from ansys.mapdl import reader

        try:
            file = reader.read_binary(str(path))
        except NotImplementedError as error:
            what = "lumped" if "lumped" in str(error) else "not symmetric"
            remedy = "write them consistent and symmetric: LUMPM,OFF and no CORIOLIS"
            wrong(path.name, f"the matrices are {what}", remedy)
        reference, stiffness, mass = file.load_km() if hasattr(file, "load_km") else (None, None, None)
        if stiffness is None or mass is None:
            remedy = "write the .full file of a modal analysis: HBMAT or WRFULL before the solution"
            wrong(path.name, "no stiffness and mass", remedy)
        held = np.array([[node, direction] for node, direction in file.const], dtype=np.int64).reshape(-1, 2)
    reference = np.asarray(reference, dtype=np.int64)
    labels = label(reference[:, 0], reference[:, 1] + 1, path.name)
    # held rows are in the file, empty
    free = np.flatnonzero(~np.isin(labels, label(held[:, 0], held[:, 1] + 1, path.name)))
    if not free.size:
        wrong(path.name, "no dof that is free", "write the file of the unconstrained bodies")
    parts = {
        name: of_table(path.name, matrix.tocsr()[free][:, free], labels[free])
        for name, matrix in (("stiffness", stiffness), ("mass", mass))
    }
    return assemble(parts, (path.name,), "ansys")
