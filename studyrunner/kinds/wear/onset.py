"""The excitation at which a joint begins to slip that sticks: its forces then grow in proportion to the excitation."""

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model import ReducedModel

if TYPE_CHECKING:
    from solver.results.history import StartState

_ROUND_OFF = 1e-6  # of the largest contact force, below which a pair is open
_PHASES = 64


def slip_amplitude(start: "StartState", model: ReducedModel) -> float:
    """Excitation amplitude, N, at which the first pair slips in every period, or lifts; inf if none ever does.

    start: in which no pair slips, so that the forces are linear in the amplitude. A pair comes to rest while some mean
    tangential force lies in the circle of friction of all phases (Melan's theorem), which two phases s and t decide:
    c |T_1(s) - T_1(t)| <= mu (2 N_0 + c N_1(s) + c N_1(t)) with c times the excitation, exact where it moves on a line.
    That the mean normal forces change with the tangential ones is left out. NaN where there is no state, or a pair that
    touches lifts in it. model: with its friction.
    """
    from solver.structure.fourier import synthesis  # a run alone needs it, and numba with it

    if start.state is None:
        return math.nan
    phase = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    rubs = model.contact.friction > 0.0
    force_h = start.state.contact_force_h[rubs]
    force, mean = force_h @ synthesis(start.resolution.orders, phase), force_h[:, 0, :1]
    least = _ROUND_OFF * np.abs(force).max(initial=0.0)
    loaded = np.abs(force).max(axis=(1, 2)) > least
    if not loaded.any() or (force[loaded, 0] <= least).any():
        return math.nan
    moving, mu, largest = force[loaded, 0] - mean[loaded], model.contact.friction[rubs][loaded, None], math.inf
    for shift in range(_PHASES // 2 + 1):
        # each phase with the one that comes so much later
        apart = np.hypot(*np.moveaxis((force - np.roll(force, shift, axis=-1))[loaded, 1:], 1, 0))
        grows = apart - mu * (moving + np.roll(moving, shift, axis=-1))
        limit = np.divide(2.0 * mu * mean[loaded], grows, out=np.full_like(grows, math.inf), where=grows > 0.0)
        largest = min(largest, float(limit.min()))
    return start.state.excitation_amplitude * largest
