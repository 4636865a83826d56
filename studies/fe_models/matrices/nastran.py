"""Matrices of Nastran: DMIG entries of a punch file (`PARAM,EXTOUT,DMIGPCH`, or EXTSEOUT), and OP4 files (OUTPUT4).

KAAX is the stiffness, MAAX the mass, BAAX the viscous damping, PAX the forces.

DMIG: a header "DMIG, name, 0, form, type" comes first, then for every column "DMIG, name, node, component" and four
fields an entry: node, component, real part, imaginary part. Lines have fields of 8 characters, with a star behind their
first word of 16, or commas. The component 0 is a scalar point, as the modal coordinates of a superelement are.
Components are along the axes of the basic system, unless a GRID names another one.

OP4, binary or text: a matrix begins with its number of columns and rows, form, type and name. A column follows as its
number, the first row, the number of words, and the values. Where the first row is 0 the column is sparse and consists
of strings, each with its own length and row: packed into one whole number, or as two where there are many rows (BIGMAT,
a negative number of rows). A column behind the last one ends the matrix.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from scipy import sparse

from studies.fe_models.files import check_file, shown, to_float
from studies.fe_models.matrices.matrices import Entries, entries_of_tables, label, wrong

_USUAL = {"stiffness": "KAAX", "mass": "MAAX", "damping": "BAAX", "load": "PAX"}
_CD = 5  # field of a GRID, counted behind its first word
_AGAIN = "punch the matrices again, real and symmetric"
_MANY_ROWS = 65536
_SINGLE, _DOUBLE = 1, 2  # types of real matrices

Strings = Iterator[tuple[int, int, np.ndarray]]
"""Column and first row, from 1, and values of each string of numbers of an OP4 file."""


def _names_of_matrices(names: Iterable[str], file: str) -> dict[str, str]:
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
    for name, own in _names_of_matrices(columns, path.name).items():
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


def read_op4(files: Mapping[str, Path]) -> dict[str, Entries]:
    """Entries of an OP4 file by the names of Nastran; the rows have a table. Raises SceneError about "matrices"."""
    path = files["matrices"]
    check_file(path)
    found = {}
    try:
        with path.open("rb") as file:
            binary = b"\0" in file.read(16)
        for name, shape, strings in _binary(path) if binary else _text(path):
            parts = list(strings)
            rows = np.concatenate([[], *(row + np.arange(len(values)) - 1 for _, row, values in parts)])
            columns = np.repeat([column - 1 for column, *_ in parts], [len(values) for *_, values in parts])
            values = np.concatenate([[], *(values for *_, values in parts)])
            found[name] = sparse.coo_array((values, (rows.astype(np.int64), columns.astype(np.int64))), shape=shape)
    except (ValueError, TypeError, IndexError, OverflowError, StopIteration) as error:
        wrong(path.name, f"no OP4 file, or damaged ({shown(str(error))})", "write it again: OUTPUT4 or EXTSEOUT")
    names = _names_of_matrices(found, path.name)
    return entries_of_tables({name: found[own] for name, own in names.items()}, files)


def _check_type(kind: int, name: str) -> None:
    if kind not in (_SINGLE, _DOUBLE):
        raise ValueError(f"{name} is complex")


def _text(path: Path) -> Iterator[tuple[str, tuple[int, int], Strings]]:
    with path.open(encoding="latin-1") as file:
        while (head := file.readline()).strip():
            columns, rows, _, kind = (int(head[at : at + 8]) for at in range(0, 32, 8))
            name, form = head[32:40].strip().upper(), head[40:].upper().replace("D", "E").rpartition(",")[2].strip()
            _check_type(kind, name)
            each, width = (int(part) for part in form.partition(".")[0].split("E")) if form else (5, 16)
            yield name, (abs(rows), columns), _text_strings(file, columns, rows, kind, each, width)


def _text_strings(file: TextIO, columns: int, rows: int, kind: int, each: int, width: int) -> Strings:
    def values(count: int) -> np.ndarray:
        text = "".join(line.rstrip("\n").ljust(each * width) for line in islice(file, -(-count // each)))
        fields = [text[at : at + width].replace("D", "E") for at in range(0, count * width, width)]
        return np.array([float(field) for field in fields])

    while True:
        head = file.readline()
        column, row, words = (int(head[at : at + 8]) for at in range(0, 24, 8))
        if column > columns:
            file.readline()
            return
        if row > 0:
            yield column, row, values(words)
            continue
        while words > 0:
            line = file.readline()
            if rows < 0 or rows >= _MANY_ROWS:
                length, row, used = int(line[:8]) - 1, int(line[8:16]), 2
            else:
                length, row, used = (int(line) >> 16) - 1, int(line) & 0xFFFF, 1
            words -= length + used
            yield column, row, values(length // kind)


def _binary(path: Path) -> Iterator[tuple[str, tuple[int, int], Strings]]:
    data = path.read_bytes()
    order = "<" if data[0] else ">"
    records = _records(data, order)
    for record in records:
        whole = f"{order}i{len(record) // 6}"  # four numbers and a name of two, of 4 bytes or of 8
        columns, rows, _, kind = (int(number) for number in np.frombuffer(record, whole, 4))
        name = record[4 * np.dtype(whole).itemsize :].decode("latin-1").replace("\0", " ").strip().upper()
        _check_type(kind, name)
        yield name, (abs(rows), columns), _binary_strings(records, columns, rows, kind, whole)


def _records(data: bytes, order: str) -> Iterator[bytes]:
    """Records of an unformatted file of Fortran: each between its length."""
    at = 0
    while at < len(data):
        length = int(np.frombuffer(data, f"{order}i4", 1, at)[0])
        if length <= 0 or at + 8 + length > len(data):
            raise ValueError("it ends too early")
        yield data[at + 4 : at + 4 + length]
        at += 8 + length


def _binary_strings(records: Iterator[bytes], columns: int, rows: int, kind: int, whole: str) -> Strings:
    size = np.dtype(whole).itemsize
    real = np.dtype(f"{whole[0]}f{8 if kind == _DOUBLE else size}")
    for record in records:
        column, row, words = (int(number) for number in np.frombuffer(record, whole, 3))
        if column > columns:
            return
        at = 3 * size
        end = at + words * size
        while at < end:
            if row > 0:
                start, length, here = row, end - at, at
            elif rows < 0 or rows >= _MANY_ROWS:
                length, start = (int(number) for number in np.frombuffer(record, whole, 2, at))
                length, here = (length - 1) * size, at + 2 * size
            else:
                packed = int(np.frombuffer(record, whole, 1, at)[0])
                length, start, here = ((packed >> 16) - 1) * size, packed & 0xFFFF, at + size
            if length <= 0:
                raise ValueError("a string of no length")
            yield column, start, np.frombuffer(record, real, length // real.itemsize, here).astype(np.float64)
            at = here + length
    raise ValueError("it ends too early")
