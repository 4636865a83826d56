"""Matrices of Nastran: DMIG entries of a punch file (`PARAM,EXTOUT,DMIGPCH`, or EXTSEOUT), and OP4 (OUTPUT4).

KAAX is the stiffness, MAAX the mass, BAAX the viscous damping, PAX the forces.

DMIG: a header "DMIG, name, 0, form, type" comes first, then for every column "DMIG, name, node, component" and four
fields an entry: node, component, real part, imaginary part. Lines have fields of 8 characters, with a star behind their
first word of 16, or commas. The component 0 is a scalar point, as the modal coordinates of a superelement are.
Components are along the axes of the basic system, unless a GRID names another one.

OP4, binary or text with numbers of fixed width: a matrix begins with its number of columns and rows, form, type and
name. A column follows as its number, the first row, the number of words, and the values. Where the first row is 0 the
column is sparse and consists of strings, each with its own length and row: packed into one whole number, or as two
where there are many rows (BIGMAT, a negative number of rows). A column behind the last one ends the matrix.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from studies.fe_models.files import FloatArray, check_file, shown, to_float
from studies.fe_models.matrices.matrices import Entries, entries_of_tables, label, read_fixed, wrong

_USUAL = {"stiffness": "KAAX", "mass": "MAAX", "damping": "BAAX", "load": "PAX"}
_CD = 5  # field of a GRID, counted behind its first word
_AGAIN = "punch the matrices again, real and symmetric"
_MANY_ROWS = 65536
_SINGLE, _DOUBLE = 1, 2  # types of real matrices

Column = tuple[list[int], Callable[[int], list[int]], Callable[[int], FloatArray]]
"""Number, first row and words; what reads the next whole numbers, and what reads real ones in so many words."""
Columns = Iterator[Column]


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


def read_op4(files: Mapping[str, Path]) -> dict[str, Entries]:
    """Entries of an OP4 file by the names of Nastran; the rows have a table. Raises SceneError about "matrices"."""
    path = files["matrices"]
    check_file(path)
    found = {}
    try:
        with path.open("rb") as file:
            binary = b"\0" in file.read(16)
        for name, (n_columns, n_rows, _, kind), columns in _binary(path) if binary else _text(path):
            if kind not in (_SINGLE, _DOUBLE):
                raise ValueError(f"{name} is complex")
            parts = list(_strings(n_columns, n_rows, columns))
            rows = np.concatenate([[], *(row + np.arange(len(values)) - 1 for _, row, values in parts)])
            places = np.repeat([column - 1 for column, *_ in parts], [len(values) for *_, values in parts])
            values = np.concatenate([[], *(values for *_, values in parts)])
            at = rows.astype(np.int64), places.astype(np.int64)
            found[name] = sparse.coo_array((values, at), shape=(abs(n_rows), n_columns))
    except (ValueError, TypeError, IndexError, OverflowError, StopIteration) as error:
        wrong(path.name, f"no OP4 file, or damaged ({shown(str(error))})", "write it again: OUTPUT4 or EXTSEOUT")
    return entries_of_tables({name: found[own] for name, own in names_of_matrices(found, path.name).items()}, files)


def _strings(n_columns: int, n_rows: int, columns: Columns) -> Iterator[tuple[int, int, FloatArray]]:
    """Column and first row, from 1, and values of each string of numbers."""
    for (column, row, words), whole, real in columns:
        if column > n_columns:
            return
        while words > 0:
            start, length, used = row, words, 0
            if row <= 0 and 0 <= n_rows < _MANY_ROWS:
                (packed,) = whole(1)
                length, start, used = (packed >> 16) - 1, packed & 0xFFFF, 1
            elif row <= 0:
                length, start = whole(2)
                length, used = length - 1, 2
            if length <= 0:
                raise ValueError("a string of no length")
            yield column, start, real(length)
            words -= length + used
    raise ValueError("it ends too early")


def _text(path: Path) -> Iterator[tuple[str, list[int], Columns]]:
    with path.open(encoding="latin-1") as file:
        while (head := file.readline()).strip():
            sizes = [int(head[at : at + 8]) for at in range(0, 32, 8)]
            name, form = head[32:40].strip().upper(), head[40:].upper().replace("D", "E").rpartition(",")[2].strip()
            each, _, width = form.partition(".")[0].partition("E") if form else ("5", "", "16")
            yield name, sizes, _text_columns(file, sizes[3], (each, width))
            file.readline()  # a number in the column behind the last one


def _text_columns(file: TextIO, kind: int, form: tuple[str, str]) -> Columns:
    def whole(count: int) -> list[int]:
        line = file.readline()
        return [int(line)] if count == 1 else [int(line[:8]), int(line[8:16])]

    while True:
        head = file.readline()
        column, row, words = (int(head[at : at + 8]) for at in range(0, 24, 8))
        # of a column that is not sparse the numbers are counted, not their words
        yield [column, row, words * (kind if row > 0 else 1)], whole, lambda n: read_fixed(file, n // kind, form)


def _binary(path: Path) -> Iterator[tuple[str, list[int], Columns]]:
    data = path.read_bytes()
    order = "<" if data[0] else ">"
    records = _records(data, order)
    for record in records:
        whole = np.dtype(f"{order}i{len(record) // 6}")  # four numbers and a name of two, of 4 bytes or of 8
        name = record[4 * whole.itemsize :].decode("latin-1").replace("\0", " ").strip().upper()
        sizes = np.frombuffer(record, whole, 4).tolist()
        real = np.dtype(f"{order}f{8 if sizes[3] == _DOUBLE else whole.itemsize}")
        yield name, sizes, (_binary_column(each, whole, real) for each in records)


def _records(data: bytes, order: str) -> Iterator[bytes]:
    """Records of an unformatted file of Fortran: each between its length."""
    at = 0
    while at < len(data):
        length = int(np.frombuffer(data, f"{order}i4", 1, at)[0])
        if length <= 0 or at + 8 + length > len(data):
            raise ValueError("it ends too early")
        yield data[at + 4 : at + 4 + length]
        at += 8 + length


def _binary_column(record: bytes, whole: np.dtype[Any], real: np.dtype[Any]) -> Column:
    rest = BytesIO(record)

    def take(kind: np.dtype[Any], words: int) -> NDArray[Any]:
        size = words * whole.itemsize
        return np.frombuffer(rest.read(size), kind, size // kind.itemsize)

    head = take(whole, 3).tolist()
    return head, lambda count: take(whole, count).tolist(), lambda words: take(real, words).astype(np.float64)
