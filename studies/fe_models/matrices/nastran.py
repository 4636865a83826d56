"""Matrices of Nastran in a punch file: DMIG entries of `PARAM,EXTOUT,DMIGPCH`, or of a superelement by EXTSEOUT.

KAAX is the stiffness, MAAX the mass, BAAX the viscous damping, PAX the forces. A header "DMIG, name, 0, form, type"
comes first, then for every column "DMIG, name, node, component" and four fields an entry: node, component, real part,
imaginary part. Lines have fields of 8 characters, with a star behind their first word of 16, or commas. The component 0
is a scalar point, as the modal coordinates of a superelement are. Components are along the axes of the basic system,
unless a GRID names another one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from studies.fe_models.matrices.matrices import LARGEST_FILE, Entries, Matrices, assemble, label, wrong
from studies.fe_models.text import check_file, shown

_USUAL = {"stiffness": "KAAX", "mass": "MAAX", "damping": "BAAX", "load": "PAX"}
_CD = 5  # field of a GRID, counted behind its first word
_AGAIN = "punch the matrices again, real and symmetric"


def names_of_matrices(names: Iterable[str], file: str) -> dict[str, str]:
    """Stiffness, mass, damping and load by the names of Nastran: KAAX, or the only one with the letter K, and so on.

    Raises SceneError where stiffness or mass is missing, or there are several.
    """
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


def read_nastran(path: Path) -> Matrices:
    """Matrices of a punch file with DMIG entries; other entries in it are passed over.

    Raises SceneError about "matrices", in particular for complex matrices, and displacements along other axes.
    """
    check_file(path, LARGEST_FILE, "matrices")
    columns: dict[str, list[np.ndarray] | None] = {}
    with path.open(encoding="latin-1") as file:
        for number, word, fields in _entries(file):
            if word in ("GRID", "GRDSET"):
                _check_grid(fields, number, path.name)
            elif word == "DMIG" and fields[0][:1].upper() in ("K", "M", "B", "P"):
                try:
                    _take(fields, columns)
                except ValueError as error:
                    wrong(path.name, f"line {number}, in DMIG {shown(fields[0])}: {shown(str(error))}", _AGAIN)
    parts = {}
    real = {name: each for name, each in columns.items() if each is not None}
    for name, own in names_of_matrices(real, path.name).items():
        table = np.concatenate(real[own]) if real[own] else np.empty((0, 5))
        node, dof, of_column, component = table[:, :4].astype(np.int64).T
        rows = label(node, dof, path.name)
        # a column of forces is the number of its load case
        column = of_column if name == "load" else label(of_column, component, path.name)
        parts[name] = Entries(path.name, rows, column, table[:, 4])
    return assemble(parts, (path.name,), "nastran")


def _entries(lines: Iterable[str]) -> Iterator[tuple[int, str, list[str]]]:
    """Line, first word in capitals and fields of each entry, with those of the lines on which it goes on."""
    number, word, fields = 0, "", list[str]()
    for at, text in enumerate(lines, 1):
        if text.startswith("$") or not text.strip():
            continue
        head = (text.partition(",")[0] if "," in text[:9] else text[:8]).strip().upper()
        width = 16 if head.endswith("*") or text.startswith("*") else 8
        free = text.rstrip("\n").split(",")[1:9] if "," in text[:9] else None
        own = [text[n : n + width].strip() for n in range(8, 72, width)] if free is None else [f.strip() for f in free]
        if text[0] in "*+ ,":
            fields += own
            continue
        if word:
            yield number, word, fields
        number, word, fields = at, head.rstrip("*").strip(), own
    if word:
        yield number, word, fields


def _take(fields: list[str], columns: dict[str, list[np.ndarray] | None]) -> None:
    """Takes a header, or a column with its entries: rows (m, 5) of node, dof, node and dof of the column, value.

    Complex matrices are None, as forces of a frequency.
    """
    name, node, component = fields[0].upper(), fields[1], fields[2]
    if node == "0":
        complex_ = fields[3] not in ("1", "2")
        if complex_ and name in ("KAAX", "MAAX"):
            raise ValueError("it is complex")
        columns.setdefault(name, None if complex_ else [])
        return
    if name not in columns:
        raise ValueError("its header is missing")
    table_of = columns[name]
    if table_of is None:
        return
    at = int(node), int(component or 0)
    table = []
    entries = fields[4:] + [""] * (-len(fields) % 4)
    for first in range(0, len(entries), 4):
        row, dof, value, imaginary = entries[first : first + 4]
        if not (row or dof or value):
            continue
        if imaginary and _real(imaginary) != 0.0:
            raise ValueError("it has an imaginary part, or is no entry of a DMIG")
        table.append((int(row), int(dof or 0), *at, _real(value)))
        if not 0 < table[-1][0] < 2**31 or not 0 < at[0] < 2**31:
            raise ValueError(f"it has the node {row}")
    if table:
        table_of.append(np.array(table, dtype=np.float64))


def _real(text: str) -> float:
    """A number of Nastran: 1.0, 1.0D+3, 1.0+3."""
    text = text.upper().replace("D", "E")
    return float(text if "E" in text else re.sub(r"(?<=[\d.])(?=[+-]\d+$)", "E", text))


def _check_grid(fields: list[str], number: int, file: str) -> None:
    """Raises SceneError where the displacements of a GRID, or of all, are along the axes of another system."""
    if len(fields) > _CD and fields[_CD] not in ("", "0"):
        of = f"GRID {shown(fields[0])}" if fields[0] else "GRDSET"
        found = f"line {number}: {of} has displacements in the coordinate system {shown(fields[_CD])} (CD)"
        wrong(file, found, "write the matrices with all displacements in the basic system: CD blank")
