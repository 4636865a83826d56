"""Reads a study: finds the file, applies the overrides, checks all of it; and writes the effective study as TOML.

By hand: `tomli_w` gives each value of a list a line of its own, and axes have up to 100 000 values.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from studies.hdf5 import is_hdf5
from studyrunner.study.checked_table import check_table
from studyrunner.study.followed import take_followed
from studyrunner.study.mission import OWN_AXES, MissionBlock, read_blocks
from studyrunner.study.mission_tables import (
    asks_for_missions,
    block_studies,
    check_mission_tables,
    check_used_axes,
    with_room_of_all,
)
from studyrunner.study.mission_tables import with_idle_keys as with_idle_keys_of_missions
from studyrunner.study.mission_tables import without_idle_keys as without_idle_keys_of_missions
from studyrunner.study.mode_tables import (
    asks_for_modes,
    check_mode_tables,
    check_worn_counts,
    with_idle_keys,
    without_idle_keys,
)
from studyrunner.study.realisation import check_scatter
from studyrunner.study.room_for_wear import with_room_for_wear
from studyrunner.study.scene_axes import (
    SceneAxis,
    as_checked,
    combinations,
    is_table,
    keys_as_given,
    only_table,
    scene_with_axes,
    take_scene_axes,
)
from studyrunner.study.scene_errors import scene_errors
from studyrunner.study.scene_table import check_scene, parameters_of
from studyrunner.study.sections import SOLVER_AXES, AxesSection
from studyrunner.study.similar_names import nearest_name
from studyrunner.study.study import Study, check_axes
from studyrunner.study.study_of_result import Archived, read_archived
from studyrunner.study.toml_text import read_toml, read_toml_file
from studyrunner.study.wear_section import WearSection
from studyrunner.study.worn import AXIS as WORN_AXIS
from studyrunner.study.worn import read_worn, worn_axis
from studyrunner.user_error import UserError, WrongValueError

Table = dict[str, object]

_BARE_WORD = re.compile(r"[^\s\"'\[\]{}=,#]+")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SECTIONS = tuple(
    name
    for name in Study.model_fields
    if name not in ("follow", "source", "folder", "archived", "scene_axes", "variants", "block_studies")
)


def read_study(study: str | Path, overrides: Sequence[str] | Mapping[str, object] = ()) -> Study:
    """Read and check a study.

    Parameters
    ----------
    study
        Path of a TOML file or of a result file, or the name of a bundled study.
    overrides
        Values of keys by their dotted names, as `{"slow_time.cycles": 1e4, "axes.frequency": [210.0, 210.5]}`; numpy
        arrays and tuples stand for lists. Or texts KEY=VALUE; VALUE is TOML or a bare word.

    Returns
    -------
    Study
        Every default filled in.

    Raises
    ------
    UserError
        Where there is no such study or something in it is wrong: one line that says what would be right.
    """
    argument = str(study)
    path = _study_path(argument)
    archived, own = None, tuple(AxesSection.model_fields)
    try:
        if is_hdf5(path):
            archived = read_archived(path, argument)
            table = read_toml(archived.study.encode(), argument)
            archived = replace(archived, scene=scene_with_axes(_section(table, "scene"), _section(table, "axes"), own))
        else:
            table = read_toml_file(path, argument)
    except OSError as error:
        raise UserError(argument, "the file", None, f"give a file that can be read: {error.strerror}") from None
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            _set_key(table, key, _plain(value), "overrides", key)
    else:
        for text in [overrides] if isinstance(overrides, str) else overrides:
            _override(table, text)
    found = check_study(table, argument, path, archived)
    check_worn_counts(found)
    return found


def bundled_studies() -> tuple[str, ...]:
    """Names of the studies that come with the program."""
    files = (Path(str(file.name)) for file in resources.files("studies").iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".toml"))


def check_study(
    table: Mapping[str, object], source: str, path: Path, archived: Archived | None = None, *, room: bool = True
) -> Study:
    """The study in a table as TOML has it, every default filled in.

    source: the file as the user named it. path: where it is; relative paths start in its folder. archived: what it says
    of the result that it holds. room: whether scenes get room for what wears. Raises UserError.
    """
    sections = dict(table)
    for name, section in sections.items():
        if name not in _SECTIONS:
            raise UserError(source, name, section, f"unknown table, give {nearest_name(name, _SECTIONS)}")
        if not isinstance(section, dict) and name != "mission":
            raise UserError(source, name, section, f"give a table [{name}] with keys")
    if asks_for_missions(sections):
        # each block may give its own values
        sections.setdefault("axes", {})
    for name in ("study", "scene", "axes"):
        if name not in sections:
            raise UserError(source, name, None, f"missing: give a table [{name}]")
    twice = [key for key in SOLVER_AXES if key in _section(table, "axes") and key in _section(table, "solver")]
    if twice:
        value = _section(table, "solver")[twice[0]]
        raise UserError(source, f"solver.{twice[0]}", value, f"give it once, here or as axes.{twice[0]}")
    worn = _section(table, "scene").get("worn")
    if worn is not None:
        sections["scene"] = {**_section(table, "scene"), "worn": read_worn(worn, source, path.parent)}
    check_mode_tables(sections, source)
    check_mission_tables(sections, source)
    scene_axes = _take_scene_axes(sections, source)
    blocks = _read_blocks(sections, source)
    if scene_axes:
        check_used_axes([axis.name for axis in scene_axes], blocks, source)
        return _with_variants(sections, scene_axes, source, path, archived)
    of_blocks = block_studies(
        sections, blocks, source, lambda tables: check_study(tables, source, path, archived, room=False)
    )
    # only what was kept on request takes the place of what a bundled scene builds
    kept = archived if _section(table, "outputs").get("scene") is True else None
    sections["scene"] = check_scene(_section(table, "scene"), source, path, archived, kept)
    follow = take_followed(sections, source)
    moved = _move_solver_axes(sections)
    given = {"source": source, "folder": path.parent, "archived": archived, "follow": follow}
    if blocks:
        given |= {"mission": blocks, "block_studies": of_blocks}
    try:
        filled = with_idle_keys_of_missions(with_idle_keys(sections))
        study = check_table(Study, {**filled, **given}, source, "")
        if blocks:
            same = {"block_studies": tuple(each.model_copy(update={"outputs": study.outputs}) for each in of_blocks)}
            study = study.model_copy(update=same)
        if room:
            study = with_room_of_all(study) if blocks else with_room_for_wear(study)
        check_scatter(study)
        return study
    except UserError as error:
        if error.key in moved:
            raise UserError(error.place, moved[error.key], error.value, error.remedy) from None
        raise


def _read_blocks(sections: Table, source: str) -> tuple[MissionBlock, ...]:
    """The blocks of a study of missions; none of another study."""
    if not asks_for_missions(sections):
        return ()
    with scene_errors(source, None):
        kind = parameters_of(_section(sections, "scene").get("model"))
    blocks = read_blocks(sections["mission"], sections, kind, AxesSection, source)
    check_used_axes([name for name in OWN_AXES if name in _section(sections, "axes")], blocks, source)
    return blocks


def _take_scene_axes(sections: Table, source: str) -> tuple[SceneAxis, ...]:
    """Axes of the study that are keys of [scene] or [wear]."""
    name = "cycle" if asks_for_modes(sections) else WORN_AXIS
    of_worn = worn_axis(_section(_section(sections, "scene"), "worn"), name)
    if all(name in AxesSection.model_fields for name in _section(sections, "axes")):
        return of_worn
    with scene_errors(source, None):
        kind = parameters_of(_section(sections, "scene").get("model"))
    return (*take_scene_axes(sections, tuple(AxesSection.model_fields), kind, WearSection, source), *of_worn)


def _with_variants(
    sections: Table, scene_axes: Sequence[SceneAxis], source: str, path: Path, archived: Archived | None
) -> Study:
    """A study with axes that are keys of [scene] or [wear]."""
    with keys_as_given(scene_axes):
        variants = [check_study(tables, source, path, archived) for tables in combinations(sections, scene_axes)]
    study = variants[0].model_copy(update={"scene_axes": as_checked(scene_axes, variants), "variants": tuple(variants)})
    try:
        check_axes(study)
    except WrongValueError as error:
        raise UserError(source, error.key or "axes", error.value, error.remedy) from None
    check_scatter(study)
    return study


def format_study(study: Study) -> str:
    """The effective study, every default filled in, as TOML; read again it is the same study."""
    sections = study.model_dump(mode="json")
    scene = sections["scene"]
    chosen = _chosen_by_scenes(study)
    kept = {key: value for key, value in scene["parameters"].items() if key not in chosen}
    sections["scene"] = {"model": scene["model"], **kept, "worn": _worn_states(study)}
    if study.follow is not None:
        sections["axes"]["frequency"] = study.follow.of
    for axis in study.scene_axes:
        if axis.key == ("worn",):
            continue
        given, axes = sections[axis.table], sections["axes"]
        for name in axis.key[:-1]:
            given, axes = only_table(given[name]), axes.setdefault(name, {})
        del given[axis.key[-1]]
        axes[axis.key[-1]] = list(axis.values)
    for key in SOLVER_AXES:
        if sections["axes"][key] is not None:
            del sections["solver"][key]
    lines = []
    for name, section in without_idle_keys_of_missions(without_idle_keys(sections), study).items():
        if not section:
            continue
        for table in section if isinstance(section, list) else [section]:
            lines.append(f"[[{name}]]" if table is not section else f"[{name}]")
            lines.extend(
                f"{_toml_key(key)} = {_toml_value(value)}" for key, value in table.items() if value is not None
            )
    return "\n".join(lines) + "\n"


def _chosen_by_scenes(study: Study) -> set[str]:
    """Parameters that are no axis and differ along the axes: each scene has room for its own wear."""
    axes = {axis.key[0] for axis in study.scene_axes}
    own = dict(study.scene.parameters)
    others = [dict(variant.scene.parameters) for variant in study.variants]
    return {key for key in own if key not in axes and any(other[key] != own[key] for other in others)}


def _worn_states(study: Study) -> dict[str, object] | None:
    """The table `worn` with all states."""
    worn = study.scene.worn
    if worn is None:
        return None
    counts = [count for axis in study.scene_axes if axis.key == ("worn",) for count in axis.values]
    if not counts:
        return {"depth": [list(each) for each in worn.depth]}
    # the axis of worn states is the last one
    depths = [variant.scene.worn.depth[0] for variant in study.variants[: len(counts)] if variant.scene.worn]
    return {"cycle": counts, "depth": [list(each) for each in depths], "result": worn.result}


def _study_path(argument: str) -> Path:
    path = Path(argument)
    try:
        if path.is_dir():
            raise UserError(argument, "the study", None, "give a TOML file: this is a folder")
        if path.is_file():
            return path
    except OSError as error:
        raise UserError(argument, "the study", None, f"give a file that can be read: {error.strerror}") from None
    if path.suffix == ".toml" or "/" in argument or "\\" in argument:
        raise UserError(argument, "the study", None, "there is no such file: give a TOML file or a bundled study")
    if argument not in bundled_studies():
        names = ", ".join(bundled_studies())
        raise UserError(argument, "the study", None, f"there is none of this name: give a TOML file or one of {names}")
    return Path(str(resources.files("studies").joinpath(f"{argument}.toml")))


def _override(table: Table, text: str) -> None:
    key, equals, value_text = text.partition("=")
    if not equals or not all(key.strip().split(".")):
        raise UserError("command line", "--set", text, "give KEY=VALUE with the dotted name of a key")
    value = _override_value(key.strip(), value_text.strip())
    _set_key(table, key.strip(), value, "command line", f"--set {key.strip()}")


def _set_key(table: Table, key: str, value: object, source: str, shown: str) -> None:
    """Sets the key of a dotted name. source, shown: where the user gave it, and how it is called there."""
    names = key.split(".")
    place: Table = table
    if names[0] == "mission" and len(names) > 1 and isinstance(table.get("mission"), list):
        place, names = _block_called(table["mission"], names, value, source, shown), names[2:]
    for name in names[:-1]:
        inner = place.setdefault(name, {})
        if not isinstance(inner, dict):
            raise UserError(source, shown, value, f"{name} holds a value and no keys: give all of it")
        place = inner
    place[names[-1]] = value
    # the last place where a key is given counts, here or under [axes]
    of_solver = names[-1] in AxesSection.model_fields
    tables = ("solver",) if of_solver else ("scene", "wear")
    others = {"axes": tables, **dict.fromkeys(tables, ("axes",))}
    if len(names) == 2 and not is_table(place[names[1]]):
        for other in others.get(names[0], ()):
            if not is_table(_section(table, other).get(names[1])):
                _section(table, other).pop(names[1], None)


def _block_called(blocks: Any, names: Sequence[str], value: object, source: str, shown: str) -> Table:
    """The block of a mission that a dotted name begins with, by its name or its number from 0 on."""
    if len(names) < 3:
        raise UserError(source, shown, value, "give mission.NAME.KEY with the name of a block")
    for number, block in enumerate(blocks):
        if isinstance(block, dict) and names[1] in (block.get("name"), str(number)):
            return block
    called = [str(block.get("name")) for block in blocks if isinstance(block, dict)]
    raise UserError(source, shown, value, f"there is no such block: give one of {', '.join(called)}")


def _override_value(key: str, text: str) -> object:
    try:
        parsed = read_toml(f"value = {text}".encode(), "")
    except UserError:
        if _BARE_WORD.fullmatch(text):
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


def _section(table: Mapping[str, object], name: str) -> Table:
    section = table.get(name, {})
    return section if isinstance(section, dict) else {}


def _move_solver_axes(sections: Table) -> dict[str, str]:
    """Makes axes of the solver keys that hold several values; a list of one value is that value.

    Returns for each of these axes the key that it was given as.
    """
    solver, axes, moved = dict(_section(sections, "solver")), dict(_section(sections, "axes")), {}
    for key in SOLVER_AXES:
        value = solver.get(key)
        if isinstance(value, list) and len(value) == 1:
            solver[key] = value[0]
        elif isinstance(value, list | dict):
            axes[key] = solver.pop(key)
            moved[f"axes.{key}"] = f"solver.{key}"
    if "solver" in sections:
        sections["solver"], sections["axes"] = solver, axes
    return moved


def _toml_key(key: str) -> str:
    """A key, in quotes where it is no bare one: labels of surfaces are any text."""
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def _toml_value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_toml_key(key)} = {_toml_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    return "inf" if value == math.inf else json.dumps(value, ensure_ascii=False)
