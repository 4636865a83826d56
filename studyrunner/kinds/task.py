"""What a rank computes at a time, what it gives back, and all tasks of a study.

There are four kinds of tasks: `Sweep` and `History` (`wear`), `Mode` (`modes`), `Mission` (`missions`).
"""

import hashlib
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, NamedTuple

from solver.model import ReducedModel
from solver.packing import Packed, unpack
from solver.settings import Automatic, SolverSettings
from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS
from studyrunner.kinds.joint import TaskJoint, joint_of
from studyrunner.mpi.dispatch import CostKeys
from studyrunner.points.table import Points
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import SceneSet, contact_changes, frequencies
from studyrunner.study.sections import AUTO, SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.system.machine import MappedFile, package_digest


@dataclass(frozen=True)
class Part:
    """How much of a task is done, from 0 to 1, and in words."""

    share: float
    words: str


Keep = Callable[[Packed | str | Part], None]
"""Takes from time to time what another computation needs to go on, and where a computation is."""

EQUAL_POINTS = "all values are those of another point"
"""Reason for a result that points share, whatever the kind of study."""


@dataclass(frozen=True)
class StartResult:
    """Start state at one frequency of a sweep.

    moves: whether any pair slips or lifts; otherwise nothing wears. n_unknowns: of the state; 0 where there is none.
    """

    place: int
    start: Packed
    moves: bool
    n_unknowns: int

    def pack(self) -> Packed:
        """Everything except the place, for a file."""
        return Packed(json.dumps([self.moves, self.n_unknowns, self.start.text]), self.start.arrays)

    @classmethod
    def unpack(cls, place: int, packed: Packed) -> "StartResult":
        """The start state from the output of `pack`. Raises an error where it is none that a history can begin from."""
        from solver.results.history import StartState  # a run alone needs it, and numba with it

        moves, n_unknowns, text = json.loads(packed.text)
        start = unpack(Packed(text, packed.arrays))
        if not (isinstance(start, StartState) and isinstance(moves, bool) and isinstance(n_unknowns, int)):
            raise TypeError(type(start).__name__)
        for state in filter(None, (start.state, start.reference)):
            n_pairs, n_coefficients = len(state.start_history), 2 * len(start.resolution.orders) + 1
            of_pairs, all_numbers = (n_pairs, 3, n_coefficients), 3 * n_pairs * n_coefficients
            found = state.displacement_h.shape, state.contact_force_h.shape, state.start_history.shape, n_unknowns
            # a pair has one to three displacements
            if found[:3] != (of_pairs, of_pairs, (n_pairs, 2)) or not all_numbers <= 3 * n_unknowns <= 3 * all_numbers:
                raise ValueError(found)
        return cls(place, Packed(text, packed.arrays), moves, n_unknowns)


@dataclass(frozen=True)
class PointResult:
    """The result of one point, or of several points that share it.

    values: variables of the result by name, with the dimensions after the axes; NaN, or 0 in whole numbers, where not
    reached, as are missing variables in the file. progress: of a history that was ended by its time limit.
    """

    values: Mapping[str, Any]
    place: int = 0
    progress: Packed | None = None


Result = StartResult | PointResult


@dataclass(frozen=True)
class Identity:
    """What the results of a study depend on beside their tasks.

    scenes: hash of the model of each scene (`SceneFacts.digest`). record: hash of the variables and their sizes.
    """

    scenes: tuple[str, ...]
    record: str

    def joint(self, joint: TaskJoint) -> tuple[object, ...]:
        """Scene and friction, and the solver."""
        solver = package_digest("solver")
        return (self.scenes[joint.scene], joint.friction_coefficient, *joint.contact, *joint.evolution, solver)


