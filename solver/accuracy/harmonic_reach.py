"""How many harmonics it takes until the structure answers all those beyond as the penalty does.

With the penalty E and the compliance G of a pair the harmonics of the predicted force that are left out are
`(1 - E_n G_n) lambda_n` (`solver.structure.penalty`). They need not fall with the next few harmonics: a slider on a
beam has a mass that falls from mode to mode, and one behind a stiff spring a mass only up to the resonance of the two.
As long as the highest harmonic is below that, states with a few more harmonics are alike and all wrong.
"""

from __future__ import annotations

import numpy as np

from solver.accuracy.harmonic_levels import LADDER
from solver.model import ReducedModel
from solver.structure.condensation import relative_indices
from solver.structure.penalty import build_penalty, compliance_at

MISMATCH = 0.25  # of |1 - E G|
RATES = 2.0 ** np.arange(0.0, 8.5, 0.5)  # times that of the first harmonic left out


def reaches(model: ReducedModel, omega: float, highest: int) -> bool:
    """Whether |1 - E G| stays below MISMATCH for all pairs and all harmonics above the highest one. omega: rad/s.

    Judged at real rates, at which the structure has no resonances.
    """
    penalty = build_penalty(model, omega, highest)
    _, component_index = relative_indices(model.contact)
    pair, tangent = component_index // 3, component_index % 3 > 0
    held = np.where(tangent, penalty.tangential[pair], penalty.normal[pair])
    marched = tangent & penalty.inertial[pair]
    for rate in (highest + 1) * omega * RATES:
        acts = np.where(marched, penalty.mass[pair] * rate**2, held)
        if np.abs(1.0 - acts * compliance_at(model, rate)).max(initial=0.0) > MISMATCH:
            return False
    return True


def reach(model: ReducedModel, omega: float, highest: int) -> int:
    """Lowest highest harmonic on the ladder, at least the given one, that reaches so far; the last where none does."""
    for step in (highest, *(step for step in LADDER if step > highest)):
        if reaches(model, omega, step):
            return step
    return LADDER[-1]
