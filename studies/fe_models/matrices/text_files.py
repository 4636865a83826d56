"""Matrices in text files of CalculiX and Abaqus.

CalculiX: `*FREQUENCY, SOLVER=MATRIXSTORAGE` writes job.sti and job.mas, the upper triangle in lines "row column value"
from 1, and job.dof with a line "node.direction" for every row, no number: 10.1 is not 10.10.

Abaqus: `*MATRIX GENERATE, STIFFNESS, MASS` writes job_STIF1.mtx and job_MASS1.mtx, one triangle or both in lines "node,
dof, node, dof, value" (FORMAT=MATRIX INPUT). Internal nodes are negative. A held dof has 1e36 on its diagonal.

Substructures: `*SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED` writes a `*USER ELEMENT`, its nodes in comments,
which may be repeated, their dofs, and the upper triangle of each `*MATRIX` column by column.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from studies.fe_models.matrices.matrices import Entries, IntArray, Matrices, assemble, label, wrong
from studies.fe_models.text import LARGEST_FILE, check_file, shown

_OF_TYPE = {"STIFFNESS": "stiffness", "MASS": "mass", "VISCOUSDAMPING": "damping"}


def read_calculix(files: Mapping[str, Path]) -> Matrices:
    """Matrices of a .sti, a .mas and a .dof file. Raises SceneError about "matrices"."""
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
            found = f"{size} rows for {n_dof} dofs in {dofs.name}"
            wrong(path.name, found, "give the three files of one run, each of them whole")
        parts[name] = Entries(path.name, labels[rows - 1], labels[columns - 1], values)
    return assemble(parts, tuple(path.name for path in files.values()), "calculix")


def read_abaqus(files: Mapping[str, Path]) -> Matrices:
    """Matrices of .mtx files by name, in the format of *MATRIX INPUT. Raises SceneError about "matrices"."""
    parts = {}
    for name, path in files.items():
        kinds = (int, int, float) if name == "load" else (int, int, int, int, float)
        *labels, values = _read_columns(path, ",", kinds, "*")
        if any((node == 0).any() for node in labels[::2]):
            wrong(path.name, "a node with the number 0", "export it again, FORMAT=MATRIX INPUT")
        rows = label(labels[0], labels[1], path.name)
        columns = np.zeros_like(rows) if name == "load" else label(labels[2], labels[3], path.name)
        parts[name] = Entries(path.name, rows, columns, values)
    return assemble(parts, tuple(path.name for path in files.values()), "abaqus")


def read_substructure(files: Mapping[str, Path]) -> Matrices:
    """Matrices of a substructure in the format of a user element. Raises SceneError about "matrices"."""
    path = files["matrices"]
    check_file(path, LARGEST_FILE, "matrices")
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
        remedy = "write *SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED"
        wrong(path.name, "no *USER ELEMENT with its nodes", remedy)
    labels = _labels(nodes, dofs, path.name)
    column, row = np.tril_indices(labels.size)
    parts = {}
    for name, values in numbers.items():
        if name not in _OF_TYPE.values():
            continue
        if len(values) != row.size:
            found = f"{len(values)} entries of {name} for {labels.size} dofs, whose triangle has {row.size}"
            wrong(path.name, found, "write it again, symmetric")
        parts[name] = Entries(path.name, labels[row], labels[column], np.array(values))
    return assemble(parts, (path.name,), "abaqus")


def _labels(nodes: list[int], dofs: list[list[int]], file: str) -> IntArray:
    """Labels of the rows: dofs of the first node, then the place of a node from which on others hold, and these."""
    changes = {1: dofs[0], **{each[0]: each[1:] for each in dofs[1:]}}
    pairs, own = [], dofs[0]
    for place, node in enumerate(nodes, 1):
        own = changes.get(place, own)
        pairs += [(node, dof) for dof in own]
    node, dof = np.array(pairs, dtype=np.int64).T
    return label(node, dof, file)


def _read_columns(
    path: Path, separator: str | None, kinds: tuple[type, ...], comment: str | None = None
) -> list[np.ndarray]:
    """Columns of a text file, one array each, of the given types, int or float. Raises SceneError about "matrices".

    separator: between the numbers; None for any blanks. comment: character with which lines begin without numbers.
    """
    check_file(path, LARGEST_FILE, "matrices")
    columns = [(f"{place}", np.int64 if kind is int else np.float64) for place, kind in enumerate(kinds)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a file without data
            table = np.loadtxt(path, columns, comment, separator, encoding="latin-1", ndmin=1)
    except (ValueError, OverflowError) as error:
        what = f"give lines of {kinds.count(int)} whole numbers and {kinds.count(float)} values"
        remedy = what + (", of Abaqus FORMAT=MATRIX INPUT" if separator == "," else "")
        wrong(path.name, f"a line is no row of numbers ({shown(str(error))})", remedy)
    if not table.size:
        wrong(path.name, "no entries in the file", "export it again")
    return [table[name] for name, _ in columns]
