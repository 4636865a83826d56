"""OP4 files of Nastran (OUTPUT4): real matrices by name, binary or text, dense or sparse. By hand: scipy has none.

A matrix begins with its number of columns and rows, form, type and name. A column follows as its number, the first row,
the number of words, and the values. Where the first row is 0 the column is sparse and consists of strings, each with
its own length and row: packed into one whole number, or as two where there are many rows (BIGMAT, a negative number of
rows). A column behind the last one ends the matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from scipy import sparse

from studies.fe_models.matrices.matrices import LARGEST_FILE, wrong
from studies.fe_models.text import check_file, shown

_MANY_ROWS = 65536
_SINGLE, _DOUBLE = 1, 2  # types of real matrices

Strings = Iterator[tuple[int, int, np.ndarray]]
"""Column and first row, from 1, and values of each string of numbers."""


def read_op4(path: Path) -> dict[str, sparse.coo_array]:
    """All matrices of a file by their names in capitals. Raises SceneError about "matrices"."""
    check_file(path, LARGEST_FILE, "matrices")
    found = {}
    try:
        with path.open("rb") as file:
            binary = b"\0" in file.read(16)
        for name, shape, strings in _binary(path) if binary else _text(path):
            parts = [(np.arange(row, row + len(values)), np.full(len(values), column), values)
                     for column, row, values in strings]  # fmt: skip
            rows, columns, values = (
                np.concatenate(each) if parts else np.empty(0) for each in zip(*parts, strict=True)
            )
            places = rows.astype(np.int64) - 1, columns.astype(np.int64) - 1
            found[name] = sparse.coo_array((values, places), shape=shape)
    except (ValueError, TypeError, IndexError, OverflowError, StopIteration) as error:
        wrong(
            path.name, f"this is no OP4 file, or damaged ({shown(str(error))})", "write it again: OUTPUT4 or EXTSEOUT"
        )
    return found


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
