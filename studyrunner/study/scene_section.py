"""[scene] of a study: the scene that its model names, its parameters, its files, and wear before its history begins."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny

from studies.fe_models.model_files import ModelFiles
from studies.fe_models.text import check_there
from studies.scene import ContactStiffness, as_scene
from studies.scene_error import SceneError
from studies.scenes import scene_parameters
from studyrunner.study.mistakes import Mistakes, check_table, close_name, scene_errors
from studyrunner.study.scene_axes import SceneAxis
from studyrunner.study.sections import ELSEWHERE
from studyrunner.study.text import SCENE_GROUP, Archived, check_result_file
from studyrunner.system.progress import count as counted
from studyrunner.user_error import UserError, Verbatim, WrongValueError
from studyrunner.values import NotNegative, Section, Wrong, listed, once

if TYPE_CHECKING:
    import xarray as xr

WORN_AXIS = "worn_cycle"
"""Name of the axis of several worn states."""


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


def _listed(value: object) -> object:
    return tuple(listed(value))


def _states(value: object) -> object:
    """Depths of all pairs, one number or one for each, of one state or of a list of states."""
    several = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
    return tuple(_listed(state) for state in listed(value)) if several else (_listed(value),)


_Depths = Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False)]
_Counts = Annotated[tuple[NotNegative, ...], BeforeValidator(_listed), AfterValidator(once)]


class Worn(Section):
    """Worn states of a joint.

    depth: of each state, m, of each pair, or one number for all pairs. cycle: cycle count of each state; empty where
    the depths are given. result: file that the depths are from.
    """

    depth: Annotated[tuple[_Depths, ...], BeforeValidator(_states)] = Field(
        description="m, of each pair or of all pairs"
    )
    cycle: _Counts = Field((), description="cycle counts of the result")
    result: str = Field("", description="result file")

    def rules(self) -> Iterator[Wrong]:
        """Each state has a cycle count, or none where there is one state."""
        if len(self.depth) != max(1, len(self.cycle)):
            found = Verbatim(f"{len(self.depth)} states with {len(self.cycle)} cycle counts")
            remedy = "give one cycle count in scene.worn.cycle for each state, or one state without a count"
            yield Wrong("depth", found, remedy)

    def depths(self, n_contact: int) -> tuple[float, ...]:
        """Depths (n_contact,), m, of the only state. Raises WrongValueError where there are others than pairs."""
        (depth,) = self.depth
        if len(depth) not in (1, n_contact):
            remedy = f"give one depth, or one for each pair: the scene has {counted(n_contact, 'contact pair')}"
            raise WrongValueError(Verbatim(f"there are {counted(len(depth), 'depth')}"), remedy)
        return depth * n_contact if len(depth) == 1 else depth


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
    if _names_model(model) and origin.archived is None:  # a file that is missing is named before keys that are
        with scene_errors(origin.source, None):
            check_there(origin.path.parent / model)
    given = {key: value for key, value in table.items() if key not in ("model", "worn")}
    mistakes, worn = Mistakes(origin.source), None
    with mistakes.collecting():
        parameters = check_table(kind, given, origin.source, "scene", {**ELSEWHERE, "model": "model", "worn": "worn"})
    if table.get("worn") is not None:
        with mistakes.collecting():
            worn = check_table(Worn, table["worn"], origin.source, "scene.worn")
    mistakes.raise_any()
    return SceneSection(model=model, parameters=parameters, worn=worn, **_find_scene(model, parameters, given, origin))


def _find_scene(model: str, parameters: BaseModel, given: Mapping[str, Any], origin: Origin) -> dict[str, Any]:
    """Where the scene is and what it offers: in the result that is read, in files, or to be built."""
    held, is_file = origin.archived, _names_file(model)
    before = held.scene if held is not None and held.holds_scene and held.scene.get("model") == model else None
    changed = [key for key in type(parameters).model_fields if before and given.get(key) != before.get(key)]
    if not (is_file or _names_model(model)):
        # only what was kept on request takes the place of what a bundled scene builds
        kept = _in_file(origin.path, SCENE_GROUP, origin) if origin.keeps_scene and before and not changed else {}
        return {**kept, "offers": as_scene(parameters).OFFERS}
    if before is not None:
        # one friction coefficient of all pairs is not part of the reduced scene
        free = is_file or isinstance(dict(parameters)["friction_coefficient"], float)
        for key in changed:
            if not (free and key == "friction_coefficient"):
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
    from studies.scene_file import read_mesh

    with scene_errors(origin.source, path):
        return {"path": path, "group": group, "offers": ("mesh",) if read_mesh(path, group) is not None else ()}


class _OfResult(Section):
    """The table `worn` with a result file; other keys select a point of the result by values of its axes."""

    model_config = ConfigDict(extra="allow")

    result: str = Field(description="path of a result file; or depth in place of a result")
    cycle: Annotated[_Counts, Field(min_length=1)] = Field(description="cycle counts of the result")


def read_worn(table: object, source: str, folder: Path) -> dict[str, Any]:
    """The table `worn` with depths, those of a result file read from the file. folder: relative paths start here.

    table: as the study file has it: {result, cycle, ...}, where other keys select a point of the result, or {depth}.

    Raises UserError where the table or the result file is wrong.
    """
    import xarray as xr  # where it is used: it takes a while to load

    if not isinstance(table, Mapping):
        remedy = 'give {result = "OUT.nc", cycle = [...]} with the axes of a point, or {depth = ...}'
        raise UserError(source, "scene.worn", table, remedy)
    if "depth" in table:
        worn = check_table(Worn, table, source, "scene.worn")
        return {"depth": [list(each) for each in worn.depth], "cycle": list(worn.cycle), "result": worn.result}
    given = check_table(_OfResult, table, source, "scene.worn")
    path = folder / given.result
    if not path.exists():
        remedy = "there is no such file: give a result file of run-study, relative to the study file"
        raise UserError(source, "scene.worn.result", given.result, remedy)
    check_result_file(path, str(path))
    try:
        with xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False) as dataset:
            depth = _depths_in(dataset, given.model_extra or {}, given.cycle, source)
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, IndexError):
        # what the libraries raise where a file is no result, or damaged
        remedy = "give a result file of run-study that is whole"
        raise UserError(str(path), "the file", Verbatim("damaged"), remedy) from None
    return {"depth": depth.tolist(), "cycle": list(given.cycle), "result": given.result}


def _depths_in(dataset: xr.Dataset, point: Mapping[str, object], cycle: Sequence[float], source: str) -> Any:
    """Depths (n_states, n_contact), m, of a point of a result at cycle counts."""
    if "wear_depth" not in dataset:
        raise UserError(source, "scene.worn.result", None, "give a result with wear_depth among its variables")
    depths, found = dataset["wear_depth"], Mistakes(source)
    axes = [str(name) for name in depths.dims[:-2]]
    for name in point.keys() - set(axes):
        remedy = f"unknown key, give result, cycle, depth or an axis of the result: {', '.join(axes)}"
        found.add(f"scene.worn.{name}", point[name], remedy)
    places: dict[str, Any] = {}
    for name in axes:
        values = dataset[name].values.tolist()
        wanted = point.get(name, values[0] if len(values) == 1 else None)
        places[name] = _place(f"scene.worn.{name}", values, wanted, found)
    counts = dataset["cycle"].values.tolist()
    places["cycle"] = [_place("scene.worn.cycle", counts, count, found) for count in cycle]
    found.raise_any()
    chosen = np.asarray(depths.isel(places).values, dtype=np.float64)
    for count, row in zip(cycle, chosen, strict=True):
        if not np.isfinite(row).all():
            remedy = "give an earlier cycle count: the result does not hold the depths of this one"
            raise UserError(source, "scene.worn.cycle", count, remedy)
    return chosen


def _place(key: str, values: Sequence[Any], wanted: Any, found: Mistakes) -> int:
    """Index of a value along an axis of a result; 0, and a mistake, where it is not there."""
    numbers = isinstance(wanted, float | int) and not isinstance(values[0], str)
    for place, value in enumerate(values):
        if (numbers and math.isclose(value, wanted, rel_tol=1e-12)) or value == wanted:
            return place
    if numbers:
        values = sorted(values, key=lambda value: abs(value - wanted))
    found.add(key, wanted, f"give a value of the result: {', '.join(map(str, values[:10]))}")
    return 0


def worn_axis(table: Mapping[str, Any], name: str) -> tuple[SceneAxis, ...]:
    """The axis of worn states; none where their cycle counts are not known. table: as `read_worn` gives it."""
    counts = table.get("cycle", [])
    meaning = "number of vibration cycles that have worn the joint before"
    return (SceneAxis(name, "scene", ("worn",), tuple(counts), "1", meaning),) if counts else ()
