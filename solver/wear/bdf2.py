"""Error-controlled steps on the slow time scale: backward differences of second order with steps of any length (BDF2).

With w = h_n / h_(n-1), the ratio of two steps, and the wear rate g = dW/dt of Eqs. (7), (21)

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

which is an implicit Euler step from a depth that is already worn and with a shorter h, so that a step costs one balance
like any other, Eq. (24). It is L-stable for equal steps and zero-stable as long as w < 1 + sqrt(2); both shares are
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
from typing import Any

import numpy as np

from solver.contact.archard import wear_gain, wear_rate
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.solve_balance import solve_balance
from solver.wear.trajectory import RESOLUTION, Trajectory

SHARE = 0.2  # of rtol, for the step; an error is judged by what it has worn, or would have worn at the mean rate so far
LONGEST_RATIO = 2.0  # of two steps
SHORTEST_RATIO = 0.2
SAFETY = 0.85
CAREFUL = 0.8  # a step that was refused is cut by at least so much
FIRST = 0.05  # of the explicit step limit: the first step, before anything is known of the error
FIRST_DEPTH = 0.01  # of the largest relative motion: what it wears at most
ITERATIONS = 10  # of a step: one that takes more is halved
SHORTEST = 1e-4  # of the first step
ZERO_STABLE = 2.4  # ratio of two steps below 1 + sqrt(2)

_CARRIED = ("error", "_length", "_shortest", "_before")


@dataclass
class AdaptiveSteps:
    """Steps of a trajectory with a relative error of the worn volume near `rtol`.

    error: estimated error of the last step, as worn volume, m3.
    """

    trajectory: Trajectory
    rtol: float
    error: float = field(init=False, default=0.0)
    _length: float = field(init=False)
    _shortest: float = field(init=False, repr=False)
    _before: tuple[float, FloatArray] | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        way = self.trajectory
        fastest = float(way.rate().max(initial=0.0))
        self._length = 1.0
        if fastest > 0.0:
            moved = float(np.abs(way.point.evaluation.displacement_h[:, :, 1:]).max())
            # the limit is far off where next to nothing slips
            self._length = min(FIRST * way.step_limit, FIRST_DEPTH * moved / fastest)
        self._shortest = SHORTEST * self._length

    def advance(self) -> tuple[bool, float]:
        """One step that is accurate enough. Whether the branch goes on, and the length of the step that was tried.

        Steps are not cut below half the resolution of jumps: where the vibration changes over one of that length, or
        none is found, an Euler step finds out whether the branch ends there.
        """
        way = self.trajectory
        while True:
            length, shortest = self._length, max(0.5 * RESOLUTION * way.cycle, self._shortest)
            tried = self._attempt(length)
            shorter = 0.25
            if tried is not None:
                ratio, point, error = tried
                # down there the wear rate has a corner, or the branch ends, which shows in the vibration
                calm = vibration_change(way.point.evaluation, point.evaluation) < CONTINUATION.smooth_change
                if ratio <= 1.0 or (length <= shortest and calm):
                    self._accept(point, length)
                    self.error = error
                    self._length = length * float(np.clip(SAFETY / np.sqrt(max(ratio, 1e-12)), CAREFUL, LONGEST_RATIO))
                    return True, length
                shorter = float(np.clip(SAFETY / np.sqrt(max(ratio, 1e-12)), SHORTEST_RATIO, CAREFUL))
            if length <= shortest:
                rate, depth = way.rate(), way.point.evaluation.wear_depth
                arrived = way.advance(way.cycle + length)
                self.error = 0.5 * length * float(np.abs(way.rate() - rate) @ way.joint.contact.area)
                self._before, self._length = (length, depth), length
                return arrived, length
            self._length = max(shorter * length, 0.999 * shortest)

    def follow(self, length: float) -> bool:
        """One step of a given length, however wrong it is; False where none is found."""
        if self._before is not None and length > ZERO_STABLE * self._before[0]:
            self._before = None
        tried = self._attempt(length)
        if tried is None:
            return False
        self._accept(tried[1], length)
        return True

    def carried(self) -> dict[str, Any]:
        """What goes on from step to step, to be packed."""
        return {name: getattr(self, name) for name in _CARRIED}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has carried so far."""
        for name in _CARRIED:
            setattr(self, name, carried[name])

    def restart(self) -> None:
        """What came before tells nothing of what follows: behind a jump."""
        self._before = None

    def _attempt(self, length: float) -> tuple[float, PathPoint, float] | None:
        """Error of a step over what is allowed, its end, and its error as worn volume; None where it is not found."""
        way = self.trajectory
        depth, rate, area = way.point.evaluation.wear_depth, way.rate(), way.joint.contact.area
        base, share, grown = depth, 1.0, np.zeros_like(depth)
        if self._before is not None:
            ratio = length / self._before[0]
            grown = depth - self._before[1]
            base = depth + ratio**2 / (1.0 + 2.0 * ratio) * grown
            share = (1.0 + ratio) / (1.0 + 2.0 * ratio)
        gain = wear_gain(way.wear_coefficient, area, share * length)
        balance = Balance(way.joint, way.point.history, base, gain)
        start = way.predicted(balance, length)
        result = solve_balance(balance, start, way.solver, way.case.settings.tolerance, way.effort, ITERATIONS)
        if not result.converged:
            return None
        new = result.evaluation
        new_rate = wear_rate(way.wear_coefficient, area, new.slip_work)
        if self._before is None:
            error = 0.5 * length * (new_rate - rate)
        else:
            explicit = depth + (1.0 + ratio) * length * rate - ratio**2 * grown
            own, other = (1.0 + ratio) ** 2 / (6.0 * ratio * (1.0 + 2.0 * ratio)), (1.0 + 1.0 / ratio) / 6.0
            error = own / (own + other) * (new.wear_depth - explicit)
        worn, before = float(new.wear_depth @ area), float(depth @ area)
        allowed = SHARE * self.rtol * max(worn - before, worn * length / (way.cycle + length))
        size = float(np.abs(error) @ area)
        point = PathPoint(0.0, new, final_history(balance, new))
        return (size / allowed if allowed > 0.0 else 0.0), point, size

    def _accept(self, point: PathPoint, length: float) -> None:
        depth = self.trajectory.point.evaluation.wear_depth
        self._before = (length, depth)
        self.trajectory.accept(point, length)
