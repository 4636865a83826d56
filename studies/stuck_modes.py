"""Natural frequencies of a reduced model with its joint stuck: every relative displacement is held at 0."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh

from solver.model import ReducedModel
from studies.scene_answers import N_MODES, NaturalFrequencies
from studies.scene_error import SceneError


def stuck_frequencies(model: ReducedModel) -> NaturalFrequencies:
    """Lowest frequencies of every nodal diameter that the model holds.

    Raises SceneError where all displacements are relative ones of pairs, so that nothing moves, or where the stuck
    structure is not held.
    """
    dofs = model.contact.dofs
    frequencies = np.full((len(model.linear), N_MODES), np.nan)
    for row, (k, linear) in enumerate(sorted(model.linear.items())):
        free = np.setdiff1d(np.arange(len(linear.stiffness)), dofs[dofs >= 0])
        if len(free) == 0:
            raise SceneError("variables", "natural_frequency", "leave it out: nothing moves where the joint sticks")
        held = np.ix_(free, free)
        try:
            # M x = K x / w^2: a displacement without mass has no frequency, which is 0 here
            inverse = eigh(linear.mass[held], linear.stiffness[held], eigvals_only=True)[::-1]
        except LinAlgError:
            raise SceneError(
                "variables",
                "natural_frequency",
                f"leave it out: nothing holds the stuck structure at nodal diameter {k}",
            ) from None
        moving = inverse[inverse > np.finfo(np.float64).eps * len(free) * inverse[0]][:N_MODES]
        frequencies[row, : len(moving)] = 1.0 / (2.0 * np.pi * np.sqrt(moving))
    return NaturalFrequencies(tuple(sorted(model.linear)), frequencies)
