"""Iwan's element: springs with sliders in parallel, of which more and more slip (J. Appl. Mech. 33 (1966) 893).

In each tangential direction, slider j at s_j carries `k/n (u - s_j)` up to its limit F_j, beyond which it follows. The
limits `F_j = (2j - 1) F / n^2` are spread evenly, and do not depend on the normal force. From rest a joint of many
sliders has `k u - (k u)^2 / (4 F)` up to `u = 2 F / k`, where all slip. None of them wears.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from solver.contact.elastic_pairs import MOST_PERIODS
from solver.contact.element import Element, Marched, SampledLaw, Tangents, numbers_of_pairs
from solver.model import FloatArray, IntArray
from solver.outcome import check
from solver.packing import packable
from solver.settings import ROUND_OFF

SLIDERS = 20
"""In a direction. A cycle loses 0.1 % more than with very many of them where all slip, 1.4 % where six do."""
SLOW_PERIODS = 8
"""Periods from one state to the next. At 1.2 times the frequency of a resonance the response is known to 2 % without
them, to 0.3 % with 8, and to 0.15 % with 16, which take twice as long."""
_SOLVED = 1e-14  # residual of a sample over its forces


@packable
@dataclass(frozen=True, eq=False)
class IwanJoints:
    """A `PairLaw`: Iwan's element in both tangential directions of some pairs, a spring in the closing one.

    pairs: ascending indices. stiffness, limit, normal_stiffness (k,) or one number: k, N/m, F, N, of the spring, N/m.
    Raises ValueError where a number is out of its range, or shapes do not fit.
    """

    pairs: tuple[int, ...]
    stiffness: FloatArray
    limit: FloatArray
    normal_stiffness: FloatArray

    def __post_init__(self) -> None:
        for name in ("stiffness", "limit", "normal_stiffness"):
            given = numbers_of_pairs(self, name, ())
            check(name, bool((given > 0.0).all()) or name == "normal_stiffness", "give numbers above 0")

    @property
    def rest_stiffness(self) -> FloatArray:
        """As in `PairLaw`."""
        return np.stack([self.normal_stiffness, self.stiffness, self.stiffness], axis=1)

    def element(self, places: IntArray, *of_pairs: Any) -> "IwanPairs":
        """As in `PairLaw`."""
        return IwanPairs(places, *of_pairs, joints=self)


@njit(cache=True)
def march_sliders(
    before_t: FloatArray, force_t: FloatArray, series_t: FloatArray, ratio: Any, limits: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Periods under a predicted force (N,), N, in which `x + sum of forces = p` with x = eps u, until they repeat.

    before_t (N,): N, from which it has come. series_t (N, m): synthesis; m = 0 for no derivatives. ratio: k / (n eps).
    limits (n,), N. at (n,): eps s_j, N, which moves. Returns of the last period x (N,), N, its derivative (N, m), where
    sliders stick (N, n), eps times the dissipated work, N * N; and by how far a slider does not come back, N.
    """
    (n_samples, m), n, x, work, change = series_t.shape, limits.size, 0.0, 0.0, 0.0
    slow = SLOW_PERIODS if np.any(before_t != force_t) else 0
    # the derivative repeats once all sliders that slip have slipped: a period after their places do
    fewest = slow + 1 if m else slow
    x_t, by_t, sticks_t, by = np.zeros(n_samples), np.zeros((n_samples, m)), np.zeros((n_samples, n)), np.zeros((n, m))
    for period in range(slow + MOST_PERIODS):
        part, begun, work = min((period + 1.0) / (slow + 1.0), 1.0), at.copy(), 0.0
        for sample in range(n_samples):
            predicted = (1.0 - part) * before_t[sample] + part * force_t[sample]
            low, high, slope, sticks, by_x = -np.inf, np.inf, 1.0, sticks_t[sample], by_t[sample]
            for _ in range(100):  # Newton's method, which takes two or three, or half of the interval
                missing, slope = predicted - x, 1.0
                for j in range(n):
                    trial = ratio * (x - at[j])
                    sticks[j] = abs(trial) < limits[j]
                    missing -= trial if sticks[j] else np.sign(trial) * limits[j]
                    slope += ratio * sticks[j]
                if abs(missing) <= _SOLVED * (abs(predicted) + n * limits[-1]):
                    break
                low, high = (x, high) if missing > 0.0 else (low, x)
                x += missing / slope
                x = x if low < x < high else 0.5 * (low + high)
            x_t[sample] = x
            for k in range(m):
                by_x[k] = part / slope * series_t[sample, k]
            for j in range(n):
                if sticks[j]:
                    for k in range(m):
                        by_x[k] += ratio / slope * by[j, k]
            for j in range(n):
                if not sticks[j]:
                    place = x - np.sign(x - at[j]) * limits[j] / ratio
                    work += limits[j] * abs(place - at[j])
                    at[j] = place
                    for k in range(m):
                        by[j, k] = by_x[k]
        change = np.abs(at - begun).max()
        if period >= fewest and change <= 0.1 * ROUND_OFF * limits[-1]:
            break
    return x_t, by_t, sticks_t, work, change


