"""`scene.sectors` of a study: how the sectors of a ring differ, from a CSV file.

The first line names the columns and their units, `sector,frequency_percent,friction,wear_depth_um`; then there is a row
for each sector.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from solver.model import FloatArray
from studies.sectors import LARGEST_DEVIATION
from studyrunner.measured import UNITS, read_table
from studyrunner.user_error import UserError, Verbatim

SECTOR = "sector"
_COLUMNS = {
    "frequency": ("1", -LARGEST_DEVIATION, LARGEST_DEVIATION),
    "friction": ("1", 0.0, np.inf),
    "wear_depth": ("m", 0.0, np.inf),
}
"""Columns beside `sector`, as `Sectors` has them: unit, least and largest number."""


def read_sectors(given: object, source: str, folder: Path) -> object:
    """The key with the numbers of its file; as it is where it names none. folder: relative paths start here.

    Raises UserError where a file is not there or not right: with the column, and the row.
    """
    if not isinstance(given, Mapping) or given.keys() != {"file"}:
        return given
    path = folder / str(given["file"])
    if not path.is_file():
        remedy = f"give the path of a CSV file: {path} is not there"
        raise UserError(source, "scene.sectors.file", given["file"], remedy)
    return {"file": str(given["file"]), **_read_columns(path)}


def _read_columns(path: Path) -> dict[str, list[float]]:
    table, found, sectors = read_table(path), dict[str, FloatArray](), None
    for header in table.dtype.names or ():
        name = next((each for each in _COLUMNS if f"{header}_".startswith(f"{each}_")), "")
        unit = header[len(name) + 1 :]
        if header == SECTOR:
            sectors = table[header]
        elif name and unit in UNITS[_COLUMNS[name][0]] and name not in found:
            found[name] = table[header] * UNITS[_COLUMNS[name][0]][unit]
        else:
            remedy = "give the columns sector, frequency or frequency_percent, friction, wear_depth_um, each once"
            raise UserError(str(path), f"column {header}", Verbatim("unknown"), remedy)
    if sectors is None or not found or not sectors.size:
        remedy = "give a first line such as sector,frequency,friction,wear_depth_um, and a row for each sector"
        raise UserError(str(path), "line 1", Verbatim(f'"{",".join(table.dtype.names or ())[:60]}"'), remedy)
    seen = set[float]()
    for row, sector in enumerate(sectors.tolist(), 2):
        if not (sector >= 0.0 and sector == round(sector)) or sector in seen:
            remedy = "give each sector once, whole numbers from 0 on"
            raise UserError(str(path), f"column {SECTOR}, row {row}", sector, remedy)
        seen.add(sector)
    if missing := [number for number in range(len(seen)) if number not in seen]:
        remedy = f"give it a row: {len(seen)} sectors are 0 to {len(seen) - 1}"
        raise UserError(str(path), f"column {SECTOR}", Verbatim(f"sector {missing[0]} is missing"), remedy)
    for name, values in found.items():
        _, low, high = _COLUMNS[name]
        if (wrong := np.flatnonzero(~((values >= low) & (values <= high) & np.isfinite(values)))).size:
            limits = f"{low:g} to {high:g}" if high < np.inf else f"{low:g} or more"
            where = f"column {name}, row {wrong[0] + 2}"
            raise UserError(str(path), where, float(values[wrong[0]]), f"give a number of {limits}")
    order = np.argsort(sectors)
    return {name: values[order].tolist() for name, values in found.items()}
