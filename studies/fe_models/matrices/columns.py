"""Columns of numbers out of large text files, in parts, so that memory stays a few times that of the numbers."""

from __future__ import annotations

import csv
import warnings
from pathlib import Path
from typing import IO, NoReturn

import numpy as np
import pandas as pd
from pandas.io.parsers import TextFileReader

from studies.fe_models.matrices.matrices import LARGEST_ENTRIES, LARGEST_FILE, wrong
from studies.fe_models.text.read_errors import check_file, shown
from studies.scene_error import SceneError

_ROWS_AT_ONCE = 1_000_000
LONGEST_LINE = 1000
"""Characters of a line with numbers."""

_BYTES_AT_ONCE = 2**24


def read_columns(path: Path, separator: str, kinds: tuple[type, ...], comment: str | None = None) -> list[np.ndarray]:
    """Columns of a text file, one array each, of the given types.

    Parameters
    ----------
    path
        Lines of as many numbers as there are kinds.
    separator
        Between the numbers; " " for any blanks.
    kinds
        int or float of each column.
    comment
        What a line begins with that is none of numbers: one character.

    Raises
    ------
    SceneError
        About "matrices": where a line is no such row, with its number.
    """
    check_file(path, LARGEST_FILE, "matrices")
    _check_lines(path)
    parts: list[list[np.ndarray]] = [[] for _ in kinds]
    n_rows = 0
    try:
        with warnings.catch_warnings(), path.open("rb") as file:
            # a row that is longer than the others, and a number that is none of the type
            warnings.simplefilter("error", pd.errors.ParserWarning)
            warnings.simplefilter("ignore", RuntimeWarning)
            with _frames(file, separator, kinds, comment) as frames:
                for frame in frames:
                    n_rows += len(frame)
                    if n_rows > LARGEST_ENTRIES:
                        wrong(path.name, f"more than {LARGEST_ENTRIES} entries", "reduce the model")
                    for place, column in enumerate(frame):
                        parts[place].append(frame[column].to_numpy())
    except SceneError:  # which is a ValueError, too
        raise
    except (ValueError, OverflowError, pd.errors.ParserError, pd.errors.ParserWarning, csv.Error):
        _find_wrong_line(path, separator, kinds, comment)
    if not n_rows:
        wrong(path.name, "no entries in the file", "export it again")
    columns = [np.concatenate(part) for part in parts]
    if not all(np.isfinite(column).all() for column, kind in zip(columns, kinds, strict=True) if kind is float):
        _find_wrong_line(path, separator, kinds, comment)
    return columns


def _check_lines(path: Path) -> None:
    """Raises SceneError where a line is longer than any with numbers: each field of it would become a column."""
    n_lines, open_bytes = 0, 0
    with path.open("rb") as file:
        while part := file.read(_BYTES_AT_ONCE):
            ends = np.flatnonzero(np.frombuffer(part, dtype=np.uint8) == ord("\n"))
            lengths = np.diff(np.concatenate(([-1 - open_bytes], ends, [len(part)])))
            if lengths.max() > LONGEST_LINE:
                number = n_lines + int(lengths.argmax()) + 1
                wrong(path.name, f"line {number} is very long", "export it again, as text")
            n_lines, open_bytes = n_lines + ends.size, int(lengths[-1]) - 1


def _frames(file: IO[bytes], separator: str, kinds: tuple[type, ...], comment: str | None) -> TextFileReader:
    names = [f"c{place}" for place in range(len(kinds))]
    frames: TextFileReader = pd.read_csv(
        file,
        sep=r"\s+" if separator == " " else separator,
        header=None,
        names=names,
        index_col=False,
        dtype=dict(zip(names, ("int64" if kind is int else "float64" for kind in kinds), strict=True)),
        comment=comment,
        chunksize=_ROWS_AT_ONCE,
        encoding="latin-1",
        quoting=csv.QUOTE_NONE,
        na_values=[],
        keep_default_na=False,
        engine="c",
    )
    return frames


def _find_wrong_line(path: Path, separator: str, kinds: tuple[type, ...], comment: str | None) -> NoReturn:
    with path.open(encoding="latin-1") as file:
        number = 0
        while text := file.readline(LONGEST_LINE + 1):
            number += 1
            if comment is not None:
                text = text.partition(comment)[0]
            if not text.strip():
                continue
            fields = text.split() if separator == " " else text.split(separator)
            try:
                good = len(fields) == len(kinds)
                for kind, field in zip(kinds, fields, strict=False):
                    good = good and np.isfinite(float(kind(field))) and abs(float(field)) < 2.0**1000
            except (ValueError, OverflowError):
                good = False
            if not good:
                what = " ".join("whole number" if kind is int else "value" for kind in kinds)
                wrong(path.name, f"line {number} is {shown(text)!r}", f"give lines of {what!r}")
    wrong(path.name, "the file is no table of numbers", "export it again")
