"""Axes that are keys of [scene] or [wear]: friction, speed, mesh, a threshold, the factor of a surface."""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from studies.scene_error import remedy_of
from studyrunner.study.mistakes import Mistakes, flat_errors, tables_in
from studyrunner.study.sections import SOLVER_AXES, AxesSection, WearSection
from studyrunner.user_error import WrongValueError
from studyrunner.values import Wrong, read_axis

Table = dict[str, Any]
AxisValue = float | int | bool | str

_MOST_COMBINATIONS = 10_000  # each of them is checked, which takes 0.2 ms
_UNITS = {"-": "1", "1": "1", "degrees": "degree", "rpm": "rpm"}
_UNITS |= {name: name for name in ("Hz", "N", "m", "m2", "Pa", "1/Pa", "N/m", "N/m3", "N s/m", "kg", "kg/m3", "J/m2")}


@dataclass(frozen=True)
class SceneAxis:
    """An axis of a study whose values belong to a key of [scene] or [wear].

    name: of the dimension. table, key: the key; a second name in `key` is that of a surface or of a key in a table.
    values: in the order of the study file. units, meaning: as in the description of the key.
    """

    name: str
    table: Literal["scene", "wear"]
    key: tuple[str, ...]
    values: tuple[AxisValue, ...]
    units: str
    meaning: str

    @property
    def dotted(self) -> str:
        """Name of the key in the study file, below its table."""
        return ".".join(self.key)


def take_scene_axes(tables: Mapping[str, Any], scene: type[BaseModel], found: Mistakes) -> tuple[SceneAxis, ...]:
    """Axes that are keys of [scene] or [wear], which are taken out of the table [axes].

    tables: of the study file. scene: what [scene] of this model consists of.
    """
    axes: list[SceneAxis] = []
    for name in [name for name in tables["axes"] if name not in AxesSection.model_fields]:
        of_scene = name in scene.model_fields
        if not of_scene and name not in WearSection.AXES:
            continue
        value = tables["axes"].pop(name)
        table: Literal["scene", "wear"] = "scene" if of_scene else "wear"
        for inner, values in value.items() if is_table(value) else [(None, value)]:
            key = (name,) if inner is None else (name, str(inner))
            wrong = _wrong_place(tables[table], table, key, values)
            of_axis = () if wrong else _read_values(".".join(key), values, found)
            if wrong:
                found.add(*wrong)
            elif of_axis:
                units, meaning = describe_key(scene if of_scene else WearSection, *key)
                axes.append(SceneAxis("_".join(key), table, key, of_axis, units, meaning))
    n_combinations = math.prod(len(axis.values) for axis in axes)
    if n_combinations > _MOST_COMBINATIONS:
        longest = max(axes, key=lambda axis: len(axis.values))
        remedy = f"give fewer values: there are {n_combinations} combinations of keys of [scene] and [wear], at most "
        remedy += f"{_MOST_COMBINATIONS} are possible; [scatter] takes more samples"
        found.add(f"axes.{longest.dotted}", len(longest.values), remedy)
        return ()
    return tuple(axes)


def _read_values(dotted: str, values: object, found: Mistakes) -> tuple[AxisValue, ...]:
    try:
        return read_axis(values)
    except ValidationError as error:
        for each in flat_errors(error):
            found.add(f"axes.{dotted}.{each['loc'][0]}", each["input"], remedy_of(each))
    except WrongValueError as error:
        found.add(f"axes.{dotted}", error.value, error.remedy)
    except ValueError as error:
        found.add(f"axes.{dotted}", values, str(error))
    return ()


def _wrong_place(table: Mapping[str, Any], name: str, key: Sequence[str], values: object) -> Wrong | None:
    """What is wrong with an axis of this key, where its table has the key, or no place for it."""
    first, dotted = table.get(key[0]), ".".join(key)
    inner = only_table(first)
    in_table = len(key) > 1 and isinstance(inner, Mapping)
    if first is not None and not (in_table and key[1] not in inner):
        where, given = (dotted, inner[key[1]]) if in_table else (key[0], first)
        return Wrong(f"{name}.{where}", given, f"give it once, here or as axes.{dotted}")
    if not "_".join(key).isidentifier():
        remedy = "give a surface whose name consists of letters, digits and _: a dimension has the name"
        return Wrong(f"axes.{dotted}", values, remedy)
    return None


