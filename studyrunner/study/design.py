"""A design: points of a study as rows of a table, with columns that are named as axes; from a file or from arrays."""

import csv
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.study.text import result_errors
from studyrunner.system.progress import count
from studyrunner.user_error import UserError

_WHOLE = 2**53  # from here on, numbers without a fraction may have lost theirs
_WITH_UNIT = re.compile(r"(.*?)\s*\[(.*)\]")


def group_rows(codes: Iterable[tuple[NDArray[np.intp], int]]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First rows of the different combinations in columns of codes, each with the number of codes, and for each row
    which of them it has.
    """
    first, rows = np.zeros(1, np.intp), np.zeros(1, np.intp)
    for own, size in codes:
        _, first, rows = np.unique(rows * size + own, return_index=True, return_inverse=True)
    return first, rows.reshape(-1)


@dataclass(frozen=True)
class DesignColumn:
    """A column. key: its axis, dotted below [axes]. values: those that differ. codes (n,): their places, by row.

    unit: as the header gives it; None without one.
    """

    key: str
    values: tuple[Any, ...]
    codes: NDArray[np.intp]
    unit: str | None = None


@dataclass(frozen=True)
class Design:
    """Points of a study, a row each.

    source: its file, or where it was given. columns: by name of the axis in a result. rows_are: what a row is called,
    and the number of the first.
    """

    source: str
    columns: Mapping[str, DesignColumn]
    rows_are: tuple[str, int]

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())).codes)

    def groups(self, names: Sequence[str]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """As `group_rows`, of columns."""
        first, rows = group_rows((self.columns[name].codes, len(self.columns[name].values)) for name in names)
        return first, np.broadcast_to(rows, self.n)

    @contextmanager
    def errors(self) -> Iterator[None]:
        """A UserError about a value of an axis that is a column names file, row and column."""
        try:
            yield
        except UserError as error:
            first, *others = (self._located(each) for each in error.mistakes)
            raise UserError(first.place, first.key, first.value, first.remedy, tuple(others)) from None

    def _located(self, error: UserError) -> UserError:
        for column in self.columns.values():
            own, whole = f"axes.{column.key}.", f"{error.key}."
            if whole.startswith(own) or own.startswith(whole):
                alike = (isinstance(each, bool) == isinstance(error.value, bool) for each in column.values)
                pairs = zip(alike, column.values, strict=True)
                place = next(
                    (place for place, (same, value) in enumerate(pairs) if same and value == error.value), None
                )
                if place is None:
                    return UserError(self.source, f"column {column.key}", None, error.remedy)
                return self.error(int(np.argmax(column.codes == place)), column.key, error.value, error.remedy)
        return error

    def error(self, row: int, name: str, value: object, remedy: str) -> UserError:
        """What is wrong in a row, counted from 0, of a column."""
        called, first = self.rows_are
        return UserError(self.source, f"{called} {row + first}, column {name}", value, remedy)


def read_design(points: object) -> Design:
    """The design in a CSV file with a header; in a table of pandas or a mapping, both of columns by name; or in a pair
    of a matrix and names of its columns. Raises UserError where it is none.
    """
    if isinstance(points, Design):
        return points
    if isinstance(points, str | Path):
        return _from_file(Path(points), str(points))
    if isinstance(points, tuple) and len(points) == 2:
        matrix, names = np.atleast_2d(np.asarray(points[0], dtype=object)), list(points[1])
        if matrix.ndim != 2 or matrix.shape[1] != len(names):
            raise UserError("points", "names", names, f"give a name for each of {matrix.shape[-1]} columns")
        return make_design("points", names, matrix.T.tolist(), ("row", 0))
    try:
        table: Any = points
        names = list(table)
        columns = [np.atleast_1d(np.asarray(table[name], dtype=object)).tolist() for name in names]
    except (TypeError, KeyError, IndexError):
        remedy = "give a CSV file, a table of pandas, arrays by name, or (matrix, names)"
        raise UserError("points", "type", type(points).__name__, remedy) from None
    return make_design("points", names, columns, ("row", 0))


def _from_file(path: Path, source: str) -> Design:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header = file.readline()
            delimiter = next((each for each in ";\t" if each in header), ",")
            names = next(csv.reader([header.lstrip("# ")], delimiter=delimiter), [])
            rows = list(csv.reader(file, delimiter=delimiter))
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8 with a header and a row a point"
        raise UserError(source, "the file", None, f"give a CSV file that can be read: {reason}") from None
    while rows and not rows[-1]:
        rows.pop()
    for number, row in enumerate(rows):
        if len(row) != len(names):
            remedy = f"give {count(len(names), 'value')}, one for each column"
            raise UserError(source, f"row {number + 2}", delimiter.join(row), remedy)
    columns = [[_parse(text) for text in column] for column in zip(*rows, strict=True)]
    return make_design(source, names, columns or [[] for _ in names], ("row", 2))


def _parse(text: str) -> object:
    text = text.strip()
    try:
        return float(text)
    except ValueError:
        return {"true": True, "false": False}.get(text.lower(), text)


def make_design(
    source: str, headers: Sequence[object], values: Sequence[Sequence[Any]], rows_are: tuple[str, int]
) -> Design:
    """The design with these columns. headers: keys of [axes], which may have a unit behind them, in [ ].

    Raises UserError where it has no rows, a value is none, or a column or a row comes twice.
    """
    names = [str(header).strip() for header in headers]
    parts = [match.groups() if (match := _WITH_UNIT.fullmatch(name)) else (name, None) for name in names]
    design = Design(source, {}, rows_are)
    columns: dict[str, DesignColumn] = {}
    lengths = {len(column) for column in values}
    if not names or lengths == {0} or not lengths:
        raise UserError(source, "points", None, "there are none: give a header with names of axes, and a row a point")
    if len(lengths) > 1:
        raise UserError(source, "points", sorted(lengths), "give columns of equal length")
    for (key, unit), column in zip(parts, values, strict=True):
        if not key or key.replace(".", "_") in columns:
            raise UserError(source, f"column {key or len(columns) + 1}", None, "give each column an axis of its own")
        column = [value.item() if isinstance(value, np.generic) else value for value in column]
        for row, value in enumerate(column):
            if value is None or value == "" or not isinstance(value, bool | int | float | str):
                raise design.error(row, key, None if value == "" else value, "missing: give a number or a name")
            if isinstance(value, float) and not math.isfinite(value):
                raise design.error(row, key, value, "give a finite number")
        if all(type(value) is float and value.is_integer() and abs(value) < _WHOLE for value in column):
            column = [int(value) for value in column]
        known = {value: place for place, value in enumerate(dict.fromkeys(column))}
        codes = np.fromiter((known[value] for value in column), np.intp, len(column))
        columns[key.replace(".", "_")] = DesignColumn(key, tuple(known), codes, unit)
    design = Design(source, columns, rows_are)
    first, rows = design.groups(list(columns))
    if len(first) < design.n:
        again = int(np.flatnonzero(first[rows] != np.arange(design.n))[0])
        name, called = next(iter(columns.values())), f"{rows_are[0]} {first[rows[again]] + rows_are[1]}"
        remedy = f"leave out this row: it is {called} again"
        raise design.error(again, name.key, name.values[name.codes[again]], remedy)
    return design


def read_archived_design(path: Path, source: str, keys: Any) -> Design:
    """The design of a result file, in whose study these are the columns. Raises UserError where it is damaged."""
    from studies.hdf5 import open_hdf5

    with result_errors(source), open_hdf5(path) as file:
        arrays = [file[str(key).replace(".", "_")][:] for key in keys]
    # flags are small whole numbers in NetCDF, and texts are bytes
    kinds: dict[str, Callable[[Any], object]] = {"i1": bool, "O": lambda each: _parse(each.decode())}
    columns = [list(map(kinds.get(array.dtype.str[1:], lambda each: each), array.tolist())) for array in arrays]
    return make_design(source, list(keys), columns, ("point", 0))
