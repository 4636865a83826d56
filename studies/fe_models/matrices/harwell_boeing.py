"""Harwell-Boeing files (.hb, and .rb of Rutherford-Boeing): a sparse matrix column by column, in fields of fixed width.

Lines: a title; how many lines the file, pointers, rows, values and right-hand sides take; type, size and number of
entries; formats of Fortran. Types are three letters: R or I for real or whole numbers; S where one triangle is written,
U or R where all entries are; A for assembled. scipy reads U alone, and neither exponents with D nor fields that touch.
"""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from scipy import sparse

from studies.fe_models.files import FloatArray, check_file, shown, to_float
from studies.fe_models.matrices.matrices import wrong
from studies.scene_error import SceneError

_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)\(?(?:ES|EN|[IEDFG])(\d+)(?:\.\d+(?:E\d+)?)?\)?\)")
_TYPES = re.compile("[RI][SUR]A")


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
