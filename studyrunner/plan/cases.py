"""What the tasks of a line have in common: joint, settings, unknowns."""

from __future__ import annotations

import math

from solver.settings import Automatic, SolverSettings
from studyrunner.plan.estimate import AUTOMATIC_HARMONICS
from studyrunner.plan.sharing import Index
from studyrunner.plan.tasks import Joint
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.study.realisation import Realisation
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study


def joint_of(part: Realisation, scene: int, contact: ContactChange) -> Joint:
    """The joint of a part of a study. scene: its number. contact: what is drawn for its pairs."""
    of_pairs = any(name == "friction_coefficient" for name, _ in contact)
    return Joint(scene, None if of_pairs else part.study.friction_coefficient, contact)


def settings_of_line(study: Study, places: Index) -> SolverSettings:
    """Settings of a line. places: indices of `SOLVER_AXES`."""
    harmonics, samples, tolerance, rtol = places
    return SolverSettings(
        harmonics=study.harmonics[harmonics],
        samples=study.samples[samples],
        tolerance=study.tolerance[tolerance],
        rtol=study.rtol[rtol],
        time_limit=math.inf if study.solver.time_limit is None else study.solver.time_limit,
    )


def n_unknowns_of(n_displacements: int, harmonics: int | Automatic) -> int:
    """Unknowns of a state with this number of harmonics, or with that which automatic ones take on average."""
    return n_displacements * (2 * (AUTOMATIC_HARMONICS if harmonics == AUTO else harmonics) + 1)
