"""A state at one resolution (harmonics and samples), the same state at others, and their difference as an error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.accuracy.certificate import SMALL_WORK, certify
from solver.accuracy.harmonic_levels import half_wave_symmetric, lacks_even
from solver.continuation.natural import ratchets, shake_down
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import State, largest_responses, transfer
from solver.model import ComplexArray, FloatArray
from solver.newton.run import Run
from solver.packing import packable
from solver.settings import NEGLIGIBLE, ROUND_OFF, Resolution, all_orders
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint

FAINT_SHARE = 0.1
"""Fraction of rtol: part of the slip work that may be creep, and normal force over the largest one below which a
contact need not be resolved."""

SMALL_PEAK = 0.01
"""Fraction of the largest peak: errors of smaller responses are relative to this fraction."""


def first_response(joint: Joint, at: Evaluation) -> ComplexArray:
    """First harmonic of the responses (n_response,), m, of a state."""
    return to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0]


@packable
@dataclass(frozen=True)
class Estimate:
    """Estimated relative errors of a state.

    response: of the first harmonic of the response.
    wear_rate: of the total wear rate.
    weight: factor on `wear_rate` in `largest`; less than 1 where almost nothing wears.
    """

    response: float
    wear_rate: float
    weight: float = 1.0

    @property
    def largest(self) -> float:
        """The larger error, with the weight of the wear rate."""
        return max(self.response, self.weight * self.wear_rate)

    def __add__(self, other: Estimate) -> Estimate:
        """Sum of the errors of two causes: the worst case."""
        weight = max(self.weight, other.weight)
        return Estimate(self.response + other.response, self.wear_rate + other.wear_rate, weight)

    def times(self, factor: float) -> Estimate:
        """The errors times a safety factor."""
        return Estimate(factor * self.response, factor * self.wear_rate, self.weight)


NOTHING = Estimate(0.0, 0.0)
UNKNOWN = Estimate(np.inf, np.inf)


@dataclass(frozen=True)
class ResolvedState:
    """A state with the case and the joint of its solution."""

    case: Case
    joint: Joint
    point: State

    def solve_at(self, resolution: Resolution, run: Run, *, with_tail: bool = False) -> ResolvedState | None:
        """The state with other harmonics and samples; None where it is not found. with_tail: as in `transfer`."""
        case = self.case.at(resolution)
        joint = case.joint(self.joint.omega, self.joint.excitation_amplitude)
        balance, start = transfer(self.case, joint, self.point.evaluation, with_tail=with_tail)
        point = run.fresh().state(balance, start, self.point.parameter)
        # the mean position of a mass depends a little on the harmonics
        return None if point is None else ResolvedState(case, joint, point).at_rest(run)

    def at_rest(self, run: Run) -> ResolvedState:
        """The state with its sliding masses at rest: their creep is slip and would count as wear."""
        fraction = FAINT_SHARE * self.case.settings.rtol
        if not ratchets(self.joint, self.point.evaluation, fraction):
            return self
        return ResolvedState(self.case, self.joint, shake_down(self.joint, self.point, fraction, run))

    def with_its_symmetry(self, run: Run) -> ResolvedState:
        """The state without even harmonics where its forces have none, and with them where its forces have some."""
        at, resolution = self.point.evaluation, self.case.resolution
        orders = resolution.orders
        if half_wave_symmetric(at, ROUND_OFF):
            orders = tuple(order for order in orders if order % 2)
        elif lacks_even(orders, at):
            orders = all_orders(resolution.highest)
        wanted = Resolution(orders, resolution.samples)
        return self if wanted == resolution else self.solve_at(wanted, run) or self

    def unknowns(self, resolution: Resolution) -> int:
        """Number of unknowns of the balance with other harmonics."""
        return self.joint.component_index.size * (2 * len(resolution.orders) + 1)

    def limit(self, unknowns: float) -> float:
        """A limit of the unknowns with 48 pairs for this joint: of a larger joint it limits the harmonics only."""
        return unknowns * max(1.0, self.joint.component_index.size / 144)

    def holds(self) -> bool:
        """Whether all violations of the certificate are below their limits."""
        return certify(self.joint, self.point.evaluation).holds(self.case.settings.tolerance)

    def response(self) -> ComplexArray:
        """First harmonic of the responses (n_response,), m."""
        return first_response(self.joint, self.point.evaluation)

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest magnitudes of the responses over the period (n_response,), m."""
        return largest_responses(self.joint, self.point.evaluation)

    def difference(self, better: ResolvedState) -> Estimate:
        """Relative differences of response and wear rate to a better state."""
        mine, its = self.response(), better.response()
        least, work = better._least_response(), max(self._least_work(), better._least_work())
        first = float(np.linalg.norm(mine - its)) / max(float(np.linalg.norm(its)), least)
        size = np.maximum(better.peaks, max(SMALL_PEAK * float(better.peaks.max(initial=0.0)), least))
        response = max(first, float((np.abs(self.peaks - better.peaks) / size).max(initial=0.0)))
        mine_slip, its_slip = (float(level.point.evaluation.slip_work.sum()) for level in (self, better))
        if max(its_slip, mine_slip) <= SMALL_WORK * work:
            return Estimate(response, 0.0)
        # the wear rate cannot be more accurate than the motion that causes it
        slip = max(its_slip, SMALL_WORK * work)
        return Estimate(response, max(first, abs(mine_slip - its_slip) / slip), slip / max(slip, work))

    def _least_response(self) -> float:
        """Response, m, below which a relative error has no meaning, as for a mass that friction holds: a small fraction
        of the response that the excitation would cause on the stiffness of the joint alone.
        """
        structure = self.joint.structure
        moved = structure.harmonic_force / self.joint.relative_penalty
        response = np.abs(structure.dynamic_response[0]) @ np.abs(moved) + np.abs(structure.harmonic_offset)
        return max(NEGLIGIBLE * float(np.linalg.norm(response)), 1e-300)

    def _least_work(self) -> float:
        """Slip work, N m, below which its error has less weight: a fraction of the work of the excitation."""
        motion = self.joint.to_relative(self.point.evaluation.displacement_h)
        return SMALL_WORK * abs(self.joint.structure.input_work(motion))
