"""What a scene can tell beside its reduced model: its mesh, its natural frequencies, an exact answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, eigh

from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import FloatArray, IntArray, ReducedModel
from studies.scene_error import SceneError

N_MODES = 6
"""Number of natural frequencies that are given for each nodal diameter."""


@dataclass(frozen=True)
class SurfaceMesh:
    """Outer faces of a finite-element mesh, for pictures.

    nodes (n_nodes, 3): m. quads (n_quads, 4): nodes of each face, anticlockwise as seen from outside. parts: label of
    the part that each face belongs to, e.g. "blade".
    """

    nodes: FloatArray
    quads: IntArray
    parts: tuple[str, ...]


@dataclass(frozen=True)
class NaturalFrequencies:
    """Natural frequencies with the joint stuck, undamped.

    nodal_diameters: ascending; 0 only where the structure is no cyclic sector. frequencies (n_nodal_diameters,
    N_MODES): Hz, ascending; NaN where there are fewer modes.
    """

    nodal_diameters: tuple[int, ...]
    frequencies: FloatArray


@dataclass(frozen=True)
class WearQuestion:
    """What an exact answer is asked for: wear and vibration at one frequency and excitation amplitude.

    frequency: Hz. excitation_amplitude: N. wear_coefficients (n_wear,): 1/Pa. cycles (n_cycles,): counts. law: wear
    law. worn_depth: m, of each pair at the count 0. changed: keys of a study that differ from their defaults, as
    "wear.law"; a closed form that does not know one of them holds no longer.
    """

    frequency: float
    excitation_amplitude: float
    wear_coefficients: FloatArray
    cycles: FloatArray
    law: WearLaw = ARCHARD
    worn_depth: float = 0.0
    changed: frozenset[str] = frozenset()


@dataclass(frozen=True)
class ExactAnswer:
    """Exact answer to a `WearQuestion`, NaN where it does not hold.

    worn_volume (n_wear, n_cycles): m3, since the count 0. response_amplitude (n_wear, n_cycles, n_response):
    amplitude of the first harmonic, m.
    """

    worn_volume: FloatArray
    response_amplitude: FloatArray


def unknown_answer(asked: WearQuestion, n_response: int) -> ExactAnswer:
    """The answer where no closed form holds."""
    shape = asked.wear_coefficients.size, asked.cycles.size
    return ExactAnswer(np.full(shape, np.nan), np.full((*shape, n_response), np.nan))


def stuck_frequencies(model: ReducedModel) -> NaturalFrequencies:
    """Lowest frequencies of every nodal diameter of a model with its joint stuck: no relative displacement moves.

    Raises SceneError where nothing else moves, or the stuck structure is not held.
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
            remedy = f"leave it out: nothing holds the stuck structure at nodal diameter {k}"
            raise SceneError("variables", "natural_frequency", remedy) from None
        moving = inverse[inverse > np.finfo(np.float64).eps * len(free) * inverse[0]][:N_MODES]
        frequencies[row, : len(moving)] = 1.0 / (2.0 * np.pi * np.sqrt(moving))
    return NaturalFrequencies(tuple(sorted(model.linear)), frequencies)