def keys_below_axes(scene_axes: Sequence[SceneAxis]) -> dict[str, str]:
    """For keys of [scene] or [wear] whose values stand under [axes]: the keys there."""
    return {f"{axis.table}.{name}": f"axes.{name}" for axis in scene_axes for name in (axis.key[0], axis.dotted)}


@contextlib.contextmanager
def keys_as_given(scene_axes: Sequence[SceneAxis]) -> Iterator[None]:
    """A UserError on a key of [scene] or [wear] whose values stand under [axes] names the key there."""
    found = Mistakes("")
    with found.collecting(keys_below_axes(scene_axes)):
        yield
    found.raise_any()


def combinations(tables: Mapping[str, Any], scene_axes: Sequence[SceneAxis]) -> Iterator[dict[str, Table]]:
    """The tables of a study with each combination of values in [scene] and [wear], the last axis fastest."""
    for values in itertools.product(*(axis.values for axis in scene_axes)):
        changed = {**tables, "scene": dict(tables["scene"]), "wear": dict(tables["wear"])}
        for axis, value in zip(scene_axes, values, strict=True):
            table, (name, *inner) = changed[axis.table], axis.key
            if name == "worn":
                # one state of several
                depth = table["worn"]["depth"][axis.values.index(value)]
                table["worn"] = {"depth": [depth], "result": table["worn"].get("result", "")}
            else:
                table[name] = _with(table.get(name, {}), inner[0], value) if inner else value
        yield changed


def scene_with_axes(scene: Mapping[str, Any], axes: Mapping[str, Any]) -> Table:
    """[scene] of a result that holds its scene, with the only value of each axis that is a key of [scene]."""
    found = dict(scene)
    for name, values in axes.items():
        if name in (*AxesSection.model_fields, *SOLVER_AXES, *WearSection.AXES):
            continue
        if not is_table(values):
            found[name] = only_table(values)
        elif isinstance(only_table(found.get(name, {})), Mapping):
            for inner, each in values.items():
                found[name] = _with(found.get(name, {}), inner, only_table(each))
    return found


def as_checked(scene_axes: Sequence[SceneAxis], study: Any) -> tuple[SceneAxis, ...]:
    """The axes with values as a checked study has them: 3 is 3.0 where that is meant."""
    checked = []
    for axis in scene_axes:
        given = only_table(getattr(study.scene.parameters if axis.table == "scene" else study.wear, axis.key[0], None))
        is_float = isinstance(given if len(axis.key) == 1 else dict(given)[axis.key[1]], float)
        values = (float(each) if is_float and isinstance(each, int) else each for each in axis.values)
        checked.append(replace(axis, values=tuple(values)))
    return tuple(checked)


def _with(given: Any, key: str, value: AxisValue) -> Any:
    return [{**given[0], key: value}] if only_table(given) is not given else {**given, key: value}


def only_table(value: Any) -> Any:
    """The table in a list of one table, as `preload` is; any other value as it is."""
    return value[0] if isinstance(value, list | tuple) and len(value) == 1 else value


def is_table(value: object) -> bool:
    """Whether a value under [axes] holds values by name of a surface or of a key, and no range."""
    return isinstance(value, dict) and bool(value) and not {"start", "stop", "num"} & value.keys()


def describe_key(kind: type[BaseModel], name: str, inner: str = "") -> tuple[str, str]:
    """Unit and meaning in the description of a key: parts between commas, of which one is the unit.

    inner: key in the table that the key holds, or a surface.
    """
    field = kind.model_fields[name]
    for table in tables_in(field.annotation):
        if inner in table.model_fields:
            units, _ = describe_key(table, inner)
            return units, f"{inner.replace('_', ' ')} of {name.replace('_', ' ')}"
    text = field.description or ""
    units = next((part for part in reversed(re.split("[,;] ", text)) if part in _UNITS), "1")
    parts = [part for part in text.partition("; ")[0].split(", ") if part != units]
    meaning = ", ".join(parts) or name.replace("_", " ")
    return _UNITS[units], f"{meaning}, {inner}" if inner else meaning
