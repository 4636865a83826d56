"""The study: what a study file says, checked, frozen and with every default filled in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final

from pydantic import BaseModel, BeforeValidator, Field, SerializeAsAny, TypeAdapter, model_validator

from solver.contact.wear_law import WearLaw
from solver.settings import TARGETS, Automatic, WearTarget
from studies.fe_models.model_files import ModelFiles
from studyrunner.study.study_of_result import Archived
from studyrunner.study.values import (
    Axis,
    Cycles,
    Fraction,
    Harmonics,
    NotNegative,
    Positive,
    Samples,
    Scheme,
    Section,
    Sweep,
    Switch,
    Text,
    once,
    read,
    whole,
)
from studyrunner.study.wear_section import WearSection
from studyrunner.user_error import WrongValueError
from studyrunner.variables import ASKED, KEPT, SCENE

AUTO: Final = "auto"
"""In place of a number of harmonics or samples: as many as each state needs for `rtol`."""

SOLVER_AXES = ("harmonics", "samples", "tolerance", "rtol")
AXES = ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep")

_MOST_POINTS = 1_000_000
_N_OUTPUTS = TypeAdapter(Annotated[int, whole(1, 1_000_000)])
_COUNT = TypeAdapter(NotNegative)
_TARGET = TypeAdapter(Positive)
_PAIR = TypeAdapter(Annotated[int, whole(0, 1_000_000)])

DEFAULT: Final = "default"
"""In a list of variables: those that cost little, which is what a study without such a list asks for."""


def _read_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or value.startswith(".") or not value.isprintable():
        raise WrongValueError(value, "give a name that can be a file name")
    if "/" in value or "\\" in value or len(value) > 100:
        raise WrongValueError(value, "give a name of at most 100 characters without a slash")
    return value


def _read_outputs(value: object) -> int | tuple[float, ...]:
    if not isinstance(value, list | tuple):
        n_outputs: int = read(_N_OUTPUTS, value)
        return n_outputs
    counts = tuple(read(_COUNT, item) for item in value)
    if not counts or any(later <= earlier for earlier, later in pairwise(counts)):
        raise WrongValueError(value, "give a number of outputs or an ascending list of cycle counts")
    return counts


def _read_variables(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of names of result variables")
    known = (*ASKED, *SCENE, *KEPT)
    for name in value:
        if name != DEFAULT and name not in known:
            raise WrongValueError(name, f'give "{DEFAULT}" or names out of {", ".join(known)}')
    names = once(value)
    return tuple(name for name in (*ASKED, *SCENE) if name in names)


def _read_loops(value: object) -> tuple[int, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of contact indices")
    return tuple(sorted(once(read(_PAIR, item) for item in value)))


def _read_target(value: object) -> dict[str, float]:
    if not isinstance(value, dict) or len(value) != 1 or next(iter(value)) not in TARGETS:
        raise WrongValueError(value, "give one of " + ", ".join(f"{{{name} = ...}}" for name in TARGETS))
    return {name: read(_TARGET, item) for name, item in value.items()}


class StudySection(Section):
    """[study]: name and title of the study."""

    name: Annotated[str, BeforeValidator(_read_name)] = Field(description="name of the study and of its result file")
    title: Text = Field("", description="goes into the result")


class AxesSection(Section):
    """[axes]: every axis becomes a dimension of the result, in the order of the values given here."""

    frequency: Axis[Positive] = Field(description="Hz; a number, a list or {start, stop, num}")
    wear_coefficient: Axis[NotNegative] = Field((1.1e-11,), description="1/Pa")
    excitation_amplitude: Axis[Positive] = Field((1.0,), description="N, multiplies the scene's unit harmonic load")
    step: Axis[Positive] = Field((1000.0,), description="h, cycles; the adaptive scheme chooses its own")
    scheme: Axis[Scheme] = Field(("adaptive",), description="of the wear steps")
    sweep: Axis[Sweep] = Field(
        ("up",), description="how the unworn state is reached: along the frequency, or by raising the excitation"
    )
    harmonics: Axis[Harmonics] | None = Field(None, description="harmonics above the static one")
    samples: Axis[Samples] | None = Field(None, description="time samples in a period")
    tolerance: Axis[Fraction] | None = Field(None, description="of the scaled residual")
    rtol: Axis[Fraction] | None = Field(
        None, description="relative error that automatic settings and adaptive steps aim at"
    )


class SlowTimeSection(Section):
    """[slow_time]: end of the histories, and cycle counts of the output."""

    cycles: Cycles = Field(
        100_000.0, description="cycles; 0 for the unworn states only, inf: until nothing wears any more"
    )
    final_share: Fraction = Field(
        1e-4, description="of the largest wear rate of each pair: below it nothing wears any more, with cycles = inf"
    )
    outputs: Annotated[int | tuple[float, ...], BeforeValidator(_read_outputs)] = Field(
        101,
        description="number of equally spaced cycle counts, 0 and the last included, or a list of cycle counts; with"
        " cycles = inf their number, spaced evenly in worn volume and cycles",
    )
    until: Annotated[dict[str, float] | None, BeforeValidator(_read_target)] = Field(
        None,
        description="wear at which a point ends, {wear_depth = m of the deepest pair}, {worn_volume = m3}, or"
        " {frequency_shift = relative change of the resonance of the vibration}",
    )
    largest_depth: Positive | None = Field(
        None, description="m; the explicit scheme then wears no pair deeper than this in a step, Eq. (22), for any h"
    )


class SolverSection(Section):
    """[solver]: resolution and accuracy. A key under [axes] replaces the key here."""

    harmonics: Harmonics = Field(AUTO, description="harmonics above the static one")
    samples: Samples = Field(AUTO, description="time samples in a period")
    tolerance: Fraction = Field(1e-8, description="of the scaled residual")
    rtol: Fraction = Field(1e-2, description="relative error that automatic settings and adaptive steps aim at")
    shortcuts: Switch = Field(
        True, description="whether points with the same history share one; false: every point is computed on its own"
    )
    time_limit: Positive | None = Field(
        None, description="s, CPU time that a start state or a wear history may take; none unless it is given"
    )


class OutputsSection(Section):
    """[outputs]: variables of the result; `outcome` and the totals of a point are always there."""

    variables: Annotated[tuple[str, ...], BeforeValidator(_read_variables)] = Field(
        tuple(ASKED), description="names of result variables"
    )
    loops: Annotated[tuple[int, ...], BeforeValidator(_read_loops)] = Field(
        (), description="indices of the contact pairs whose fretting loops are kept"
    )
    scene: Switch = Field(
        False, description="whether the reduced model of a bundled scene is kept, as that of a scene file always is"
    )


class SceneFileParameters(Section):
    """[scene] of a scene file: the friction coefficient only, if the file has none for each pair."""

    friction_coefficient: NotNegative | None = Field(None, description="a number, 0 or more")


class SceneSection(Section):
    """[scene]: model, and parameters of this model.

    parameters: checked object of the class of the scene, with `friction_coefficient` at least.
    path: file of the scene; None for a scene that is built.
    group: group of the scene in this file; empty in a scene file.
    files: files of a finite-element model; None for other scenes.
    offers: names in `outputs.variables` that this scene knows and not every scene knows.
    """

    model: Text
    parameters: SerializeAsAny[BaseModel]
    path: Path | None = Field(None, exclude=True)
    group: str = Field("", exclude=True)
    files: ModelFiles | None = Field(None, exclude=True)
    offers: tuple[str, ...] = Field((), exclude=True)

    @property
    def is_bundled(self) -> bool:
        """Whether the scene is a bundled one; a result may hold the model that it was built to."""
        return not (names_file(self.model) or names_model(self.model))


class Study(Section):
    """A whole study.

    source: file of the study, as the user named it.
    folder: folder of this file.
    archived: attributes of a result file; None for a study file.
    """

    study: StudySection
    scene: SceneSection
    axes: AxesSection
    wear: WearSection = WearSection()
    slow_time: SlowTimeSection = SlowTimeSection()
    solver: SolverSection = SolverSection()
    outputs: OutputsSection = OutputsSection()
    source: str = Field(exclude=True)
    folder: Path = Field(exclude=True)
    archived: Archived | None = Field(None, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _fill_variables(cls, table: object) -> object:
        """The default variables where the study names none: those of every point, and the mesh if there is one."""
        if not isinstance(table, dict) or not isinstance(scene := table.get("scene"), SceneSection):
            return table
        outputs = table.get("outputs", {})
        if not isinstance(outputs, dict):
            return table
        names = outputs.get("variables", [DEFAULT])
        if not isinstance(names, list) or names.count(DEFAULT) != 1:
            return table
        cheap = [*ASKED, *(name for name in scene.offers if name == "mesh")]
        filled = [*cheap, *(name for name in names if name != DEFAULT and name not in cheap)]
        return {**table, "outputs": {**outputs, "variables": filled}}

    @model_validator(mode="after")
    def _check_variables(self) -> Study:
        for name in ("mesh", "exact"):
            if name in self.outputs.variables and name not in self.scene.offers:
                remedy = f"leave it out: the scene {self.scene.model} has none"
                raise WrongValueError(name, remedy, "outputs.variables")
        return self

    @model_validator(mode="after")
    def _check_points(self) -> Study:
        n_points = math.prod(len(values) for values in self.dimensions.values())
        if n_points > _MOST_POINTS:
            longest = max(self.dimensions, key=lambda name: len(self.dimensions[name]))
            remedy = f"give fewer values: there are {n_points:.3g} points, and a study has at most {_MOST_POINTS}"
            raise WrongValueError(len(self.dimensions[longest]), remedy, f"axes.{longest}")
        return self

    @model_validator(mode="after")
    def _check_samples(self) -> Study:
        most, given = max(self.given_harmonics, default=0), [n for n in self.samples if n != AUTO]
        fewest = min(given, default=None)
        if fewest is not None and fewest <= 2 * most:
            table = "solver" if self.axes.samples is None else "axes"
            remedy = f"give more than twice the {most} harmonics, at least {2 * most + 1}"
            raise WrongValueError(fewest, remedy, f"{table}.samples")
        return self

    @model_validator(mode="after")
    def _check_outputs(self) -> Study:
        cycles, outputs = self.slow_time.cycles, self.slow_time.outputs
        if isinstance(outputs, tuple):
            if self.to_the_end:
                remedy = (
                    "give their number: with slow_time.cycles = inf they are spaced evenly in worn volume and cycles"
                )
                raise WrongValueError(outputs, remedy, "slow_time.outputs")
            if outputs[-1] > cycles:
                remedy = f"give cycle counts of at most slow_time.cycles = {cycles:g}"
                raise WrongValueError(outputs[-1], remedy, "slow_time.outputs")
        elif outputs < 2 and cycles > 0.0:
            raise WrongValueError(outputs, "give at least 2: cycle 0 and the last one", "slow_time.outputs")
        return self

    @model_validator(mode="after")
    def _check_end(self) -> Study:
        if self.to_the_end and "explicit" in self.axes.scheme:
            remedy = 'give "adaptive" or "implicit": explicit steps cannot grow, as slow_time.cycles = inf asks for'
            raise WrongValueError("explicit", remedy, "axes.scheme")
        if "final" in self.axes.scheme and not self.to_the_end:
            remedy = 'give inf: the scheme "final" finds the state at which nothing wears any more'
            raise WrongValueError(self.slow_time.cycles, remedy, "slow_time.cycles")
        if "final" in self.axes.scheme and self.slow_time.until is not None:
            remedy = 'leave it out: the scheme "final" has no way on which it could be reached'
            raise WrongValueError(self.slow_time.until, remedy, "slow_time.until")
        if self.to_the_end and "exact" in self.outputs.variables:
            remedy = "leave it out: it is of given cycle counts, and slow_time.cycles = inf has none"
            raise WrongValueError("exact", remedy, "outputs.variables")
        return self

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that a run of the study reads."""
        study_file = self.folder / Path(self.source).name
        scene = () if self.scene.path is None else (self.scene.path,)
        model = () if self.scene.files is None else self.scene.files.all
        return (study_file, *scene, *model)

    @property
    def friction_coefficient(self) -> float | None:
        """Coulomb friction coefficient of all pairs; None where each pair has its own."""
        value = dict(self.scene.parameters)["friction_coefficient"]
        return None if value is None or isinstance(value, dict) else float(value)

    @property
    def wear_law(self) -> WearLaw:
        """The wear law as the solver takes it."""
        return self.wear.wear_law

    @property
    def until(self) -> WearTarget | None:
        """Wear at which a point ends."""
        for quantity in TARGETS:
            if self.slow_time.until is not None and quantity in self.slow_time.until:
                return WearTarget(quantity, self.slow_time.until[quantity])
        return None

    @property
    def to_the_end(self) -> bool:
        """Whether histories end where nothing wears any more; then each point has its own cycle counts."""
        return self.slow_time.cycles == math.inf

    @cached_property
    def cycles_kept(self) -> tuple[float, ...]:
        """Cycle counts of the result, ascending; numbers of the outputs where each point has its own counts."""
        cycles, outputs = self.slow_time.cycles, self.slow_time.outputs
        if isinstance(outputs, tuple):
            return outputs
        if self.to_the_end:
            return tuple(float(number) for number in range(outputs))
        if cycles == 0.0:
            return (0.0,)
        return (*(cycles * position / (outputs - 1) for position in range(outputs - 1)), cycles)

    @property
    def harmonics(self) -> tuple[int | Automatic, ...]:
        """Values of `harmonics`, from its axis or the one under [solver]; so for the other solver keys."""
        return (self.solver.harmonics,) if self.axes.harmonics is None else self.axes.harmonics

    @property
    def samples(self) -> tuple[int | Automatic, ...]:
        """Values of `samples`."""
        return (self.solver.samples,) if self.axes.samples is None else self.axes.samples

    @property
    def tolerance(self) -> tuple[float, ...]:
        """Values of `tolerance`."""
        return (self.solver.tolerance,) if self.axes.tolerance is None else self.axes.tolerance

    @property
    def rtol(self) -> tuple[float, ...]:
        """Values of `rtol`."""
        return (self.solver.rtol,) if self.axes.rtol is None else self.axes.rtol

    @property
    def given_harmonics(self) -> tuple[int, ...]:
        """Values of `harmonics` that are numbers."""
        return tuple(number for number in self.harmonics if number != AUTO)

    @property
    def dimensions(self) -> Mapping[str, tuple[float | str, ...]]:
        """Names and values of the axes of the result, in their order; solver keys only where they are axes."""
        names = (*AXES, *(key for key in SOLVER_AXES if getattr(self.axes, key) is not None))
        return {name: getattr(self.axes, name) for name in names}


def names_model(model: str) -> bool:
    """Whether the text under `scene.model` names a finite-element model: a deck or a mesh."""
    return Path(model).suffix.lower() in (".inp", ".msh", ".cdb")


def names_file(model: str) -> bool:
    """Whether the text under `scene.model` names a scene file: a path, or a name with an HDF5 ending."""
    return "/" in model or "\\" in model or Path(model).suffix.lower() in (".h5", ".hdf5", ".he5")
