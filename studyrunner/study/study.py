"""The study: what a study file says, checked, frozen and with every default filled in."""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import Field, InstanceOf

from solver.settings import TARGETS, FollowedFrequency, WearTarget
from studyrunner.coordinates import POINT, SAMPLE, SCENE
from studyrunner.kinds.kind import Kind
from studyrunner.kinds.wear.kind import ALLOWED, COUNTS, LOOPS
from studyrunner.measured import MeasuredSection
from studyrunner.scatter import ScatterSection
from studyrunner.study import sections
from studyrunner.study.design import Design
from studyrunner.study.scene_axes import SceneAxis
from studyrunner.study.scene_section import SceneSection
from studyrunner.study.text import Archived
from studyrunner.values import Section
from studyrunner.variables import Variable


class Study(Section):
    """A whole study.

    - kind: which kind of study this is. tables: what marks it, by name, as `mission`.
    - block_studies: for each block a study of this block alone, whose name is `block`.
    - follow: what the frequency of the excitation follows; None where it is given.
    - allowable: whether the excitation amplitude is sought at which each point just meets its target.
    - source, folder: file of the study as the user named it, and its folder.
    - archived: attributes of a result file; None for a study file.
    - solver_axes: keys of [solver] that are given under [axes].
    - scene_axes: axes that are keys of [scene] or [wear]; variants: for each combination of their values, the last one
      fastest, the study with these values in [scene] and [wear]. This study has their first values.
    - design: points that are rows of a table; axes that are its columns are no dimensions of the result.
    """

    study: sections.StudySection
    scene: SceneSection
    axes: sections.AxesSection
    wear: sections.WearSection = sections.WearSection()
    slow_time: sections.SlowTimeSection = sections.SlowTimeSection()
    solver: sections.SolverSection = sections.SolverSection()
    outputs: sections.OutputsSection = sections.OutputsSection()
    scatter: ScatterSection | None = None
    loading: sections.LoadingSection | None = None
    measured: MeasuredSection | None = None
    tables: dict[str, Any] = Field({}, description="of its kind alone")
    kind: InstanceOf[Kind] = Field(exclude=True)
    block_studies: tuple["Study", ...] = Field((), exclude=True)
    block: str = Field("", exclude=True)
    follow: FollowedFrequency | None = Field(None, exclude=True)
    allowable: bool = Field(False, exclude=True)
    source: str = Field(exclude=True)
    folder: Path = Field(exclude=True)
    archived: Archived | None = Field(None, exclude=True)
    solver_axes: tuple[str, ...] = Field((), exclude=True)
    scene_axes: tuple[SceneAxis, ...] = Field((), exclude=True)
    variants: tuple["Study", ...] = Field((), exclude=True)
    design: InstanceOf[Design] | None = Field(None, exclude=True)

    @property
    def mission(self) -> tuple[Any, ...]:
        """Blocks in order; none where each point has one vibration."""
        return tuple(self.tables.get("mission", ()))

    @property
    def parts(self) -> tuple["Study", ...]:
        """The studies of its vibrations, one after the other: of its blocks, or itself."""
        return self.block_studies or (self,)

    def is_in_blocks(self, name: str) -> bool:
        """Whether it has blocks, each of which gives a value of its own to an axis or a number of the joint."""
        return bool(self.mission) and all(block.gives(name) for block in self.mission)

    def part_of(self, name: str) -> "Study":
        """The part whose value of a number is shown: the first block where each has one of its own, else the whole."""
        return self.block_studies[0] if self.is_in_blocks(name) else self

    @property
    def recorded(self) -> Mapping[str, Variable]:
        """Variables of its points, beside those that every result holds."""
        asked = {name: entry for name, entry in self.kind.asked.items() if name in self.outputs.variables}
        more = (
            *((LOOPS, self.outputs.loops), (COUNTS, self.to_the_end), (ALLOWED, self.allowable)),
            (self.kind.of_rings, self.scene.ring),
        )
        return asked | {name: entry for table, is_there in more if is_there for name, entry in table.items()}

    @property
    def scene_variables(self) -> tuple[str, ...]:
        """What `outputs.variables` asks of the scene, names of SCENE."""
        return tuple(name for name in self.outputs.variables if name in SCENE and name not in self.kind.asked)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that a run of the study reads."""
        worn = self.scene.worn.result if self.scene.worn else ""
        sectors = self.scene.ring.file if self.scene.ring else ""
        own, measured = self.folder / Path(self.source).name, self.measured.all if self.measured else ()
        names = [worn, sectors, *(each.file for _, each in measured)]
        return (own, *self.scene.source.files, *(self.folder / name for name in names if name))

    @property
    def friction_coefficient(self) -> float | None:
        """Coulomb friction coefficient of all pairs, unworn; None where each pair has its own."""
        if tables := self.evolving.get("friction_coefficient"):
            return tables[""][0] if "" in tables else None
        value = dict(self.scene.parameters)["friction_coefficient"]
        return None if value is None or isinstance(value, dict) else float(value)

    @property
    def evolving(self) -> Mapping[str, Mapping[str, tuple[float, ...]]]:
        """What changes with the dissipated energy, as `EvolutionSection.tables`; nothing where none is given."""
        return {} if self.wear.evolution is None else self.wear.evolution.tables

    @property
    def until(self) -> WearTarget | None:
        """Wear at which a point ends."""
        given = self.slow_time.until or {}
        return next((WearTarget(quantity, given[quantity]) for quantity in TARGETS if quantity in given), None)

    @property
    def to_the_end(self) -> bool:
        """Whether histories end where nothing wears any more; then each point has its own cycle counts."""
        return self.slow_time.cycles == math.inf

    @cached_property
    def output_counts(self) -> tuple[float, ...]:
        """Cycle counts, or numbers of missions, of the result, ascending; with `to_the_end` numbers of the outputs."""
        outputs, end = self.slow_time.outputs, float(self.slow_time.missions or self.slow_time.cycles)
        if isinstance(outputs, tuple):
            return outputs
        if end == math.inf:
            return tuple(map(float, range(outputs)))
        steps = max(1, outputs - 1)
        spaced = (end * position / steps for position in range(steps))
        return tuple(sorted({*(map(float, map(round, spaced)) if self.kind.whole else spaced), end}))

    @property
    def given_harmonics(self) -> tuple[int, ...]:
        """Values of `harmonics` that are numbers."""
        return tuple(number for number in self.solver.harmonics if number != sections.AUTO)

    @property
    def dimensions(self) -> Mapping[str, Sequence[float | str]]:
        """Names and values of the axes of the result, in their order; solver keys only where they are axes."""
        names = {} if self.axes.frequency_ratio is None else {"frequency": "frequency_ratio"}
        own = {
            names.get(name, name): self.solver if name in sections.SOLVER_AXES else self.axes for name in self.own_axes
        }
        found: dict[str, Sequence[float | str]] = {name: getattr(table, name) or () for name, table in own.items()}
        found |= {axis.name: axis.values for axis in self.scene_axes}
        found |= {} if self.scatter is None else {SAMPLE: range(self.scatter.n_rows)}
        if not self.kind.counted:
            worn = found.pop("cycle", (0.0,))
            found |= {name: getattr(self.axes, name) for name in self.kind.last_axes} | {"cycle": worn}
        if self.design is None:
            return found
        left = {name: values for name, values in found.items() if name not in self.design.columns}
        return {POINT: range(self.design.n), **left}

    @property
    def n_points(self) -> int:
        """Number of points of the result."""
        return math.prod(len(values) for values in self.dimensions.values())

    @property
    def own_axes(self) -> tuple[str, ...]:
        """Names of the axes that are neither keys of [scene] or [wear] nor samples."""
        # those of which every block of a mission gives a value of its own are none
        idle = [name for name in self.kind.axes if self.is_in_blocks(name)]
        idle += ["excitation_amplitude"] if self.allowable else []
        several = [key for key in sections.SOLVER_AXES if key in self.solver_axes or len(getattr(self.solver, key)) > 1]
        return (*(name for name in self.kind.axes if name not in idle), *several)