@dataclass(frozen=True, kw_only=True)
class IwanPairs(Element):
    """Pairs with Iwan's element. The history has the positions of the sliders, n in each direction."""

    joints: IwanJoints

    @property
    def n_history(self) -> int:  # noqa: D102
        return 2 * SLIDERS

    @property
    def _share(self) -> FloatArray:
        """Of the predicted normal force that the spring carries (k, 1, 1); all of it where nothing moves."""
        share = self.joints.normal_stiffness / (self.joints.normal_stiffness + self.penalty.normal)
        return np.where(self.dofs[:, 0] >= 0, share, 1.0)[:, None, None]

    def _marched(
        self, predicted_t: FloatArray, sliders: FloatArray, before_t: FloatArray | None = None, m: int = 0
    ) -> tuple[FloatArray, ...]:
        """As `march_sliders`, each (k, 2, ...), and the sliders (k, 2n), m, at the end."""
        n, eps = SLIDERS, self.penalty.tangential
        limits, ratio = np.outer(self.joints.limit / n**2, 2.0 * np.arange(n) + 1.0), self.joints.stiffness / (n * eps)
        at, series_t = (sliders * eps[:, None]).reshape(-1, 2, n), self.basis.synthesis.T[:, :m].copy()
        before_t = predicted_t if before_t is None else before_t
        found = [
            march_sliders(
                before_t[pair, 1 + i], predicted_t[pair, 1 + i], series_t, ratio[pair], limits[pair], at[pair, i]
            )
            for pair, i in np.ndindex(len(eps), 2)
        ]
        parts = (np.array(each).reshape(len(eps), 2, *np.shape(each[0])) for each in zip(*found, strict=True))
        return *parts, at.reshape(sliders.shape) / eps[:, None]

    def _again(self, at: Marched) -> tuple[FloatArray, ...]:
        return self._marched(at.predicted_t, self.final_history(at, at.force_h))

    def march(self, predicted_h: FloatArray, history: FloatArray, before_t: FloatArray | None, /) -> Marched:  # noqa: D102
        predicted_t = predicted_h @ self.basis.synthesis
        x_t, _, _, _, change, inner = self._marched(predicted_t, history, before_t)
        force_t = np.concatenate([self._share * predicted_t[:, :1], predicted_t[:, 1:] - x_t], axis=1)
        return self.marched(predicted_t, force_t, inner=inner, periodicity_error=float(change.max()))

    def switching_tangent(
        self, at: Marched, history: FloatArray | None, before_t: FloatArray | None, out: Tangents, /
    ) -> None:
        """As in Element, along all periods: on the way sliders come to where they stick."""
        m, synthesis = at.force_h.shape[2], self.basis.synthesis
        begin = self.final_history(at, at.force_h) if history is None else history
        by_t = self._marched(at.predicted_t, begin, before_t, m)[1]
        parts = self._share * np.eye(m), *np.moveaxis(self.basis.analysis.T @ (synthesis.T - by_t), 1, 0)
        for i, part in enumerate(parts):
            out[0][:, i * m : (i + 1) * m, i * m : (i + 1) * m] = part

    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:
        """As in Element, but by a change of sliders at the sample before nothing."""
        sticking = self._again(at)[2][:, :, ::stride].sum(axis=3)
        slope = 1.0 / (1.0 + (self.joints.stiffness / (SLIDERS * self.penalty.tangential))[:, None, None] * sticking)
        own = np.concatenate([np.broadcast_to(1.0 - self._share, (len(slope), 1, slope.shape[2])), slope], axis=1)
        own = np.ascontiguousarray(own.transpose(2, 0, 1))
        return own[..., None] * np.eye(3), np.zeros((*own.shape[:2], 2, 2))

    def sampled(self, at: Marched, pairs: IntArray) -> SampledLaw:
        """As in Element: the force falls by `k/n ds'` of sliders that stick, the others follow, `ds = du`."""
        found, stiffness = super().sampled(at, pairs), self.joints.stiffness[pairs, None, None] / SLIDERS
        sticks = self._again(at)[2][pairs].transpose(2, 0, 1, 3).reshape(-1, pairs.size, 2 * SLIDERS, 1)
        along = np.repeat(np.eye(3)[1:], SLIDERS, axis=0)
        by_inner = -found.by_force @ (stiffness * sticks * along).swapaxes(2, 3)
        # where a slider sticks all the time, its place is given
        kept = (sticks * ~sticks.all(axis=0))[..., 0]
        return replace(found, by_inner=by_inner, inner_by_motion=(1.0 - sticks) * along, kept=kept)

    def friction_work(self, at: Marched) -> FloatArray:  # noqa: D102
        return np.asarray(self._again(at)[3].sum(axis=1) / self.penalty.tangential)

    def final_history(self, at: Marched, _: FloatArray, /) -> FloatArray:  # noqa: D102
        return at.inner[:, : self.n_history]

    def started_from(self, at: Marched, _: FloatArray, /) -> FloatArray:  # noqa: D102
        return self.final_history(at, at.force_h)
