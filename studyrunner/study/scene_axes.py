"""Axes that are keys of other tables: friction, speed, mesh, a threshold, the factor of a surface; harmonics."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, RootModel

from studies.scene import Unit, said_of
from studyrunner.study.design import Design
from studyrunner.study.mistakes import check_tables, raise_wrong, tables_in
from studyrunner.study.sections import SOLVER_AXES, AxesSection, WearSection
from studyrunner.user_error import UserError
from studyrunner.values import Wrong, read_axis

Tables = dict[str, Any]
AxisValue = float | int | bool | str

_MOST_VARIANTS = 10_000  # each of them is checked, which takes 0.2 ms


@dataclass(frozen=True)
class SceneAxis:
    """An axis of a study whose values belong to a key of [scene] or [wear].

    name: of the dimension. table, key: the key; a second name in `key` is that of a surface or of a key in a table.
    values: in the order of the study file. units, meaning: of the key.
    """

    name: str
    table: str
    key: tuple[str, ...]
    values: tuple[AxisValue, ...]
    units: str
    meaning: str

    @property
    def is_worn(self) -> bool:
        """Whether it is that of the worn states with which histories begin, or whose modes are sought."""
        return self.key == ("worn",)

    @property
    def dotted(self) -> str:
        """Name of the key in the study file, below its table."""
        return ".".join(self.key)


class _Values(RootModel[Annotated[tuple[Any, ...], BeforeValidator(read_axis)]]):
    """Values of an axis of any kind."""


def take_axes(
    tables: Tables, scene: type[BaseModel], source: str, design: Design | None = None
) -> tuple[SceneAxis, ...]:
    """Axes that are keys of [scene] or [wear]. Keys of other tables are taken out of [axes], those of [solver] moved.

    tables: of the study file. scene: what [scene] of this model consists of. design: of which some may be columns.
    Raises UserError.
    """
    tables_of = {"solver": SOLVER_AXES, "wear": WearSection.AXES, "scene": scene.model_fields}
    # how sectors differ is a table, of one study
    places = {name: table for table, names in tables_of.items() for name in names if name != "sectors"}
    keys: dict[str, tuple[str, ...]] = {}
    given: Tables = {}
    wrong: list[Wrong] = []
    for name in [name for name in tables["axes"] if name in places and name not in AxesSection.model_fields]:
        table, value = places[name], tables["axes"].pop(name)
        first, parts = tables[table].get(name), dict[tuple[str, ...], object]({(name,): value})
        if is_table(value) and table != "solver":
            parts = {(name, str(inner)): each for inner, each in value.items()}
        for key, values in parts.items():
            dotted, inner = ".".join(key), only_table(first)
            if first is not None and not (len(key) > 1 and isinstance(inner, Mapping) and key[1] not in inner):
                wrong.append(Wrong(f"{table}.{name}", first, f"give it once, here or as axes.{dotted}"))
            elif not "_".join(key).isidentifier():
                remedy = "give a surface whose name consists of letters, digits and _: a dimension has the name"
                wrong.append(Wrong(f"axes.{dotted}", values, remedy))
            elif table == "solver":
                tables[table][name] = values
            else:
                keys[f"axes.{dotted}"], given[f"axes.{dotted}"] = key, values
    raise_wrong(source, wrong)
    axes = []
    for dotted, checked in check_tables(dict.fromkeys(given, _Values), given, source).items():
        key, table = keys[dotted], places[keys[dotted][0]]
        about = describe_key(scene if table == "scene" else WearSection, *key)
        axes.append(SceneAxis("_".join(key), table, key, checked.root, *about))
    rows, others = _rows_and_others(axes, design)
    if (n_variants := len(rows) * math.prod(len(axis.values) for axis in others)) > _MOST_VARIANTS:
        longest = max(axes, key=lambda axis: len(axis.values))
        remedy = f"give fewer values: there are {n_variants} combinations of keys of [scene] and [wear], at most "
        remedy += f"{_MOST_VARIANTS} are possible; [scatter] takes more samples"
        raise UserError(source, f"axes.{longest.dotted}", len(longest.values), remedy)
    return tuple(axes)


def keys_below_axes(scene_axes: Sequence[SceneAxis]) -> dict[str, str]:
    """For keys of [scene] or [wear] whose values stand under [axes]: the keys there."""
    return {f"{axis.table}.{axis.key[0]}": f"axes.{axis.key[0]}" for axis in scene_axes if not axis.is_worn}


def _rows_and_others(
    scene_axes: Sequence[SceneAxis], design: Design | None
) -> tuple[list[list[tuple[SceneAxis, AxisValue]]], list[SceneAxis]]:
    """The different values that rows of a design give to axes, and the axes that are none of its columns."""
    columns = {} if design is None else design.columns
    own = [axis for axis in scene_axes if axis.name in columns]
    first = [0] if design is None else design.groups([axis.name for axis in own])[0]
    rows = [[(axis, columns[axis.name].values[columns[axis.name].codes[row]]) for axis in own] for row in first]
    return rows, [axis for axis in scene_axes if axis.name not in columns]


def variants_of(
    tables: Mapping[str, Any], scene_axes: Sequence[SceneAxis], design: Design | None = None
) -> Iterator[Tables]:
    """[scene] and [wear] with each combination of values of the axes, the last axis fastest.

    Of axes that are columns of a design it is those that its rows have, in the order of `Design.groups`.
    """
    rows, others = _rows_and_others(scene_axes, design)
    for row, values in itertools.product(rows, itertools.product(*(axis.values for axis in others))):
        changed = {name: dict(tables[name]) for name in ("scene", "wear")}
        for axis, value in (*row, *zip(others, values, strict=True)):
            table, (name, *inner) = changed[axis.table], axis.key
            given = table.get(name, {})
            if inner:
                own = {**only_table(given), inner[0]: value}
                table[name] = own if only_table(given) is given else [own]
            else:
                table[name] = value
        yield changed


def as_checked(scene_axes: Sequence[SceneAxis], study: Any) -> tuple[SceneAxis, ...]:
    """The axes with values as a checked study has them: 3 is 3.0 where that is meant."""
    checked = []
    for axis in scene_axes:
        given = only_table(getattr(study.scene.parameters if axis.table == "scene" else study.wear, axis.key[0], None))
        is_float = isinstance(given if len(axis.key) == 1 else dict(given)[axis.key[1]], float)
        values = (float(each) if is_float and isinstance(each, int) else each for each in axis.values)
        checked.append(replace(axis, values=tuple(values)))
    return tuple(checked)


def only_table(value: Any) -> Any:
    """The table in a list of one table, as `preload` is; any other value as it is."""
    return value[0] if isinstance(value, list | tuple) and len(value) == 1 else value


def is_table(value: object) -> bool:
    """Whether a value under [axes] holds values by name of a surface or of a key, and no range."""
    return isinstance(value, dict) and bool(value) and not {"start", "stop", "num"} & value.keys()


def describe_key(kind: type[BaseModel], name: str, inner: str = "") -> tuple[str, str]:
    """Unit and meaning of a key. inner: key in the table that the key holds, or a surface."""
    field = kind.model_fields[name]
    for table in tables_in(field.annotation):
        if inner in table.model_fields:
            units, _ = describe_key(table, inner)
            return units, f"{inner.replace('_', ' ')} of {name.replace('_', ' ')}"
    meaning = field.description or name.replace("_", " ")
    return said_of(field, Unit) or "1", f"{meaning}, {inner}" if inner else meaning
