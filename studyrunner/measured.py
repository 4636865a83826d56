"""[measured] of a study: what was measured on a joint, with standard deviations; from files or as lists of numbers.

Responses may be in files of universal format (`universal_file`). Any other file has a first line with the names of its
columns and their units, `cycle,worn_volume_mm3,standard_deviation_mm3`, and a row for each number. A depth is positive
where material is missing.
"""

import contextlib
import itertools
import re
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field

from studyrunner.universal_file import SUFFIXES, read_response
from studyrunner.user_error import UserError, Verbatim
from studyrunner.values import Listed, NotNegative, Positive, Section, Wrong, listed

Over = Literal["cycle", "x", "frequency", "modal_amplitude"]


class _Quantity(NamedTuple):
    """A measured quantity. units: of its values. over: what it may be given over. variables: of the result, that it is
    compared with. column: as its column is named, by default as its key.
    """

    units: str
    over: tuple[Over, ...]
    variables: tuple[str, ...]
    column: str = ""


QUANTITIES = {
    "profile": _Quantity("m", ("x",), ("wear_depth", "wear_depth_error"), "depth"),
    "worn_volume": _Quantity("m3", ("cycle",), ("worn_volume", "worn_volume_error")),
    "wear_depth": _Quantity("m", ("cycle",), ("wear_depth_max", "wear_depth_max_error")),
    "response_amplitude": _Quantity("m", ("cycle", "frequency"), ("response_amplitude", "response_error")),
    "excitation_frequency": _Quantity("Hz", ("cycle",), ("excitation_frequency", "excitation_frequency_error")),
    "natural_frequency": _Quantity(
        "Hz", ("cycle", "modal_amplitude"), ("natural_frequency", "natural_frequency_error")
    ),
    "damping_ratio": _Quantity("1", ("cycle", "modal_amplitude"), ("damping_ratio", "damping_ratio_error")),
}
"""What may be measured, by its key; of `profile` the depth over the place x."""

FEWEST_OF_PROFILE = 5
"""Places of a profile below which its shape is not known."""

_ABSCISSAS = {"cycle": "1", "x": "m", "frequency": "Hz", "modal_amplitude": "m_sqrtkg"}
_LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9}
UNITS: Mapping[str, Mapping[str, float]] = {
    "1": {"": 1.0, "percent": 1e-2},
    "m": _LENGTHS,
    "m3": {f"{unit}3": size**3 for unit, size in _LENGTHS.items()},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "m_sqrtkg": {"m_sqrtkg": 1.0},
}
"""For each unit of the program what a column may be in, with its size; as `read_table` writes names of columns."""


