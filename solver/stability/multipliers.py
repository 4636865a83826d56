"""Floquet multipliers of a periodic state, and the kind of its stability: what a point of a whole curve tells.

`floquet` asks whether a machine stays in a state. Here the multipliers themselves are the result, those inside the unit
circle included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import ComplexArray
from solver.newton.linear_solver import EXPENSIVE_UNKNOWNS, SMALL_JOINT
from solver.newton.run import Run
from solver.stability.floquet import exponents, march_samples, moving, multipliers_of, opens_and_closes, sharper
from solver.stability.hill_exponents import hill_multipliers, hill_size
from solver.stability.monodromy import build_monodromy, switching_pairs
from solver.stability.options import STABILITY
from solver.structure.joint import Case, Joint

Stability = Literal["stable", "fold", "period doubling", "Neimark-Sacker", "unknown"]
"""Stability of a state: stable, or by which kind of disturbance unstable: a growing one ("fold", as between two folds),
one that changes sign in each period, or one with a second frequency."""


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a state.

    - values: the multipliers, largest modulus first; of a large joint the largest ones only; none where not computed.
    - error: change of the first value with twice as many time steps; the error is about as large.
    """

    values: ComplexArray
    error: float

    def stability(self, odd: bool) -> Stability:
        """Kind of stability. odd: whether Hill's determinant shows an odd number of real multipliers beyond +1."""
        if odd:
            return "fold"
        if not self.values.size:
            return "unknown"
        largest = complex(self.values[0])
        if abs(largest) - 1.0 <= max(self.error, STABILITY.smallest_growth):
            return "stable"
        if largest.imag != 0.0:
            return "Neimark-Sacker"
        return "fold" if largest.real > 0.0 else "period doubling"


NOT_KNOWN = Multipliers(np.empty(0, np.complex128), np.inf)
"""Of a state whose multipliers are not computed."""


def find_multipliers(case: Case, joint: Joint, at: Evaluation, run: Run) -> Multipliers:
    """Multipliers of a state at a fixed wear depth; for the limits see `floquet.find_instability`.

    A small joint that opens and closes is solved with `STABILITY.opening_harmonics` before, and its multipliers are
    those of Hill's method. Where no such state is found near, they are not known. Of all other joints the number of
    time steps is doubled until the first multiplier has settled, or lies on one side of 1 by more than its error.
    """
    switching, stuck = switching_pairs(at)
    period = 2.0 * np.pi / joint.omega
    if not switching.any():
        linear = joint.model.harmonic_structure(1)
        return Multipliers(_sorted(np.exp(exponents(linear, moving(joint, stuck)) * period)), 0.0)
    travels = joint.model.n_sectors > 0 and joint.model.nodal_diameter > 0
    if travels or 3 * np.count_nonzero(switching) > STABILITY.most_rows:
        return NOT_KNOWN
    linear = joint.model.linear[0]
    small = int(moving(joint, stuck).sum()) <= SMALL_JOINT
    if small:
        finer = sharper(case, joint, at, run)
        if finer is None or _first(finer[1], at) > STABILITY.other_branch:
            return NOT_KNOWN
        joint, at = finer
        if opens_and_closes(at) and hill_size(joint) <= EXPENSIVE_UNKNOWNS and not joint.law.rate_dependent:
            return Multipliers(_sorted(hill_multipliers(joint, at)), 0.0)
    n_samples = march_samples(joint, linear, (stuck, stuck | switching), small) // 2
    found = _sorted(multipliers_of(build_monodromy(joint, linear, at, n_samples), small))
    error = np.inf
    while found.size and error > case.settings.rtol and n_samples < 8 * STABILITY.small_samples:
        if abs(abs(found[0]) - 1.0) > 2.0 * error:
            break
        n_samples, coarse = 2 * n_samples, found
        found = _sorted(multipliers_of(build_monodromy(joint, linear, at, n_samples), small))
        error = abs(found[0] - coarse[0]) if found.size else np.inf
    return Multipliers(found, float(error))


def _first(finer: Evaluation, at: Evaluation) -> float:
    """Relative difference of means and first harmonics of two states: beside folds a solve may change the branch."""
    one, other = (state.displacement_h[..., :3] for state in (finer, at))
    return float(np.linalg.norm(one - other)) / max(float(np.linalg.norm(other)), 1e-300)


def _sorted(values: ComplexArray) -> ComplexArray:
    # of a conjugate pair the one that turns forward comes first
    return values[np.lexsort((-values.imag, -np.abs(values).round(12)))]
