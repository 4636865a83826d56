"""The study: what a study file says, checked, frozen and with every default filled in."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, model_validator

from studies.scenes import scene_has
from studyrunner.user_error import WrongValueError
from studyrunner.values import (
    axis_of,
    number_or,
    one_of,
    read_fraction,
    read_not_negative,
    read_number,
    read_positive,
    read_switch,
    whole_number,
)
from studyrunner.variables import ASKED, KEPT, SCENE

Automatic = Literal["auto"]
AUTO: Final = "auto"
"""In place of a number of harmonics or samples: as many as each state needs for `rtol`."""

SOLVER_AXES = ("harmonics", "samples", "tolerance", "rtol")
AXES = ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep")

_read_harmonics = number_or(AUTO, whole_number(1))
_read_samples = number_or(AUTO, whole_number(4))
_read_scheme = one_of("implicit", "explicit", "adaptive")

_OF_THE_SCENE = {"mesh": "describe_mesh", "exact": "exact_answer"}

PositiveAxis = Annotated[tuple[float, ...], BeforeValidator(axis_of(read_positive))]
NotNegativeAxis = Annotated[tuple[float, ...], BeforeValidator(axis_of(read_not_negative))]
HarmonicsAxis = Annotated[tuple[int | Automatic, ...], BeforeValidator(axis_of(_read_harmonics))]
SamplesAxis = Annotated[tuple[int | Automatic, ...], BeforeValidator(axis_of(_read_samples))]
FractionAxis = Annotated[tuple[float, ...], BeforeValidator(axis_of(read_fraction))]
Scheme = Literal["implicit", "explicit", "adaptive"]
Sweep = Literal["up", "down"]


def _read_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or value.startswith(".") or not value.isprintable():
        raise WrongValueError(value, "give a name that can be a file name")
    if "/" in value or "\\" in value or len(value) > 100:
        raise WrongValueError(value, "give a name of at most 100 characters without a slash")
    return value


def _read_text(value: object) -> str:
    if not isinstance(value, str):
        raise WrongValueError(value, "give a text in quotes")
    return value


def _read_outputs(value: object) -> int | tuple[float, ...]:
    if not isinstance(value, list | tuple):
        return whole_number(1)(value)
    counts = tuple(read_not_negative(item) for item in value)
    if not counts or any(later <= earlier for earlier, later in pairwise(counts)):
        raise WrongValueError(value, "give a number of outputs or an ascending list of cycle counts")
    return counts


def _read_variables(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of names of result variables")
    known = (*ASKED, *SCENE, *KEPT)
    for name in value:
        if name not in known:
            raise WrongValueError(name, f"give names out of {', '.join(known)}")
        if list(value).count(name) > 1:
            raise WrongValueError(name, "give every name once")
    return tuple(name for name in (*ASKED, *SCENE) if name in value)


def _read_loops(value: object) -> tuple[int, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of contact indices")
    pairs = tuple(whole_number(0)(item) for item in value)
    for pair in pairs:
        if pairs.count(pair) > 1:
            raise WrongValueError(pair, "give every contact index once")
    return tuple(sorted(pairs))


class Section(BaseModel):
    """A table of the study file: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class StudySection(Section):
    """[study]: how the study is called."""

    name: Annotated[str, BeforeValidator(_read_name)] = Field(description="name of the study and of its result file")
    title: Annotated[str, BeforeValidator(_read_text)] = Field("", description="goes into the result")


class AxesSection(Section):
    """[axes]: every axis becomes a dimension of the result, in the order of the values given here."""

    frequency: PositiveAxis = Field(description="Hz; a number, a list or {start, stop, num}")
    wear_coefficient: NotNegativeAxis = Field((1.1e-11,), description="1/Pa")
    excitation_amplitude: PositiveAxis = Field((1.0,), description="N, multiplies the scene's unit harmonic load")
    step: PositiveAxis = Field((1000.0,), description="h, cycles; the adaptive scheme chooses its own")
    scheme: Annotated[tuple[Scheme, ...], BeforeValidator(axis_of(_read_scheme))] = Field(
        ("implicit",), description="of the wear steps"
    )
    sweep: Annotated[tuple[Sweep, ...], BeforeValidator(axis_of(one_of("up", "down")))] = Field(
        ("up",), description="the branch followed at cycle 0"
    )
    harmonics: HarmonicsAxis | None = Field(None, description="harmonics above the static one")
    samples: SamplesAxis | None = Field(None, description="time samples in a period")
    tolerance: FractionAxis | None = Field(None, description="of the scaled residual")
    rtol: FractionAxis | None = Field(
        None, description="relative error that automatic settings and adaptive steps aim at"
    )


class SlowTimeSection(Section):
    """[slow_time]: how far, and which cycle counts are kept."""

    cycles: Annotated[float, BeforeValidator(read_not_negative)] = Field(
        100_000.0, description="cycles; 0 for the unworn states only"
    )
    outputs: Annotated[int | tuple[float, ...], BeforeValidator(_read_outputs)] = Field(
        101, description="number of equally spaced cycle counts, 0 and the last included, or a list of cycle counts"
    )
    largest_depth: Annotated[float, BeforeValidator(read_positive)] | None = Field(
        None, description="m; the explicit scheme then wears no pair deeper than this in a step, Eq. (22), for any h"
    )


