"""Nonlinear modes: tasks and their computation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from solver.model import ReducedModel
from studyrunner.kinds import task as tasks
from studyrunner.kinds.estimate import iterations_of_mode, seconds_of
from studyrunner.kinds.results import first_harmonic, named
from studyrunner.scene.scene_set import ContactChange, SceneSet
from studyrunner.study.study import Study
from studyrunner.variables import OF_A_MODE_POINT


@dataclass(frozen=True, kw_only=True)
class Mode(tasks.Task):
    """A nonlinear mode; a result at each modal amplitude.

    mode: its number, from 1. direction: "up" or "down" along the amplitude. amplitudes: m sqrt(kg), ascending.
    """

    joint: tasks.TaskJoint
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
                "natural_frequency": found.frequency,
                "natural_frequency_error": found.frequency_error,
                "damping_ratio_error": found.damping_error,
                "outcome": int(found.outcome),
            }
            yield tasks.PointResult(named((*self.variables, *OF_A_MODE_POINT), own, found), wanted[place])

    def describe(self, place: int) -> str:
        """Where along the amplitude."""
        return f"mode {self.mode} {self.direction} to {self.amplitudes[place]:.3g} m sqrt(kg)"


def build_tasks(
    study: Study, scenes: SceneSet, n_displacements: Sequence[int], contacts: Sequence[Sequence[ContactChange]]
) -> tasks.TaskPlan:
    """Tasks of a study of nonlinear modes: one along the amplitude for each joint, mode, direction and setting."""
    amplitudes = study.axes.modal_amplitude or ()
    ascending = sorted(range(len(amplitudes)), key=lambda place: amplitudes[place])
    first, whole = (iterations_of_mode(number) for number in (1, len(amplitudes)))
    modes: dict[Mode, list[dict[str, int]]] = {}
    for part, (scene,), (contact,) in zip(scenes.parts, scenes.of_blocks, contacts, strict=True):
        joint = tasks.joint_of(part.study, scene, contact)
        of_part = dict(zip(study.axes_of_parts, part.place, strict=True))
        for at, settings in tasks.grid(study):
            n_unknowns = tasks.n_unknowns_of(n_displacements[joint.scene], settings.harmonics)
            mode = Mode(
                number=0,
                scenes=(scene,),
                settings=settings,
                cost=seconds_of(n_unknowns, whole),
                first_share=first / whole,
                n_unknowns=n_unknowns,
                joint=joint,
                mode=study.axes.mode[at["mode"]],
                direction=study.axes.sweep[at["sweep"]],
                amplitudes=tuple(amplitudes[place] for place in ascending),
                variables=tuple(study.recorded),
            )
            modes.setdefault(mode, []).append({**at, **of_part})
    indices = {
        mode: [
            # dimensions of one value have no place
            tuple(tuple({**at, "modal_amplitude": place}.get(name, 0) for name in study.dimensions) for at in lines)
            for place in ascending
        ]
        for mode, lines in modes.items()
    }
    return tasks.number_points(indices, study)
