"""Where the reduced model of a scene comes from: the program, a scene file, a finite-element model, or a result.

What reads files is loaded where there are some: it takes a while to load. What functions do stands in `SceneSource`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel, Field

from solver.model import FloatArray, ReducedModel
from studies.fe_models.files import ModelFiles, check_there, file_digest
from studies.scene import (
    ContactStiffness,
    ExpectedWear,
    Progress,
    Scene,
    SurfaceMesh,
    as_scene,
    make_compliant,
    stuck_frequencies,
)
from studies.scenes import build_scene, scene_parameters
from studies.sectors import OfRing

Check = tuple[list[tuple[str, str]], Callable[[Path], None]]
"""Label and text of each line on a finite-element model, and what draws its contact pairs."""


@dataclass(frozen=True)
class SceneSource(ABC):
    """A source of scenes, whatever their parameters.

    model: name or path, as the study has it. folder: relative paths start here. held: file that holds the reduced
    model, a scene file or a result, and its group there; None where the model is built from parameters.

    Functions that take parameters, an object of the class `parameters`, or read files raise SceneError where these are
    wrong, and OSError where a file cannot be read.
    """

    model: str
    folder: Path
    held: tuple[Path, str] | None = None

    is_bundled: ClassVar[bool] = False
    """Whether the program builds it from the parameters alone."""

    @property
    @abstractmethod
    def parameters(self) -> type[BaseModel]:
        """What [scene] consists of beside `model`; has `friction_coefficient`."""

    @property
    def path(self) -> Path | None:
        """The file that holds the reduced model."""
        return None if self.held is None else self.held[0]

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that are read."""
        return () if self.held is None else (self.held[0],)

    @cached_property
    def offers(self) -> tuple[str, ...]:
        """What a study may ask for beside what all scenes have: "mesh", "exact"."""
        return () if self.held is None or _read_mesh(*self.held) is None else ("mesh",)

    @property
    def usual(self) -> Mapping[str, float]:
        """Numbers above 0 of a usual scene, by key; those of files have none."""
        return {}

    def found(self, parameters: BaseModel) -> "SceneSource":
        """The source with its files, once it is known that they are there."""
        return self

    def of_model(self, parameters: BaseModel) -> dict[str, Any]:
        """Parameters that the reduced model depends on: mostly without one friction coefficient of all pairs."""
        given: dict[str, Any] = parameters.model_dump(mode="json")
        if not isinstance(given["friction_coefficient"], dict):
            del given["friction_coefficient"]
        if isinstance(parameters, OfRing):
            # the model is that of a sector of a ring, however its sectors differ
            del given["sectors"], given["forced_sector"]
            given |= {"sectors": "all"} if parameters.ring else {}
        return given

    def key(self, parameters: BaseModel) -> tuple[object, ...]:
        """All that the reduced model depends on, contents of files included, beside its harmonics."""
        content = None if self.path is None else file_digest(self.path)
        return self.model, self.of_model(parameters), self.describe(parameters), content

    def build(self, parameters: BaseModel, least: int, n_harmonics: int, progress: Progress) -> ReducedModel:
        """Reduced model, with the nodal diameters that the harmonics 0..n_harmonics see; of a file those that it holds,
        which are at least those of the harmonics 0..least.
        """
        if self.held is None:
            return self._build(parameters, n_harmonics, progress)
        from studies.scene_file import read_scene

        return read_scene(self.held[0], least, self.held[1])

    def describe(self, parameters: BaseModel) -> dict[str, str]:
        """Attributes of a scene or result file, see `studies.scene_file.DESCRIPTION`."""
        if self.held is None:
            return self._describe(parameters)
        from studies.scene_file import read_description

        return read_description(self.held[0])

    def mesh(self, parameters: BaseModel) -> SurfaceMesh | None:
        """Outer faces, None of a source that does not offer them."""
        if "mesh" not in self.offers:
            return None
        return self._mesh(parameters) if self.held is None else _read_mesh(*self.held)

    def _build(self, parameters: BaseModel, n_harmonics: int, progress: Progress) -> ReducedModel:
        raise NotImplementedError

    def _describe(self, parameters: BaseModel) -> dict[str, str]:
        raise NotImplementedError

    def _mesh(self, parameters: BaseModel) -> SurfaceMesh:
        raise NotImplementedError

    def natural_frequencies(self, parameters: BaseModel, model: ReducedModel) -> dict[int, FloatArray]:
        """Of its model, as `stuck_frequencies`, for all nodal diameters that are known."""
        return stuck_frequencies(model)

    def with_room_for_wear(self, parameters: BaseModel, expected: ExpectedWear) -> BaseModel:
        """Parameters with room for what a study wears, where a model is built with such."""
        return parameters

    def remarks(self) -> tuple[tuple[str, str], ...]:
        """Label and text of each line on what was skipped in files, or read in one of two ways."""
        return ()

    def check(self, parameters: BaseModel, n_harmonics: int, progress: Progress) -> Check | None:
        """What is to be said of a finite-element model; None of others."""
        return None


def _read_mesh(path: Path, group: str) -> SurfaceMesh | None:
    from studies.scene_file import read_mesh

    return read_mesh(path, group)