class Measurement(Section):
    """Numbers that were measured, in SI: `value` at places `at`, each with a standard deviation.

    over: what `at` is. cycle: count at which a profile, or a response over the frequency, was measured; by default the
    last one, and the first one, of the study. surface: of a profile; response: of an amplitude, by default the first
    one. share: of the computed wear. file: where they are from; record, force, between: what of a universal file.
    """

    over: Over = Field("cycle", description='what `at` is: "cycle", "x", m, "frequency", Hz, or "modal_amplitude"')
    at: Annotated[Listed[float], Field(min_length=1)] = Field(description="places, or counts, of the values")
    value: Annotated[Listed[float], Field(min_length=1)] = Field(description="in SI; file in place of both")
    standard_deviation: Annotated[tuple[Positive, ...], BeforeValidator(lambda given: tuple(listed(given)))] = Field(
        description="in SI, one or one for each value; or a column of the file"
    )
    cycle: NotNegative | None = Field(None, description="at which a profile or a response over frequency was measured")
    surface: str = Field("", description="of a profile")
    share: Annotated[float, Field(gt=0, le=1)] = Field(
        1.0, description="of the computed wear, that of both bodies, which the measured body has"
    )
    response: str = Field("", description="of an amplitude")
    file: str = Field(
        "", description="CSV file with the numbers, or universal file (.uff, .unv), beside the study file"
    )
    record: int | None = Field(None, ge=1, description="number of the response among those of a universal file")
    force: Positive | None = Field(None, description="of a universal file: excitation amplitude of the amplitude, N")
    between: Annotated[tuple[NotNegative, NotNegative], BeforeValidator(lambda given: tuple(listed(given)))] | None = (
        Field(None, description="of a universal file: from and to which frequency, Hz")
    )

    def rules(self) -> Iterator[Wrong]:
        """As many values as places, and one deviation or as many."""
        if len(self.value) != len(self.at):
            yield Wrong("value", None, f"give as many values as places, {len(self.at)}")
        if len(self.standard_deviation) not in (1, len(self.value)):
            yield Wrong("standard_deviation", None, f"give one, or one for each of {len(self.value)} values")

    @property
    def numbers(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Places, values and standard deviations, each (n,)."""
        at, value = np.array(self.at), np.array(self.value)
        return at, value, np.broadcast_to(np.array(self.standard_deviation), value.shape)


_Several = Annotated[tuple[Measurement, ...], BeforeValidator(lambda given: tuple(listed(given)))]


class MeasuredSection(Section):
    """[measured]: each key one measurement or a list of them; what computed values may be off beside what was measured.

    Numbers of the study do not depend on it.
    """

    COUNTED: ClassVar = ("worn_volume", "wear_depth")
    profile: _Several = Field((), description="worn profile of a surface: {file, standard_deviation, cycle, surface}")
    worn_volume: _Several = Field((), description="over the cycles")
    wear_depth: _Several = Field((), description="of the deepest pair, over the cycles")
    response_amplitude: _Several = Field(
        (), description="over the cycles or the frequency; of a universal file {file, record, force, between}"
    )
    excitation_frequency: _Several = Field((), description="that of a followed resonance, over the cycles")
    natural_frequency: _Several = Field((), description="of a mode, over the cycles or the modal amplitude")
    damping_ratio: _Several = Field((), description="of a mode, over the cycles or the modal amplitude")
    discrepancy: NotNegative = Field(
        0.0, description="share of a measured value by which the model may be off, as a standard deviation"
    )

    @property
    def all(self) -> tuple[tuple[str, Measurement], ...]:
        """Every measurement with its key."""
        return tuple((name, each) for name in QUANTITIES for each in getattr(self, name))

    def rules(self) -> Iterator[Wrong]:
        """Each is given over what it can be, and profiles have a shape."""
        for name, each in self.all:
            allowed = QUANTITIES[name].over
            if each.over not in allowed:
                yield Wrong(f"{name}.over", each.over, f"give {' or '.join(allowed)}")
            if name == "profile" and len(each.at) < FEWEST_OF_PROFILE:
                yield Wrong(name, Verbatim(f"{len(each.at)} places"), f"give at least {FEWEST_OF_PROFILE}")
            if name == "profile" and np.median(each.value) < 0.0:
                remedy = "give depths that are positive where material is missing: turn the sign of the column"
                yield Wrong(name, Verbatim("most depths are negative"), remedy)
            if any(value <= 0.0 for value in each.value) and name not in ("profile", *self.COUNTED, "damping_ratio"):
                yield Wrong(f"{name}.value", min(each.value), "give numbers above 0")


def read_measured(table: object, source: str, folder: Path) -> dict[str, object]:
    """The table [measured] with the numbers of its files. folder: relative paths start here.

    Raises UserError where a file is not there or not right.
    """
    if not isinstance(table, Mapping):
        raise UserError(source, "measured", table, "give a table [measured] with keys")
    found: dict[str, object] = {}
    for name, given in table.items():
        if name not in QUANTITIES:
            found[name] = given
            continue
        tables = [dict(each) if isinstance(each, Mapping) else each for each in listed(given)]
        for each in tables:
            if isinstance(each, dict) and "file" in each and "value" not in each:
                path, key = folder / str(each["file"]), f"measured.{name}.file"
                if not path.is_file():
                    raise UserError(source, key, each["file"], f"give the path of a file: {path} is not there")
                universal = path.suffix.lower() in SUFFIXES
                if universal and name != "response_amplitude":
                    raise UserError(source, key, each["file"], "give a CSV file: universal files hold responses alone")
                own = read_response(path, f"measured.{name}", each) if universal else read_columns(path, name)
                if "standard_deviation" not in {*each, *own}:
                    remedy = "give it, in SI, or a column of the file: how well is known decides what fits"
                    raise UserError(source, f"measured.{name}.standard_deviation", None, remedy)
                each |= own if "standard_deviation" not in each else {**own, **each}
        found[name] = tables
    return found


def read_columns(path: Path, name: str) -> dict[str, object]:
    """`over`, `at`, `value` and perhaps `standard_deviation` of a measurement, in SI, from a CSV file; in rising order.

    name: of `QUANTITIES`. Raises UserError with file and row.
    """
    table, quantity = read_table(path, "x_mm,depth_um"), QUANTITIES[name]
    column, found, over = quantity.column or name, dict[str, NDArray[np.float64]](), ""
    units: dict[str, str] = {each: _ABSCISSAS[each] for each in quantity.over}
    units |= {column: quantity.units, "standard_deviation": quantity.units}
    for header, (wanted, of) in product(table.columns, units.items()):
        match = re.fullmatch(rf"{wanted}s?_?(.*)", header, re.IGNORECASE)
        if match and match[1] in UNITS[of]:
            found[wanted] = table.numbers(header) * UNITS[of][match[1]]
            over = wanted if wanted in _ABSCISSAS else over
    if not over or column not in found:
        possible = " or ".join(_header(each, _ABSCISSAS[each]) for each in quantity.over)
        remedy = f"give a first line that names {possible}, and {_header(column, quantity.units)}, with their units"
        raise UserError(str(path), "line 1", table.header, remedy)
    wrong = np.flatnonzero(~np.isfinite([*found.values()]).all(axis=0))
    if not table.lines or wrong.size:
        where = f"row {table.lines[wrong[0]]}" if wrong.size else "the file"
        raise UserError(str(path), where, None, "give at least one row, and finite numbers in all columns")
    order = np.argsort(found[over], kind="stable")
    values = {"at": found[over], "value": found[column]}
    values |= {"standard_deviation": found["standard_deviation"]} if "standard_deviation" in found else {}
    return {"over": over} | {key: each[order].tolist() for key, each in values.items()}


def _header(name: str, units: str) -> str:
    shown = [unit for unit in UNITS[units] if unit and unit != "µm" and not unit.startswith("µ")]
    return f"{name}_{' or _'.join(shown)}" if units != "1" else name


class CsvTable(NamedTuple):
    """Columns of a CSV file by name, each (n,) texts, and the lines (n,) on which the rows stand."""

    columns: dict[str, tuple[str, ...]]
    lines: tuple[int, ...]

    @property
    def header(self) -> Verbatim:
        """The names as they are shown."""
        return Verbatim(f'"{",".join(self.columns)[:60]}"')

    def numbers(self, name: str) -> NDArray[np.float64]:
        """A column (n,), NaN where there is no number. Commas that are in a text are decimal ones."""
        found = np.full(len(self.lines), np.nan)
        for place, text in enumerate(self.columns[name]):
            with contextlib.suppress(ValueError):
                found[place] = float(text.replace(",", "."))
        return found


def read_table(path: Path, example: str) -> CsvTable:
    """The columns of a CSV file, between commas, semicolons or tabs. A name with a unit, `depth [um]`, is `depth_um`.

    example: of a first line. Raises UserError with file and row.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").replace('"', "").splitlines()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        remedy = f"give a CSV file with a first line such as {example}: {reason}"
        raise UserError(str(path), "the file", None, remedy) from None
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip(" ,;\t")]
    # numpy writes the first line as a comment; other comments may be above it
    begin = sum(1 for _ in itertools.takewhile(lambda row: row[1].startswith("#"), rows))
    begin -= bool(begin and rows[begin:] and re.match(r"[-+.\d\s]", rows[begin][1]))
    header = rows[begin][1].lstrip("# ") if rows[begin:] else ""
    rows = [row for row in rows[begin + 1 :] if not row[1].startswith("#")]
    delimiter = next((each for each in ";\t" if each in header), ",")
    named = header.rstrip(f"{delimiter} ").replace("%", "percent").split(delimiter) if header else []
    names = [re.sub(r"\W+", "_", name).strip("_") for name in named]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(str(path), f"column {twice[0]}", Verbatim("given twice"), "give each column once")
    found = []
    for number, line in rows:
        cells = [cell.strip() for cell in line.split(delimiter)]
        # rows may end with a comma that the header does not have
        if len(cells) < len(names) or any(cells[len(names) :]):
            remedy = f"give {len(names)} values, one for each column, and numbers with decimal points"
            raise UserError(str(path), f"row {number}", line, remedy)
        found.append(cells[: len(names)])
    columns = zip(*found, strict=True) if found else [()] * len(names)
    return CsvTable(dict(zip(names, columns, strict=True)), tuple(number for number, _ in rows))


class Profile(NamedTuple):
    """A measured profile. name: of its file. x, depth (n,): m, depth positive where material is missing."""

    name: str
    x: NDArray[np.float64]
    depth: NDArray[np.float64]


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file: a header such as `x_mm,depth_um`, then a row for each position. Raises UserError."""
    found: dict[str, Any] = read_columns(path, "profile")
    return Profile(path.name, np.array(found["at"]), np.array(found["value"]))