class Work(NamedTuple):
    """What tasks take that are alike. way: what they do. n_results: that are computed, not read from others.

    n_unknowns: most of one. seconds, longest: estimated time of all, and of one, in a plan with the sweep before it.
    """

    way: str
    n_tasks: int
    n_results: int
    n_unknowns: int
    seconds: float
    longest: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Task(ABC):
    """A task, which gives one result or several, one after the other, each at a place of its own.

    number: among the sweeps, or the other tasks, of the study. cost: estimated time, s. first_share: its part until the
        first result; the others take equal ones of the rest.
    n_unknowns: of its largest state; an estimate where the number of harmonics is automatic.
    skipped: places whose results are not needed, or are there from an earlier run. resume: progress of an earlier run.
    names: of the results in the file of a run, by place (`hashes`).
    scenes: numbers of the scenes whose models the task needs. models: of these, for a rank that does not have them.
    variables: names of the variables in a result. indices: for each place the points of the study that have its result;
        none for start states.
    """

    gives_starts: ClassVar[bool] = False
    """Whether other tasks wait for the results."""

    number: int
    scenes: tuple[int, ...]
    settings: SolverSettings
    cost: float
    first_share: float = 1.0
    n_unknowns: int
    skipped: frozenset[int] = frozenset()
    resume: Packed | None = field(default=None, compare=False, repr=False)
    names: tuple[str, ...] = field(default=(), compare=False, repr=False)
    models: tuple[ReducedModel | MappedFile, ...] = field(default=(), compare=False, repr=False)
    variables: tuple[str, ...] = ()
    indices: tuple[tuple[int, ...], ...] = ()

    @property
    def key(self) -> str:
        """Of the task in the file of a run."""
        return _key_of(self.names)

    @property
    def order(self) -> tuple[int, ...]:
        """Places of all results, in the order in which they are given."""
        return tuple(range(len(self.indices)))

    @property
    def places(self) -> tuple[int, ...]:
        """Places of the results that are needed, in the order in which they are given."""
        return tuple(place for place in self.order if place not in self.skipped)

    @property
    def n_results(self) -> int:
        """Number of results that the task gives."""
        return len(self.places)

    @property
    def costs(self) -> tuple[float, ...]:
        """Estimated time, s, of each result that is needed."""
        others = (1.0 - self.first_share) / max(1, len(self.order) - 1)
        return tuple(self.cost * (others if number else self.first_share) for number in range(self.n_results))

    @property
    def waits_for(self) -> tuple[int, int] | None:
        """Number of the sweep, and place of the start state, without which the task cannot begin."""
        return None

    def from_start(self, result: StartResult) -> "Task":  # noqa: ARG002
        """The task that begins from a start state, where it waits for one."""
        return self

    @property
    def cost_keys(self) -> CostKeys:
        """Groups of similar tasks, see `CostModel`: first of all tasks, which tell how fast the machine is."""
        return (("task", type(self).__name__),)

    @property
    def group(self) -> tuple[Hashable, ...]:
        """Most general of the groups."""
        return self.cost_keys[0][:2]

    @property
    def way(self) -> str:
        """What it does, in a word."""
        return type(self).__name__.lower()

    @property
    def work(self) -> Work:
        """What it takes."""
        return Work(self.way, 1, self.n_results, self.n_unknowns, self.cost, self.cost)

    def points(self, place: int) -> tuple[int, ...]:
        """Points that have the result at a place."""
        return self.indices[place] if self.indices else ()

    @abstractmethod
    def hashes(self, identity: Identity) -> tuple[str, ...]:
        """Hashes of all inputs of each result, in the order of the places. Equal hashes mean equal results."""

    @abstractmethod
    def compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[Result]:
        """Gives the results one by one, and the progress from time to time. models: by number of the scene."""

    def failed(self, place: int, outcome: int, message: str) -> Result:
        """In place of a result that was not computed."""
        return PointResult({"outcome": outcome, "message": message}, place)

    @abstractmethod
    def describe(self, place: int) -> str:
        """The task in words while it computes the result at a place."""


def digest(*values: object) -> str:
    """Hash of values, frozen dataclasses among them; numbers enter with all bits.

    A time limit does not enter: it decides whether there is a result, not the values of the result.
    """
    # by hand: `joblib.hash` hashes pickled bytes, which change with the versions of Python and numpy
    text = json.dumps(values, default=lambda each: {**asdict(each), "time_limit": None})
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@lru_cache(maxsize=4096)
def _key_of(names: tuple[str, ...]) -> str:
    # not kept by the tasks: there may be a million
    return digest("task", names)


