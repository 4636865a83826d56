"""Reads a study: finds the file, applies the overrides, checks all of it; and writes the effective study as TOML."""

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from solver.settings import FOLLOWED, Followed, FollowedFrequency
from studies.hdf5 import is_hdf5
from studies.sectors import OfRing
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.kinds.table import KINDS
from studyrunner.kinds.wear.kind import FOLLOWED_FREQUENCY, OF_EVOLUTION
from studyrunner.measured import QUANTITIES, read_measured
from studyrunner.scatter import flat_table
from studyrunner.study import scene_axes, sections
from studyrunner.study.design import Design, read_archived_design, read_design
from studyrunner.study.mistakes import check_tables, keys_as_given, nearest_name, raise_wrong
from studyrunner.study.overrides import override, with_design
from studyrunner.study.room import with_room_for_wear
from studyrunner.study.rules import broken_rules
from studyrunner.study.scene_section import WORN_AXIS, Origin, SceneSection, find_scene, read_source, read_worn
from studyrunner.study.sectors import read_sectors
from studyrunner.study.study import Study
from studyrunner.study.text import SCENE_GROUP, format_toml, read_archived, read_toml
from studyrunner.user_error import UserError, Verbatim
from studyrunner.values import listed

_ON_REQUEST = ("scatter", "loading", "measured")


def read_study(study: str | Path, overrides: Sequence[str] | Mapping[str, object] = (), points: object = None) -> Study:
    """Read and check a study; every default is filled in.

    study: path of a TOML file or of a result file, or the name of a bundled study. overrides: values of keys by their
    dotted names, as `{"slow_time.cycles": 1e4, "axes.frequency": [210.0, 210.5]}`, where numpy arrays and tuples stand
    for lists, and None leaves a key out, as "points" the design of a result; or texts KEY=VALUE, where VALUE is TOML or
    a bare word. points: a table with a row a point, and columns in place of the axes that they are named as, in a file
    or as `read_design` takes it.

    Raises UserError where there is no such study or something in it is wrong: a line for each mistake.
    """
    source = str(study)
    path = _study_path(source)
    archived, scene, design, before = None, None, None, ""
    try:
        if is_hdf5(path):
            archived = read_archived(path, source)
            table = read_toml(archived.study.encode(), source)
            columns = cast("Any", table.pop("points", {})).get("columns")
            design = read_archived_design(path, source, columns) if columns else None
            whole = with_design(table, design)
            scene = _scene_of_result(whole, source, path, design) if archived.holds_scene else None
            before = _about_scenes(_tables_of(whole, source))
        else:
            table = read_toml(path, source)
    except OSError as error:
        raise UserError(source, "the file", None, f"give a file that can be read: {error.strerror}") from None
    if points is not None or (isinstance(overrides, Mapping) and "points" in overrides):
        design = None if points is None else read_design(points)
    override(table, overrides, design)
    table = with_design(table, design)
    if archived is not None and _about_scenes(_tables_of(table, source)) != before:
        archived = replace(archived, scene_sha256=None)
    with contextlib.nullcontext() if design is None else design.errors():
        found = _check_study(table, Origin(source, path, archived, scene), design)
        return found if design is None else _with_units(found, design)


@contextlib.contextmanager
def keys_in_file(study: Study) -> Iterator[None]:
    """A UserError that is raised inside names keys as the file of the study, or its design, has them."""
    of_design = contextlib.nullcontext() if study.design is None else study.design.errors()
    with of_design, keys_as_given(scene_axes.keys_below_axes(study.scene_axes)):
        yield


def bundled_studies() -> tuple[str, ...]:
    """Names of the studies that come with the program."""
    files = (Path(str(file.name)) for file in resources.files("studies").iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".toml"))


def _study_path(argument: str) -> Path:
    names = bundled_studies()
    with contextlib.suppress(OSError):
        if Path(argument).is_file():
            return Path(argument)
    if argument in names:
        return Path(str(resources.files("studies").joinpath(f"{argument}.toml")))
    remedy = f"there is no such file: give a TOML file or one of the bundled studies {', '.join(names)}"
    raise UserError(argument, "the study", None, remedy)


