"""Keys of a study that come from elsewhere than its file: overrides, and the columns of a design."""

import copy
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, cast

from studyrunner.kinds.table import KINDS
from studyrunner.study import scene_axes, sections
from studyrunner.study.design import Design
from studyrunner.study.text import read_toml
from studyrunner.user_error import UserError

_INSTEAD = {"axes.frequency": "frequency_ratio", "axes.frequency_ratio": "frequency"}
"""Keys that stand in each other's place."""

_NO_COLUMNS = ("model", "worn", *(name for kind in KINDS.values() for name in kind.no_columns))
"""Names that no column of a design has: each point has whole modes, over their amplitude."""


def override(
    table: scene_axes.Tables, overrides: str | Sequence[str] | Mapping[str, object], design: Design | None
) -> None:
    """Sets keys of a study. overrides: as in `read_study`; a value None leaves a key out.

    Raises UserError, also where a key is a column of the design.
    """
    columns = () if design is None else tuple(column.key for column in design.columns.values())
    if isinstance(overrides, Mapping):
        source, option, given = "overrides", "", [(key, _as_toml(value)) for key, value in overrides.items()]
    else:
        texts = [overrides] if isinstance(overrides, str) else overrides
        source, option, given = "command line", "--set ", [_key_and_value(text) for text in texts]
    for key, value in given:
        if not isinstance(key, str) or not all(key.split(".")) or not _set_key(table, key, value):
            remedy = "give the dotted name of a key in a table, that of a block with the name of the block"
            raise UserError(source, f"{option}{key}", value, remedy)
        if key.partition(".")[2] in columns and design is not None:
            raise UserError(source, f"{option}{key}", value, f"leave it out: it is a column of {design.source}")


def with_design(given: Mapping[str, object], design: Design | None) -> scene_axes.Tables:
    """A study with the columns of a design as axes, in place of what stands there, or in the tables of their keys."""
    table = dict(copy.deepcopy(given))
    if design is None:
        return table
    for column in design.columns.values():
        is_twice = _INSTEAD.get(f"axes.{column.key}") in design.columns
        if is_twice or column.key in _NO_COLUMNS or not _set_key(table, f"axes.{column.key}", column.values):
            remedy = "leave it out: give it in the study, and of frequency and frequency_ratio one"
            raise UserError(design.source, f"column {column.key}", None, remedy)
        words = [value for value in column.values if isinstance(value, str)]
        if words and column.key == "frequency":
            remedy = "give Hz: what follows a resonance stands under [axes] of the study, for all points"
            raise design.located(UserError(design.source, "axes.frequency", words[0], remedy))
        first, *inner = column.key.split(".")
        for name in ("scene", "wear") if inner else ():
            own = scene_axes.only_table(cast("Any", table.get(name, {})).get(first))
            if isinstance(own, dict):
                own.pop(inner[0], None)
    return table


def _set_key(table: scene_axes.Tables, key: str, value: object) -> bool:
    """Sets the key of a dotted name, or with None leaves it out; whether there is a table that can hold it."""
    (*names, last), place = key.split("."), cast("Any", table)
    for name in names:
        if isinstance(place, list):
            # blocks of a mission, by number or name
            blocks = {str(number): each for number, each in enumerate(place)}
            place = (blocks | {str(each.get("name")): each for each in place if isinstance(each, dict)}).get(name)
        else:
            place = place.setdefault(name, {}) if isinstance(place, dict) else None
    if not isinstance(place, dict):
        return False
    if value is None:
        place.pop(last, None)
        return True
    place[last] = value
    place.pop(_INSTEAD.get(key, ""), None)
    # the last place where a key is given counts, here or under [axes]
    tables = ("solver",) if last in sections.SOLVER_AXES else ("scene", "wear")
    others = {"axes": tables, **dict.fromkeys(tables, ("axes",))}
    for other in others.get(".".join(names), ()) if not scene_axes.is_table(value) else ():
        given = table.get(other)
        if isinstance(given, dict) and not scene_axes.is_table(given.get(last)):
            given.pop(last, None)
    return True


def _key_and_value(text: str) -> tuple[str, object]:
    """The key and the value in KEY=VALUE, where VALUE is TOML or a bare word. Raises UserError."""
    key, _, value = (part.strip() for part in text.partition("="))
    try:
        parsed = read_toml(f"value = {value}".encode(), "")
    except UserError:
        parsed = {"value": value} if re.fullmatch(r"[^\s\"'\[\]{}=,#]+", value) else {}
    if set(parsed) != {"value"}:
        remedy = (
            f'give KEY=VALUE with a TOML value or a bare word; words in a list in quotes, as \'{key}=["up", "down"]\''
        )
        raise UserError("command line", f"--set {key}", value, remedy)
    return key, parsed["value"]


def _as_toml(value: object) -> object:
    """A value as TOML has it: numpy's numbers and arrays, tuples and paths are none of its types."""
    plain = json.dumps(value, default=lambda each: each.tolist() if hasattr(each, "tolist") else str(each))
    return json.loads(plain)
