"""Matrices of other programs: what reads which files, by the name that a user gives.

CalculiX: `*FREQUENCY, SOLVER=MATRIXSTORAGE` writes job.sti and job.mas, the upper triangle in lines "row column value"
from 1, and job.dof with a line "node.direction" for every row, no number: 10.1 is not 10.10.

Abaqus: `*MATRIX GENERATE, STIFFNESS, MASS` writes job_STIF1.mtx and job_MASS1.mtx, one triangle or both in lines "node,
dof, node, dof, value" (FORMAT=MATRIX INPUT). Internal nodes are negative. A held dof has 1e36 on its diagonal.

Substructures: `*SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED` writes a `*USER ELEMENT`, its nodes in comments,
which may be repeated, their dofs, and the upper triangle of each `*MATRIX` column by column.

MATLAB (.mat), MatrixMarket and Harwell-Boeing files have no labels. Node and dof of each row, in the order of the rows,
are the variable `rows` (n, 2) of a .mat file, or stand beside the files in job_rows.csv with the columns node and dof;
dof 0 is a coordinate of no place, as of a mode, whose node may be 0 as well.

Harwell-Boeing (.hb, and .rb of Rutherford-Boeing), a sparse matrix column by column in numbers of fixed width. Lines: a
title; how many lines the file, pointers, rows, values and right-hand sides take; type, size and number of entries;
formats of Fortran. Types are three letters: R or I for real or whole numbers; S where one triangle is written, U or R
where all entries are; A for assembled. scipy reads U alone, and neither exponents with D nor fields that touch.
"""

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from glob import escape
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import io, sparse

from studies.fe_models.files import check_file, library_errors, shown
from studies.fe_models.matrices.matrices import (
    NAMES,
    Entries,
    Matrices,
    assemble,
    entries_of_tables,
    label,
    read_fixed,
    wrong,
)
from studies.fe_models.matrices.nastran import read_op4, read_punch
from studies.scene_error import SceneError

Files = Mapping[str, Path]
"""Files of a model by what is in them."""

_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)\(?(?:ES|EN|[IEDFG])(\d+)(?:\.\d+(?:E\d+)?)?\)?\)")
_TYPES = re.compile("[RI][SUR]A")
_OF_TYPE = {"STIFFNESS": "stiffness", "MASS": "mass", "VISCOUSDAMPING": "damping"}


def find_matrix_files(path: Path) -> tuple[Path, ...]:
    """The files that belong to the name that they have in common, or to one of them.

    Raises SceneError about "matrices" where there are none, or of more than one kind.
    """
    return tuple(_find(path)[1].values())


def read_matrices(path: Path) -> Matrices:
    """The matrices of these files. Raises SceneError about "matrices"."""
    kind, files = _find(path)
    return assemble(kind.reader(files), tuple(own.name for part, own in files.items() if part != "rows"), kind.code)


def _read_calculix(files: Files) -> dict[str, Entries]:
    dofs = files["dofs"]
    node, direction = _read_columns(dofs, ".", (int, int))
    labels, n_dof = label(node, direction, dofs.name), node.size
    if np.unique(labels).size < n_dof:
        at = np.setdiff1d(np.arange(n_dof), np.unique(labels, return_index=True)[1])[0]
        wrong(dofs.name, f"dof {direction[at]} of node {node[at]} has two rows", "export the matrices again")
    parts = {}
    for name in ("stiffness", "mass"):
        path = files[name]
        rows, columns, values = _read_columns(path, None, (int, int, float))
        size = int(max(rows.max(), columns.max()))
        if size == 2 * n_dof:
            found = f"{size} rows for {n_dof} dofs in {dofs.name}, written for a nodal diameter"
            wrong(path.name, found, "export without *SELECT CYCLIC SYMMETRY MODES, and with CYCMPC=INACTIVE")
        if size != n_dof or min(rows.min(), columns.min()) < 1:
            wrong(path.name, f"{size} rows for {n_dof} dofs in {dofs.name}", "give the three whole files of one run")
        parts[name] = Entries(path.name, labels[rows - 1], labels[columns - 1], values)
    return parts


def _read_abaqus(files: Files) -> dict[str, Entries]:
    parts = {}
    for name, path in files.items():
        kinds = (int, int, float) if name == "load" else (int, int, int, int, float)
        *labels, values = _read_columns(path, ",", kinds, "*")
        if any((node == 0).any() for node in labels[::2]):
            wrong(path.name, "a node with the number 0", "export it again, FORMAT=MATRIX INPUT")
        rows = label(labels[0], labels[1], path.name)
        columns = np.zeros_like(rows) if name == "load" else label(labels[2], labels[3], path.name)
        parts[name] = Entries(path.name, rows, columns, values)
    return parts


