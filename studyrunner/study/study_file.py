"""Reads a study: finds the file, applies the overrides, checks all of it; and writes the effective study as TOML."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from studies.sandboxed_read import check_scene_readable, is_hdf5
from studies.scene_error import SceneError
from studies.scenes import scene_has, scene_parameters
from studyrunner.study.room_for_wear import with_room_for_wear
from studyrunner.study.scene_errors import scene_errors
from studyrunner.study.similar_names import nearest_name
from studyrunner.study.study import SOLVER_AXES, SceneFileParameters, SceneSection, Study, names_file, names_model
from studyrunner.study.study_of_result import SCENE_GROUP, Archived, read_archived
from studyrunner.study.toml_text import read_toml, read_toml_file
from studyrunner.user_error import UserError, Verbatim, WrongValueError

Checked = TypeVar("Checked", bound=BaseModel)
Table = dict[str, object]

_OFFERED = {"mesh": "describe_mesh", "exact": "exact_answer"}
_BARE_WORD = re.compile(r"[^\s\"'\[\]{}=,#]+")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SECTIONS = tuple(name for name in Study.model_fields if name not in ("source", "folder", "archived"))


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
    archived = None
    try:
        if is_hdf5(path):
            archived = read_archived(path, argument)
            table = read_toml(archived.study.encode(), argument)
            archived = replace(archived, scene=dict(_section(table, "scene")))
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
    return check_study(table, argument, path, archived)


def bundled_studies() -> tuple[str, ...]:
    """Names of the studies that come with the program."""
    files = (Path(str(file.name)) for file in resources.files("studies").iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".toml"))


def check_study(table: Mapping[str, object], source: str, path: Path, archived: Archived | None = None) -> Study:
    """The study in a table as TOML has it, every default filled in.

    source: the file as the user named it. path: where it is; relative paths start in its folder. archived: what it says
    of the result that it holds. Raises UserError.
    """
    sections = dict(table)
    for name, section in sections.items():
        if name not in _SECTIONS:
            raise UserError(source, name, section, f"unknown table, give {nearest_name(name, _SECTIONS)}")
        if not isinstance(section, dict):
            raise UserError(source, name, section, f"give a table [{name}] with keys")
    for name in ("study", "scene", "axes"):
        if name not in sections:
            raise UserError(source, name, None, f"missing: give a table [{name}]")
    twice = [key for key in SOLVER_AXES if key in _section(table, "axes") and key in _section(table, "solver")]
    if twice:
        value = _section(table, "solver")[twice[0]]
        raise UserError(source, f"solver.{twice[0]}", value, f"give it once, here or as axes.{twice[0]}")
    # only what was kept on request takes the place of what a bundled scene builds
    kept = archived if _section(table, "outputs").get("scene") is True else None
    sections["scene"] = _check_scene(_section(table, "scene"), source, path, archived, kept)
    moved = _move_solver_axes(sections)
    try:
        study = _check(Study, {**sections, "source": source, "folder": path.parent, "archived": archived}, source, "")
        return with_room_for_wear(study)
    except UserError as error:
        if error.key in moved:
            raise UserError(error.place, moved[error.key], error.value, error.remedy) from None
        raise


def format_study(study: Study) -> str:
    """The effective study, every default filled in, as TOML; read again it is the same study."""
    sections = study.model_dump(mode="json")
    scene = sections["scene"]
    sections["scene"] = {"model": scene["model"], **scene["parameters"]}
    for key in SOLVER_AXES:
        if sections["axes"][key] is not None:
            del sections["solver"][key]
    lines = []
    for name, section in sections.items():
        lines.append(f"[{name}]")
        lines.extend(f"{key} = {_toml_value(value)}" for key, value in section.items() if value is not None)
    return "\n".join(lines) + "\n"


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
    for name in names[:-1]:
        inner = place.setdefault(name, {})
        if not isinstance(inner, dict):
            raise UserError(source, shown, value, f"{name} holds a value and no keys: give all of it")
        place = inner
    place[names[-1]] = value
    other = {"axes": "solver", "solver": "axes"}.get(names[0])
    if other is not None and len(names) == 2 and names[1] in SOLVER_AXES:
        _section(table, other).pop(names[1], None)


def _override_value(key: str, text: str) -> object:
    try:
        parsed = read_toml(f"value = {text}".encode(), "")
    except UserError:
        if _BARE_WORD.fullmatch(text):
            return text
        raise UserError("command line", f"--set {key}", text, "give a TOML value or a bare word") from None
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


def _check_scene(
    table: Table, source: str, path: Path, archived: Archived | None, kept: Archived | None
) -> SceneSection:
    """The scene in a table. kept: the result that may hold what a bundled scene was built to, None to build it."""
    parameters = dict(table)
    model = parameters.pop("model", None)
    if model is None:
        raise UserError(source, "scene.model", None, "missing: give a bundled scene or the path of a scene file")
    if not isinstance(model, str):
        raise UserError(source, "scene.model", model, "give a bundled scene or the path of a scene file, in quotes")
    if names_model(model):
        return _check_model_scene(model, parameters, source, path, archived)
    if names_file(model):
        found = _find_scene(model, source, path, archived)
        return SceneSection(model=model, parameters=_check(SceneFileParameters, parameters, source, "scene"), **found)
    try:
        kind = scene_parameters(model)
        offers = tuple(name for name, function in _OFFERED.items() if scene_has(model, function))
    except SceneError as error:
        raise UserError(source, "scene.model", model, error.remedy) from None
    checked, found = _check(kind, parameters, source, "scene"), {}
    if kept is not None and kept.holds_scene and model == kept.scene.get("model"):
        before = {key: value for key, value in kept.scene.items() if key != "model"}
        if checked == _check(kind, before, source, "scene"):
            found = _find_scene(model, source, path, kept)
    return SceneSection(model=model, parameters=checked, **{**found, "offers": offers})


def _check_model_scene(model: str, table: Table, source: str, path: Path, archived: Archived | None) -> SceneSection:
    """A finite-element model; a result file holds what it was reduced to."""
    # what reads and reduces it is loaded where there is one
    from studies.fe_models.from_files.model import find_files
    from studies.fe_models.from_files.parameters import Parameters

    parameters = _check(Parameters, table, source, "scene")
    if archived is not None and archived.holds_scene and model == archived.scene.get("model"):
        before = _check(
            Parameters, {key: archived.scene[key] for key in archived.scene if key != "model"}, source, "scene"
        )
        for key, value in parameters:
            if value != getattr(before, key) and not (key == "friction_coefficient" and isinstance(value, float)):
                remedy = "leave it out: the result holds the reduced scene; to change it run the study file again"
                raise UserError(source, f"scene.{key}", table.get(key), remedy)
        return SceneSection(model=model, parameters=parameters, **_find_scene(model, source, path, archived))
    with scene_errors(source, None):
        files = find_files(path.parent, model, parameters)
    return SceneSection(model=model, parameters=parameters, files=files, offers=("mesh",))


def _find_scene(model: str, source: str, path: Path, archived: Archived | None) -> dict[str, Any]:
    """Where the scene of a scene file stands and what it offers, once it is known that it can be read at all."""
    from studies.scene_file import has_mesh

    if archived is not None and archived.holds_scene and model == archived.scene.get("model"):
        scene_path, group = path, SCENE_GROUP
    else:
        scene_path, group = path.parent / model, ""
        try:
            exists = scene_path.is_file()
        except (OSError, ValueError):
            exists = False
        if not exists:
            remedy = "there is no such file: give a path relative to the study file"
            raise UserError(source, "scene.model", model, remedy)
    with scene_errors(source, scene_path):
        if not group:
            check_scene_readable(scene_path)
        offers = ("mesh",) if has_mesh(scene_path, group) else ()
    return {"path": scene_path, "group": group, "offers": offers}


def _check(kind: type[Checked], table: Mapping[str, object], source: str, prefix: str) -> Checked:
    """`kind` from the table, or UserError for the first thing wrong in it. Keys of the table stand under `prefix`."""
    try:
        return kind.model_validate(table, strict=True)
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
    except SceneError as error:
        raise UserError(
            source, ".".join(filter(None, (prefix, error.key))), Verbatim(error.value), error.remedy
        ) from None
    raise _user_error(kind, details, source, prefix)


def _user_error(kind: type[BaseModel], details: ErrorDetails, source: str, prefix: str) -> UserError:
    owner, names = _owner(kind, [str(part) for part in details["loc"]])
    key, field = ".".join(filter(None, (prefix, *names))), names[-1] if names else ""
    description = owner.model_fields[field].description if field in owner.model_fields else None
    unit = f" ({description})" if description else ""
    if details["type"] == "extra_forbidden":
        return UserError(source, key, details["input"], f"unknown key, give {nearest_name(field, owner.model_fields)}")
    if details["type"] == "missing":
        return UserError(source, key, None, f"missing: give it{unit}")
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, WrongValueError):
        return UserError(source, cause.key or key, cause.value, cause.remedy + unit)
    if isinstance(cause, SceneError):
        named = ".".join(filter(None, (prefix, cause.key)))
        return UserError(source, named or key, Verbatim(cause.value), cause.remedy + unit)
    if isinstance(details["input"], list) and details["type"].endswith("_type") and prefix != "axes":
        several = "give one value: only keys of [axes] have several, which keys of [solver] may be, too"
        return UserError(source, key, details["input"], several + unit)
    message = details["msg"].removeprefix("Value error, ").replace("Input should be", "give").strip()
    return UserError(source, key, details["input"], message + unit)


def _owner(kind: type[BaseModel], place: Sequence[str]) -> tuple[type[BaseModel], Sequence[str]]:
    """Class that holds the key at `place`, and the names that lead to it, without places in a list."""
    for depth, name in enumerate(place, start=1):
        inner = kind.model_fields[name].annotation if name in kind.model_fields else None
        if depth == len(place) or not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return kind, place[:depth]
        kind = inner
    return kind, ()


def _toml_key(key: str) -> str:
    """A key, in quotes where it is no bare one: labels of surfaces are any text."""
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def _toml_value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_toml_key(key)} = {_toml_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    return "inf" if value == math.inf else json.dumps(value, ensure_ascii=False)
