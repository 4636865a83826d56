"""`worn` of [scene]: a joint that is worn before its history begins, by depths that are given or those of a result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field

from studyrunner.study.mistakes import Mistakes, check_table
from studyrunner.study.scene_axes import SceneAxis
from studyrunner.study.study_of_result import check_result_file
from studyrunner.system.progress import count as counted
from studyrunner.user_error import UserError, Verbatim, WrongValueError
from studyrunner.values import NotNegative, Section, Wrong, listed, once

if TYPE_CHECKING:
    import xarray as xr

AXIS = "worn_cycle"
"""Name of the axis of several worn states."""


def _listed(value: object) -> object:
    return tuple(listed(value))


def _states(value: object) -> object:
    """Depths of all pairs, one number or one for each, of one state or of a list of states."""
    several = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
    return tuple(_listed(state) for state in listed(value)) if several else (_listed(value),)


_Depths = Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False)]
_Counts = Annotated[tuple[NotNegative, ...], BeforeValidator(_listed), AfterValidator(once)]


class Worn(Section):
    """Worn states of a joint.

    depth: of each state, m, of each pair, or one number for all pairs. cycle: cycle count of each state; empty where
    the depths are given. result: file that the depths are from.
    """

    depth: Annotated[tuple[_Depths, ...], BeforeValidator(_states)] = Field(
        description="m, of each pair or of all pairs"
    )
    cycle: _Counts = Field((), description="cycle counts of the result")
    result: str = Field("", description="result file")

    def rules(self) -> Iterator[Wrong]:
        """Each state has a cycle count, or none where there is one state."""
        if len(self.depth) != max(1, len(self.cycle)):
            found = Verbatim(f"{len(self.depth)} states with {len(self.cycle)} cycle counts")
            remedy = "give one cycle count in scene.worn.cycle for each state, or one state without a count"
            yield Wrong("depth", found, remedy)

    def depths(self, n_contact: int) -> tuple[float, ...]:
        """Depths (n_contact,), m, of the only state. Raises WrongValueError where there are others than pairs."""
        (depth,) = self.depth
        if len(depth) not in (1, n_contact):
            remedy = f"give one depth, or one for each pair: the scene has {counted(n_contact, 'contact pair')}"
            raise WrongValueError(Verbatim(f"there are {counted(len(depth), 'depth')}"), remedy)
        return depth * n_contact if len(depth) == 1 else depth


class _OfResult(Section):
    """The table `worn` with a result file; other keys select a point of the result by values of its axes."""

    model_config = ConfigDict(extra="allow")

    result: str = Field(description="path of a result file; or depth in place of a result")
    cycle: Annotated[_Counts, Field(min_length=1)] = Field(description="cycle counts of the result")


def read_worn(table: object, source: str, folder: Path) -> dict[str, Any]:
    """The table `worn` with depths, those of a result file read from the file. folder: relative paths start here.

    table: as the study file has it: {result, cycle, ...}, where other keys select a point of the result, or {depth}.

    Raises UserError where the table or the result file is wrong.
    """
    import xarray as xr  # where it is used: it takes a while to load

    if not isinstance(table, Mapping):
        remedy = 'give {result = "OUT.nc", cycle = [...]} with the axes of a point, or {depth = ...}'
        raise UserError(source, "scene.worn", table, remedy)
    if "depth" in table:
        worn = check_table(Worn, table, source, "scene.worn")
        return {"depth": [list(each) for each in worn.depth], "cycle": list(worn.cycle), "result": worn.result}
    given = check_table(_OfResult, table, source, "scene.worn")
    path = folder / given.result
    if not path.exists():
        remedy = "there is no such file: give a result file of run-study, relative to the study file"
        raise UserError(source, "scene.worn.result", given.result, remedy)
    check_result_file(path, str(path))
    try:
        with xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False) as dataset:
            depth = _depths_in(dataset, given.model_extra or {}, given.cycle, source)
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, IndexError):
        # what the libraries raise where a file is no result, or damaged
        remedy = "give a result file of run-study that is whole"
        raise UserError(str(path), "the file", Verbatim("damaged"), remedy) from None
    return {"depth": depth.tolist(), "cycle": list(given.cycle), "result": given.result}


def _depths_in(dataset: xr.Dataset, point: Mapping[str, object], cycle: Sequence[float], source: str) -> Any:
    """Depths (n_states, n_contact), m, of a point of a result at cycle counts."""
    if "wear_depth" not in dataset:
        raise UserError(source, "scene.worn.result", None, "give a result with wear_depth among its variables")
    depths, found = dataset["wear_depth"], Mistakes(source)
    axes = [str(name) for name in depths.dims[:-2]]
    for name in point.keys() - set(axes):
        remedy = f"unknown key, give result, cycle, depth or an axis of the result: {', '.join(axes)}"
        found.add(f"scene.worn.{name}", point[name], remedy)
    places: dict[str, Any] = {}
    for name in axes:
        values = dataset[name].values.tolist()
        wanted = point.get(name, values[0] if len(values) == 1 else None)
        places[name] = _place(f"scene.worn.{name}", values, wanted, found)
    counts = dataset["cycle"].values.tolist()
    places["cycle"] = [_place("scene.worn.cycle", counts, count, found) for count in cycle]
    found.raise_any()
    chosen = np.asarray(depths.isel(places).values, dtype=np.float64)
    for count, row in zip(cycle, chosen, strict=True):
        if not np.isfinite(row).all():
            remedy = "give an earlier cycle count: the result does not hold the depths of this one"
            raise UserError(source, "scene.worn.cycle", count, remedy)
    return chosen


def _place(key: str, values: Sequence[Any], wanted: Any, found: Mistakes) -> int:
    """Index of a value along an axis of a result; 0, and a mistake, where it is not there."""
    numbers = isinstance(wanted, float | int) and not isinstance(values[0], str)
    for place, value in enumerate(values):
        if (numbers and math.isclose(value, wanted, rel_tol=1e-12)) or value == wanted:
            return place
    if numbers:
        values = sorted(values, key=lambda value: abs(value - wanted))
    found.add(key, wanted, f"give a value of the result: {', '.join(map(str, values[:10]))}")
    return 0


def worn_axis(table: Mapping[str, Any], name: str) -> tuple[SceneAxis, ...]:
    """The axis of worn states; none where their cycle counts are not known. table: as `read_worn` gives it."""
    counts = table.get("cycle", [])
    meaning = "number of vibration cycles that have worn the joint before"
    return (SceneAxis(name, "scene", ("worn",), tuple(counts), "1", meaning),) if counts else ()
