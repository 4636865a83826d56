"""Mission histories: tasks and their computation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from typing import TYPE_CHECKING, Literal, cast

from solver.contact.wear_law import WearLaw
from solver.packing import Packed
from solver.settings import WearTarget
from studyrunner.kinds.estimate import iterations_of_missions, missions_computed, seconds_an_iteration
from studyrunner.kinds.task import (
    Identity,
    Index,
    Joint,
    Keep,
    PointResult,
    Reached,
    Task,
    described,
    digest,
    joint_of,
    n_unknowns_of,
    raise_fault,
    settings_at,
)
from studyrunner.kinds.task_plan import TaskPlan, number_points
from studyrunner.mpi.cost_model import CostKeys
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.mission import MissionBlock
from studyrunner.study.realisation import Realisation
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.system.progress import count

if TYPE_CHECKING:
    from solver.model import ReducedModel

_OF_ONE_PAIR = 3
"""Relative displacements of one contact pair, at most."""

_MOST = 0.95
"""Largest share of a history that is said to be done before all of it is: the number of steps is an estimate."""

_POINT = ("frequency", "wear_coefficient", "excitation_amplitude", "sweep")
_FOR_THE_TABLE = ("worn_volume", "block_worn_volume")
_NO_JOINT = Joint(0, None)


@dataclass(frozen=True)
class PlannedBlock:
    """A block of a mission.

    frequency: Hz; where it starts for a passage. passage: where the frequency stops, Hz, and its rate, Hz/s; None for
    steady vibration. excitation_amplitude: N. cycles: in one mission. begin: "ramp", "up", "down" or "continue".
    """

    name: str
    joint: Joint
    frequency: float
    passage: tuple[float, float] | None
    excitation_amplitude: float
    cycles: float
    begin: str


@dataclass(frozen=True, kw_only=True)
class Mission(Task):
    """A mission history: blocks of vibration, one after the other, many times. It has one result.

    begin: how the first mission begins where its first block continues; "" elsewhere.
    missions: numbers of missions of the output. until: wear at which the history ends before the last of them.
    """

    blocks: tuple[PlannedBlock, ...]
    law: WearLaw
    wear_coefficient: float
    begin: str
    missions: tuple[float, ...]
    until: WearTarget | None

    @property
    def scenes(self) -> tuple[int, ...]:
        """Those of the blocks."""
        return tuple(sorted({block.joint.scene for block in self.blocks}))

    @property
    def order(self) -> tuple[int, ...]:
        """One place."""
        return (0,)

    @property
    def cost_keys(self) -> CostKeys:
        """By unknowns and wear coefficient."""
        return (("mission", ("mission", self.n_unknowns)), (("mission", self.wear_coefficient),))

    def names(self, identity: Identity) -> tuple[str, ...]:
        """Hash of the history: of all blocks with their scenes."""
        blocks = [(identity.joint(block.joint), astuple(replace(block, joint=_NO_JOINT))) for block in self.blocks]
        until = None if self.until is None else astuple(self.until)
        wear = (self.wear_coefficient, asdict(self.law), self.begin, described(self.settings))
        return (digest("mission", blocks, wear, self.missions, until, identity.record),)

    def compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[PointResult]:
        """The history."""
        from solver.missions import mission as solver_mission
        from solver.missions.history import integrate_missions
        from studyrunner.kinds.mission_result import build_mission_result, missions_read

        of_joints = {block.joint: block.joint.model(models) for block in self.blocks}
        blocks = tuple(
            solver_mission.Block(
                model=of_joints[block.joint],
                frequency=block.frequency
                if block.passage is None
                else solver_mission.Passage(block.frequency, *block.passage),
                excitation_amplitude=block.excitation_amplitude,
                friction_coefficient=block.joint.friction_coefficient,
                cycles=block.cycles if block.passage is None else None,
                begin=cast("Literal['ramp', 'up', 'down', 'continue']", block.begin),
                name=block.name,
            )
            for block in self.blocks
        )
        reached, n_computed = Reached(self, keep), itertools.count(1)
        # as many again for the reference solution
        n_planned = 2 * max(1, missions_computed(self.missions[-1]))

        def note(progress: Packed) -> None:
            reached(progress)
            keep(min(next(n_computed) / n_planned, _MOST))

        mission = solver_mission.Mission(
            blocks,
            self.wear_coefficient,
            missions_read(self.missions),
            self.settings,
            self.law,
            self.until,
            cast("Literal['up', 'down', 'ramp']", self.begin),
        )
        history = integrate_missions(mission, note, self.resume)
        raise_fault(history.outcome, history.message)
        yield replace(build_mission_result(self, history), progress=reached.after(history.outcome))

    def describe(self, place: int) -> str:  # noqa: ARG002
        """Its number."""
        return f"mission history {self.number + 1}"


def variables(study: Study) -> tuple[str, ...]:
    """Variables of a mission history: those asked for and those that the last lines of a run are made of."""
    return tuple(name for name in study.variables if name in study.outputs.variables or name in _FOR_THE_TABLE)


def build_tasks(
    study: Study, n_displacements: Sequence[int], contacts: Sequence[Sequence[ContactChange]], scenes: SceneSet
) -> TaskPlan:
    """Tasks of a study of missions. Points with equal blocks share a task.

    contacts: what is drawn for the pairs of each part, by block.
    """
    points: dict[Mission, list[Index]] = {}
    for number, part in enumerate(scenes.parts):
        sizes = {name: len(getattr(part.study.axes, name)) for name in _POINT}
        sizes |= {name: len(getattr(study, name)) for name in SOLVER_AXES}
        for places in itertools.product(*map(range, sizes.values())):
            at = dict(zip(sizes, places, strict=True))
            blocks = tuple(_blocks(part, at, scenes.of_blocks[number], contacts[number]))
            task = _task(study, part, at, blocks, n_displacements)
            points.setdefault(task, []).append((*(at[name] for name in study.own_axes), *part.place))
    return number_points({task: [tuple(indices)] for task, indices in points.items()}, study, len(scenes.studies))


def _blocks(
    part: Realisation, at: Mapping[str, int], scenes: Sequence[int], contacts: Sequence[ContactChange]
) -> Iterator[PlannedBlock]:
    """The blocks of a point. at: indices of the point along the axes."""
    sweep = part.study.axes.sweep[at["sweep"]]
    for given, study, scene, contact in zip(
        part.study.mission, part.study.block_studies, scenes, contacts, strict=True
    ):
        amplitude, frequency = (
            getattr(study.axes, name)[0 if given.gives(name) else at[name]]
            for name in ("excitation_amplitude", "frequency")
        )
        passage, begin = None, str(given.begin)
        if isinstance(given.frequency, dict):
            frequency, stop = given.frequency["start"], given.frequency["stop"]
            passage, begin = (stop, given.frequency["rate"]), "up" if stop > frequency else "down"
        elif begin == "sweep":
            begin = sweep
        joint = joint_of(Realisation(study, part.place), scene, contact)
        yield PlannedBlock(given.name, joint, frequency, passage, amplitude, given.cycles_at(frequency), begin)


def _task(
    study: Study,
    part: Realisation,
    at: Mapping[str, int],
    blocks: tuple[PlannedBlock, ...],
    n_displacements: Sequence[int],
) -> Mission:
    """The task of a point, without its number and its points."""
    settings = settings_at(study, at)
    n_unknowns = max(n_unknowns_of(n_displacements[block.joint.scene], settings.harmonics) for block in blocks)
    one_pair = n_displacements[blocks[0].joint.scene] <= _OF_ONE_PAIR
    ways = [
        (block.begin, abs(math.log2(block.passage[0] / block.frequency)) if block.passage else 0.0) for block in blocks
    ]
    iterations = iterations_of_missions(ways, study.cycles_kept[-1], one_pair=one_pair)
    return Mission(
        number=0,
        settings=settings,
        cost=seconds_an_iteration(n_unknowns) * iterations,
        blocks=blocks,
        law=part.study.wear_law,
        wear_coefficient=part.study.axes.wear_coefficient[at["wear_coefficient"]],
        # only a first block that continues begins by it
        begin=part.study.axes.sweep[at["sweep"]] if blocks[0].begin == "continue" else "",
        missions=study.cycles_kept,
        variables=variables(study),
        until=study.until,
        n_unknowns=n_unknowns,
    )


TIME = "to a factor of three, if every block wears"


def describe_tasks(tasks: Sequence[Task]) -> str:
    """Tasks in words."""
    return f"{count(len(tasks), 'mission history', 'mission histories')}, each computed by one rank"


def slow_time(study: Study) -> list[tuple[str, str]]:
    """Number of missions, and the blocks."""
    kept = count(len(study.missions_kept), "number is", "numbers are")
    blocks = zip(study.mission, study.block_studies, strict=True)
    return [
        ("missions", f"{study.slow_time.missions}, of which {kept} kept"),
        *(("block", f"{block.name}: {_describe(block, max(own.axes.frequency))}") for block, own in blocks),
    ]


def _describe(block: MissionBlock, frequency: float) -> str:
    """A block in words. frequency: of steady vibration, Hz; the largest of an axis."""
    how = {"ramp": "begins with a ramp", "sweep": "begins with a sweep", "continue": "continues the block before"}
    cycles = f"{block.cycles_at(frequency):.4g} cycles a mission"
    if isinstance(block.frequency, dict):
        passed = "{start:g} to {stop:g} Hz at {rate:g} Hz/s".format(**block.frequency)
        return f"passage from {passed}, {cycles}"
    return f"{frequency:g} Hz, {cycles}, {how[block.begin]}"
