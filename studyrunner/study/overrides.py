"""Overrides of a study: KEY=VALUE of the command line, or values by dotted names in Python."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studyrunner.study.scene_axes import is_table
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.text import read_toml
from studyrunner.user_error import UserError

Table = dict[str, Any]

_INSTEAD = {"axes.frequency": "frequency_ratio", "axes.frequency_ratio": "frequency"}
"""Keys under [axes] that stand in each other's place."""


def override(table: Table, overrides: str | Sequence[str] | Mapping[str, object]) -> None:
    """Sets keys of a study. overrides: as in `read_study`; a value None leaves a key out. Raises UserError."""
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            _set_key(table, key, _plain(value), "overrides", key)
        return
    for text in [overrides] if isinstance(overrides, str) else overrides:
        key, equals, value_text = (part.strip() for part in text.partition("="))
        if not equals or not all(key.split(".")):
            raise UserError("command line", "--set", text, "give KEY=VALUE with the dotted name of a key")
        _set_key(table, key, _value_of(key, value_text), "command line", f"--set {key}")


def _set_key(table: Table, key: str, value: object, source: str, shown: str) -> None:
    """Sets the key of a dotted name. source, shown: where the user gave it, and how it is called there."""
    names, place = key.split("."), table
    if names[0] == "mission" and len(names) > 1 and isinstance(table.get("mission"), list):
        blocks = [block for block in table["mission"] if isinstance(block, dict)]
        called = {str(block.get("name")): block for block in blocks}
        block = called.get(names[1]) or {str(number): each for number, each in enumerate(blocks)}.get(names[1])
        if block is None or len(names) < 3:
            remedy = f"give mission.NAME.KEY with the name of a block: {', '.join(called)}"
            raise UserError(source, shown, value, remedy)
        place, names = block, names[2:]
    for name in names[:-1]:
        inner = place.setdefault(name, {})
        if not isinstance(inner, dict):
            raise UserError(source, shown, value, f"{name} holds a value and no keys: give all of it")
        place = inner
    if value is None:
        place.pop(names[-1], None)
        return
    place[names[-1]] = value
    if key in _INSTEAD:
        place.pop(_INSTEAD[key], None)
    # the last place where a key is given counts, here or under [axes]
    tables = ("solver",) if names[-1] in SOLVER_AXES else ("scene", "wear")
    others = {"axes": tables, **dict.fromkeys(tables, ("axes",))}
    if len(names) == 2 and not is_table(value):
        for other in others.get(names[0], ()):
            given = table.get(other)
            if isinstance(given, dict) and not is_table(given.get(names[1])):
                given.pop(names[1], None)


def _value_of(key: str, text: str) -> object:
    try:
        parsed = read_toml(f"value = {text}".encode(), "")
    except UserError:
        if re.fullmatch(r"[^\s\"'\[\]{}=,#]+", text):
            return text
        remedy = "give a TOML value or a bare word"
        if text[:1] in ("[", "{"):
            remedy = f'give a list or table of TOML: words in it stand in quotes, as --set \'{key}=["up", "down"]\''
        raise UserError("command line", f"--set {key}", text, remedy) from None
    if set(parsed) != {"value"}:
        raise UserError("command line", f"--set {key}", text, "give one TOML value")
    return parsed["value"]


def _plain(value: object) -> object:
    """A value as TOML has it: numpy's numbers and arrays, tuples and paths are none of its types."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    return str(value) if isinstance(value, Path) else value