class SolverSection(Section):
    """[solver]: how finely and how exactly. A key that stands under [axes] is not used from here."""

    harmonics: Annotated[int | Automatic, BeforeValidator(_read_harmonics)] = Field(
        AUTO, description="harmonics above the static one"
    )
    samples: Annotated[int | Automatic, BeforeValidator(_read_samples)] = Field(
        AUTO, description="time samples in a period"
    )
    tolerance: Annotated[float, BeforeValidator(read_fraction)] = Field(1e-8, description="of the scaled residual")
    rtol: Annotated[float, BeforeValidator(read_fraction)] = Field(
        1e-2, description="relative error that automatic settings and adaptive steps aim at"
    )
    shortcuts: Annotated[bool, BeforeValidator(read_switch)] = Field(
        True, description="whether points with the same history share one; false: every point is computed on its own"
    )
    time_limit: Annotated[float, BeforeValidator(read_positive)] | None = Field(
        None, description="s, CPU time that a start state or a wear history may take; none unless it is given"
    )


class OutputsSection(Section):
    """[outputs]: which variables the result holds; `outcome` and the totals of a point are always there."""

    variables: Annotated[tuple[str, ...], BeforeValidator(_read_variables)] = Field(
        tuple(ASKED), description="names of result variables"
    )
    loops: Annotated[tuple[int, ...], BeforeValidator(_read_loops)] = Field(
        (), description="indices of the contact pairs whose fretting loops are kept"
    )


class SceneFileParameters(Section):
    """[scene] of a scene file: the file says all the rest."""

    friction_coefficient: Annotated[float, BeforeValidator(read_not_negative)] = Field(
        description="a number, 0 or more"
    )


class SceneSection(Section):
    """[scene]: which model, and the parameters that this model knows.

    parameters: checked object of the class that the scene names, with at least `friction_coefficient`.
    """

    model: Annotated[str, BeforeValidator(_read_text)]
    parameters: SerializeAsAny[BaseModel]

    @property
    def is_file(self) -> bool:
        """Whether the model is a scene file rather than a bundled scene."""
        return names_file(self.model)

    @property
    def tells(self) -> tuple[str, ...]:
        """Names in `outputs.variables` of what a bundled scene tells at little cost."""
        if self.is_file:
            return ()
        return tuple(name for name, function in _OF_THE_SCENE.items() if scene_has(self.model, function))


class Study(Section):
    """A whole study.

    source: the file that it was read from, as the user named it. folder: the one that this file stands in.
    """

    study: StudySection
    scene: SceneSection
    axes: AxesSection
    slow_time: SlowTimeSection = SlowTimeSection()
    solver: SolverSection = SolverSection()
    outputs: OutputsSection = OutputsSection()
    source: str = Field(exclude=True)
    folder: Path = Field(exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _fill_variables(cls, table: object) -> object:
        """All that cost little, unless the study names them: those of every point, and those that its scene has."""
        if not isinstance(table, dict) or not isinstance(scene := table.get("scene"), SceneSection):
            return table
        outputs = table.get("outputs", {})
        if not isinstance(outputs, dict) or "variables" in outputs:
            return table
        return {**table, "outputs": {**outputs, "variables": [*ASKED, *scene.tells]}}

    @model_validator(mode="after")
    def _check_variables(self) -> Study:
        for name in _OF_THE_SCENE:
            if name in self.outputs.variables and name not in self.scene.tells:
                remedy = f"leave it out: the scene {self.scene.model} has none"
                raise WrongValueError(name, remedy, "outputs.variables")
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
            if outputs[-1] > cycles:
                remedy = f"give cycle counts of at most slow_time.cycles = {cycles:g}"
                raise WrongValueError(outputs[-1], remedy, "slow_time.outputs")
        elif outputs < 2 and cycles > 0.0:
            raise WrongValueError(outputs, "give at least 2: cycle 0 and the last one", "slow_time.outputs")
        return self

    @property
    def scene_path(self) -> Path:
        """Path of the scene file; only where the scene is one."""
        return self.folder / self.scene.model

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that a run of the study reads."""
        study_file = self.folder / Path(self.source).name
        return (study_file, self.scene_path) if self.scene.is_file else (study_file,)

    @property
    def friction_coefficient(self) -> float:
        """Coulomb's coefficient of the scene."""
        return read_number(dict(self.scene.parameters)["friction_coefficient"])

    @cached_property
    def cycles_kept(self) -> tuple[float, ...]:
        """Cycle counts of the result, ascending."""
        cycles, outputs = self.slow_time.cycles, self.slow_time.outputs
        if isinstance(outputs, tuple):
            return outputs
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
        """The values of `harmonics` that are numbers."""
        return tuple(number for number in self.harmonics if number != AUTO)

    @property
    def dimensions(self) -> Mapping[str, tuple[float | str, ...]]:
        """Name and values of the axes of the result, in its order; solver keys only where they are axes."""
        names = (*AXES, *(key for key in SOLVER_AXES if getattr(self.axes, key) is not None))
        return {name: getattr(self.axes, name) for name in names}


def names_file(model: str) -> bool:
    """Whether the text under `scene.model` names a scene file: a path, or a name with an HDF5 ending."""
    return "/" in model or "\\" in model or Path(model).suffix.lower() in (".h5", ".hdf5", ".he5")
