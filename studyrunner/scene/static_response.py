"""The response of a scene at rest: what its harmonic load does when it is applied for ever so slowly."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.model import ReducedModel


def static_response(model: ReducedModel) -> NDArray[np.float64] | None:
    """Magnitude (n_response,), m per unit excitation amplitude, with the joint stuck; pairs with an initial gap open.

    `|R K^-1 F|`, K and F without the relative displacements that are held. Below its first resonance an undamped
    structure responds with more, far above its resonances with less. None where K alone does not hold the structure.
    """
    from scipy.linalg import LinAlgWarning, solve

    linear, _ = model.harmonic_structure(1)
    held = model.contact.dofs[model.contact.gap <= 0.0]
    free = np.setdiff1d(np.arange(len(linear.load_harmonic)), held[held >= 0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            moved = solve(linear.stiffness[np.ix_(free, free)], linear.load_harmonic[free], assume_a="her")
    except (LinAlgWarning, np.linalg.LinAlgError, ValueError):
        return None
    return np.asarray(np.abs(linear.response[:, free] @ moved), dtype=np.float64)