@dataclass(frozen=True)
class TaskPlan:
    """All tasks of a study.

    make: the tasks that give the results of points; histories wait for a start state. make_sweeps: those that give
    start states. works: what all of them take. left_out: numbers of points that are not computed alone, by reason.
    n_points: of the study.
    """

    make: Callable[[], Iterator[Task]]
    works: Sequence[Work]
    left_out: Mapping[str, int]
    n_points: int
    make_sweeps: Callable[[], Iterator[Task]] = lambda: iter(())

    @cached_property
    def sweeps(self) -> tuple[Task, ...]:
        """The tasks that give start states."""
        return tuple(self.make_sweeps())

    @cached_property
    def results(self) -> tuple[Task, ...]:
        """The tasks that give the results of points."""
        return tuple(self.make())

    def named(self, identity: Identity, known: Mapping[str, str] = {}) -> "TaskPlan":
        """The plan with the names of its tasks. known: names that are in memory already, each by itself."""

        def with_names(task: Task) -> Task:
            return replace(task, names=tuple([known.get(name, name) for name in task.hashes(identity)]))

        of_sweeps, of_results = self.make_sweeps, self.make
        return replace(
            self, make_sweeps=lambda: map(with_names, of_sweeps()), make=lambda: map(with_names, of_results())
        )

    @cached_property
    def waiting(self) -> Mapping[tuple[int, int] | None, Sequence[Task]]:
        """Tasks by the start state that they wait for, number of the sweep and place; None: for none."""
        found: dict[tuple[int, int] | None, list[Task]] = {}
        for task in self.results:
            found.setdefault(task.waits_for, []).append(task)
        return found


def number_points(tasks: Mapping[Any, Sequence[Sequence[int]]], n_points: int) -> TaskPlan:
    """The plan of a study without start states. tasks: each, without number and points, with its `indices`."""
    results = tuple(
        replace(task, number=number, indices=tuple(map(tuple, indices)))
        for number, (task, indices) in enumerate(tasks.items())
    )
    shared = n_points - sum(len(task.order) for task in results)
    left_out = {EQUAL_POINTS: shared} if shared else {}
    return TaskPlan(results.__iter__, [task.work for task in results], left_out, n_points)


# --- from a study to its tasks ---


def with_tasks(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]) -> Points:
    """The points with what tasks are made of: "joint", a joint for each block, "law", "settings" and "hertz".

    facts: of each scene. Raises UserError as `contact_changes` and `frequencies`.
    """
    points, limit = scenes.points, math.inf if study.solver.time_limit is None else study.solver.time_limit
    parts = zip(points.studies, scenes.of_blocks, contact_changes(study, scenes, facts), strict=True)
    joints = [tuple(map(joint_of, own.parts, numbers, of_blocks)) for own, numbers, of_blocks in parts]

    def settings(*values: Any) -> SolverSettings:
        return SolverSettings(**dict(zip(SOLVER_AXES, values, strict=True)), time_limit=limit)

    columns = {
        "joint": points.of_studies(joints),
        "law": points.of_studies([own.wear.as_law for own in points.studies]),
        "settings": points.combined(settings, *map(points.axis, SOLVER_AXES)),
        "hertz": frequencies(study, scenes, facts),
    }
    return replace(points, columns={**points.columns, **columns})


def up_or_down(n_places: int, direction: str) -> tuple[int, ...]:
    """Places in the order in which they are computed, ascending but with the direction "down"."""
    return tuple(reversed(range(n_places)) if direction == "down" else range(n_places))


def n_unknowns_of(n_displacements: int, harmonics: int | Automatic) -> int:
    """Unknowns of a state with this number of harmonics, or with that which automatic ones take on average."""
    return n_displacements * (2 * (AUTOMATIC_HARMONICS if harmonics == AUTO else harmonics) + 1)
