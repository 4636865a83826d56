"""Coulomb friction with separation at displacement level, Eqs. (9)-(15): the law of the paper, of pairs on an elastic
joint. The kernels are in `elastic_pairs`, the way from one state to the next in `slow_slide`.
"""

from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, SLIP, STICK, friction_limit, mean_normal_force, mean_normal_tangent
from solver.contact.elastic_pairs import MOST_PERIODS, Period, by_columns, march_period, march_tangent, new_period
from solver.contact.element import Element, Marched, Tangents
from solver.contact.slow_slide import Path, slide_along, slide_tangent
from solver.model import BoolArray, FloatArray, IntArray
from solver.settings import ROUND_OFF


@dataclass(frozen=True)
class CoulombPairs(Element):
    """Pairs that rub and open. The history is the corrected slip X_T."""

    def march(self, predicted_h: FloatArray, history: FloatArray, before_t: FloatArray | None, /) -> Marched:  # noqa: D102
        predicted_t = predicted_h @ self.basis.synthesis
        pairs, begin = np.arange(len(history)), history * self.penalty.tangential[:, None]
        start = begin.copy()
        if before_t is not None:
            slide_along(pairs, Path(before_t, predicted_t, self.friction_coefficient, begin), start)
        period = new_period(predicted_t, self.friction_coefficient, start)
        limit = friction_limit(self.friction_coefficient, np.maximum(predicted_t[:, 0].max(axis=1), 0.0))
        # a hundredth of the usual tolerance of the residual, 1e-8, so that the residual does not show the change
        periodicity = 0.1 * ROUND_OFF * float(limit.max(initial=0.0))
        march_period(pairs, period, periodicity, MOST_PERIODS)
        return self.left_by(period, period.force_t @ self.basis.analysis, (start != begin).any(axis=1))

    def left_by(self, period: Period, force_h: FloatArray, slid: BoolArray) -> Marched:
        """What a march has left. force_h (k, 3, m): harmonics of the contact force, N, the normal one in place."""
        force_h[:, 0] = mean_normal_force(period.predicted_t) @ self.basis.analysis
        own = period._asdict() | {"slip_work": period.slip_work / self.state_stiffness}
        own["inner"] = np.zeros((slid.size, 0))
        del own["friction"], own["change"]
        return Marched(**own, force_h=force_h, slid=slid, periodicity_error=float(period.change.max(initial=0.0)))

    def period(self, at: Marched) -> Period:
        """The period that a march has left, for derivatives."""
        marched = at.predicted_t, self.friction_coefficient, at.start, at.force_t, at.state_t, at.status_t
        return Period(*marched, at.periods, at.slip_work, at.slip_work)

    def switching_tangent(  # noqa: D102
        self, at: Marched, history: FloatArray | None, before_t: FloatArray | None, out: Tangents, /
    ) -> None:
        # an open pair transmits nothing
        switching = ~(at.stuck | (at.status_t == SEPARATED).all(axis=1))
        basis_t, analysis_h = (part.T.copy() for part in (self.basis.synthesis, self.basis.analysis))
        starts = np.zeros((switching.size, 2, 3 * len(analysis_h) + 1))
        if before_t is not None and history is not None:
            start = history * self.penalty.tangential[:, None]
            path = Path(before_t, at.predicted_t, self.friction_coefficient, start)
            slide_tangent(np.flatnonzero(at.slid), path, self.basis.synthesis, starts)
        slides = np.flatnonzero(switching & (self.dofs[:, 1:] >= 0).any(axis=1))
        self.friction_tangent(slides, self.period(at), starts, (basis_t, analysis_h), out)
        closing = np.flatnonzero((self.dofs[:, 0] >= 0) & switching)
        mean_normal_tangent(closing, at.predicted_t, basis_t, analysis_h, out[0])
        out[1][:] /= self.state_stiffness[:, None]
        out[2][:, -1] /= self.state_stiffness

    def started_from(self, at: Marched, history: FloatArray, /) -> FloatArray:  # noqa: D102
        return np.where(at.slid[:, None], at.start / self.state_stiffness[:, None], history)

    def relieved(self, history: FloatArray, force: FloatArray, /) -> FloatArray:  # noqa: D102
        return history + force / self.penalty.tangential[:, None]

    def friction_tangent(
        self, pairs: IntArray, period: Period, starts: FloatArray, by: tuple[FloatArray, FloatArray], out: Tangents, /
    ) -> None:
        """Derivatives of friction and slip work of some pairs (n,), as `march_tangent`. by: synthesis, analysis."""
        march_tangent(pairs, period, starts, by_columns(by[0]), by[1], out)

    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:  # noqa: D102
        predicted, status = at.predicted_t[:, :, ::stride], at.status_t[:, ::stride]
        limit = friction_limit(self.friction_coefficient[:, None], np.maximum(predicted[:, 0], 0.0))
        trial = predicted[:, 1:] - at.state_t[:, :, :-1:stride]
        size = np.hypot(trial[:, 0], trial[:, 1])
        slips = (status == SLIP) & (limit > 0.0) & (size > 0.0)
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=slips)
        unit, ratio = trial * inverse[:, None], np.where(slips, limit * inverse, status == STICK)
        carried = (np.eye(2)[:, :, None] - unit[:, :, None] * unit[:, None]) * ratio[:, None, None]
        own = np.zeros((len(status), 3, 3, status.shape[1]))
        own[:, 0, 0] = status == SEPARATED
        own[:, 1:, 1:] = np.eye(2)[:, :, None] - carried
        own[:, 1:, 0] = -(self.friction_coefficient * (self.dofs[:, 0] >= 0))[:, None, None] * unit
        by_sample = 3, 0, 1, 2
        return np.ascontiguousarray(own.transpose(by_sample)), np.ascontiguousarray(carried.transpose(by_sample))
