"""Matrices of Nastran: DMIG entries of a punch file (`PARAM,EXTOUT,DMIGPCH`, or EXTSEOUT).

KAAX is the stiffness, MAAX the mass, BAAX the viscous damping, PAX the forces.

DMIG: a header "DMIG, name, 0, form, type" comes first, then for every column "DMIG, name, node, component" and four
fields an entry: node, component, real part, imaginary part. Lines have fields of 8 characters, with a star behind their
first word of 16, or commas. The component 0 is a scalar point, as the modal coordinates of a superelement are.
Components are along the axes of the basic system, unless a GRID names another one.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from studies.fe_models.files import check_file, shown, to_float
from studies.fe_models.matrices.matrices import Entries, label, wrong

_USUAL = {"stiffness": "KAAX", "mass": "MAAX", "damping": "BAAX", "load": "PAX"}
_CD = 5  # field of a GRID, counted behind its first word
_AGAIN = "punch the matrices again, real and symmetric"


def names_of_matrices(names: Iterable[str], file: str) -> dict[str, str]:
    """Stiffness, mass, damping and load by the names of Nastran: KAAX, or the only one with the letter K, and so on."""
    found = {}
    for name, usual in _USUAL.items():
        own = [each for each in names if each[:1] == usual[0] and not each.startswith("K4")]
        same = [each for each in own if each in (usual, usual.rstrip("X"))]
        if same or len(own) == 1:
            found[name] = (same or own)[0]
        elif name in ("stiffness", "mass"):
            listed = ", ".join(map(shown, names)) or "none"
            wrong(file, f"no matrix {usual} but {listed}", "punch it: PARAM,EXTOUT,DMIGPCH")
    return found


def read_punch(files: Mapping[str, Path]) -> dict[str, Entries]:
    """Entries of a punch file with DMIG entries; others are passed over. Raises SceneError about "matrices"."""
    path = files["matrices"]
    check_file(path)
    columns: dict[str, list[np.ndarray]] = {}
    passed: set[str] = set()
    with path.open(encoding="latin-1") as file:
        for number, word, fields in _entries(file):
            fields = [*fields, *[""] * (_CD + 1 - len(fields))]
            if word in ("GRID", "GRDSET") and fields[_CD] not in ("", "0"):
                what = f"{word} {shown(fields[0])} has displacements in the coordinate system {shown(fields[_CD])}"
                wrong(path.name, f"line {number}: {what}", "write all of them in the basic system: CD blank")
            if word == "DMIG" and fields[0][:1].upper() in ("K", "M", "B", "P"):
                try:
                    _take(fields, columns, passed)
                except ValueError as error:
                    wrong(path.name, f"line {number}, in DMIG {shown(fields[0])}: {shown(str(error))}", _AGAIN)
    parts = {}
    for name, own in names_of_matrices(columns, path.name).items():
        table = np.concatenate([np.empty((0, 5)), *columns[own]])
        node, dof, of_column, component = table[:, :4].astype(np.int64).T
        rows = label(node, dof, path.name)
        # a column of forces is the number of its load case
        column = of_column if name == "load" else label(of_column, component, path.name)
        parts[name] = Entries(path.name, rows, column, table[:, 4])
    return parts


def _entries(lines: Iterable[str]) -> Iterator[tuple[int, str, list[str]]]:
    """Line, first word in capitals and fields of each entry, with those of the lines on which it goes on."""
    number, word, fields = 0, "", list[str]()
    for at, text in enumerate(lines, 1):
        if text.startswith("$") or not text.strip():
            continue
        free = "," in text[:9]
        head = (text.partition(",")[0] if free else text[:8]).strip().upper()
        width = 16 if head.endswith("*") or text.startswith("*") else 8
        parts = text.rstrip("\n").split(",")[1:9] if free else [text[n : n + width] for n in range(8, 72, width)]
        own = [part.strip() for part in parts]
        if text[0] in "*+ ,":
            fields += own
            continue
        if word:
            yield number, word, fields
        number, word, fields = at, head.rstrip("*").strip(), own
    if word:
        yield number, word, fields


def _take(fields: list[str], columns: dict[str, list[np.ndarray]], passed: set[str]) -> None:
    """Takes a header, or a column with its entries: rows (m, 5) of node, dof, node and dof of the column, value.

    Complex matrices are passed over, but not stiffness and mass. Raises ValueError.
    """
    name, node, component = fields[0].upper(), fields[1], fields[2]
    if node == "0":
        if fields[3] in ("1", "2"):
            columns.setdefault(name, [])
        elif name in ("KAAX", "MAAX"):
            raise ValueError("it is complex")
        else:
            passed.add(name)
    if node == "0" or name in passed:
        return
    if name not in columns:
        raise ValueError("its header is missing")
    table = []
    entries = fields[4:] + [""] * (-len(fields) % 4)
    for first in range(0, len(entries), 4):
        row, dof, value, imaginary = entries[first : first + 4]
        if not (row or dof or value):
            continue
        if imaginary and _real(imaginary) != 0.0:
            raise ValueError("it has an imaginary part, or is no entry of a DMIG")
        table.append((int(row), int(dof or 0), int(node), int(component or 0), _real(value)))
        if not 0 < table[-1][0] < 2**31 or not 0 < table[-1][2] < 2**31:
            raise ValueError(f"it has the node {row}")
    if table:
        columns[name].append(np.array(table, dtype=np.float64))


def _real(text: str) -> float:
    """A number of Nastran: 1.0, 1.0D+3, 1.0+3. Raises ValueError."""
    value = to_float(text)
    if math.isnan(value):
        raise ValueError(f"{text!r} in place of a number")
    return value