def _read_columns(
    path: Path, separator: str | None, kinds: tuple[type, ...], comment: str | None = None
) -> list[np.ndarray]:
    """Columns of a text file, one array each, of the given types, int or float. Raises SceneError.

    separator: between the numbers; None for any blanks. comment: character with which lines begin without numbers.
    """
    check_file(path)
    columns = [(f"{place}", np.int64 if kind is int else np.float64) for place, kind in enumerate(kinds)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a file without data
            table = np.loadtxt(path, columns, comment, separator, encoding="latin-1", ndmin=1)
    except (ValueError, OverflowError) as error:
        remedy = "write them again" + (", FORMAT=MATRIX INPUT" if separator == "," else "")
        wrong(path.name, f"a line is no row of numbers ({shown(str(error))})", remedy)
    if not table.size:
        wrong(path.name, "no entries in the file", "export it again")
    return [table[name] for name, _ in columns]


def _read_substructure(files: Files) -> dict[str, Entries]:
    path = files["matrices"]
    check_file(path)
    nodes: list[int] = []
    dofs: list[list[int]] = []
    numbers: dict[str, list[float]] = {}
    into: list[float] | None = None
    in_nodes = False
    with path.open(encoding="latin-1") as file:
        for number, text in enumerate(file, 1):
            fields = [field.strip() for field in text.lstrip("* ").split(",") if field.strip()]
            try:
                if text.startswith("**"):
                    in_nodes = in_nodes and all(field.lstrip("-").isdigit() for field in fields)
                    nodes += [int(field) for field in fields] if in_nodes else []
                    in_nodes = in_nodes or text.upper().split() == ["**", "ELEMENT", "NODES"]
                elif text.startswith("*"):
                    in_nodes = False
                    kind = text.upper().replace(" ", "").strip().partition("*MATRIX,TYPE=")[2]
                    into = numbers.setdefault(_OF_TYPE.get(kind, kind), []) if kind else None
                elif into is not None:
                    into += [float(field) for field in fields]
                elif fields and not numbers:
                    dofs.append([int(field) for field in fields])
            except ValueError:
                wrong(path.name, f"line {number} is {shown(text)!r}", "write OUTPUT FILE=USER DEFINED")
    if not nodes or not dofs:
        wrong(path.name, "no *USER ELEMENT with its nodes", "write OUTPUT FILE=USER DEFINED")
    # dofs of the first node, then the place of a node from which on others hold, and these
    changes, own, pairs = {each[0]: each[1:] for each in dofs[1:]}, dofs[0], []
    for place, node in enumerate(nodes, 1):
        own = changes.get(place, own)
        pairs += [(node, dof) for dof in own]
    rows = np.array(pairs, dtype=np.int64)
    labels = label(rows[:, 0], rows[:, 1], path.name)
    column, row = np.tril_indices(labels.size)
    parts = {}
    for name, values in numbers.items():
        if name not in _OF_TYPE.values():
            continue
        if len(values) != row.size:
            wrong(path.name, f"{len(values)} entries of {name} for {labels.size} dofs", "write the whole triangle")
        parts[name] = Entries(path.name, labels[row], labels[column], np.array(values))
    return parts


def _read_tables(files: Files) -> dict[str, Entries]:
    """MatrixMarket and Harwell-Boeing files, each with a matrix."""
    found = {}
    for name in [name for name in NAMES if name in files]:
        path = files[name]
        if path.suffix.lower() != ".mtx":
            found[name] = _read_harwell_boeing(path)
            continue
        with library_errors(path, "scipy.io", "scipy", "matrices"):
            *_, field, symmetry = io.mminfo(path)
            if field == "pattern" or symmetry == "skew-symmetric":
                wrong(path.name, f"its header says {field} {symmetry}", "write the numbers of a symmetric matrix")
            found[name] = io.mmread(path)
    return entries_of_tables(found, files)


def _read_harwell_boeing(path: Path) -> sparse.coo_array:
    """The entries of a file as they stand there, of a triangle where it has one. Raises SceneError about "matrices"."""
    check_file(path)
    try:
        with path.open(encoding="latin-1") as file:
            _, counts, (kind, *size), formats = [next(file, "").upper().split() for _ in range(4)]
            n_rows, n_columns, n_entries = (int(text) for text in size[:3])
            if not _TYPES.fullmatch(kind):
                wrong(path.name, f"a matrix of type {shown(kind)}", "write a real symmetric one, assembled: RSA")
            if any(int(count) for count in counts[4:]):
                remedy = "write it without them, and the forces as job_load.hb"
                wrong(path.name, "right-hand sides beside the matrix", remedy)
            if len(forms := _FORMAT.findall("".join(formats))) < 3:
                raise ValueError(f"formats {' '.join(formats)}")
            lengths = (n_columns + 1, n_entries, n_entries)
            starts, rows, values = (read_fixed(file, *each) for each in zip(lengths, forms, strict=False))
        columns = np.repeat(np.arange(n_columns), np.diff(starts).astype(np.int64))
        return sparse.coo_array((values, (rows.astype(np.int64) - 1, columns)), shape=(n_rows, n_columns))
    except SceneError:
        raise
    except (ValueError, IndexError, OverflowError) as error:
        wrong(path.name, f"no Harwell-Boeing file, or damaged ({shown(str(error))})", "write it again")


def _read_matlab(files: Files) -> dict[str, Entries]:
    """A .mat file of any version, by the variables NAMES and `rows`."""
    path = files["matrices"]
    with library_errors(path, "scipy.io", "scipy", "matrices"):
        with path.open("rb") as file:
            newest = file.read(10) == b"MATLAB 7.3" or h5py.is_hdf5(path)
        found = _read_v73(path) if newest else io.loadmat(path, variable_names=[*NAMES, "rows"])
    rows = None
    if "rows" in found:
        table = np.asarray(found["rows"])
        if table.ndim != 2 or table.shape[1] != 2 or table.dtype.kind not in "iuf":
            wrong(path.name, f"rows have the shape {table.shape}", "give node and dof of each row of the matrices")
        rows = table.astype(np.int64).T
    return entries_of_tables({name: found[name] for name in NAMES if name in found}, files, rows)


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


def _read_ansys(files: Files) -> dict[str, Entries]:
    """A .full file, without the rows that ANSYS holds."""
    path = files["matrices"]
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "matrices"):
        from ansys.mapdl import reader

        try:
            file = reader.read_binary(str(path))
        except NotImplementedError as error:
            what = "lumped" if "lumped" in str(error) else "not symmetric"
            wrong(path.name, f"the matrices are {what}", "write them with LUMPM,OFF and without CORIOLIS")
        reference, stiffness, mass = file.load_km() if hasattr(file, "load_km") else (None, None, None)
        if stiffness is None or mass is None:
            wrong(path.name, "no stiffness and mass", "write that of a modal analysis, with HBMAT or WRFULL before it")
        tables = reference, [[node, direction] for node, direction in file.const]
        (node, direction), (held, fixed) = (np.array(each, dtype=np.int64).reshape(-1, 2).T for each in tables)
    # held rows are in the file, empty
    free = np.flatnonzero(~np.isin(label(node, direction + 1, path.name), label(held, fixed + 1, path.name)))
    if not free.size:
        wrong(path.name, "no dof that is free", "write the file of the unconstrained bodies")
    found = {"stiffness": stiffness.tocsr()[free][:, free], "mass": mass.tocsr()[free][:, free]}
    return entries_of_tables(found, files, np.stack([node, direction + 1])[:, free])


