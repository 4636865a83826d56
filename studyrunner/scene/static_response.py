"""The response of a scene at rest: what its harmonic load does when it is applied ever so slowly."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.model import ReducedModel


@dataclass(frozen=True)
class StaticResponse:
    """What the harmonic load does at rest, with the joint stuck; pairs with an initial gap are open.

    amplitude (n_response,): m per unit excitation amplitude, `|R x|` with `x = K^-1 F`, K and F without the relative
    displacements that are held. Below its first resonance an undamped structure responds with more, far above with
    less. frequency: Hz, Rayleigh's quotient of this shape, `omega^2 = x* K x / x* M x`: no less than that of the first
    resonance; inf where nothing moves that has mass, and nothing can resonate.
    """

    amplitude: NDArray[np.float64]
    frequency: float


def static_response(model: ReducedModel) -> StaticResponse | None:
    """The response at rest of the first harmonic; None where the stiffness alone does not hold the structure."""
    from scipy.linalg import LinAlgWarning, solve

    linear = model.harmonic_structure(1)
    held = model.contact.dofs[model.contact.gap <= 0.0]
    free = np.setdiff1d(np.arange(len(linear.load_harmonic)), held[held >= 0])
    both = np.ix_(free, free)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            moved = solve(linear.stiffness[both], linear.load_harmonic[free], assume_a="her")
    except (LinAlgWarning, np.linalg.LinAlgError, ValueError):
        return None
    amplitude = np.asarray(np.abs(linear.response[:, free] @ moved), dtype=np.float64)
    # K x is F
    energy, inertia = (float(np.vdot(moved, of).real) for of in (linear.load_harmonic[free], linear.mass[both] @ moved))
    return StaticResponse(
        amplitude, math.sqrt(max(energy, 0.0) / inertia) / (2.0 * math.pi) if inertia > 0.0 else math.inf
    )