def _tables_of(table: Mapping[str, object], source: str) -> scene_axes.Tables:
    """The tables of a study file, those that are always read as empty ones; copies, in which keys may be changed."""
    tables: scene_axes.Tables = {name: {} for name in sections.SECTIONS if name not in _ON_REQUEST} | {"scene": {}}
    of_kinds = [kind.table for kind in KINDS.values() if kind.table]
    for name, section in table.items():
        if (meant := nearest_name(name, (*sections.SECTIONS, "scene", *of_kinds))) != name:
            raise UserError(source, name, section, f"unknown table, give {meant}")
        if name not in of_kinds and not isinstance(section, dict):
            raise UserError(source, name, section, f"give a table [{name}] with keys")
        tables[name] = dict(section) if isinstance(section, dict) else section
    if "scatter" in tables:
        tables["scatter"] = flat_table(tables["scatter"])
    return tables


def _about_scenes(tables: scene_axes.Tables) -> str:
    """All that the scenes of a study depend on, as text."""
    keys = [(name, value) for name, value in tables["axes"].items() if name not in sections.AxesSection.model_fields]
    scene = {name: value for name, value in tables["scene"].items() if name != "worn"}
    return json.dumps([scene, keys, tables.get("scatter")], sort_keys=True, default=str)


def _scene_of_result(table: Mapping[str, object], source: str, path: Path, design: Design | None) -> SceneSection:
    """The scene of the study of a result that keeps its reduced model: one for all values of axes."""
    tables = _tables_of(table, source)
    model, _ = tables["scene"].pop("model", None), tables["scene"].pop("worn", None)
    found = read_source(model, source, path.parent, in_result=True)
    axes = scene_axes.take_axes(tables, found.parameters, source, design)
    given = next(scene_axes.variants_of(tables, axes, design))["scene"]
    parameters = check_tables({"scene": found.parameters}, {"scene": given}, source)["scene"]
    return SceneSection(model=found.model, parameters=parameters, source=replace(found, held=(path, SCENE_GROUP)))


