"""Ends of a wear history: a last count, a target, a steady state, or wear without end.

In a steady state every pair that slips carries no force. The slowest pair determines how fast a history approaches this
state. So the history ends where the wear rate of every pair is below a fraction of the largest rate of this pair. A
joint that slips everywhere under a load that nothing else carries has no steady state: its wear rate is constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.outcome import Outcome
from solver.settings import ROUND_OFF
from solver.wear.options import WEAR
from solver.wear.output import DenseOutput
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint

AS_ASKED = Failure(Outcome.CONVERGED)
"""The regular end of a history."""


@dataclass(frozen=True)
class AtCount:
    """End at a cycle count, or before at the target or without wear."""

    end: float

    def __call__(self, work: WearingJoint, state: WearState, output: DenseOutput) -> Failure | None:
        """AS_ASKED at the end, else None."""
        if state.cycle >= self.end * (1.0 - 1e-12) or output.reached_target or not work.wears(state):
            return AS_ASKED
        return None


@dataclass(frozen=True)
class InSteadyState:
    """End where nothing wears any more, or where wear goes on without end.

    share: `settings.ToTheEnd.final_share`.
    """

    share: float

    def __call__(self, work: WearingJoint, state: WearState, output: DenseOutput) -> Failure | None:
        """AS_ASKED in a steady state or at the target, NO_FINAL_STATE where there is none, else None."""
        if output.reached_target or self._is_over(state) or not work.wears(state):
            return AS_ASKED
        rate, n_steps = float(state.rates[-1]), len(output.taken.course.ends) - 1
        if self._is_steady(work, state, output):
            steady = f"from cycle {state.cycle:.4g} on they wear at a steady rate of {rate:.6g} m3 a cycle"
            return Failure(Outcome.NO_FINAL_STATE, f"all pairs slip, and {steady}")
        if n_steps >= WEAR.steps_to_the_end or state.cycle > WEAR.longest_march:
            still = f"the joint still wears at {rate:.6g} m3 a cycle"
            return Failure(Outcome.NO_FINAL_STATE, f"after {n_steps} steps, at cycle {state.cycle:.4g}, {still}")
        return None

    def _is_over(self, state: WearState) -> bool:
        """Whether the rate of every pair is below the fraction `share` of its largest rate."""
        rates, largest = state.rates[:-1], state.largest_rates[:-1]
        floor = self.share * float(largest.max(initial=0.0))
        return bool((rates <= self.share * np.maximum(largest, floor)).all())

    def _is_steady(self, work: WearingJoint, state: WearState, output: DenseOutput) -> bool:
        """Whether wear goes on without end.

        Every pair that carries load slips, and the wear rate is constant although the wear is deep enough to act back.
        """
        joint, at = work.at(state), state.point.evaluation
        normal = at.force_h[:, 0, 0]
        pressed = normal > ROUND_OFF * float(normal.max(initial=0.0))
        if not pressed.any() or not (at.slip_work[pressed] > 0.0).all():
            return False
        course = output.taken.course
        volumes, rates = np.array(course.depths) @ work.area, np.array(course.rates)
        # over the last nine tenths of the worn volume, to the accuracy of a rate
        first = max(int(np.searchsorted(volumes, 0.1 * volumes[-1], "right")) - 1, 0)
        if (
            volumes[first] > 0.1 * volumes[-1]
            or (np.abs(rates[first:] - rates[-1]) > work.case.settings.rtol * rates[-1]).any()
        ):
            return False
        rows = np.flatnonzero(joint.component_index % 3 == 0)
        rows = rows[pressed[joint.component_index[rows] // 3]]
        pair = joint.component_index[rows] // 3
        moved = joint.structure.static_stiffness[rows, rows] * at.wear_depth[pair]
        return bool((moved >= WEAR.acted_back * normal[pair]).all())
