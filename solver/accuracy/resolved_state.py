"""A state at one resolution (harmonics and samples), the same state at others, and their difference as an error; levels
of harmonics, and the events in the period of a state that decide about them.

"One level up" is the next entry of `HARMONIC_LEVELS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.accuracy.certificate import certify
from solver.contact.coulomb import OTHER, SEPARATED, SLIP, STICK
from solver.continuation.natural import ratchets, shake_down
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import State, first_response, largest_responses, state_of, transfer
from solver.model import BoolArray, ComplexArray, FloatArray
from solver.newton.run import Run
from solver.packing import packable
from solver.settings import NEGLIGIBLE, ROUND_OFF, SMALL, Resolution, SolverSettings, all_orders, samples_for
from solver.structure.joint import Case, Joint

HARMONIC_LEVELS = (1, 3, 5, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
"""Highest harmonics between which "auto" chooses; the last two for comparison only. Without 7: for the dovetail at 212
Hz 5 and 7 agree by chance (errors of the worn volume with 5, 7, 9: 1.9, 1.2, 0.1 %)."""

CONTRACTED = 1e-2
"""Residual after two steps towards a longer series up to which the first of them does not count: it may be 15 times too
long where the second is right (dovetail). The friction oscillators of `SCATTERED_SAFETY` often do not come so near; of
one of them the solution with 27 harmonics is as wrong as that with 9."""

CREEP_SHARE = 0.1
"""Share of rtol of the slip work that may be the creep of a mass. Half and twice: sliders, masses and
a wave are equal, an unstable ring within 7e-7."""

SMALL_PEAK = 0.01
"""Fraction of the largest peak: errors of smaller responses are relative to this fraction. With a tenth of it blocks,
waves and impacts are equal."""


@packable
@dataclass(frozen=True)
class Estimate:
    """Estimated relative errors of a state: of the first harmonic of the response, and of the total wear rate.

    weight: factor on `wear_rate` in `largest`; less than 1 where almost nothing wears. NaN becomes inf, not known.
    """

    response: float
    wear_rate: float
    weight: float = 1.0

    def __post_init__(self) -> None:
        for name in ("response", "wear_rate"):
            if math.isnan(getattr(self, name)):
                object.__setattr__(self, name, math.inf)

    @property
    def largest(self) -> float:
        """The larger error, with the weight of the wear rate."""
        return max(self.response, self.weight * self.wear_rate)

    def __add__(self, other: Estimate) -> Estimate:
        """Sum of the errors of two causes: the worst case."""
        weight = max(self.weight, other.weight)
        return Estimate(self.response + other.response, self.wear_rate + other.wear_rate, weight)

    def larger(self, other: Estimate) -> Estimate:
        """The larger one of each error."""
        weight = max(self.weight, other.weight)
        return Estimate(max(self.response, other.response), max(self.wear_rate, other.wear_rate), weight)

    def times(self, factor: float) -> Estimate:
        """The errors times a safety factor."""
        return Estimate(factor * self.response, factor * self.wear_rate, self.weight)


NOTHING = Estimate(0.0, 0.0)
UNKNOWN = Estimate(np.inf, np.inf)


@dataclass(frozen=True)
class ResolvedState:
    """A state with the case of its solution.

    estimate: estimated errors, as far as estimated.
    accurate: whether the estimate is below rtol; only its response where slip shows with more samples than given; for
        fixed settings whether it is known.
    """

    case: Case
    point: State
    estimate: Estimate = NOTHING
    accurate: bool = True

    @cached_property
    def joint(self) -> Joint:
        """The joint of the state."""
        return self.point.joint(self.case)

    def solve_at(self, resolution: Resolution, run: Run, *, with_tail: bool = False) -> ResolvedState | None:
        """The state with other harmonics and samples; None where it is not found. with_tail: as in `transfer`."""
        point = run.move(self.case, self.point, resolution, with_tail=with_tail)
        # the mean position of a mass depends a little on the harmonics
        return None if point is None else ResolvedState(self.case.at(resolution), point).at_rest(run)

    def steps_to(self, resolution: Resolution, run: Run) -> tuple[list[ResolvedState], bool]:
        """The states after each of two Newton steps towards other harmonics and samples, and whether these contract: to
        a small residual, which is no solution.
        """
        case, own, reached = self.case.at(resolution), run.fresh(), list[ResolvedState]()
        joint = replace(self.point, resolution=resolution).joint(self.case)
        balance, predicted = transfer(self.case, self.point, joint)
        at = balance.evaluate(predicted)
        # a step that goes too far ends by its values, without a warning of numpy
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(2):
                at = balance.evaluate(at.predicted_h + own.steps(balance, at, [-at.residual])[0])
                reached.append(ResolvedState(case, state_of(joint, at)))
        run.budget.iterations += 2
        return reached, at.scaled_residual() <= CONTRACTED

    def at_rest(self, run: Run) -> ResolvedState:
        """The state with its sliding masses at rest: their creep is slip and would count as wear."""
        fraction = CREEP_SHARE * self.case.settings.rtol
        if not ratchets(self.joint, self.point.evaluation, fraction):
            return self
        return ResolvedState(self.case, shake_down(self.joint, self.point, fraction, run))

    def with_its_symmetry(self, run: Run) -> ResolvedState:
        """The state without even harmonics where its forces have none, and with them where its forces have some."""
        at, resolution = self.point.evaluation, self.case.resolution
        orders = resolution.orders
        if half_wave_symmetric(at, ROUND_OFF):
            orders = tuple(order for order in orders if order % 2)
        elif lacks_even(self.point):
            orders = all_orders(resolution.highest)
        wanted = Resolution(orders, resolution.samples)
        return self if wanted == resolution else self.solve_at(wanted, run) or self

    def unknowns(self, resolution: Resolution) -> int:
        """Number of unknowns of the balance with other harmonics."""
        return self.joint.component_index.size * (2 * len(resolution.orders) + 1)

    def most_unknowns(self, unknowns: float) -> float:
        """A limit of the unknowns with 48 pairs for this joint: of a larger joint it limits the harmonics only."""
        return unknowns * max(1.0, self.joint.component_index.size / 144)

    def holds(self) -> bool:
        """Whether equilibrium, contact law, energy and periodicity hold within the limits of the certificate."""
        return not certify(self.joint, self.point.evaluation).failures(self.case.settings.tolerance)

    def response(self) -> ComplexArray:
        """First harmonic of the responses (n_response,), m."""
        return first_response(self.joint, self.point.evaluation)

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest magnitudes of the responses over the period (n_response,), m."""
        return largest_responses(self.joint, self.point.evaluation)

    def difference(self, better: ResolvedState) -> Estimate:
        """Relative differences of response and wear rate to a better state; unknown to one that is no number."""
        if not np.isfinite(better.point.evaluation.residual).all():
            return UNKNOWN
        mine, its = self.response(), better.response()
        # slip work whose error has less weight: a fraction of the work of the excitation
        least, work = better._least_response(), SMALL * max(self._input_work(), better._input_work())
        first = float(np.linalg.norm(mine - its)) / max(float(np.linalg.norm(its)), least)
        size = np.maximum(better.peaks, max(SMALL_PEAK * float(better.peaks.max(initial=0.0)), least))
        response = max(first, float((np.abs(self.peaks - better.peaks) / size).max(initial=0.0)))
        mine_slip, its_slip = (float(level.point.evaluation.slip_work.sum()) for level in (self, better))
        if max(its_slip, mine_slip) <= SMALL * work:
            return Estimate(response, 0.0)
        # the wear rate cannot be more accurate than the motion that causes it
        slip = max(its_slip, SMALL * work)
        return Estimate(response, max(first, abs(mine_slip - its_slip) / slip), slip / max(slip, work))

    def _least_response(self) -> float:
        """Response, m, below which a relative error has no meaning: a small fraction of that to the excitation on the
        stiffness of the joint alone.
        """
        structure = self.joint.structure
        moved = structure.harmonic_force / self.joint.relative_penalty
        response = np.abs(structure.dynamic_response[0]) @ np.abs(moved) + np.abs(structure.harmonic_offset)
        return max(NEGLIGIBLE * float(np.linalg.norm(response)), 1e-300)

    def _input_work(self) -> float:
        return abs(self.joint.structure.input_work(self.joint.motion(self.point.evaluation)))


