"""Nonlinear modes: tasks and their computation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from solver.model import ReducedModel
from studyrunner.kinds import task as tasks
from studyrunner.kinds.estimate import seconds_of
from studyrunner.kinds.joint import TaskJoint
from studyrunner.kinds.modes.kind import OF_A_MODE_POINT
from studyrunner.kinds.results import first_harmonic, motion_of_sectors, named
from studyrunner.points.table import Points
from studyrunner.study.study import Study
from studyrunner.system.progress import count

# Newton iterations
_OF_MODE = 900  # to the first point of a mode; with two more unknowns it takes five times as long as forced vibration
_A_MODE_POINT = 300  # each further amplitude, with errors (study `modes`: 3300 for 9; 30 where nothing slips)


@dataclass(frozen=True, kw_only=True, slots=True)
class Mode(tasks.Task):
    """A nonlinear mode; a result at each modal amplitude.

    mode: its number, from 1. direction: "up" or "down" along the amplitude. amplitudes: m sqrt(kg), ascending.
    """

    joint: TaskJoint
    mode: int
    direction: str
    amplitudes: tuple[float, ...]

    @property
    def order(self) -> tuple[int, ...]:
        """Indices of the amplitudes in the order in which they are computed."""
        return tasks.up_or_down(len(self.amplitudes), self.direction)

    def hashes(self, identity: tasks.Identity) -> tuple[str, ...]:
        """Hashes of the points. None depends on the other amplitudes."""
        own = (identity.joint(self.joint), self.mode, self.direction, self.settings, identity.record)
        return tuple(tasks.digest("mode", *own, amplitude) for amplitude in self.amplitudes)

    def compute(self, models: Mapping[int, ReducedModel], keep: tasks.Keep) -> Iterator[tasks.PointResult]:
        """Points of the mode."""
        del keep
        from solver.modes.points import follow_mode

        model, wanted = self.joint.model(models), sorted(self.places)
        amplitudes = np.array([self.amplitudes[place] for place in wanted])
        direction = cast("Literal['up', 'down']", self.direction)
        for place, found in follow_mode(model, amplitudes, self.mode, direction, self.settings):
            own = {
                **first_harmonic(found.response),
                **motion_of_sectors(self.joint.n_sectors, found.response),
                "natural_frequency": found.frequency,
                "natural_frequency_error": found.frequency_error,
                "damping_ratio_error": found.damping_error,
                "outcome": int(found.outcome),
            }
            yield tasks.PointResult(named((*self.variables, *OF_A_MODE_POINT), own, found), wanted[place])

    def describe(self, place: int) -> str:
        """Where along the amplitude."""
        return f"mode {self.mode} {self.direction} to {self.amplitudes[place]:.3g} m sqrt(kg)"


def build_tasks(study: Study, points: Points, n_displacements: Sequence[int]) -> tasks.TaskPlan:
    """Tasks of a study of nonlinear modes: one along the amplitude for each joint, mode, direction and setting."""
    modes: dict[tuple[Any, ...], dict[float, list[int]]] = {}
    columns = (points.columns["joint"], *map(points.axis, ("mode", "sweep")), points.columns["settings"])
    for (*own, amplitude), numbers in points.groups(*columns, points.axis("modal_amplitude")):
        modes.setdefault(tuple(own), {})[amplitude] = numbers
    found: dict[Mode, list[list[int]]] = {}
    for ((joint,), mode, direction, settings), amplitudes in modes.items():
        n_unknowns = tasks.n_unknowns_of(n_displacements[joint.scene], settings.harmonics)
        first, whole = _OF_MODE, _OF_MODE + _A_MODE_POINT * (len(amplitudes) - 1)
        task = Mode(
            number=0,
            scenes=(joint.scene,),
            settings=settings,
            cost=seconds_of(n_unknowns, whole, joint.n_sectors),
            first_share=first / whole,
            n_unknowns=n_unknowns,
            joint=joint,
            mode=mode,
            direction=direction,
            amplitudes=tuple(sorted(amplitudes)),
            variables=tuple(study.recorded),
        )
        found[task] = [amplitudes[amplitude] for amplitude in task.amplitudes]
    return tasks.number_points(found, points.n)


WAYS = {
    "mode": lambda n_tasks, n_results: (
        f"{count(n_tasks, 'nonlinear mode')} over the amplitude, {count(n_results, 'point')}"
    )
}


def plan_rows(study: Study) -> tuple[tuple[str, str], ...]:  # noqa: ARG001
    """No rows of a plan: a mode has no slow time."""
    return ()
