"""Error-controlled steps on the slow time scale: backward differences of second order with steps of any length (BDF2).

With w = h_n / h_(n-1), the ratio of two steps, and the wear rate g = dW/dt of Eqs. (7), (21)

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

which is an implicit Euler step from a depth that is already worn and with a shorter h, so that a step costs one balance
like any other, Eq. (24). It is L-stable for equal steps and zero-stable as long as w < 1 + sqrt(2); both factors are
positive, so that wear never falls. The local error follows from the difference to an explicit formula of the same order
(Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5; Gresho, Lee, Sani 1980):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

The first step, and the first one behind a jump, is an implicit Euler step, whose error is that against the trapezoidal
rule.

The steps know neither the last cycle count nor the wear coefficient but through `k_w h`: they go beyond the end, which
is interpolated, and runs that differ in k_w alone are the same trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from solver.accuracy.error_estimate import euler_error
from solver.contact.archard import wear_gain, wear_rate
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Balance, worn_by
from solver.model import FloatArray
from solver.newton.solve_balance import solve_balance
from solver.packing import attributes, set_attributes
from solver.wear.options import WEAR
from solver.wear.trajectory import Trajectory

ZERO_STABLE = 1.0 + np.sqrt(2.0)
"""Ratio of two steps up to which errors do not grow from step to step, in theory."""


class AdaptiveState(TypedDict):
    """What goes on from step to step: attributes of `AdaptiveSteps`."""

    error: float
    length: float
    shortest: float
    before: tuple[float, FloatArray] | None


@dataclass
class AdaptiveSteps:
    """Steps of a trajectory with a relative error of the worn volume near `rtol`.

    error: estimated error of the last step, as worn volume, m3. length: of the next step, cycles. shortest: the same at
    least. before: length of the last step, cycles, and depth (n_contact,) at its start, m; None where there is none.
    """

    trajectory: Trajectory
    rtol: float
    error: float = field(init=False, default=0.0)
    length: float = field(init=False)
    shortest: float = field(init=False, repr=False)
    before: tuple[float, FloatArray] | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        trajectory = self.trajectory
        fastest = float(trajectory.rate().max(initial=0.0))
        self.length = 1.0
        if fastest > 0.0:
            moved = float(np.abs(trajectory.point.evaluation.displacement_h[:, :, 1:]).max())
            # the limit is far off where next to nothing slips
            self.length = min(WEAR.first_step * trajectory.step_limit, WEAR.first_depth * moved / fastest)
        self.shortest = WEAR.shortest_slow_step * self.length

    def advance(self) -> tuple[bool, float]:
        """One step that is accurate enough. Whether the branch goes on, and the length of the step that was tried.

        Steps are not cut below half the resolution of jumps: where the vibration changes over one of that length, or
        none is found, an Euler step finds out whether the branch ends there.
        """
        trajectory = self.trajectory
        while True:
            length, shortest = self.length, max(0.5 * WEAR.fold_resolution * trajectory.cycle, self.shortest)
            tried = self._attempt(length)
            shorter = WEAR.smallest_step_ratio
            if tried is not None:
                ratio, point, error = tried
                wanted = WEAR.step_safety / np.sqrt(max(ratio, 1e-12))
                # down there the wear rate has a corner, or the branch ends, which shows in the vibration
                calm = vibration_change(trajectory.point.evaluation, point.evaluation) < CONTINUATION.smooth_change
                if ratio <= 1.0 or (length <= shortest and calm):
                    self._accept(point, length)
                    self.error = error
                    self.length = length * float(np.clip(wanted, WEAR.refused_step_ratio, WEAR.largest_step_ratio))
                    return True, length
                shorter = float(np.clip(wanted, WEAR.smallest_step_ratio, WEAR.refused_step_ratio))
            if length <= shortest:
                rate, depth = trajectory.rate(), trajectory.point.evaluation.wear_depth
                arrived = trajectory.advance(trajectory.cycle + length)
                self.error = euler_error(
                    length, float(np.abs(trajectory.rate() - rate) @ trajectory.joint.contact.area)
                )
                self.before, self.length = (length, depth), length
                return arrived, length
            self.length = max(shorter * length, 0.999 * shortest)

    def follow(self, length: float) -> bool:
        """One step of a given length, however wrong it is; False where none is found."""
        if self.before is not None and length > ZERO_STABLE * self.before[0]:
            self.before = None
        tried = self._attempt(length)
        if tried is None:
            return False
        self._accept(tried[1], length)
        return True

    def state_dict(self) -> AdaptiveState:
        """What goes on from step to step, to be packed."""
        return attributes(self, AdaptiveState)

    def load_state(self, state: AdaptiveState) -> None:
        """Go on from the state of another one."""
        set_attributes(self, state)

    def restart(self) -> None:
        """What came before tells nothing of what follows: behind a jump."""
        self.before = None

    def _attempt(self, length: float) -> tuple[float, PathPoint, float] | None:
        """Error of a step over what is allowed, its end, and its error as worn volume; None where it is not found."""
        trajectory = self.trajectory
        depth, rate, area = trajectory.point.evaluation.wear_depth, trajectory.rate(), trajectory.joint.contact.area
        base, factor, grown = depth, 1.0, np.zeros_like(depth)
        if self.before is not None:
            ratio = length / self.before[0]
            grown = depth - self.before[1]
            base = depth + ratio**2 / (1.0 + 2.0 * ratio) * grown
            factor = (1.0 + ratio) / (1.0 + 2.0 * ratio)
        gain = wear_gain(trajectory.wear_coefficient, area, factor * length)
        balance = Balance(trajectory.joint, trajectory.point.history, base, gain, trajectory.wearing)
        start = trajectory.predicted(balance, length)
        result = solve_balance(
            balance,
            start,
            trajectory.solver,
            trajectory.case.settings.tolerance,
            trajectory.effort,
            WEAR.step_iterations,
        )
        if not result.converged:
            return None
        new = result.evaluation
        new_rate = wear_rate(trajectory.wear_coefficient, area, trajectory.wearing.work(*worn_by(new)))
        if self.before is None:
            error = euler_error(length, new_rate - rate)
        else:
            explicit = depth + (1.0 + ratio) * length * rate - ratio**2 * grown
            own, other = (1.0 + ratio) ** 2 / (6.0 * ratio * (1.0 + 2.0 * ratio)), (1.0 + 1.0 / ratio) / 6.0
            error = own / (own + other) * (new.wear_depth - explicit)
        worn, before = float(new.wear_depth @ area), float(depth @ area)
        allowed = WEAR.step_error_fraction * self.rtol * max(worn - before, worn * length / (trajectory.cycle + length))
        size = float(np.abs(error) @ area)
        point = PathPoint(0.0, new, final_history(balance, new))
        return (size / allowed if allowed > 0.0 else 0.0), point, size

    def _accept(self, point: PathPoint, length: float) -> None:
        depth = self.trajectory.point.evaluation.wear_depth
        self.before = (length, depth)
        self.trajectory.accept(point, length)
