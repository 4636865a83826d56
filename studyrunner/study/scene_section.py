"""[scene] of a study: the scene that its model names, its parameters, its files, and wear before its history begins."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, InstanceOf, SerializeAsAny

from studies.scene_source import SceneSource, source_of
from studies.sectors import OfRing, Sectors
from studyrunner.study.mistakes import check_tables, raise_wrong, scene_errors
from studyrunner.study.text import Archived, check_result_file, result_errors
from studyrunner.system.progress import count as counted
from studyrunner.user_error import UserError, Verbatim, listing
from studyrunner.values import Axis, NotNegative, Section, Wrong, listed

if TYPE_CHECKING:
    import xarray as xr

WORN_AXIS = "worn_cycle"
"""Name of the axis of several worn states."""


def _states(value: object) -> object:
    """Depths of all pairs, one number or one for each, of one state or of a list of states."""
    several = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
    return tuple(tuple(listed(state)) for state in (listed(value) if several else [value]))


_Depths = Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False)]


class Worn(Section):
    """Worn states of a joint.

    depth: of each state, m, of each pair, or one number for all pairs. energy: that friction has dissipated, J/m2, in
    the same way; () where it is not known. cycle: cycle count of each state; empty where the depths are given. result:
    file that the depths are from.
    """

    depth: Annotated[tuple[_Depths, ...], BeforeValidator(_states)] = Field(
        description="m, of each pair or of all pairs"
    )
    energy: Annotated[tuple[_Depths, ...], BeforeValidator(_states)] = Field(
        (), description="J/m2, dissipated before, of each pair or of all pairs: for [wear.evolution]"
    )
    cycle: Axis[NotNegative] = Field((), description="cycle counts of the result")
    result: str = Field("", description="result file")

    def rules(self) -> Iterator[Wrong]:
        """Each state has a cycle count, or none where there is one state."""
        if len(self.depth) != max(1, len(self.cycle)):
            found = Verbatim(f"{counted(len(self.depth), 'state')} with {counted(len(self.cycle), 'cycle count')}")
            remedy = "give one cycle count in scene.worn.cycle for each state, or one state without a count"
            yield Wrong("depth", found, remedy)
        if self.energy and [*map(len, self.energy)] != [*map(len, self.depth)]:
            yield Wrong("energy", None, "give as many numbers as depths, for as many states")

    def states(self) -> tuple["Worn", ...]:
        """Each state alone, without its count."""
        energies = self.energy or ((),) * len(self.depth)
        states = zip(self.depth, energies, strict=True)
        return tuple(
            self.model_copy(update={"depth": (depth,), "energy": (energy,) if energy else (), "cycle": ()})
            for depth, energy in states
        )

    def depths(self, n_contact: int) -> tuple[float, ...]:
        """Depths (n_contact,), m, of the only state, as `of_pairs`."""
        return self.of_pairs(self.depth[0], n_contact)

    def of_pairs(self, depth: tuple[float, ...], n_contact: int) -> tuple[float, ...]:
        """Numbers (n_contact,) of a state.

        Raises Wrong where there are others than pairs; one number is of all pairs, but not one of a result.
        """
        if len(depth) == n_contact:
            return depth
        if len(depth) == 1 and not self.result:
            return depth * n_contact
        key, given = ("result", "a result with the same pairs") if self.result else ("depth", "one depth for each pair")
        remedy = f"give {given}: the scene has {counted(n_contact, 'contact pair')}"
        raise Wrong(key, Verbatim(f"there are {counted(len(depth), 'depth')}"), remedy)


class SceneSection(Section):
    """[scene]: model, and parameters of this model.

    parameters: checked object of the class of the scene, with `friction_coefficient` at least.
    worn: wear that the joint begins with.
    source: where its reduced model comes from.
    """

    model: str = Field(description="name of a bundled scene, or path of a scene file or a deck, beside the study file")
    parameters: SerializeAsAny[BaseModel]
    worn: Worn | None = Field(None, description="wear before the history begins")
    source: InstanceOf[SceneSource] = Field(exclude=True)

    @property
    def ring(self) -> Sectors | None:
        """How the sectors of a ring differ; None where a study computes no ring."""
        return self.parameters.ring if isinstance(self.parameters, OfRing) else None

    @property
    def forced_sector(self) -> int | None:
        """The only sector that is excited."""
        return self.parameters.forced_sector if isinstance(self.parameters, OfRing) else None

    @property
    def of_model(self) -> dict[str, Any]:
        """Parameters that the reduced model depends on."""
        return self.source.of_model(self.parameters)


@dataclass(frozen=True)
class Origin:
    """Where a study is from.

    source: the file as the user named it. path: where it is; relative paths start in its folder. archived: what it says
    of the result that it holds. scene: that of this result, where the file keeps its reduced model.
    """

    source: str
    path: Path
    archived: Archived | None = None
    scene: SceneSection | None = None


def read_source(model: object, source: str, folder: Path, *, in_result: bool) -> SceneSource:
    """What `model` of [scene] stands for, see `source_of`. Raises UserError where there is no such scene."""
    if not isinstance(model, str):
        raise UserError(source, "scene.model", model, "give a bundled scene or the path of a scene file, in quotes")
    with scene_errors(source, None):
        return source_of(model, folder, in_result=in_result)


def find_scene(scene: SceneSection, origin: Origin) -> SceneSection:
    """The scene in the result that is read, where this holds it, else with the files of its source.

    scene: checked. Raises UserError where a file is missing, or the result holds the model of another scene.
    """
    before, source = origin.scene, scene.source
    if before is not None and before.model == scene.model:
        ours, theirs = scene.of_model, before.of_model
        changed = [key for key in {**theirs, **ours} if ours.get(key) != theirs.get(key)]
        if changed and not source.is_bundled:
            remedy = "leave it out: the result holds the reduced scene; to change it run the study file again"
            raise UserError(origin.source, f"scene.{changed[0]}", ours.get(changed[0]), remedy)
        source = source if changed else before.source
    with scene_errors(origin.source, None):
        found = source.found(scene.parameters)
    with scene_errors(origin.source, found.path):
        # from here on it is known that a file can be read at all
        _ = found.offers
    return scene.model_copy(update={"source": found})


class _OfResult(Section):
    """The table `worn` with a result file; other keys select a point of the result by values of its axes."""

    model_config = ConfigDict(extra="allow")

    result: str = Field(description="path of a result file; or depth in place of a result")
    cycle: Axis[NotNegative] = Field((), description="cycle counts of the result, the last one if not given")


def read_worn(table: object, source: str, folder: Path) -> Worn:
    """The table `worn`, with the depths of a result file where it names one. folder: relative paths start here.

    table: as the study file has it: {result, cycle, ...}, where other keys select a point of the result, or {depth}.
    Raises UserError where the table or the result file is wrong.
    """
    import xarray as xr  # where it is used: it takes a while to load

    kind = Worn if isinstance(table, Mapping) and "depth" in table else _OfResult
    given = check_tables({"scene.worn": kind}, {"scene.worn": table}, source)["scene.worn"]
    if isinstance(given, Worn):
        return given
    path = folder / given.result
    if not path.exists():
        raise UserError(source, "scene.worn.result", given.result, f"give the path of a result: {path} is not there")
    check_result_file(path, str(path))
    with result_errors(str(path)), xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False) as dataset:
        of_point = given.model_extra or {}, given.cycle, source
        found = {"depth": _worn_in(dataset, "wear_depth", *of_point).tolist(), "result": given.result}
        if "dissipated_energy" in dataset:
            found["energy"] = _worn_in(dataset, "dissipated_energy", *of_point).tolist()
        return Worn.model_validate(found | ({"cycle": given.cycle} if given.cycle else {}))


def worn_before(study: Mapping[str, Any], name: str, state: int) -> NDArray[np.float64]:
    """The depth, m, or the energy, J/m2, with which a state of the study of a result began, of each pair or of all
    (n_contact or 1,); 0 of an unworn joint.

    study: tables of the study. name: "wear_depth" or "dissipated_energy". state: number on the axis `WORN_AXIS`.
    """
    key = "energy" if name == "dissipated_energy" else "depth"
    states = (study.get("scene", {}).get("worn") or {}).get(key)
    return np.array(states[state] if states else (0.0,))


def _worn_in(dataset: "xr.Dataset", name: str, point: Mapping[str, object], cycle: Sequence[float], source: str) -> Any:
    """Depths, m, or energies, J/m2 (n_states, n_contact), of a point of a result at cycle counts, with those with which
    its history began.
    """
    if name not in dataset:
        raise UserError(source, "scene.worn.result", None, f"give a result with {name} among its variables")
    depths = dataset[name]
    if "cycle" not in depths.dims:
        raise UserError(source, "scene.worn.result", None, "give a result of wear histories: missions have no cycles")
    axes = [str(name) for name in depths.dims[:-2]]
    remedy = f"unknown key, give result, cycle, depth or an axis of the result: {', '.join(axes)}"
    raise_wrong(source, (Wrong(f"scene.worn.{name}", point[name], remedy) for name in point.keys() - set(axes)))

    def place(name: str, wanted: Any, values: list[Any]) -> int:
        if wanted is None and len(values) == 1:
            return 0
        is_number = isinstance(wanted, float | int) and not isinstance(values[0], str)
        for number, value in enumerate(values):
            if value == wanted or (is_number and math.isclose(value, wanted, rel_tol=1e-12)):
                return number
        near = sorted(filter(math.isfinite, values), key=lambda value: abs(value - wanted)) if is_number else values
        remedy = f"give a value of the result: {listing(near)}"
        raise UserError(source, f"scene.worn.{name}", wanted, remedy)

    places = {name: place(name, point.get(name), dataset[name].values.tolist()) for name in axes}
    # the coordinate of a study to the end numbers its outputs
    counts = dataset.get("cycle_count", dataset["cycle"]).isel(places, missing_dims="ignore").values.tolist()
    cycle = cycle or counts[-1:]
    states = [place("cycle", count, counts) for count in cycle]
    chosen = depths.isel({**places, "cycle": states}).values.astype(np.float64)
    if "contact_exists" in dataset:  # its scenes differ in their pairs
        chosen = chosen[:, dataset["contact_exists"].isel(places, missing_dims="ignore").values != 0]
    for count, row in zip(cycle, chosen, strict=True):
        if not np.isfinite(row).all():
            remedy = "give an earlier cycle count: the result does not hold the depths of this one"
            raise UserError(source, "scene.worn.cycle", count, remedy)
    return chosen + worn_before(tomllib.loads(dataset.attrs.get("study", "")), name, places.get(WORN_AXIS, 0))
