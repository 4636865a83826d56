"""Friction of masses directly on rigid ground, which move by Newton's law; the kernels are in `sliding_masses`."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.contact.elastic import CoulombPairs
from solver.contact.elastic_pairs import Period, by_columns, new_period
from solver.contact.element import Marched, SampledLaw, Tangents
from solver.contact.sliding_masses import Masses, march_masses, mass_slopes, mass_tangent, step_gains
from solver.model import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class SlidingMasses(CoulombPairs):
    """Pairs with a mass. The state is the displacement since the start of the period, m, the history the mean position,
    which the friction alone does not determine.
    """

    @cached_property
    def masses(self) -> Masses:
        """The masses of the pairs."""
        tangents = self.dofs[:, 1:] >= 0
        line = np.where(tangents.sum(axis=1) == 1, np.argmax(tangents, axis=1), -1)
        return Masses(self.penalty.mass, self.penalty.drag, line, self.sample_step)

    @cached_property
    def compliance(self) -> ComplexArray:
        """As in Element; tangential ones are those of the marched masses."""
        found, penalty, orders = super().compliance, self.penalty, np.array(self.basis.orders, np.float64)
        if orders.size:
            angle = np.pi * orders / self.basis.n_samples
            mass, drag, mean = (part[:, None] for part in (penalty.mass, penalty.drag, penalty.mean))
            impedance = 2j * mass * np.sin(angle) / self.sample_step + drag * np.cos(angle)
            moving = np.sin(angle) / angle / (1j * self.omega * orders * impedance)
            found[:, 1:] = np.concatenate([1.0 / mean, moving], axis=1)[:, None, :]
        return found

    def march(self, predicted_h: FloatArray, history: FloatArray, _: FloatArray | None, /) -> Marched:  # noqa: D102
        basis, pairs = self.basis, np.arange(len(history))
        predicted_t = predicted_h @ basis.synthesis
        predicted_t[:, 1:] = (predicted_h[:, 1:] * basis.step_mean) @ basis.synthesis
        period = new_period(predicted_t, self.friction_coefficient, np.zeros((pairs.size, 2)))
        march_masses(pairs, period, self.masses)
        force_h = period.force_t @ basis.analysis
        force_h[:, 1:] /= basis.step_mean
        return self.left_by(period, force_h, np.zeros(pairs.size, bool))

    def friction_tangent(  # noqa: D102
        self, pairs: IntArray, period: Period, _: FloatArray, by: tuple[FloatArray, FloatArray], out: Tangents, /
    ) -> None:
        (basis_t, analysis_h), step_mean = by, self.basis.step_mean
        slopes, means = mass_slopes(pairs, period, self.masses), by_columns(basis_t * step_mean)
        analysis = analysis_h / step_mean[:, None]
        mass_tangent(pairs, period, slopes, self.sample_step, (by_columns(basis_t), means), analysis, out)

    def sampled(self, at: Marched, pairs: IntArray) -> SampledLaw:
        """As in Element. With the derivatives T of the steps `dlambda = T_p dp + T_v dv' + T_l mu dlambda_N`, and
        `dp = dlambda + gain dv - loss dv'`.
        """
        found, step, friction = super().sampled(at, pairs), self.sample_step, self.friction_coefficient
        slopes_t, _ = mass_slopes(pairs, self.period(at), self.masses)
        for place, pair in enumerate(pairs.tolist()):
            slopes, there = slopes_t[place], np.flatnonzero(self.dofs[pair, 1:] >= 0)
            rows = 1 + there
            by_predicted, by_before = (slopes[:, there[:, None], first + there] for first in (0, 2))
            for part in (found.by_force, found.by_motion, found.by_last_motion):
                part[:, place, rows] = 0.0
            block = (slice(None), place, rows[:, None], rows)
            found.by_force[block] = np.eye(there.size) - by_predicted
            if self.dofs[pair, 0] >= 0:
                presses = at.predicted_t[pair, 0, :, None] > 0.0
                found.by_force[:, place, rows, 0] = np.where(presses, -friction[pair] * slopes[:, there, 4], 0.0)
            gain, loss = step_gains(self.penalty.mass[pair], self.penalty.drag[pair], step)
            found.by_speed[block] = -gain / step * by_predicted
            found.by_last_speed[block] = (by_before - loss * by_predicted) / step
        return found
