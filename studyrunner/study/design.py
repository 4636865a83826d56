"""A design: points of a study as rows of a table, with columns that are named as axes; from a file or from arrays."""

import csv
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.study.text import result_errors
from studyrunner.system.progress import count
from studyrunner.user_error import UserError

TASK = "task"
"""Column of the table of a plan: it and those behind it say more of the points than the axes before it."""

Codes = NDArray[np.signedinteger[Any]]
CODE = np.int32
"""Type of numbers of points and of values: a study has at most a million points."""

_WHOLE = 2**53  # from here on, numbers without a fraction may have lost theirs
_DENSE = 4  # codes are counted, and not sorted, up to so many for each row
_FIRST = 2  # row of a file with the first point, below the header


def group_rows(codes: Iterable[tuple[Codes, int]]) -> tuple[Codes, Codes]:
    """First rows of the different combinations in columns of codes, each with the number of codes, and for each row
    which of them it has.
    """
    first, rows = np.zeros(1, CODE), np.zeros(1, CODE)
    for own, size in codes:
        if len(first) == len(own):
            # all rows differ already
            break
        keys, most = rows.astype(np.int64) * size + own, len(first) * size
        if most > _DENSE * len(keys):
            _, first, rows = np.unique(keys, return_index=True, return_inverse=True)
            first, rows = first.astype(CODE), rows.astype(CODE)
            continue
        # without sorting; of equal keys the first is written last
        first = np.full(most, -1, CODE)
        first[keys[::-1]] = np.arange(len(keys), dtype=CODE)[::-1]
        there = first >= 0
        first, rows = first[there], np.cumsum(there, dtype=CODE)[keys] - 1
    return first, rows.reshape(-1)


def as_they_come(first: Codes, rows: Codes) -> tuple[Codes, Codes, Codes]:
    """Groups of rows, as of `group_rows`, in the order in which they come first: their first rows, for each row which
    of them it has, and the numbers that the groups had.
    """
    order = np.argsort(first)
    number = np.empty(len(order), CODE)
    number[order] = np.arange(len(order))
    return first[order], number[rows], order.astype(CODE)


@dataclass(frozen=True, eq=False)
class DesignColumn:
    """A column. key: its axis, dotted below [axes]. values: those that differ. codes (n,): their places, by row.

    unit: as the header gives it; None without one.
    """

    key: str
    values: tuple[Any, ...]
    codes: Codes
    unit: str | None = None


@dataclass(frozen=True, eq=False)
class Design:
    """Points of a study, a row each.

    source: its file, or where it was given. columns: by name of the axis in a result. first: number of the first row.
    """

    source: str
    columns: Mapping[str, DesignColumn]
    first: int = 0

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())).codes)

    def groups(self, names: Iterable[str]) -> tuple[Codes, Codes]:
        """As `group_rows`, of columns."""
        first, rows = group_rows((self.columns[name].codes, len(self.columns[name].values)) for name in names)
        return first, np.broadcast_to(rows, self.n)

    @contextmanager
    def errors(self) -> Iterator[None]:
        """A UserError about a value of an axis that is a column names file, row and column."""
        try:
            yield
        except UserError as error:
            first, *others = (self.located(each) for each in error.mistakes)
            raise UserError(first.place, first.key, first.value, first.remedy, tuple(others)) from None

    def located(self, error: UserError) -> UserError:
        """The same, with file, row and column where it is about a value of a column."""
        for column in self.columns.values():
            own, whole = f"axes.{column.key}.", f"{error.key}."
            if whole.startswith(own) or own.startswith(whole):
                wrong, is_flag = error.value, isinstance(error.value, bool)
                # True is 1, too
                places = [place for place, value in enumerate(column.values) if value == wrong]
                place = next((place for place in places if isinstance(column.values[place], bool) == is_flag), -1)
                rows = np.flatnonzero(column.codes == place).tolist()
                return self.error(rows[0] if rows else None, column.key, wrong, error.remedy)
        return error

    def error(self, row: int | None, name: str, value: object, remedy: str) -> UserError:
        """What is wrong in a row, counted from 0, of a column, or with None in all of it."""
        if row is None:
            return UserError(self.source, f"column {name}", None, remedy)
        return UserError(self.source, f"row {row + self.first}, column {name}", value, remedy)


def read_design(points: Any) -> Design:
    """The design in a CSV file with a header; in a table of pandas or a mapping, both of columns by name; or in a pair
    of a matrix and names of its columns. Raises UserError where it is none.
    """
    if isinstance(points, str | Path):
        return _from_file(Path(points), str(points))
    try:
        if isinstance(points, tuple):
            columns, names = list(np.array(points[0], dtype=object, ndmin=2).T), list(points[1])
        else:
            columns, names = [np.array(points[name], dtype=object, ndmin=1) for name in points], list(points)
        return make_design("points", names, [column.tolist() for column in columns])
    except (TypeError, LookupError):
        remedy = "give a CSV file, a table of pandas, arrays by name, or (matrix, names)"
        raise UserError("points", "type", type(points).__name__, remedy) from None


