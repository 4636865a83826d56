"""The joint that a task computes: the model of a scene, with what a study says of its contact."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from solver.compliant_contact import with_evolution
from solver.model import ReducedModel, with_friction
from solver.structure.ring import build_ring
from studyrunner.scatter import SECTOR_FREQUENCY
from studyrunner.scene.scene_set import FORCED_SECTOR, ContactChange
from studyrunner.study.study import Study

Evolving = tuple[tuple[str, tuple[tuple[str, tuple[float, ...]], ...]], ...]
"""`EvolutionSection.tables` as pairs of name and content, with the energies, J/m2, as the first."""


@dataclass(frozen=True)
class TaskJoint:
    """The joint that a task computes.

    scene: number of the scene (`SceneSet`). friction_coefficient: of all pairs; None where each pair has its own.
    contact: arrays of the contact interface in place of those of the scene, and `energy` with which it begins, J/m2.
    evolution: what changes with the dissipated energy (`Evolving`); () for nothing.
    """

    scene: int
    friction_coefficient: float | None
    contact: ContactChange = ()
    evolution: Evolving = ()

    @property
    def n_sectors(self) -> int:
        """Sectors of a ring whose joints it has together; 1 where it is that of one."""
        return len(dict(self.contact).get(SECTOR_FREQUENCY, (0.0,)))

    def model(self, models: Mapping[int, ReducedModel]) -> ReducedModel:
        """The model of the scene with its friction and what is drawn for the pairs. models: by number of the scene."""
        model, changes = models[self.scene], dict(self.contact)
        if SECTOR_FREQUENCY in changes:
            model = _ring(model, changes.pop(SECTOR_FREQUENCY), *changes.pop(FORCED_SECTOR, ()))
        drawn: dict[str, Any] = {name: np.array(values) for name, values in changes.items()}
        energy = drawn.pop("energy", np.zeros(model.contact.n_contact))
        model = replace(model, contact=replace(model.contact, **drawn))
        if self.evolution:
            model = evolving(model, self.evolution)
            model = replace(model, contact=model.contact.after(energy))
        return with_friction(model, self.friction_coefficient)


@lru_cache(maxsize=2)
def _ring(model: ReducedModel, deviations: tuple[float, ...], forced: float | None = None) -> ReducedModel:
    """The ring of a sector; the last ones are kept, with all that is derived from their structure."""
    return build_ring(model, deviations, forced_sector=None if forced is None else int(forced))


def evolving(model: ReducedModel, evolution: Evolving) -> ReducedModel:
    """The model of a joint whose contact changes. KeyError where a surface has no table."""
    (_, ((_, energy),)), *tables = evolution
    of_pairs = dict[str, Any]()
    for name, by_surface in tables:
        known = dict(by_surface)
        of_pairs[name] = [known[""] if "" in known else known[label] for label in model.contact.surface]
    return with_evolution(model, energy, **of_pairs)


def joint_of(study: Study, scene: int, contact: ContactChange) -> TaskJoint:
    """The joint of a part of a study. scene: its number. contact: what is drawn for its pairs."""
    own = "friction_coefficient" in study.evolving or any(name == "friction_coefficient" for name, _ in contact)
    evolution: Evolving = ()
    if study.wear.evolution is not None:
        tables = {"energy": {"": study.wear.evolution.energy}, **study.evolving}
        evolution = tuple((name, tuple(each.items())) for name, each in tables.items())
    return TaskJoint(scene, None if own else study.friction_coefficient, contact, evolution)