def shifted(resolution: Resolution, levels: int) -> Resolution:
    """Resolution so many levels up, as `with_highest`."""
    above = [highest for highest in HARMONIC_LEVELS if highest > resolution.highest]
    beyond = (levels + 1) * resolution.highest
    return with_highest(resolution, above[levels - 1] if len(above) >= levels else beyond)


def with_highest(resolution: Resolution, highest: int) -> Resolution:
    """Resolution with harmonics up to a highest one and enough samples; odd harmonics stay odd."""
    orders = all_orders(highest)
    if resolution.highest > 1 and all(order % 2 for order in resolution.orders):
        orders = orders[::2]
    return Resolution(orders, max(resolution.samples, samples_for(highest)))


def fewer(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """Resolution with one level fewer harmonics and half the samples, as far as these are automatic."""
    orders, samples = resolution.orders, resolution.samples
    if settings.harmonics == "auto":
        below = (highest for highest in HARMONIC_LEVELS if highest < resolution.highest)
        orders = with_highest(resolution, max(below, default=resolution.highest)).orders
    if settings.samples == "auto":
        samples = max(samples // 2, samples_for(orders[-1]))
    return Resolution(orders, samples)


def nothing_happens(evaluation: Evaluation) -> bool:
    """Whether every pair sticks or is open throughout the period, so that the joint is linear.

    A pair that reaches its friction limit without slip counts as stuck. One with another law is linear at rest alone.
    """
    status_t, force_t = evaluation.status_t, evaluation.predicted_t
    closed = ((status_t == STICK) | (status_t == SLIP)).all(axis=1) & _is_constant(evaluation.state_t)
    other = (status_t == OTHER).all(axis=1)
    calm = other & _is_constant(force_t) if other.any() else other
    return bool((closed | calm | (status_t == SEPARATED).all(axis=1)).all())


def _is_constant(values_t: FloatArray) -> BoolArray:
    """Pairs (n_contact,) with values (n_contact, k, N) that do not change."""
    return np.asarray((np.ptp(values_t, axis=2) <= ROUND_OFF * np.abs(values_t).max(axis=2)).all(axis=1))


def lacks_even(state: State) -> bool:
    """Whether a state has odd harmonics only although its contact forces have even ones."""
    return all(order % 2 for order in state.resolution.orders) and not half_wave_symmetric(state.evaluation, NEGLIGIBLE)


def half_wave_symmetric(evaluation: Evaluation, fraction: float) -> bool:
    """Whether all even harmonics of the contact force but the static one are below a fraction of its largest value."""
    half = evaluation.force_t.shape[2] // 2
    if evaluation.force_t.shape[2] % 2:
        return False
    total = evaluation.force_t[:, :, :half] + evaluation.force_t[:, :, half:]
    size = np.abs(evaluation.force_t).max(initial=0.0)
    return bool(np.ptp(total, axis=2).max(initial=0.0) <= fraction * size)


def left_out(state: State) -> float:
    """Fraction of the vibrating contact force of a state in harmonics that it leaves out, which only its samples hold.

    The fraction grows and falls with the error of the state, and needs no further solve.
    """
    force_h = np.fft.rfft(state.evaluation.force_t, axis=2)[:, :, 1:]
    size = np.linalg.norm(force_h)
    beyond = np.delete(force_h, np.array(state.resolution.orders, int) - 1, axis=2)
    return float(np.linalg.norm(beyond) / size) if size > 0.0 else 0.0
