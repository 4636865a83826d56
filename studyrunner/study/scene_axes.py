"""Axes that are keys of [scene] or [wear]: friction, speed, mesh, a threshold, the factor of a surface."""

from __future__ import annotations

import contextlib
import copy
import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import BaseModel

from studyrunner.study.mistakes import Mistakes, tables_in, wrong_keys
from studyrunner.study.sections import AxesSection, WearSection
from studyrunner.values import Section, Wrong, read_axis

Table = dict[str, Any]
AxisValue = float | int | bool | str

_MOST_COMBINATIONS = 10_000  # each of them is checked, which takes 0.2 ms
_UNITS = {"-": "1", "1": "1", "degrees": "degree", "rpm": "rpm"}
_UNITS |= dict.fromkeys(("Hz", "N", "m", "m2", "Pa", "1/Pa", "N/m", "N/m3", "N s/m", "kg", "kg/m3", "J/m2"), "")


@dataclass(frozen=True)
class SceneAxis:
    """An axis of a study whose values belong to a key of [scene] or [wear].

    name: of the dimension. table, key: the key whose values these are. A second name in `key` is that of a surface or
        of a key in a table.
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


def take_scene_axes(
    tables: Mapping[str, Any], scene: type[BaseModel], wear: type[Section], found: Mistakes
) -> tuple[SceneAxis, ...]:
    """Axes that are keys of [scene] or [wear], which are taken out of the table [axes].

    tables: of the study file. scene, wear: what [scene] of this model and [wear] consist of.
    """
    axes: list[SceneAxis] = []
    known: dict[Literal["scene", "wear"], Collection[str]] = {"scene": scene.model_fields, "wear": wear.AXES}
    for name in [name for name in tables["axes"] if name not in AxesSection.model_fields]:
        table = next((table for table, keys in known.items() if name in keys), None)
        if table is None:
            continue
        value = tables["axes"].pop(name)
        for inner, values in value.items() if is_table(value) else [(None, value)]:
            key = (name,) if inner is None else (name, str(inner))
            dotted = ".".join(key)
            wrong = _wrong_place(tables[table], table, key, values)
            if wrong is not None:
                found.add(*wrong)
                continue
            try:
                of_axis = read_axis(values)
            except ValueError as error:
                for wrong in wrong_keys(error, AxesSection, {}):
                    found.add(f"axes.{dotted}{wrong.key}", values if wrong.value is None else wrong.value, wrong.remedy)
                continue
            units, meaning = describe_key(scene if table == "scene" else wear, *key)
            axes.append(SceneAxis("_".join(key), table, key, of_axis, units, meaning))
    n_combinations = math.prod(len(axis.values) for axis in axes)
    if n_combinations > _MOST_COMBINATIONS:
        longest = max(axes, key=lambda axis: len(axis.values))
        remedy = f"give fewer values: there are {n_combinations} combinations of keys of [scene] and [wear], at most "
        remedy += f"{_MOST_COMBINATIONS} are possible; [scatter] takes more samples"
        found.add(f"axes.{longest.dotted}", len(longest.values), remedy)
        return ()
    return tuple(axes)


def _wrong_place(table: Mapping[str, Any], name: str, key: Sequence[str], values: object) -> Wrong | None:
    """What is wrong with an axis of this key, where its table has the key, or no place for it."""
    dotted, given = ".".join(key), table
    for part in key:
        given = only_table(given)
        if not isinstance(given, Mapping):
            return Wrong(
                f"{name}.{key[0]}", given, f"give it once, here or as axes.{key[0]}; a table of other keys here"
            )
        if part not in given:
            break
        given = given[part]
    else:
        return Wrong(f"{name}.{dotted}", given, f"give it once, here or as axes.{dotted}")
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


def combinations(sections: Mapping[str, Any], scene_axes: Sequence[SceneAxis]) -> Iterator[dict[str, Table]]:
    """The tables of a study with each combination of values in [scene] and [wear], the last axis fastest."""
    for values in itertools.product(*(axis.values for axis in scene_axes)):
        tables = {name: copy.copy(table) for name, table in sections.items()}
        for axis, value in zip(scene_axes, values, strict=True):
            table = tables.setdefault(axis.table, {})
            if axis.key == ("worn",):
                # one state of several
                states, place = table["worn"], axis.values.index(value)
                table["worn"] = {"depth": [states["depth"][place]], "result": states.get("result", "")}
                continue
            table[axis.key[0]] = value if len(axis.key) == 1 else _with(table.get(axis.key[0], {}), axis.key[1], value)
        yield tables


def scene_with_axes(scene: Mapping[str, Any], axes: Mapping[str, Any]) -> Table:
    """[scene] of a result that holds its scene, with the only value of each axis that is a key of [scene]."""
    found = dict(scene)
    for name, values in axes.items():
        if name in (*AxesSection.model_fields, *WearSection.AXES):
            continue
        if not is_table(values):
            found[name] = only_table(values)
        elif isinstance(only_table(found.get(name, {})), Mapping):
            for inner, each in values.items():
                found[name] = _with(found.get(name, {}), inner, only_table(each))
    return found


def as_checked(scene_axes: Sequence[SceneAxis], variants: Sequence[Any]) -> tuple[SceneAxis, ...]:
    """The axes with their values as the checked studies of all combinations have them: 3 is 3.0 where that is meant."""
    checked, apart = [], len(variants)
    for axis in scene_axes:
        apart //= len(axis.values)
        if axis.key == ("worn",):
            checked.append(axis)
            continue
        values = []
        for variant in variants[::apart][: len(axis.values)]:
            table = variant.scene.parameters if axis.table == "scene" else variant.wear
            value = only_table(getattr(table, axis.key[0]))
            values.append(value if len(axis.key) == 1 else dict(value)[axis.key[1]])
        checked.append(replace(axis, values=tuple(values)))
    return tuple(checked)


def _with(given: Any, key: str, value: AxisValue) -> Any:
    """A table, or a list of one table, with a value."""
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
    return _UNITS.get(units) or units, f"{meaning}, {inner}" if inner else meaning
