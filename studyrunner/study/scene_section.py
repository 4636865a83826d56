"""[scene] of a study: which scene its model names, the parameters of this model, and where its files are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel, Field, SerializeAsAny

from studies.contact_compliance import ContactStiffness
from studies.fe_models.model_files import ModelFiles
from studies.scene_error import SceneError
from studies.scenes import scene_has, scene_parameters
from studyrunner.study.mistakes import Mistakes, check_table, scene_errors
from studyrunner.study.sections import names_file, names_model
from studyrunner.study.study_of_result import SCENE_GROUP, Archived
from studyrunner.study.worn import Worn
from studyrunner.user_error import UserError
from studyrunner.values import NotNegative, Section

_OFFERED = {"mesh": "describe_mesh", "exact": "exact_answer"}


class SceneFileParameters(Section):
    """[scene] of a scene file: the friction coefficient only, if the file has none for each pair."""

    AXES: ClassVar = ("friction_coefficient", "contact_stiffness")

    friction_coefficient: NotNegative | None = Field(None, description="a number, 0 or more")
    contact_stiffness: ContactStiffness = None


class SceneSection(Section):
    """[scene]: model, and parameters of this model.

    parameters: checked object of the class of the scene, with `friction_coefficient` at least.
    worn: wear that the joint begins with.
    path: file of the scene; None for a scene that is built.
    group: group of the scene in this file; empty in a scene file.
    files: files of a finite-element model; None for other scenes.
    offers: names in `outputs.variables` that this scene knows and not every scene knows.
    """

    model: str = Field(description="name of a bundled scene, or path of a scene file or a deck, beside the study file")
    parameters: SerializeAsAny[BaseModel]
    worn: Worn | None = Field(None, description="wear before the history begins")
    path: Path | None = Field(None, exclude=True)
    group: str = Field("", exclude=True)
    files: ModelFiles | None = Field(None, exclude=True)
    offers: tuple[str, ...] = Field((), exclude=True)

    @property
    def is_bundled(self) -> bool:
        """Whether the scene is a bundled one; a result may hold the model that it was built to."""
        return not (names_file(self.model) or names_model(self.model))


@dataclass(frozen=True)
class Origin:
    """Where a study is from.

    source: the file as the user named it. path: where it is; relative paths start in its folder. archived: what it says
    of the result that it holds. keeps_scene: whether this result keeps the model of a bundled scene.
    """

    source: str
    path: Path
    archived: Archived | None = None
    keeps_scene: bool = False

    def holds(self, model: str) -> bool:
        """Whether the result holds the scene of this model."""
        return self.archived is not None and self.archived.holds_scene and self.archived.scene.get("model") == model

    def parameters_before(self, kind: type[BaseModel]) -> BaseModel:
        """Parameters of the scene in the result."""
        assert self.archived is not None
        table = {key: value for key, value in self.archived.scene.items() if key not in ("model", "worn")}
        return check_table(kind, table, self.source, "scene")


def parameters_of(model: object, source: str) -> type[BaseModel]:
    """What [scene] consists of beside `model` and `worn`. Raises UserError where there is no such scene."""
    if not isinstance(model, str):
        remedy = "give a bundled scene or the path of a scene file, in quotes"
        raise UserError(source, "scene.model", model, remedy if model is not None else f"missing: {remedy}")
    if names_model(model):
        from studies.fe_models.from_files.parameters import Parameters  # where it is used: it takes a while to load

        return Parameters
    if names_file(model):
        return SceneFileParameters
    try:
        return scene_parameters(model)
    except SceneError as error:
        raise UserError(source, "scene.model", model, error.remedy) from None


def check_scene(table: Mapping[str, Any], origin: Origin) -> SceneSection:
    """The scene in a table. Raises UserError."""
    source, model = origin.source, table.get("model")
    kind = parameters_of(model, source)
    assert isinstance(model, str)
    given = {key: value for key, value in table.items() if key not in ("model", "worn")}
    mistakes, worn = Mistakes(source), None
    with mistakes.collecting():
        parameters = check_table(kind, given, source, "scene", ("model", "worn"))
    if table.get("worn") is not None:
        with mistakes.collecting():
            worn = check_table(Worn, table["worn"], source, "scene.worn")
    mistakes.raise_any()
    if names_model(model):
        found = _find_model(model, parameters, given, origin)
    elif names_file(model):
        found = _find_scene(model, origin)
        if found["group"]:
            _check_kept(parameters, origin, ("contact_stiffness",), given)
    else:
        found = {}
        # only what was kept on request takes the place of what a bundled scene builds
        if origin.keeps_scene and origin.holds(model) and parameters == origin.parameters_before(kind):
            found = _find_scene(model, origin)
        found["offers"] = tuple(name for name, function in _OFFERED.items() if scene_has(model, function))
    return SceneSection(model=model, parameters=parameters, worn=worn, **found)


def _find_model(model: str, parameters: BaseModel, given: Mapping[str, Any], origin: Origin) -> dict[str, Any]:
    """The files of a finite-element model; a result file holds what it was reduced to."""
    # what reads and reduces it is loaded where there is one
    from studies.fe_models.from_files.model import find_files
    from studies.fe_models.from_files.parameters import Parameters

    assert isinstance(parameters, Parameters)
    if origin.holds(model):
        own_friction = isinstance(parameters.friction_coefficient, float)
        fixed = tuple(key for key in Parameters.model_fields if not (own_friction and key == "friction_coefficient"))
        _check_kept(parameters, origin, fixed, given)
        return _find_scene(model, origin)
    with scene_errors(origin.source, None):
        files = find_files(origin.path.parent, model, parameters)
    return {"files": files, "offers": ("mesh",) if files.has_faces else ()}


def _check_kept(parameters: BaseModel, origin: Origin, fixed: tuple[str, ...], given: Mapping[str, Any]) -> None:
    """Raises UserError where parameters `fixed` differ from those with which the scene in a result was reduced."""
    before = origin.parameters_before(type(parameters))
    for key in fixed:
        if getattr(parameters, key) != getattr(before, key):
            remedy = "leave it out: the result holds the reduced scene; to change it run the study file again"
            raise UserError(origin.source, f"scene.{key}", given.get(key), remedy)


def _find_scene(model: str, origin: Origin) -> dict[str, Any]:
    """Where the scene of a scene file stands and what it offers, once it is known that it can be read at all."""
    from studies.scene_file import has_mesh

    path, group = (origin.path, SCENE_GROUP) if origin.holds(model) else (origin.path.parent / model, "")
    try:
        exists = bool(group) or path.is_file()
    except (OSError, ValueError):
        exists = False
    if not exists:
        remedy = "there is no such file: give a path relative to the study file"
        raise UserError(origin.source, "scene.model", model, remedy)
    with scene_errors(origin.source, path):
        offers = ("mesh",) if has_mesh(path, group) else ()
    return {"path": path, "group": group, "offers": offers}