@dataclass(frozen=True)
class Bundled(SceneSource):
    """A bundled scene."""

    is_bundled = True

    @property
    def parameters(self) -> type[Scene]:
        return scene_parameters(self.model)

    @cached_property
    def offers(self) -> tuple[str, ...]:
        return self.parameters.OFFERS

    @property
    def usual(self) -> Mapping[str, float]:
        defaults = {name: field.default for name, field in self.parameters.model_fields.items()}
        return {name: value for name, value in defaults.items() if isinstance(value, float) and value > 0.0}

    def of_model(self, parameters: BaseModel) -> dict[str, Any]:
        in_model = self.parameters.FRICTION_IN_MODEL
        return parameters.model_dump(mode="json") if in_model else super().of_model(parameters)

    def _build(self, parameters: BaseModel, n_harmonics: int, progress: Progress) -> ReducedModel:
        return build_scene(self.model, parameters, n_harmonics)

    def _describe(self, parameters: BaseModel) -> dict[str, str]:
        return dict(self.parameters.DESCRIPTION)

    def _mesh(self, parameters: BaseModel) -> SurfaceMesh:
        return as_scene(parameters).describe_mesh()

    def natural_frequencies(self, parameters: BaseModel, model: ReducedModel) -> dict[int, FloatArray]:
        return as_scene(parameters).natural_frequencies(model)

    def with_room_for_wear(self, parameters: BaseModel, expected: ExpectedWear) -> BaseModel:
        # what a result holds was built with the parameters that stand beside it
        return parameters if self.held else as_scene(parameters).with_room_for_wear(expected)


class SceneFileParameters(OfRing):
    """[scene] of a scene file: the friction coefficient only, if the file has none for each pair."""

    AXES: ClassVar = ("friction_coefficient", "contact_stiffness", "forced_sector")

    friction_coefficient: float | None = Field(None, ge=0, description="of all pairs")
    contact_stiffness: ContactStiffness = None


@dataclass(frozen=True)
class SceneFile(SceneSource):
    """A scene file, or in its place a result, which always hold the model."""

    @property
    def parameters(self) -> type[SceneFileParameters]:
        return SceneFileParameters

    def found(self, parameters: BaseModel) -> SceneSource:
        for path in self.files:
            check_there(path)
        return self

    def build(self, parameters: BaseModel, least: int, n_harmonics: int, progress: Progress) -> ReducedModel:
        model = super().build(parameters, least, n_harmonics, progress)
        # a result holds what was computed with
        is_result = self.held is not None and self.held[1]
        return model if is_result else make_compliant(model, dict(parameters)["contact_stiffness"])


@dataclass(frozen=True)
class FiniteElements(SceneSource):
    """A deck, a mesh or a table of nodes, with or without matrices. found_files: None until they are looked for."""

    found_files: ModelFiles | None = None

    @property
    def parameters(self) -> type[BaseModel]:
        from studies.fe_models.from_files.parameters import Parameters

        return Parameters

    @property
    def _files(self) -> ModelFiles:
        assert self.found_files is not None, "of a source that was found"
        return self.found_files

    @property
    def files(self) -> tuple[Path, ...]:
        return super().files if self.held else self._files.all

    @cached_property
    def offers(self) -> tuple[str, ...]:
        # a table of nodes has no faces that can be drawn
        return super().offers if self.held else ("mesh",) * (self._files.mesh.suffix.lower() != ".csv")

    def found(self, parameters: BaseModel) -> SceneSource:
        if self.held:
            return self
        from studies.fe_models.from_files.model import checked, find_files

        return replace(self, found_files=find_files(self.folder, self.model, checked(parameters)))

    def _build(self, parameters: BaseModel, n_harmonics: int, progress: Progress) -> ReducedModel:
        from studies.fe_models.from_files.model import build

        return build(self._files, parameters, n_harmonics, progress)

    def _describe(self, parameters: BaseModel) -> dict[str, str]:
        from studies.fe_models.from_files.model import describe_origin

        return describe_origin(self._files, parameters)

    def _mesh(self, parameters: BaseModel) -> SurfaceMesh:
        from studies.fe_models.from_files.model import describe_model_mesh

        return describe_model_mesh(self._files, parameters)

    def remarks(self) -> tuple[tuple[str, str], ...]:
        from studies.fe_models.meshes import read_mesh_file

        return () if self.held else read_mesh_file(self._files.mesh).remarks

    def check(self, parameters: BaseModel, n_harmonics: int, progress: Progress) -> Check | None:
        if self.held:
            return None
        from studies.fe_models.from_files.check import describe_model, draw_pairs
        from studies.fe_models.from_files.model import checked, load_model, reduce_model

        loaded = load_model(self._files, checked(parameters), progress)
        scene = reduce_model(loaded, n_harmonics, progress)
        rows = [("files", self.describe(parameters)["model_files"]), *describe_model(loaded, scene, progress)]
        return rows, lambda picture: draw_pairs(loaded, scene, picture)


def source_of(model: str, folder: Path, *, in_result: bool = False) -> SceneSource:
    """The source that a name or path stands for: a bundled scene, or a file, which is there.

    folder: relative paths start here. in_result: whether a result may hold the scene in place of the file. Raises
    SceneError.
    """
    suffix = Path(model).suffix.lower()
    is_deck = suffix in (".inp", ".msh", ".cdb", ".csv")
    if not is_deck and not ("/" in model or "\\" in model or suffix in (".h5", ".hdf5", ".he5")):
        scene_parameters(model)
        return Bundled(model, folder)
    if not in_result:
        check_there(folder / model)
    return FiniteElements(model, folder) if is_deck else SceneFile(model, folder, (folder / model, ""))