def _check_study(table: Mapping[str, object], origin: Origin, design: Design | None) -> Study:
    """The study in a table as TOML has it, every default filled in.

    Raises UserError with all that is wrong in single tables; where nothing is, with all that does not fit together.
    """
    source, tables = origin.source, _tables_of(table, origin.source)
    model, worn = tables["scene"].pop("model", None), tables["scene"].pop("worn", None)
    found = read_source(model, source, origin.path.parent, in_result=origin.archived is not None)
    parameters = found.parameters
    kind, *others = [each for each in KINDS.values() if each.is_in(tables)] or KINDS.values()
    if kind.marker and others:
        remedy = f"leave it out, or {others[0].marker}: a study is of {kind.words} or of {others[0].words}"
        raise UserError(source, kind.marker, None, remedy)
    worn = None if worn is None else read_worn(worn, source, origin.path.parent)
    for key in OfRing.model_fields.keys() & tables["scene"].keys() - parameters.model_fields.keys():
        remedy = f"leave it out: {model} is no sector of a ring"
        raise UserError(source, f"scene.{key}", tables["scene"][key], remedy)
    if "sectors" in tables["scene"]:
        own, in_result = tables["scene"]["sectors"], origin.archived is not None
        tables["scene"]["sectors"] = read_sectors(own, source, origin.path.parent, in_result=in_result)
    if "measured" in tables:
        tables["measured"] = read_measured(tables["measured"], source, origin.path.parent)
    solver_axes = tuple(key for key in sections.SOLVER_AXES if key in tables["axes"])
    axes = scene_axes.take_axes(tables, parameters, source, design)
    of_kind: dict[str, Any] = {}
    if kind.table:
        of_kind = {kind.table: kind.part("rules").read_table(tables.pop(kind.table), parameters, source)}
    if any(each in FOLLOWED for each in listed(tables["axes"].get("frequency"))):
        tables.setdefault("loading", {})
    classes: dict[str, type[BaseModel]] = {name: each for name, each in sections.SECTIONS.items() if name in tables}
    with keys_as_given({**scene_axes.keys_below_axes(axes), **{f"solver.{key}": f"axes.{key}" for key in solver_axes}}):
        variants, studies = [*scene_axes.variants_of(tables, axes, design)], list[Study]()
        given_tables = check_tables({**classes, "scene": parameters}, {**tables, **variants[0]}, source)
        worn_axis: tuple[scene_axes.SceneAxis, ...] = ()
        if worn is not None and worn.cycle:
            name = WORN_AXIS if kind.counted else "cycle"
            meaning = "number of vibration cycles that have worn the joint before"
            worn_axis = (scene_axes.SceneAxis(name, "scene", ("worn",), worn.cycle, "1", meaning),)
        fixed = {"source": source, "folder": origin.path.parent, "archived": origin.archived}
        fixed |= {"kind": kind, "tables": of_kind, "solver_axes": solver_axes}
        fixed |= {"scene_axes": (*axes, *worn_axis), "design": design}
        for given in variants:
            checked = check_tables({"scene": parameters, "wear": sections.WearSection}, given, source)
            for state in (None,) if worn is None else worn.states():
                scene = SceneSection(model=found.model, parameters=checked["scene"], worn=state, source=found)
                own = {"scene": find_scene(scene, origin), "wear": checked["wear"]}
                study = Study.model_construct(**{**given_tables, **fixed, **own})
                raise_wrong(source, broken_rules(study, first=not studies))
                study = study.model_copy(update={"scene_axes": (), "design": None})
                if kind.table:
                    study = kind.part("rules").complete(study, given["scene"], origin)
                studies.append(_complete(study))
    study = studies[0]
    if (all_axes := (*scene_axes.as_checked(axes, study), *worn_axis)) or design is not None:
        study = study.model_copy(update={"scene_axes": all_axes, "variants": tuple(studies), "design": design})
    return study


def _complete(study: Study) -> Study:
    """A right study with frequencies in numbers, variables by name, and scenes that have room for wear.

    Ratios stand for frequencies until the natural frequencies of the scenes are known (`scene_set.at_ratios`).
    """
    axes, kind, names = study.axes, study.kind, set(study.outputs.variables)
    frequency = axes.frequency_ratio or axes.frequency or (sections.IDLE_FREQUENCY,)
    update: dict[str, object] = {}
    if study.loading is not None:
        low, high = study.loading.between
        update["follow"] = FollowedFrequency(cast("Followed", frequency[0]), low, high)
        frequency = (0.5 * low + 0.5 * high,)
    amplitude: tuple[Any, ...] = axes.excitation_amplitude
    if amplitude == (sections.ALLOWABLE,):
        update["allowable"], amplitude = True, (1.0,)
    if sections.DEFAULT in names:
        names |= {*(kind.usual if study.scatter is None else kind.of_samples)}
        names |= {*(FOLLOWED_FREQUENCY if study.loading is not None else ())}
        names |= {"friction_power"} & {*kind.asked} if study.wear.law == "power" else set()
        names |= {*OF_EVOLUTION} & {*kind.asked} if study.evolving else set()
        names |= {"mesh"} & {*study.scene.source.offers}
    measured = [name for name, _ in study.measured.all] if study.measured else []
    names |= {each for name in measured for each in QUANTITIES[name].variables} & {*kind.asked}
    if study.scatter is not None and study.scatter.given_limits:
        names |= {"worn_volume", "worn_volume_error", "wear_depth_max", "wear_depth_max_error"}
        names |= {"response_amplitude", "response_error"}
    known = dict.fromkeys((*KINDS["wear"].asked, *SCENE, *kind.asked))
    outputs = study.outputs.model_copy(update={"variables": tuple(name for name in known if name in names)})
    update |= {
        "axes": axes.model_copy(update={"frequency": frequency, "excitation_amplitude": amplitude}),
        "outputs": outputs,
    }
    update |= {"slow_time": sections.SlowTimeSection(cycles=0.0)} if not kind.counted else {}
    update["block_studies"] = tuple(each.model_copy(update={"outputs": outputs}) for each in study.block_studies)
    return with_room_for_wear(study.model_copy(update=update))


