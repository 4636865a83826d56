"""Mission histories: tasks and their computation."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import WearLaw
from solver.missions.mission import Begin, Block, MissionRequest
from solver.model import ReducedModel
from solver.packing import Packed
from solver.settings import Direction, Passage, SolverSettings, WearTarget
from studyrunner.kinds import task as tasks
from studyrunner.kinds.estimate import iterations_of_sweep, seconds_of
from studyrunner.kinds.joint import TaskJoint
from studyrunner.kinds.missions.kind import OF_A_MISSION
from studyrunner.kinds.results import (
    deepest,
    describe_target,
    first_harmonic,
    motion_of_sectors,
    named,
    wear_of_sectors,
)
from studyrunner.points.table import Points
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.progress import count

if TYPE_CHECKING:
    from solver.missions.mission import MissionHistory

_NO_JOINT = TaskJoint(0, None)
# Newton iterations, see `estimate`
_OF_BLOCK = 20  # of a mission, after its start state (slider: 10 to 35)
_OF_PASSAGE = 900  # (dovetail with 16 pairs, rtol 0.1: 970, 2500 with 40 frequencies, 330 where nothing slips)
_AN_OCTAVE = 350  # of a wide passage (slider from 1 to 10 000 Hz: 5600, and 2700 of its reference solution)

_MISSIONS_A_DOUBLING = 2.0
"""Missions that are computed for each doubling of their number, by the history and again by its reference solution: 6
of 20 on a slider, 18 to 26 of thousands on a dovetail, 42 of a million on a slider."""

_A_WAY = 0.5
"""Iterations of the way to a block in a later mission, over those of the first one (dovetail with 16 pairs: 150 to 190
of 320 to 380; one pair that slips: 2 of 14 missions with 20 missions, 12 of 84 with a million)."""


_AS_OTHERS, _HARMONICS_BY_RTOL = 0.05, 0.66
"""Share of the estimate: 0.4 and 0.5 of it with rtol = 0.1, three times of it with 0.01 (dovetail with 16 pairs)."""


@dataclass(frozen=True)
class PlannedBlock:
    """A block of a mission, as the `Block` of the solver, but cycles are in one mission, also of a passage."""

    name: str
    joint: TaskJoint
    frequency: float | Passage
    excitation_amplitude: float
    cycles: float
    begin: Begin

    def as_block(self, model: ReducedModel) -> Block:
        """The block as the solver takes it. model: of the joint, with its friction."""
        cycles = None if isinstance(self.frequency, Passage) else self.cycles
        return Block(model, self.frequency, self.excitation_amplitude, None, cycles, self.begin, self.name)


@dataclass(frozen=True, kw_only=True, slots=True)
class Mission(tasks.Task):
    """A mission history: blocks of vibration, one after the other, many times. It has one result.

    first: how the first mission begins where its first block continues; "" elsewhere.
    missions: numbers of missions of the output. until: wear at which the history ends before the last of them.
    """

    blocks: tuple[PlannedBlock, ...]
    law: WearLaw
    wear_coefficient: float
    first: str
    missions: tuple[float, ...]
    until: WearTarget | None

    def hashes(self, identity: tasks.Identity) -> tuple[str, ...]:
        """Hash of the history: of all blocks with their scenes."""
        blocks = [(identity.joint(block.joint), replace(block, joint=_NO_JOINT)) for block in self.blocks]
        wear = (self.wear_coefficient, self.law, self.first, self.settings)
        return (tasks.digest("mission", blocks, wear, self.missions, self.until, identity.record),)

    def compute(self, models: Mapping[int, ReducedModel], keep: tasks.Keep) -> Iterator[tasks.PointResult]:
        """The history."""
        # numba is loaded where a task runs, so that --plan and --help do without it
        from solver.missions.history import integrate_missions

        of_joints = {block.joint: block.joint.model(models) for block in self.blocks}
        blocks = tuple(block.as_block(of_joints[block.joint]) for block in self.blocks)
        n_computed = itertools.count(1)
        # as many again for the reference solution
        n_planned = 2 * max(1, _n_computed(self.missions[-1]))

        def note(progress: Packed) -> None:
            keep(progress)
            n = next(n_computed)
            # the first one has the ways to all blocks
            share = (n + 1) / (max(n_planned, n + 1) + 1)
            keep(tasks.Part(share, f"{n} of about {n_planned} missions that are computed"))

        wanted = {int(number) for number in self.missions}
        # with those before, for the wear of one
        read = tuple(sorted({0, 1} | wanted | {max(number - 1, 0) for number in wanted}))
        first = cast("Direction", self.first)
        asked = MissionRequest(blocks, self.wear_coefficient, read, self.settings, self.law, self.until, first)
        yield tasks.PointResult(
            _values(self, integrate_missions(asked, note, self.resume), blocks[0].model.contact.area)
        )

    def describe(self, place: int) -> str:  # noqa: ARG002
        """Its number."""
        return f"mission history {self.number + 1}"


def build_tasks(study: Study, points: Points, n_displacements: Sequence[int]) -> tasks.TaskPlan:
    """Tasks of a study of missions, one for equal points."""
    found: dict[Mission, list[int]] = {}
    # of the axes their places: blocks may have values of their own
    places = [points.columns[name] for name in ("study", "frequency", "excitation_amplitude", "sweep")]
    own = [*(points.columns[name] for name in ("joint", "law", "settings")), points.axis("wear_coefficient")]
    for (joints, law, settings, wear_coefficient, number, *at), numbers in points.groups(*own, *places):
        part = points.studies[number]
        blocks, sweep = tuple(_blocks(part, joints, *at)), part.axes.sweep[at[-1]]
        scenes = tuple(sorted({joint.scene for joint in joints}))
        n_unknowns = tasks.n_unknowns_of(max(n_displacements[scene] for scene in scenes), settings.harmonics)
        ways = [(block.begin, block.frequency) for block in blocks]
        task = Mission(
            number=0,
            scenes=scenes,
            settings=settings,
            cost=seconds_of(n_unknowns, _iterations(ways, study.output_counts[-1]), joints[0].n_sectors)
            * _finer(settings),
            n_unknowns=n_unknowns,
            blocks=blocks,
            law=law,
            wear_coefficient=wear_coefficient,
            first=sweep if blocks[0].begin == "continue" else "",
            missions=study.output_counts,
            variables=tuple(study.recorded),
            until=study.until,
        )
        found.setdefault(task, []).extend(numbers)
    return tasks.number_points({task: [numbers] for task, numbers in found.items()}, points.n)


def _finer(settings: SolverSettings) -> float:
    """Estimated time of an iteration over that of any state: automatic harmonics are more where less is allowed."""
    is_automatic = AUTO in (settings.harmonics, settings.samples)
    return (_AS_OTHERS / settings.rtol) ** _HARMONICS_BY_RTOL if is_automatic else 1.0


def _n_computed(missions: float) -> int:
    """Missions that are computed for a number of missions, by the history or by its reference solution."""
    return math.ceil(min(missions, 2.0 + _MISSIONS_A_DOUBLING * math.log2(max(missions, 1.0))))


def _iterations(blocks: Sequence[tuple[str, float | Passage]], missions: float) -> float:
    """Newton iterations of a mission history. blocks: how each begins, and its frequency."""
    each = 0.0
    for begin, frequency in blocks:
        if isinstance(frequency, Passage):
            each += _OF_PASSAGE + _AN_OCTAVE * abs(math.log2(frequency.stop / frequency.start))
        elif begin == "continue":
            each += 2 * _OF_BLOCK
        else:
            each += _OF_BLOCK + _A_WAY * iterations_of_sweep(begin, 1)
    return 2 * _n_computed(missions) * each


def _blocks(
    part: Study, joints: Sequence[TaskJoint], frequency_at: int, amplitude_at: int, sweep_at: int
) -> Iterator[PlannedBlock]:
    """The blocks of a point, from its places on the axes."""
    at = {"frequency": frequency_at, "excitation_amplitude": amplitude_at}
    for given, study, joint in zip(part.mission, part.block_studies, joints, strict=True):
        frequency, amplitude = (
            getattr(study.axes, name)[0 if given.gives(name) else place] for name, place in at.items()
        )
        begin: str = part.axes.sweep[sweep_at] if given.begin == "sweep" else given.begin
        cycles = given.cycles_at(frequency)
        if given.passage is not None:
            frequency, begin = given.passage, given.passage.sweep
        yield PlannedBlock(given.name, joint, frequency, amplitude, cycles, cast("Begin", begin))


def _values(task: Mission, history: "MissionHistory", area: NDArray[np.float64]) -> dict[str, Any]:
    """Variables of the result, at the numbers of missions that the task asks for. area: of the pairs, m2."""
    from solver.results.history import last_error

    counts = np.array(task.missions)
    rows, ends = (np.searchsorted(history.missions, each) for each in (counts, np.clip(counts, 1.0, None)))
    in_mission = history.block_volume[ends] - history.block_volume[ends - 1]
    rate, worn = in_mission.sum(axis=1), history.worn_volume[rows]
    share = np.divide(in_mission, rate[:, None], out=np.full_like(in_mission, np.nan), where=rate[:, None] > 0.0)
    reached = np.flatnonzero(np.isfinite(worn))
    last = history.wear_depth[rows[reached[-1]] if reached.size else 0]
    is_state = np.isfinite(history.worn_volume).any() and np.isfinite(history.response_begin).any()
    of_depth = ("worn_volume", "worn_volume_error", "wear_depth", "wear_depth_error")
    of_energy = ("dissipated_energy", "dissipated_energy_error")
    whole, target = history.last_mission >= task.missions[-1], ""
    if history.outcome.complete:
        target = describe_target(task.until, history.missions_to_target, "mission", whole=whole)
    n, of_ring = task.blocks[0].joint.n_sectors, {}
    if n > 1:
        of_ring = motion_of_sectors(n, history.response_end[rows]) | wear_of_sectors(n, history.wear_depth[rows], area)
    own: Mapping[str, object] = {
        **of_ring,
        **{name: getattr(history, name)[rows] for name in (*of_depth, *of_energy)},
        **{name: getattr(history, name)[rows] for name in ("response_error", "response_peak_begin")},
        **deepest(history.wear_depth[rows], history.wear_depth_error[rows]),
        **first_harmonic(history.response_end[rows]),
        "wear_rate": np.where(np.isfinite(worn), rate, np.nan),
        "wear_depth_last": last,
        "block_worn_volume": history.block_volume[rows],
        "block_worn_volume_error": history.block_volume_error[rows],
        "block_share": share,
        "response_amplitude_begin": np.abs(history.response_begin[rows]),
        "response_peak": history.response_peak_end[rows],
        "excitation_frequency": history.excitation_frequency[:, 1],
        "excitation_frequency_begin": history.excitation_frequency[:, 0],
        "block_cycles": np.array([block.cycles for block in task.blocks]),
        "outcome": int(history.outcome),
        # a mission is computed for the vibration at 0
        "error_estimate": last_error(
            counts[reached],
            history.worn_volume_error[rows[reached]],
            rate[reached],
            min(history.last_mission, counts[-1]),
        ),
        "last_mission": min(history.last_mission, float(counts[-1])) if is_state else math.nan,
        "largest_wear_depth": float(last.max(initial=0.0)) if reached.size else math.nan,
        "message": "; ".join(filter(None, (history.message, target))),
    }
    return named((*task.variables, *OF_A_MISSION), own, history)


WAYS = {
    "mission": lambda n_tasks, _: f"{count(n_tasks, 'mission history', 'mission histories')}, each computed by one rank"
}


def plan_rows(study: Study) -> Iterator[tuple[str, str]]:
    """Rows of a plan on the missions, and on each block."""
    n_stored = count(len(study.output_counts), "number is", "numbers are")
    yield "missions", f"{study.slow_time.missions}, of which {n_stored} stored"
    for block, own in zip(study.mission, study.block_studies, strict=True):
        yield "block", f"{block.name}: {block.describe(max(own.axes.frequency))}"