@dataclass(frozen=True)
class _Format:
    """A format.

    code: see `Matrices`. ends: of the names of its files, by what is in them; * is a number. Damping, load and the
    table of rows may be missing. by_name: whether the name that the files have in common is enough.
    """

    code: str
    reader: Callable[[Files], dict[str, Entries]]
    ends: Mapping[str, str]
    by_name: bool = True


_ROWS = {"rows": "_rows.csv"}
_ABAQUS = zip(NAMES, ("STIF", "MASS", "DMPV", "LOAD"), strict=True)
FORMATS = (
    _Format("calculix", _read_calculix, {"stiffness": ".sti", "mass": ".mas", "dofs": ".dof"}),
    _Format("abaqus", _read_abaqus, {name: f"_{short}*.mtx" for name, short in _ABAQUS}),
    *(_Format("table", _read_tables, {name: f"_{name}{e}" for name in NAMES} | _ROWS) for e in (".mtx", ".hb", ".rb")),
    *(_Format("nastran", read_punch, {"matrices": end}) for end in (".pch", ".dmig")),
    *(_Format("nastran", read_punch, {"matrices": end}, by_name=False) for end in (".bdf", ".dat")),
    _Format("table", read_op4, {"matrices": ".op4"} | _ROWS),
    _Format("table", _read_matlab, {"matrices": ".mat"} | _ROWS),
    _Format("ansys", _read_ansys, {"matrices": ".full"}),
    _Format("abaqus", _read_substructure, {"matrices": ".mtx"}),
)
"""Matrices of CalculiX, of Abaqus, of any program, of Nastran, MATLAB and ANSYS, and substructures."""


def _find(path: Path) -> tuple[_Format, dict[str, Path]]:
    """The format of the matrices, and their files by what is in them."""
    for each in FORMATS:
        for end in set(each.ends.values()) - set(_ROWS.values()):
            if match := re.fullmatch("(.*)" + re.escape(end).replace(r"\*", r"(\d+)"), path.name, re.IGNORECASE):
                job, number = match[1], match[match.re.groups]
                files = {part: path.with_name(job + name.replace("*", number)) for part, name in each.ends.items()}
                may_miss = ("damping", "load", "rows")
                return each, {part: own for part, own in files.items() if part not in may_miss or own.is_file()}
    firsts = [next(iter(each.ends.values())) for each in FORMATS if each.by_name]
    patterns = [escape(path.name) + end.replace("*", "[0-9]*") for end in firsts]
    if not (found := [file for pattern in patterns for file in sorted(path.parent.glob(pattern))]):
        looked_for = ", ".join(path.name + end.replace("*", "1") for end in firsts)
        raise SceneError("matrices", f"there is no {looked_for}", "give the name that the files have in common")
    if len(found) > 1:
        names = " and ".join(file.name for file in found)
        raise SceneError("matrices", f"there are {names}", "give the name of one of these files")
    return _find(found[0])
