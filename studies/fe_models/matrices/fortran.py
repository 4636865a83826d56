"""Matrices in files of Fortran, with numbers of fixed width: Harwell-Boeing, and OP4 of Nastran (OUTPUT4).

Harwell-Boeing (.hb, and .rb of Rutherford-Boeing), a sparse matrix column by column. Lines: a title; how many lines the
file, pointers, rows, values and right-hand sides take; type, size and number of entries; formats of Fortran. Types are
three letters: R or I for real or whole numbers; S where one triangle is written, U or R where all entries are; A for
assembled. scipy reads U alone, and neither exponents with D nor fields that touch.

OP4, binary or text: a matrix begins with its number of columns and rows, form, type and name. A column follows as its
number, the first row, the number of words, and the values. Where the first row is 0 the column is sparse and consists
of strings, each with its own length and row: packed into one whole number, or as two where there are many rows (BIGMAT,
a negative number of rows). A column behind the last one ends the matrix.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from studies.fe_models.files import FloatArray, check_file, shown, to_float
from studies.fe_models.matrices.matrices import Entries, entries_of_tables, wrong
from studies.fe_models.matrices.nastran import names_of_matrices
from studies.scene_error import SceneError

_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)\(?(?:ES|EN|[IEDFG])(\d+)(?:\.\d+(?:E\d+)?)?\)?\)")
_TYPES = re.compile("[RI][SUR]A")
_MANY_ROWS = 65536
_SINGLE, _DOUBLE = 1, 2  # types of real matrices

Column = tuple[list[int], Callable[[int], list[int]], Callable[[int], FloatArray]]
"""Number, first row and words; what reads the next whole numbers, and what reads real ones in so many words."""
Columns = Iterator[Column]


def read_harwell_boeing(path: Path) -> sparse.coo_array:
    """The entries of a file as they stand there, of a triangle where it has one. Raises SceneError about "matrices"."""
    check_file(path)
    try:
        with path.open(encoding="latin-1") as file:
            return _read(path.name, file)
    except SceneError:
        raise
    except (ValueError, IndexError, OverflowError) as error:
        wrong(path.name, f"no Harwell-Boeing file, or damaged ({shown(str(error))})", "write it again")


def _read(name: str, file: TextIO) -> sparse.coo_array:
    _, counts, (kind, *size), formats = [next(file, "").upper().split() for _ in range(4)]
    n_rows, n_columns, n_entries = (int(text) for text in size[:3])
    if not _TYPES.fullmatch(kind):
        wrong(name, f"a matrix of type {shown(kind)}", "write a real symmetric one, assembled: RSA")
    if any(int(count) for count in counts[4:]):
        wrong(name, "right-hand sides beside the matrix", "write it without them, and the forces as job_load.hb")
    forms = _FORMAT.findall("".join(formats))
    if len(forms) < 3:
        raise ValueError(f"formats {' '.join(formats)}")
    lengths = (n_columns + 1, n_entries, n_entries)
    starts, rows, values = (_numbers(file, *each) for each in zip(lengths, forms, strict=False))
    columns = np.repeat(np.arange(n_columns), np.diff(starts).astype(np.int64))
    return sparse.coo_array((values, (rows.astype(np.int64) - 1, columns)), shape=(n_rows, n_columns))


def _numbers(file: TextIO, length: int, form: tuple[str, str]) -> FloatArray:
    """Numbers (length,) in the next lines. form: how many stand in a line, and their width."""
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
    names = names_of_matrices(found, path.name)
    return entries_of_tables({name: found[own] for name, own in names.items()}, files)


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
        yield [column, row, words * (kind if row > 0 else 1)], whole, lambda words: _numbers(file, words // kind, form)


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