def format_study(study: Study) -> str:
    """The effective study, every default filled in, as TOML; read again it is the same study."""
    tables = study.model_dump(mode="json")
    # parameters that differ along the axes without being one: each scene has room for its own wear
    names = {axis.key[0] for axis in study.scene_axes}
    own, others = dict(study.scene.parameters), [dict(each.scene.parameters) for each in study.variants]
    chosen = {key for key in own if key not in names and any(other[key] != own[key] for other in others)}
    chosen |= {*study.evolving}  # whose first numbers stand there
    chosen |= {"friction_coefficient"} if study.scene.ring and study.scene.ring.friction else set()
    kept = {key: value for key, value in tables["scene"]["parameters"].items() if key not in chosen}
    tables["scene"] = {"model": study.scene.model, **kept, "worn": _worn_states(study)}
    used = {*study.own_axes, *study.kind.last_axes, *study.kind.other_axes}
    used -= set() if study.axes.frequency_ratio is None else {"frequency"}
    designed = {} if study.design is None else study.design.columns
    axes = tables["axes"] = {name: values for name, values in tables["axes"].items() if name in used}
    if study.follow is not None:
        axes["frequency"] = study.follow.of
    if study.allowable:
        axes["excitation_amplitude"] = sections.ALLOWABLE
    for axis in study.scene_axes:
        if axis.is_worn:
            continue
        given, place = tables[axis.table], {} if axis.name in designed else axes
        for name in axis.key[:-1]:
            given, place = scene_axes.only_table(given[name]), place.setdefault(name, {})
        del given[axis.key[-1]]
        place[axis.key[-1]] = list(axis.values)
    for key in sections.SOLVER_AXES:
        if key in study.own_axes:
            axes[key] = tables["solver"].pop(key)
        elif key in designed:
            del tables["solver"][key]
        else:
            (tables["solver"][key],) = tables["solver"][key]
    for table in ("slow_time", "wear"):
        tables[table] = {key: value for key, value in tables[table].items() if study.kind.is_read(table, key)}
    tables |= tables.pop("tables")
    if study.design is not None:
        tables["axes"] = {name: values for name, values in axes.items() if name not in designed}
        tables["points"] = {"columns": [column.key for column in designed.values()]}
    return format_toml(tables)


def _with_units(study: Study, design: Design) -> Study:
    """The study, once it is known that units in headers of a design are those of the axes."""
    of_scenes = {axis.name: axis.units for axis in study.scene_axes}
    for name, column in design.columns.items():
        units = of_scenes.get(name) or COORDINATES[name].units
        if column.unit is not None and column.unit not in (units, *(("", "-") if units == "1" else ())):
            remedy = (
                "give plain numbers, without a unit"
                if units == "1"
                else f"give the column in {units}, or without a unit"
            )
            raise UserError(design.source, f"column {column.key}", Verbatim(f"[{column.unit}]"), remedy)
    return study


def _worn_states(study: Study) -> dict[str, object] | None:
    worn = study.scene.worn
    if worn is None:
        return None
    counts = [count for axis in study.scene_axes if axis.is_worn for count in axis.values]
    # the axis of worn states is the last one
    variants = study.variants[: len(counts)] if counts else (study,)
    states = [each.scene.worn for each in variants if each.scene.worn]
    found: dict[str, object] = {"depth": [list(each.depth[0]) for each in states]}
    found |= {"energy": [list(each.energy[0]) for each in states]} if worn.energy else {}
    return {"cycle": counts, **found, "result": worn.result} if counts else found