def _from_file(path: Path, source: str) -> Design:
    columns: list[list[Any]] = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header = file.readline()
            delimiter = next((each for each in ";\t" if each in header), ",")
            names, empty = next(csv.reader([header.lstrip("# ")], delimiter=delimiter), []), 0
            if (numbers := _numbers_in(path, delimiter, len(names))) is not None:
                return make_design(source, names, [*numbers.T], _FIRST)
            columns += ([] for _ in names)
            for number, row in enumerate(csv.reader(file, delimiter=delimiter), _FIRST):
                # empty lines at the end are none
                if row and (empty or len(row) != len(names)):
                    remedy = f"give {count(len(names), 'value')}, one for each column"
                    raise UserError(source, f"row {empty or number}", "" if empty else delimiter.join(row), remedy)
                empty = empty or (0 if row else number)
                for column, text in zip(columns, row, strict=False):
                    column.append(_parse(text))
    except (OSError, UnicodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8 with a header and a row a point"
        raise UserError(source, "the file", None, f"give a CSV file that can be read: {reason}") from None
    return make_design(source, names, columns, _FIRST)


def _numbers_in(path: Path, delimiter: str, n_columns: int) -> NDArray[np.float64] | None:
    """Rows (n, n_columns) of a file of numbers alone, a row a line below the header; None of any other."""
    with path.open("rb") as file:
        n_rows = sum(1 for _ in file) - 1
    try:
        # of a file without rows
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            found = np.loadtxt(path, delimiter=delimiter, skiprows=1, comments=None, ndmin=2, encoding="utf-8-sig")
    except ValueError:
        return None
    return found if found.shape == (n_rows, n_columns) and n_rows else None


def _parse(text: str) -> object:
    text = text.strip()
    try:
        return float(text)
    except ValueError:
        return {"true": True, "false": False}.get(text.lower(), text)


def make_design(
    source: str, headers: Sequence[object], values: Sequence[list[Any] | NDArray[np.float64]], first: int = 0
) -> Design:
    """The design with these columns. headers: keys of [axes], which may have a unit behind them, in [ ].

    Of the table of a plan, which has a column `TASK`, only columns before this one are read, and rows that are equal in
    these, as of samples, are one. Raises UserError where there are no rows, a value is none, or a column or else a row
    comes twice.
    """
    is_plan = TASK in headers
    if is_plan:
        n_axes = headers.index(TASK)
        headers, values = headers[:n_axes], values[:n_axes]
    columns: dict[str, DesignColumn] = {}
    design, lengths = Design(source, columns, first), {len(column) for column in values}
    if len(headers) != len(values) or len(lengths) > 1:
        raise UserError(source, "columns", None, "give columns of equal length, and a name for each")
    if not lengths or lengths == {0}:
        raise UserError(source, "points", None, "there are none: give a header with names of axes, and a row a point")
    for header, column in zip(headers, values, strict=True):
        key, _, unit = str(header).partition("[")
        key, name = key.strip(), key.strip().replace(".", "_")
        if not key or name in columns:
            raise design.error(None, key, None, "give each column an axis of its own")
        columns[name] = _column(design, key, unit.strip().removesuffix("]") if unit else None, column)
    firsts, rows = design.groups(columns)
    if is_plan:
        kept = np.sort(firsts)
        columns |= {name: replace(column, codes=column.codes[kept]) for name, column in columns.items()}
    elif len(firsts) < design.n:
        again = int(np.flatnonzero(firsts[rows] != np.arange(design.n))[0])
        one = next(iter(columns.values()))
        remedy = f"leave out this row: it is row {firsts[rows[again]] + first} again"
        raise design.error(again, one.key, one.values[one.codes[again]], remedy)
    return design


def _column(design: Design, key: str, unit: str | None, given: list[Any] | NDArray[np.float64]) -> DesignColumn:
    """A column, in which numbers without a fraction are whole numbers if all are."""
    if isinstance(given, np.ndarray):
        for row in np.flatnonzero(~np.isfinite(given)).tolist():
            raise _not_finite(design, row, key, float(given[row]))
        _, first, rows = np.unique(given, return_index=True, return_inverse=True)
        first, codes, _ = as_they_come(first, rows)
        values = known = given[first].tolist()
    else:
        values = [value.item() if isinstance(value, np.generic) else value for value in given]
        for row, value in enumerate(values):
            if value == "" or not isinstance(value, bool | int | float | str):
                raise design.error(row, key, value or None, "missing: give a number or a name")
            if isinstance(value, float) and not math.isfinite(value):
                raise _not_finite(design, row, key, value)
        places = {value: place for place, value in enumerate(dict.fromkeys(values))}
        known, codes = list(places), np.array([places[value] for value in values], CODE)
    if all(type(value) is float and value.is_integer() and abs(value) < _WHOLE for value in values):
        known = list(map(int, known))
    return DesignColumn(key, tuple(known), codes, unit)


def _not_finite(design: Design, row: int, key: str, value: float) -> UserError:
    return design.error(row, key, value, "give a finite number")


def read_archived_design(path: Path, source: str, keys: Any) -> Design:
    """The design of a result file, in whose study these are the columns. Raises UserError where it is damaged."""
    from studies.hdf5 import open_hdf5

    with result_errors(source), open_hdf5(path) as file:
        arrays = [file[str(key).replace(".", "_")][:] for key in keys]
    # flags are small whole numbers in NetCDF, and texts are bytes
    kinds: dict[str, Callable[[Any], object]] = {"i1": bool, "O": lambda each: _parse(each.decode())}
    columns = [list(map(kinds.get(array.dtype.str[1:], lambda each: each), array.tolist())) for array in arrays]
    return make_design(source, list(keys), columns)
