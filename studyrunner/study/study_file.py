"""Reads a study: finds the file, applies the overrides, checks all of it; and writes the effective study as TOML."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from solver.settings import FOLLOWED, Followed, FollowedFrequency
from studies.hdf5 import is_hdf5
from studyrunner.scatter import flat_table
from studyrunner.study.mission import OWN_AXES, MissionBlock, engine_frequency, read_blocks
from studyrunner.study.mistakes import Mistakes, check_table, close_name, nearest_name
from studyrunner.study.overrides import override
from studyrunner.study.realisation import with_room_for_wear
from studyrunner.study.rules import check_rules, size_of_result, wrong_scatter
from studyrunner.study.scene_axes import (
    SceneAxis,
    as_checked,
    combinations,
    keys_below_axes,
    only_table,
    scene_with_axes,
    take_scene_axes,
)
from studyrunner.study.scene_section import WORN_AXIS, Origin, check_scene, parameters_of, read_worn, worn_axis
from studyrunner.study.sections import (
    DEFAULT,
    ELSEWHERE,
    SECTIONS,
    SOLVER_AXES,
    VARIABLES,
    AxesSection,
    SlowTimeSection,
    WearSection,
)
from studyrunner.study.study import MODES, Study
from studyrunner.study.text import format_toml, read_archived, read_toml, read_toml_file
from studyrunner.user_error import UserError
from studyrunner.values import listed
from studyrunner.variables import FOLLOWED_FREQUENCY

Tables = dict[str, Any]

_IDLE_FREQUENCY = 1.0  # Hz, where no point has a frequency of the axis
_ON_REQUEST = ("scatter", "loading", "mission")
_TABLES = ("study", "scene", "axes", "wear", "slow_time", "solver", "outputs", *_ON_REQUEST)


def read_study(study: str | Path, overrides: Sequence[str] | Mapping[str, object] = ()) -> Study:
    """Read and check a study; every default is filled in.

    study: path of a TOML file or of a result file, or the name of a bundled study. overrides: values of keys by their
    dotted names, as `{"slow_time.cycles": 1e4, "axes.frequency": [210.0, 210.5]}`, where numpy arrays and tuples stand
    for lists; or texts KEY=VALUE, where VALUE is TOML or a bare word.

    Raises UserError where there is no such study or something in it is wrong: a line for each mistake.
    """
    argument = str(study)
    path = _study_path(argument)
    archived = None
    try:
        if is_hdf5(path):
            archived = read_archived(path, argument)
            table = read_toml(archived.study.encode(), argument)
            archived = replace(archived, scene=scene_with_axes(_dict(table, "scene"), _dict(table, "axes")))
        else:
            table = read_toml_file(path, argument)
    except OSError as error:
        raise UserError(argument, "the file", None, f"give a file that can be read: {error.strerror}") from None
    override(table, overrides)
    return _check_study(table, Origin(argument, path, archived, _dict(table, "outputs").get("scene") is True))


def bundled_studies() -> tuple[str, ...]:
    """Names of the studies that come with the program."""
    files = (Path(str(file.name)) for file in resources.files("studies").iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".toml"))


def _study_path(argument: str) -> Path:
    path, names = Path(argument), bundled_studies()
    try:
        if path.is_file():
            return path
        remedy = "give a TOML file: this is a folder" if path.is_dir() else ""
    except OSError as error:
        remedy = f"give a file that can be read: {error.strerror}"
    if not remedy and argument in names:
        return Path(str(resources.files("studies").joinpath(f"{argument}.toml")))
    what = "no such file" if path.suffix == ".toml" or "/" in argument or "\\" in argument else "none of this name"
    remedy = remedy or f"there is {what}: give a TOML file or one of the bundled studies {', '.join(names)}"
    raise UserError(argument, "the study", None, remedy)


def _dict(table: Mapping[str, object], name: str) -> dict[str, Any]:
    section = table.get(name, {})
    return section if isinstance(section, dict) else {}


def _check_study(table: Mapping[str, object], origin: Origin) -> Study:
    """The study in a table as TOML has it, every default filled in.

    Raises UserError with all that is wrong in single tables; where nothing is, with all that does not fit together.
    """
    found = Mistakes(origin.source)
    tables = _known_tables(table, found)
    _take_worn(tables, origin, found)
    scene: type[BaseModel] | None = None
    with contextlib.suppress(UserError):  # a mistake where the scene is checked
        scene = parameters_of(tables["scene"].get("model"), origin.source)
    axes, blocks = _axes_and_blocks(tables, scene, found)
    solver_axes = _take_solver_axes(tables, found)
    renamed, parts = {**keys_below_axes(axes), **solver_axes}, []
    sections = {**_check_sections(tables, scene, renamed, found), "mission": blocks, "archived": origin.archived}
    sections |= {"source": origin.source, "folder": origin.path.parent}
    sections["solver_axes"] = tuple(key for key in SOLVER_AXES if f"solver.{key}" in solver_axes)
    for part in combinations(tables, axes):
        of_part: dict[str, Any] = {}
        with found.collecting(renamed):
            of_part["wear"] = check_table(WearSection, part["wear"], origin.source, "wear")
        with found.collecting(renamed):
            of_part["scene"] = check_scene(part["scene"], origin)
        parts.append((part["scene"], of_part))
    found.raise_any(table)
    studies = []
    for given, of_part in parts:
        with found.collecting(renamed):
            study, wrong = Study.model_construct(**sections, **of_part), Mistakes(origin.source)
            check_rules(study, wrong)
            study = _with_block_studies(study, given, origin, wrong) if blocks else study
            wrong.raise_any()
            studies.append(_complete(study))
    found.raise_any(table)
    study = studies[0]
    if axes:
        study = study.model_copy(update={"scene_axes": as_checked(axes, study), "variants": tuple(studies)})
        for each in (*size_of_result(study), *wrong_scatter(study)):
            found.add(*each)
        found.raise_any()
    return study


def _known_tables(table: Mapping[str, object], found: Mistakes) -> Tables:
    """The tables of a study file, those that may be missing as empty ones; copies, in which keys may be changed."""
    given: Tables = {}
    for name, section in table.items():
        meant = nearest_name(name, _TABLES)
        if meant != name:
            found.add(name, section, f"unknown table, give {meant}")
        elif meant != "mission" and not isinstance(section, dict):
            found.add(name, section, f"give a table [{name}] with keys")
        # what a table of another name holds may be wrong as well
        if meant in _TABLES and (meant == name or meant not in table):
            own: Any = dict(section) if isinstance(section, dict) else section if meant == "mission" else {}
            given[meant] = flat_table(own) if meant == "scatter" else own
    for name in ("study", "scene", *(() if "mission" in table else ("axes",))):
        if name not in given:
            found.add(name, None, f"missing: give a table [{name}]")
    return {name: {} for name in _TABLES if name not in _ON_REQUEST} | given


def _take_worn(tables: Tables, origin: Origin, found: Mistakes) -> None:
    worn = tables["scene"].pop("worn", None)
    if worn is None:
        return
    with found.collecting():
        tables["scene"]["worn"] = read_worn(worn, origin.source, origin.path.parent)
        if "modal_amplitude" in tables["axes"] and not tables["scene"]["worn"]["cycle"]:
            remedy = "missing: give the cycle count of each depth, which is the coordinate cycle of the modes"
            found.add("scene.worn.cycle", None, remedy)


def _axes_and_blocks(
    tables: Tables, scene: type[BaseModel] | None, found: Mistakes
) -> tuple[tuple[SceneAxis, ...], tuple[MissionBlock, ...]]:
    """Axes that are keys of [scene] or [wear], taken out of the tables, and the blocks of a study of missions.

    scene: what [scene] consists of; None where its model is wrong.
    """
    if scene is None:
        # other names may be keys of the scene
        own = [*AxesSection.model_fields]
        tables["axes"] = {name: each for name, each in tables["axes"].items() if close_name(name, own)}
        return (), ()
    own = [name for name in tables["axes"] if name in OWN_AXES]
    axes = take_scene_axes(tables, scene, found)
    blocks: tuple[MissionBlock, ...] = ()
    if "mission" in tables:
        blocks = read_blocks(tables["mission"], tables["axes"], scene, found)
        for used in [*own, *(axis.name for axis in axes)]:
            if blocks and all(block.gives(used) for block in blocks):
                found.add(f"axes.{used}", None, f"leave it out: every block under [[mission]] gives its own {used}")
    name = "cycle" if "modal_amplitude" in tables["axes"] else WORN_AXIS
    return (*axes, *worn_axis(tables["scene"].get("worn", {}), name)), blocks


def _take_solver_axes(tables: Tables, found: Mistakes) -> dict[str, str]:
    """Moves keys of [solver] from [axes]: their names there, and in the file."""
    renamed: dict[str, str] = {}
    for key in [key for key in SOLVER_AXES if key in tables["axes"]]:
        if key in tables["solver"]:
            found.add(f"solver.{key}", tables["solver"][key], f"give it once, here or as axes.{key}")
        tables["solver"][key] = tables["axes"].pop(key)
        renamed |= {f"solver.{key}{end}": f"axes.{key}{end}" for end in ("", ".start", ".stop", ".num", ".spacing")}
    return renamed


def _check_sections(
    tables: Tables, scene: type[BaseModel] | None, renamed: Mapping[str, str], found: Mistakes
) -> dict[str, Any]:
    """The tables but [scene] and [wear], which differ along axes: those that are right."""
    sections: dict[str, Any] = {}
    if any(each in FOLLOWED for each in listed(tables["axes"].get("frequency"))):
        tables.setdefault("loading", {})
    for name, kind in SECTIONS.items():
        if name in tables and name not in found and name != "wear":
            of_parts = (*scene.model_fields, *WearSection.AXES) if scene and name == "axes" else ()
            with found.collecting(renamed):
                others = {**ELSEWHERE, **{key: key for key in of_parts}}
                sections[name] = check_table(kind, tables[name], found.source, name, others)
    return sections


def _with_block_studies(study: Study, scene: Mapping[str, Any], origin: Origin, found: Mistakes) -> Study:
    """The study with a study of each block alone. scene: table of the study."""
    studies = []
    for block in study.mission:
        own = {name: (getattr(block, name),) for name in OWN_AXES if isinstance(getattr(block, name), float)}
        update: dict[str, Any] = {"mission": (), "slow_time": SlowTimeSection()}
        with found.collecting({f"scene.{key}": f"mission.{block.name}.{key}" for key in block.parameters}):
            update["scene"] = check_scene({**scene, **block.parameters}, origin)
            if block.engine_order is not None:
                own["frequency"] = (engine_frequency(block, update["scene"].parameters, origin.source),)
        axes = {"frequency": study.axes.frequency or (_IDLE_FREQUENCY,), **own}
        update["axes"] = study.axes.model_copy(update=axes)
        studies.append(study.model_copy(update=update))
    return study.model_copy(update={"block_studies": tuple(studies)})


def _complete(study: Study) -> Study:
    """A right study with frequencies in numbers, variables by name, and scenes that have room for wear.

    Ratios stand for frequencies until the natural frequencies of the scenes are known (`scene_set.at_ratios`).
    """
    axes, kind, names = study.axes, study.kind, set(study.outputs.variables)
    frequency = axes.frequency_ratio or axes.frequency or (_IDLE_FREQUENCY,)
    update: dict[str, object] = {}
    if study.loading is not None:
        low, high = study.loading.between
        update["follow"] = FollowedFrequency(cast("Followed", frequency[0]), low, high)
        frequency = (0.5 * low + 0.5 * high,)
    if DEFAULT in names:
        names |= {*(kind.usual if study.scatter is None else kind.of_samples)}
        names |= {*(FOLLOWED_FREQUENCY if study.loading is not None else ())}
        names |= {"mesh"} & {*study.scene.offers}
    outputs = study.outputs.model_copy(update={"variables": tuple(name for name in VARIABLES if name in names)})
    update |= {"axes": axes.model_copy(update={"frequency": frequency}), "outputs": outputs}
    update |= {"slow_time": SlowTimeSection(cycles=0.0)} if kind is MODES else {}
    update["block_studies"] = tuple(each.model_copy(update={"outputs": outputs}) for each in study.block_studies)
    return with_room_for_wear(study.model_copy(update=update))


def format_study(study: Study) -> str:
    """The effective study, every default filled in, as TOML; read again it is the same study."""
    tables = study.model_dump(mode="json")
    scene, axes = tables["scene"], tables["axes"]
    # parameters that differ along the axes without being one: each scene has room for its own wear
    names = {axis.key[0] for axis in study.scene_axes}
    own, others = dict(study.scene.parameters), [dict(each.scene.parameters) for each in study.variants]
    chosen = {key for key in own if key not in names and any(other[key] != own[key] for other in others)}
    kept = {key: value for key, value in scene["parameters"].items() if key not in chosen}
    tables["scene"] = {"model": scene["model"], **kept, "worn": _worn_states(study)}
    if study.follow is not None:
        axes["frequency"] = study.follow.of
    used = {*study.own_axes, "modal_amplitude", "frequency_ratio"}
    used -= set() if axes["frequency_ratio"] is None else {"frequency"}
    axes = tables["axes"] = {name: values for name, values in axes.items() if name in used}
    for axis in study.scene_axes:
        if axis.key == ("worn",):
            continue
        given, place = tables[axis.table], axes
        for name in axis.key[:-1]:
            given, place = only_table(given[name]), place.setdefault(name, {})
        del given[axis.key[-1]]
        place[axis.key[-1]] = list(axis.values)
    solver = {key: value[0] if key in SOLVER_AXES else value for key, value in tables["solver"].items()}
    tables["solver"] = {key: value for key, value in solver.items() if key not in study.own_axes}
    axes |= {key: list(getattr(study.solver, key)) for key in SOLVER_AXES if key in study.own_axes}
    for table in ("slow_time", "wear"):
        for key in study.kind.unused.get(table, ()):
            del tables[table][key]
    tables["mission"] = [block.as_table() for block in study.mission]
    return format_toml(tables)


def _worn_states(study: Study) -> dict[str, object] | None:
    worn = study.scene.worn
    if worn is None:
        return None
    counts = [count for axis in study.scene_axes if axis.key == ("worn",) for count in axis.values]
    if not counts:
        return {"depth": [list(each) for each in worn.depth]}
    # the axis of worn states is the last one
    depths = [variant.scene.worn.depth[0] for variant in study.variants[: len(counts)] if variant.scene.worn]
    return {"cycle": counts, "depth": [list(each) for each in depths], "result": worn.result}
