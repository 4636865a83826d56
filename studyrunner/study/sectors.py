"""`scene.sectors` of a study: how the sectors of a ring differ, from a CSV file.

The first line names the columns and their units, `sector,frequency_percent,friction,wear_depth_um,result`; then there
is a row for each sector.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from solver.model import FloatArray
from studies.sectors import LARGEST_DEVIATION
from studyrunner.measured import UNITS, CsvTable, read_table
from studyrunner.study.scene_section import read_worn
from studyrunner.user_error import UserError, Verbatim

_EXAMPLE = "sector,frequency_percent,friction,wear_depth_um"
_COLUMNS = {
    "sector": ("1", 0.0, np.inf),
    "frequency": ("1", -LARGEST_DEVIATION, LARGEST_DEVIATION),
    "friction": ("1", 0.0, np.inf),
    "wear_depth": ("m", 0.0, np.inf),
}
"""Columns of numbers, as `Sectors` has them: unit, least and largest number."""
_ALL = "sector, frequency or frequency_percent, friction, wear_depth_um, result"


def read_sectors(given: object, source: str, folder: Path, *, in_result: bool) -> object:
    """The key with the numbers of its file; as it is where it names none, or a result has them. folder: relative paths
    start here. in_result: whether the key is that of a result.

    Raises UserError where a file is not there or not right: with the column, and the row.
    """
    if not isinstance(given, Mapping) or "file" not in given:
        return given
    path = folder / str(given["file"])
    if given.keys() != {"file"} and (in_result or not path.is_file()):
        return given
    if not path.is_file():
        raise UserError(source, "scene.sectors.file", given["file"], "give the path of a CSV file that is there")
    found = _read_columns(path, folder)
    for name, values in found.items():
        if given.get(name, values) != values:
            remedy = f"leave it out: {path.name} has other numbers"
            raise UserError(source, f"scene.sectors.{name}", Verbatim("given twice"), remedy)
    return {**given, **found}


def _read_columns(path: Path, folder: Path) -> dict[str, list[float]]:
    table, found = read_table(path, _EXAMPLE), dict[str, FloatArray]()
    if "sector" not in table.columns or len(table.columns) < 2 or not table.lines:
        remedy = f"give a first line such as {_EXAMPLE}, and a row for each sector"
        raise UserError(str(path), "line 1", table.header, remedy)
    for header in table.columns:
        if header == "result":
            continue
        name = next((each for each in _COLUMNS if f"{header}_".startswith(f"{each}_")), "")
        size = UNITS[_COLUMNS[name][0]].get(header[len(name) + 1 :]) if name else None
        if size is None or name in found:
            raise UserError(str(path), f"column {header}", Verbatim("unknown"), f"give the columns {_ALL}, each once")
        found[name] = size * _numbers(path, table, header, *(limit / size for limit in _COLUMNS[name][1:]))
    sectors = found.pop("sector").tolist()
    for place, (line, sector) in enumerate(zip(table.lines, sectors, strict=True)):
        if sector != round(sector) or sector in sectors[:place]:
            remedy = "give each sector once, whole numbers from 0 on"
            raise UserError(str(path), f"column sector, row {line}", Verbatim(f"{sector:g}"), remedy)
    order = np.argsort(sectors)
    if missing := [number for number, place in enumerate(order.tolist()) if sectors[place] != number]:
        remedy = f"give each of the sectors 0 to {max(sectors):g} a row: they are counted from 0"
        raise UserError(str(path), "column sector", Verbatim(f"sector {missing[0]} is missing"), remedy)
    if "result" in table.columns:
        worn = _worn(path, table, folder)
        found["wear_depth"] = found.get("wear_depth", np.zeros(len(order)))[:, None] + worn
    return {name: values[order].ravel().tolist() for name, values in found.items()}


def _numbers(path: Path, table: CsvTable, header: str, low: float, high: float) -> FloatArray:
    """A column (n,), in its own unit."""
    values = table.numbers(header)
    wrong = np.flatnonzero(~((values >= low) & (values <= high) & np.isfinite(values)))
    if wrong.size:
        limits = f"{low:g} to {high:g}" if high < np.inf else f"{low:g} or more"
        shown = Verbatim(f'"{table.columns[header][wrong[0]]}"')
        where = f"column {header}, row {table.lines[wrong[0]]}"
        raise UserError(str(path), where, shown, f"give a number of {limits}")
    return values


def _worn(path: Path, table: CsvTable, folder: Path) -> FloatArray:
    """Depths (n, n_pairs), m, at the end of the results of one sector; 0 where none is named."""
    found = dict[int, tuple[float, ...]]()
    for place, (line, name) in enumerate(zip(table.lines, table.columns["result"], strict=True)):
        where, first = f"column result, row {line}", next(iter(found.values()), ())
        if name:
            try:
                found[place] = read_worn({"result": name}, str(path), folder).depth[0]
            except UserError as error:
                raise UserError(str(path), where, name, error.remedy) from None
            if first and len(found[place]) != len(first):
                both = f"the first one has {len(first)} pairs, this one {len(found[place])}"
                raise UserError(str(path), where, name, f"give results of one scene: {both}")
    worn = np.zeros((len(table.lines), max(map(len, found.values()), default=1)))
    for place, depths in found.items():
        worn[place] = depths
    return worn
