"""The table [scene] of a study: which scene its model names, its parameters, and where its files are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from studies.scene_error import SceneError
from studies.scenes import scene_has, scene_parameters
from studyrunner.study.checked_table import check_table
from studyrunner.study.scene_errors import scene_errors
from studyrunner.study.sections import SceneFileParameters, SceneSection, names_file, names_model
from studyrunner.study.study_of_result import SCENE_GROUP, Archived
from studyrunner.study.worn import Worn
from studyrunner.user_error import UserError

Table = dict[str, object]

_OFFERED = {"mesh": "describe_mesh", "exact": "exact_answer"}


def parameters_of(model: object) -> type[BaseModel]:
    """What [scene] consists of beside `model`. Raises SceneError where there is no such scene."""
    if isinstance(model, str) and names_model(model):
        from studies.fe_models.from_files.parameters import Parameters

        return Parameters
    return SceneFileParameters if not isinstance(model, str) or names_file(model) else scene_parameters(model)


def check_scene(
    table: Table, source: str, path: Path, archived: Archived | None, kept: Archived | None
) -> SceneSection:
    """The scene in a table. kept: the result that may hold what a bundled scene was built to, None to build it."""
    parameters = dict(table)
    if "worn" in parameters:
        worn = check_table(Worn, cast("Table", parameters.pop("worn")), source, "scene.worn")
        section = check_scene(parameters, source, path, _without_wear(archived), _without_wear(kept))
        return section.model_copy(update={"worn": worn})
    model = parameters.pop("model", None)
    if model is None:
        raise UserError(source, "scene.model", None, "missing: give a bundled scene or the path of a scene file")
    if not isinstance(model, str):
        raise UserError(source, "scene.model", model, "give a bundled scene or the path of a scene file, in quotes")
    if names_model(model):
        return _check_model(model, parameters, source, path, archived)
    if names_file(model):
        found = _find_scene(model, source, path, archived)
        given = check_table(SceneFileParameters, parameters, source, "scene")
        if found["group"] and archived is not None:
            before = check_table(SceneFileParameters, _without_model(archived.scene), source, "scene")
            _check_kept(given, before, ("contact_stiffness",), parameters, source)
        return SceneSection(model=model, parameters=given, **found)
    try:
        kind = scene_parameters(model)
        offers = tuple(name for name, function in _OFFERED.items() if scene_has(model, function))
    except SceneError as error:
        raise UserError(source, "scene.model", model, error.remedy) from None
    checked, found = check_table(kind, parameters, source, "scene"), {}
    holds = kept is not None and kept.holds_scene and model == kept.scene.get("model")
    if kept is not None and holds and checked == check_table(kind, _without_model(kept.scene), source, "scene"):
        found = _find_scene(model, source, path, kept)
    return SceneSection(model=model, parameters=checked, **{**found, "offers": offers})


def _without_wear(archived: Archived | None) -> Archived | None:
    """A result whose scene is compared with one that is not worn."""
    if archived is None:
        return None
    return replace(archived, scene={key: value for key, value in archived.scene.items() if key != "worn"})


def _check_model(model: str, table: Table, source: str, path: Path, archived: Archived | None) -> SceneSection:
    """A finite-element model; a result file holds what it was reduced to."""
    # what reads and reduces it is loaded where there is one
    from studies.fe_models.from_files.model import find_files
    from studies.fe_models.from_files.parameters import Parameters

    parameters = check_table(Parameters, table, source, "scene")
    if archived is not None and archived.holds_scene and model == archived.scene.get("model"):
        before = check_table(Parameters, _without_model(archived.scene), source, "scene")
        own_friction = isinstance(parameters.friction_coefficient, float)
        fixed = tuple(key for key in Parameters.model_fields if not (own_friction and key == "friction_coefficient"))
        _check_kept(parameters, before, fixed, table, source)
        return SceneSection(model=model, parameters=parameters, **_find_scene(model, source, path, archived))
    with scene_errors(source, None):
        files = find_files(path.parent, model, parameters)
    return SceneSection(model=model, parameters=parameters, files=files, offers=("mesh",))


def _without_model(scene: Mapping[str, object]) -> Table:
    return {key: value for key, value in scene.items() if key != "model"}


def _check_kept(given: BaseModel, before: BaseModel, fixed: tuple[str, ...], table: Table, source: str) -> None:
    """Raises UserError where parameters `fixed` differ from those before, with which a kept scene was reduced."""
    for key in fixed:
        if getattr(given, key) != getattr(before, key):
            remedy = "leave it out: the result holds the reduced scene; to change it run the study file again"
            raise UserError(source, f"scene.{key}", table.get(key), remedy)


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
        offers = ("mesh",) if has_mesh(scene_path, group) else ()
    return {"path": scene_path, "group": group, "offers": offers}
