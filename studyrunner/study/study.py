"""The study: what a study file says, checked, frozen and with every default filled in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

from pydantic import Field, model_validator

from solver.contact.wear_law import WearLaw
from solver.settings import TARGETS, Automatic, FollowedFrequency, WearTarget
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.mission_variables import OF_A_MISSION, OF_MISSIONS, OF_MISSIONS_BY_DEFAULT, OF_SAMPLED_MISSIONS
from studyrunner.mode_variables import OF_A_MODE_POINT, OF_MODES
from studyrunner.scatter.section import ScatterSection
from studyrunner.study.followed import LoadingSection
from studyrunner.study.mission import OWN_AXES, MissionBlock
from studyrunner.study.scene_axes import SceneAxis
from studyrunner.study.sections import (
    AUTO,
    AXES,
    AXES_OF_MISSIONS,
    AXES_OF_MODES,
    DEFAULT,
    SOLVER_AXES,
    AxesSection,
    OutputsSection,
    SceneSection,
    SlowTimeSection,
    SolverSection,
    StudySection,
)
from studyrunner.study.study_of_result import Archived
from studyrunner.study.values import Section
from studyrunner.study.wear_section import WearSection
from studyrunner.user_error import WrongValueError
from studyrunner.variables import ASKED, FOLLOWED_FREQUENCY, KEPT, OF_SAMPLES, USUAL, Variable

_MOST_POINTS = 1_000_000


class Study(Section):
    """A whole study.

    - mission: blocks in order; none where each point has one vibration.
    - block_studies: for each block a study of this block alone.
    - follow: what the frequency of the excitation follows; None where it is given.
    - source: file of the study, as the user named it.
    - folder: folder of this file.
    - archived: attributes of a result file; None for a study file.
    - scene_axes: axes that are keys of [scene] or [wear].
    - variants: for each combination of the values of `scene_axes`, the last of them fastest, the study with these
      values in [scene] and [wear] and without these axes; none where there are no such axes. What [scene] and [wear] of
      this study say of a key that is an axis is its first value.
    """

    study: StudySection
    scene: SceneSection
    axes: AxesSection
    wear: WearSection = WearSection()
    slow_time: SlowTimeSection = SlowTimeSection()
    solver: SolverSection = SolverSection()
    outputs: OutputsSection = OutputsSection()
    scatter: ScatterSection | None = None
    loading: LoadingSection | None = None
    mission: tuple[MissionBlock, ...] = ()
    block_studies: tuple[Study, ...] = Field((), exclude=True)
    follow: FollowedFrequency | None = Field(None, exclude=True)
    source: str = Field(exclude=True)
    folder: Path = Field(exclude=True)
    archived: Archived | None = Field(None, exclude=True)
    scene_axes: tuple[SceneAxis, ...] = Field((), exclude=True)
    variants: tuple[Study, ...] = Field((), exclude=True)

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
        usual = OF_SAMPLES if table.get("scatter") is not None else USUAL
        if "modal_amplitude" in table.get("axes", {}):
            usual = tuple(OF_MODES)
        if table.get("mission"):
            usual = OF_SAMPLED_MISSIONS if table.get("scatter") is not None else OF_MISSIONS_BY_DEFAULT
        followed = FOLLOWED_FREQUENCY if table.get("follow") is not None else ()
        cheap = [*usual, *followed, *(name for name in scene.offers if name == "mesh")]
        filled = [*cheap, *(name for name in names if name != DEFAULT and name not in cheap)]
        return {**table, "outputs": {**outputs, "variables": filled}}

    @model_validator(mode="after")
    def _check_variables(self) -> Study:
        for name in self.outputs.variables:
            if name in self.variables or (name in SCENE and not (name == "exact" and self._has_no_exact_answer)):
                continue
            if self.has_modes:
                remedy = f"give names out of {', '.join(OF_MODES)}, mesh: with axes.modal_amplitude nothing wears"
            elif self.has_missions:
                known = ", ".join((*OF_MISSIONS, "mesh", "natural_frequency"))
                remedy = f"give names out of {known}: missions do not have it"
            elif name in OF_MISSIONS:
                remedy = "leave it out, or give blocks under [[mission]]: only missions have it"
            else:
                remedy = "leave it out, or give axes.modal_amplitude: only nonlinear modes have it"
            raise WrongValueError(name, remedy, "outputs.variables")
        for name in ("mesh", "exact"):
            if name in self.outputs.variables and name not in self.scene.offers:
                remedy = f"leave it out: the scene {self.scene.model} has none"
                raise WrongValueError(name, remedy, "outputs.variables")
        return self

    @model_validator(mode="after")
    def _check_points(self) -> Study:
        check_axes(self)
        return self

    @model_validator(mode="after")
    def _check_worn(self) -> Study:
        if self.scene.worn is not None and self.wear.law == "table":
            remedy = 'give another law: the factors of a "table" depend on depths, which a worn scene counts from 0'
            raise WrongValueError(self.wear.law, remedy, "wear.law")
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
    def _check_missions(self) -> Study:
        missions, outputs = self.slow_time.missions, self.slow_time.outputs
        if missions is None:
            return self
        if isinstance(outputs, tuple) and (outputs[-1] > missions or any(count != round(count) for count in outputs)):
            remedy = f"give whole numbers of missions, at most slow_time.missions = {missions}"
            raise WrongValueError(outputs, remedy, "slow_time.outputs")
        if self.slow_time.until is not None and "frequency_shift" in self.slow_time.until:
            remedy = "give wear_depth or worn_volume: blocks of a mission have frequencies of their own"
            raise WrongValueError(self.slow_time.until, remedy, "slow_time.until")
        return self

    @model_validator(mode="after")
    def _check_outputs(self) -> Study:
        if self.has_missions:
            return self
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

    @model_validator(mode="after")
    def _check_followed(self) -> Study:
        if self.follow is None:
            return self
        word = self.follow.of
        if "ramp" in self.axes.sweep:
            remedy = f'give "up" or "down": a ramp holds the frequency, and axes.frequency = "{word}" seeks it'
            raise WrongValueError("ramp", remedy, "axes.sweep")
        if "final" in self.axes.scheme:
            remedy = (
                f'give "adaptive": the scheme "final" holds the frequency, and axes.frequency = "{word}" follows it'
            )
            raise WrongValueError("final", remedy, "axes.scheme")
        if "exact" in self.outputs.variables:
            remedy = f'leave it out: it is of given frequencies, and axes.frequency = "{word}" has none'
            raise WrongValueError("exact", remedy, "outputs.variables")
        return self

    @property
    def has_modes(self) -> bool:
        """Whether the points of the study are those of nonlinear modes; then nothing wears."""
        return self.axes.modal_amplitude is not None

    @property
    def has_missions(self) -> bool:
        """Whether the points of the study are mission histories, whose slow time is counted in missions."""
        return bool(self.mission)

    @property
    def _has_no_exact_answer(self) -> bool:
        return self.has_modes or self.has_missions

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Variables that the points of such a study have, if they are asked for."""
        return OF_MODES if self.has_modes else OF_MISSIONS if self.has_missions else ASKED

    @property
    def kept(self) -> Mapping[str, Variable]:
        """Variables that the result of such a study always holds."""
        return OF_A_MODE_POINT if self.has_modes else OF_A_MISSION if self.has_missions else KEPT

    @property
    def sizes(self) -> Mapping[str, int]:
        """Lengths of the dimensions after the axes that the study gives: slow time, and blocks of missions."""
        if self.has_modes:
            return {}
        n_kept = len(self.cycles_kept)
        return {"mission": n_kept, "block": len(self.mission)} if self.has_missions else {"cycle": n_kept}

    @property
    def scene_variables(self) -> tuple[str, ...]:
        """What `outputs.variables` asks of the scene, names of SCENE."""
        return tuple(name for name in self.outputs.variables if name in SCENE and name not in self.variables)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that a run of the study reads."""
        study_file = self.folder / Path(self.source).name
        scene = () if self.scene.path is None else (self.scene.path,)
        model = () if self.scene.files is None else self.scene.files.all
        worn = () if self.scene.worn is None or not self.scene.worn.result else (self.folder / self.scene.worn.result,)
        return (study_file, *scene, *model, *worn)

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
        """Cycle counts, or numbers of missions, of the result, ascending; numbers of the outputs where each point has
        its own counts.
        """
        cycles, outputs = self.slow_time.cycles, self.slow_time.outputs
        if self.has_missions:
            return tuple(map(float, self.missions_kept))
        if isinstance(outputs, tuple):
            return outputs
        if self.to_the_end:
            return tuple(float(number) for number in range(outputs))
        if cycles == 0.0:
            return (0.0,)
        return (*(cycles * position / (outputs - 1) for position in range(outputs - 1)), cycles)

    @property
    def missions_kept(self) -> tuple[int, ...]:
        """Numbers of flown missions of the result, ascending; equally spaced but for rounding to whole numbers."""
        missions, outputs = self.slow_time.missions, self.slow_time.outputs
        assert missions is not None
        if isinstance(outputs, tuple):
            return tuple(int(count) for count in outputs)
        spaced = (round(missions * position / max(1, outputs - 1)) for position in range(outputs))
        return tuple(sorted({*spaced, missions}))

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
        found = {**{name: getattr(self.axes, name) for name in self.own_axes}, **self.axes_of_parts}
        if self.axes.modal_amplitude is None:
            return found
        worn = found.pop("cycle", (0.0,))
        return {**found, "modal_amplitude": self.axes.modal_amplitude, "cycle": worn}

    @property
    def axes_of_parts(self) -> Mapping[str, tuple[float | str, ...]]:
        """Names and values of the axes whose points are parts of the study (`realise`): the last axes of the result."""
        samples = {} if self.scatter is None else {"sample": tuple(range(self.scatter.realisations))}
        return {**{axis.name: axis.values for axis in self.scene_axes}, **samples}

    def units(self, name: str) -> str:
        """Unit of an axis; "1" where it has none."""
        of_scene = {axis.name: axis.units for axis in self.scene_axes}
        return of_scene[name] if name in of_scene else COORDINATES[name].units

    @property
    def idle_axes(self) -> tuple[str, ...]:
        """Axes of which every block of a mission gives a value of its own; then they are none."""
        return tuple(name for name in OWN_AXES if self.mission and all(block.gives(name) for block in self.mission))

    @property
    def own_axes(self) -> tuple[str, ...]:
        """Names of the axes that are neither keys of [scene] or [wear] nor samples."""
        axes = AXES_OF_MODES if self.has_modes else AXES_OF_MISSIONS if self.has_missions else AXES
        used = (name for name in axes if name not in self.idle_axes)
        return (*used, *(key for key in SOLVER_AXES if getattr(self.axes, key) is not None))


def check_axes(study: Study) -> None:
    """Raises WrongValueError where a study has too many points, or two dimensions of the result have one name."""
    if "nodal_diameter" in study.dimensions and "natural_frequency" in study.scene_variables:
        remedy = "leave it out: it has a dimension nodal_diameter of its own; a study without this axis gives it"
        raise WrongValueError("natural_frequency", remedy, "outputs.variables")
    n_points = math.prod(len(values) for values in study.dimensions.values())
    if n_points > _MOST_POINTS:
        longest = max(study.dimensions, key=lambda name: len(study.dimensions[name]))
        remedy = f"give fewer values: there are {n_points:.3g} points, and a study has at most {_MOST_POINTS}"
        key = "scatter.samples" if longest == "sample" else f"axes.{longest}"
        raise WrongValueError(len(study.dimensions[longest]), remedy, key)
