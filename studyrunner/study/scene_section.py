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
from studyrunner.study.mistakes import Mistakes, check_table, close_name, scene_errors
from studyrunner.study.study_of_result import SCENE_GROUP, Archived
from studyrunner.study.worn import Worn
from studyrunner.user_error import UserError
from studyrunner.values import NotNegative, Section

_OFFERED = {"mesh": "describe_mesh", "exact": "exact_answer"}


def _names_model(model: str) -> bool:
    """Whether the text under `scene.model` names a finite-element model: a deck, a mesh or a table of nodes."""
    return Path(model).suffix.lower() in (".inp", ".msh", ".cdb", ".csv")


def _names_file(model: str) -> bool:
    """Whether the text under `scene.model` names a scene file: a path, or a name with an HDF5 ending."""
    return "/" in model or "\\" in model or Path(model).suffix.lower() in (".h5", ".hdf5", ".he5")


class SceneFileParameters(Section):
    """[scene] of a scene file: the friction coefficient only, if the file has none for each pair."""

    AXES: ClassVar = ("friction_coefficient", "contact_stiffness")

    friction_coefficient: NotNegative | None = Field(None, description="a number, 0 or more")
    contact_stiffness: ContactStiffness = None


class SceneSection(Section):
    """[scene]: model, and parameters of this model.

    parameters: checked object of the class of the scene, with `friction_coefficient` at least.
    worn: wear that the joint begins with.
    path, group: file of the scene and its group in this file, which is empty in a scene file; None where it is built.
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
        return not (_names_file(self.model) or _names_model(self.model))


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

    def parameters_before(self, model: str, kind: type[BaseModel]) -> BaseModel | None:
        """Parameters of the scene that the result holds; None where it holds none of this model."""
        held = self.archived
        if held is None or not held.holds_scene or held.scene.get("model") != model:
            return None
        table = {key: value for key, value in held.scene.items() if key not in ("model", "worn")}
        return check_table(kind, table, self.source, "scene")


def parameters_of(model: object, source: str) -> type[BaseModel]:
    """What [scene] consists of beside `model` and `worn`. Raises UserError where there is no such scene."""
    if not isinstance(model, str):
        remedy = "give a bundled scene or the path of a scene file, in quotes"
        raise UserError(source, "scene.model", model, remedy if model is not None else f"missing: {remedy}")
    if _names_model(model):
        from studies.fe_models.from_files.parameters import Parameters  # where it is used: it takes a while to load

        return Parameters
    if _names_file(model):
        return SceneFileParameters
    try:
        return scene_parameters(model)
    except SceneError as error:
        raise UserError(source, "scene.model", model, error.remedy) from None


def check_scene(table: Mapping[str, Any], origin: Origin) -> SceneSection:
    """The scene in a table. Raises UserError."""
    model = table.get("model")
    for key in table if model is None else ():
        if close_name(key, ["model"]):
            raise UserError(origin.source, f"scene.{key}", table[key], "unknown key, give model")
    kind = parameters_of(model, origin.source)
    assert isinstance(model, str)
    given = {key: value for key, value in table.items() if key not in ("model", "worn")}
    mistakes, worn = Mistakes(origin.source), None
    with mistakes.collecting():
        parameters = check_table(kind, given, origin.source, "scene", ("model", "worn"))
    if table.get("worn") is not None:
        with mistakes.collecting():
            worn = check_table(Worn, table["worn"], origin.source, "scene.worn")
    mistakes.raise_any()
    return SceneSection(model=model, parameters=parameters, worn=worn, **_find_scene(model, parameters, given, origin))


def _find_scene(model: str, parameters: BaseModel, given: Mapping[str, Any], origin: Origin) -> dict[str, Any]:
    """Where the scene is and what it offers: in the result that is read, in files, or to be built."""
    before, is_file = origin.parameters_before(model, type(parameters)), _names_file(model)
    if not (is_file or _names_model(model)):
        # only what was kept on request takes the place of what a bundled scene builds
        held = _in_file(origin.path, SCENE_GROUP, origin) if origin.keeps_scene and before == parameters else {}
        return {**held, "offers": tuple(name for name, function in _OFFERED.items() if scene_has(model, function))}
    if before is not None:
        # one friction coefficient of all pairs is not part of the reduced scene
        free = is_file or isinstance(dict(parameters)["friction_coefficient"], float)
        for key in type(parameters).model_fields:
            if getattr(parameters, key) != getattr(before, key) and not (free and key == "friction_coefficient"):
                remedy = "leave it out: the result holds the reduced scene; to change it run the study file again"
                raise UserError(origin.source, f"scene.{key}", given.get(key), remedy)
        return _in_file(origin.path, SCENE_GROUP, origin)
    if is_file:
        path = origin.path.parent / model
        try:
            exists = path.is_file()
        except (OSError, ValueError):
            exists = False
        if not exists:
            remedy = "there is no such file: give a path relative to the study file"
            raise UserError(origin.source, "scene.model", model, remedy)
        return _in_file(path, "", origin)
    # what reads and reduces it is loaded where there is one
    from studies.fe_models.from_files.model import find_files
    from studies.fe_models.from_files.parameters import Parameters

    assert isinstance(parameters, Parameters)
    with scene_errors(origin.source, None):
        files = find_files(origin.path.parent, model, parameters)
    return {"files": files, "offers": ("mesh",) if files.has_faces else ()}


def _in_file(path: Path, group: str, origin: Origin) -> dict[str, Any]:
    """Where the scene stands and what it offers, once it is known that it can be read at all."""
    from studies.scene_file import has_mesh

    with scene_errors(origin.source, path):
        return {"path": path, "group": group, "offers": ("mesh",) if has_mesh(path, group) else ()}
