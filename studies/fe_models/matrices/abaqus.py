"""Matrices of Abaqus, and substructures of CalculiX.

`*MATRIX GENERATE, STIFFNESS, MASS` writes job_STIF1.mtx and job_MASS1.mtx (and job_DMPV1.mtx, job_LOAD1.mtx) with lines
"node, dof, node, dof, value" (FORMAT=MATRIX INPUT), one triangle or both. Internal nodes are negative. A dof that a
boundary condition holds has 1e36 on its diagonal.

`*SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED` writes one file with a `*USER ELEMENT`, the numbers of its nodes
in comments, their dofs, and the upper triangle of each `*MATRIX` column by column. Nodes may be repeated.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.matrices.columns import read_columns
from studies.fe_models.matrices.matrices import LARGEST_FILE, Entries, IntArray, Matrices, assemble, label, wrong
from studies.fe_models.text.read_errors import check_file, shown

_OF_TYPE = {"STIFFNESS": "stiffness", "MASS": "mass", "VISCOUSDAMPING": "damping"}


def read_abaqus(files: dict[str, Path]) -> Matrices:
    """Matrices of .mtx files by name, in the format of *MATRIX INPUT. Raises SceneError about "matrices"."""
    parts = {}
    for name, path in files.items():
        _check_format(path, name)
        kinds = (int, int, float) if name == "load" else (int, int, int, int, float)
        *labels, values = read_columns(path, ",", kinds, "*")
        if any((node == 0).any() for node in labels[::2]):
            wrong(path.name, "a node with the number 0", "export it again, FORMAT=MATRIX INPUT")
        rows = label(labels[0], labels[1], path.name)
        columns = np.zeros_like(rows) if name == "load" else label(labels[2], labels[3], path.name)
        parts[name] = Entries(path.name, rows, columns, values)
    return assemble(parts, tuple(path.name for path in files.values()), "abaqus")


def _check_format(path: Path, name: str) -> None:
    """Raises SceneError where the lines are "row column value" (FORMAT=COORDINATE), without nodes."""
    check_file(path, LARGEST_FILE, "matrices")
    with path.open(encoding="latin-1") as file:
        first = next((text for text in file if text.strip() and not text.startswith(("*", "%"))), "")
    if name != "load" and len(first.replace(",", " ").split()) == 3:
        found = "lines have a row, a column and a value (FORMAT=COORDINATE), and no node"
        wrong(path.name, found, "write *MATRIX OUTPUT, STIFFNESS, MASS, FORMAT=MATRIX INPUT")


def read_substructure(path: Path) -> Matrices:
    """Matrices of a substructure in the format of a user element. Raises SceneError about "matrices"."""
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
        wrong(
            path.name, "no *USER ELEMENT with its nodes", "write *SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED"
        )
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
