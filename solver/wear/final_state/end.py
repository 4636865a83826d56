"""Where a march to the end stops: nothing wears any more, or the wear goes on without end.

In a final state no pair slips, or carries a force while it slips. A march comes near to it as fast as its slowest pair
lets it: it stops where the wear rate of every pair is below a share of the largest that this pair has had. A joint that
slips everywhere under a load that nothing else bears has no such state: it wears at a steady rate.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from solver.packing import attributes, set_attributes
from solver.wear.options import WEAR
from solver.wear.trajectory import Trajectory


class EndState(TypedDict):
    """What goes on from step to step: attributes of `EndWatch`."""

    course: list[tuple[float, float]]


@dataclass
class EndWatch:
    """Watches a march. share: `settings.ToTheEnd.final_share`; None where the march has a last count.

    course: worn volume, m3, and wear rate, m3 per cycle, of the steps that wore the last nine tenths, and one before.
    """

    trajectory: Trajectory
    share: float | None
    course: list[tuple[float, float]] = field(init=False, default_factory=list)

    def note(self) -> None:
        """Take the state after a step."""
        if self.share is None:
            return
        volume = float(self.trajectory.point.evaluation.wear_depth @ self.trajectory.joint.contact.area)
        self.course.append((volume, float(self.trajectory.rates.value[-1])))
        first = next(place for place, (worn, _) in enumerate(self.course) if worn > 0.1 * volume or worn == volume)
        self.course = self.course[max(first - 1, 0) :]

    def ended(self) -> bool:
        """Whether the joint has come to a state in which nothing wears."""
        if self.share is None:
            return False
        rates, largest = self.trajectory.rates.value[:-1], self.trajectory.rates.largest[:-1]
        floor = self.share * float(largest.max(initial=0.0))
        return bool((rates <= self.share * np.maximum(largest, floor)).all())

    def goes_on(self, n_steps: int) -> str:
        """Why there will be no such state, after so many steps; empty where there may be one."""
        if self.share is None:
            return ""
        rate, cycle = float(self.trajectory.rates.value[-1]), self.trajectory.cycle
        if self._is_steady():
            return f"all pairs slip, and from cycle {cycle:.4g} on they wear at a steady rate of {rate:.6g} m3 a cycle"
        if n_steps >= WEAR.steps_to_the_end or cycle > WEAR.longest_march:
            return f"after {n_steps} steps, at cycle {cycle:.4g}, the joint still wears at {rate:.6g} m3 a cycle"
        return ""

    def _is_steady(self) -> bool:
        """Whether the joint slips at every pair that bears it and its wear rate is steady, though what it has worn is
        so much that it has acted back.
        """
        joint, at = self.trajectory.joint, self.trajectory.point.evaluation
        normal = at.force_h[:, 0, 0]
        pressed = normal > WEAR.bears * float(normal.max(initial=0.0))
        if not pressed.any() or not (at.slip_work[pressed] > 0.0).all():
            return False
        if len(self.course) < 2 or self.course[0][0] > 0.1 * self.course[-1][0]:
            return False
        now = self.course[-1][1]
        if any(abs(rate - now) > WEAR.steady_rate * now for _, rate in self.course):
            return False
        rows = np.flatnonzero(joint.component_index % 3 == 0)
        rows = rows[pressed[joint.component_index[rows] // 3]]
        pair = joint.component_index[rows] // 3
        moved = joint.structure.static_stiffness[rows, rows] * at.wear_depth[pair]
        return bool((moved >= WEAR.acted_back * normal[pair]).all())

    def state_dict(self) -> EndState:
        """What goes on from step to step, to be packed."""
        return attributes(self, EndState)

    def load_state(self, state: EndState) -> None:
        """Go on from the state of another one."""
        set_attributes(self, state)
