"""A joint that wears: what its history is asked for, its state, from which it goes on, and how its states are solved.

A `StartState` of a sweep has a `PeriodicState`, which is evaluated (`WearingJoint.unworn_state`) and becomes a `State`,
as Newton's method gives it. A `WearState` has a `State` at a cycle count, and all with which the history goes on:
what was `Checked`, the `LastStep`, and the `Record` for the result.

A followed frequency is an unknown with one more equation: a given phase lag of the vibration, or that of the largest
amplitude (`solver.continuation.phase_lag`).
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from solver.accuracy.resolved_state import NOTHING, UNKNOWN, Estimate, left_out
from solver.contact.coulomb import friction_limit
from solver.contact.wear_law import ARCHARD, WearingWork, WearLaw, wearing_work
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.phase_lag import PEAK_RISE, rise_of_response, solve_at_lag, solve_at_peak
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.harmonic_balance.state import Failure, State, state_of, vibration_change
from solver.model import FloatArray
from solver.newton.run import MOST_ITERATIONS, Run
from solver.outcome import Outcome, in_digits, in_whole
from solver.packing import packable
from solver.results.history import PeriodicState, StartState
from solver.results.state_report import evaluated
from solver.settings import ROUND_OFF, FollowedFrequency, Scheme, ToTheEnd, WearTarget
from solver.structure.joint import Case, Joint
from solver.wear.slow_time import Guide


@dataclass(frozen=True)
class Given:
    """Euler steps of `length` cycles, which end at its multiples also after a shorter step: equal steps in `k_w h` of
    histories that differ in k_w only. To the end of wear, each step wears about as much as the first one.

    depth: in place of the length, wear of the fastest pair at the rate of the start of a step, m, Eq. (22).
    """

    length: float
    scheme: Scheme = "implicit"
    depth: float | None = None


def steps_of(scheme: str, length: float, largest_depth: float | None = None) -> Given | None:
    """The steps of a scheme by its name, "final" included; largest_depth: in place of the length of explicit steps."""
    if scheme in ("adaptive", "final"):
        return None
    return Given(length, "explicit", largest_depth) if scheme == "explicit" else Given(length)


@dataclass(frozen=True)
class WearRequest:
    """What a wear history is asked for, Eqs. (20) to (26).

    wear_coefficient: k_w, 1/Pa. law: part of the slip work that wears.
    steps: None for BDF2 steps with a relative error of the worn volume near rtol, the last count interpolated.
    cycles (n_output,): ascending counts to report, the first 0; the last Euler step ends at the last one. Or
        `ToTheEnd`: until nothing wears any more; not with explicit steps, which cannot grow.
    until: target of the wear, with whose step the history ends. loops: pairs with reported fretting loops.
    ends_at_last: whether the last adaptive step ends at the last count, for a joint that vibrates otherwise from there.
    follow: what the frequency of the excitation follows; None for that of the start state.
    """

    wear_coefficient: float
    steps: Given | None
    cycles: FloatArray | ToTheEnd
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    loops: tuple[int, ...] = ()
    ends_at_last: bool = False
    follow: FollowedFrequency | None = None

    @property
    def end(self) -> float:
        """Last cycle count; inf where it is not known."""
        return math.inf if isinstance(self.cycles, ToTheEnd) else float(self.cycles[-1])

    def adaptive_to(self, counts: FloatArray) -> "WearRequest":
        """The same with adaptive steps, to the last of some counts (n,), whatever target is reached before."""
        never = self.until and replace(self.until, value=math.inf)
        return replace(self, steps=None, cycles=counts, until=never)


@packable
@dataclass(frozen=True)
class Checked:
    """What the last checks have found.

    left_out, estimate, accurate: of the state for which harmonics were chosen: fraction of the contact force in
        harmonics that are left out, errors, and whether these are below rtol (True for given harmonics).
    judged_h (n_rel, 2H+1): predicted force at the last stability check, N.
    """

    left_out: float
    estimate: Estimate
    accurate: bool
    judged_h: FloatArray


@packable
@dataclass(frozen=True)
class LastStep:
    """The state before a step, None at the first state and after a jump; length, cycles; local errors: of the volume,
    m3, and of the energy that an evolving contact has dissipated, J.
    """

    before: State | None = None
    length: float = math.nan
    error: float = 0.0
    heat_error: float = 0.0


@packable
@dataclass(frozen=True)
class Record:
    """What a history says at its end, and by what it judges when nothing wears any more.

    largest_rates (n_contact + 1,), most_rate: largest wear rates so far of the pairs and, last, of all together, m3 per
        cycle; and if every pair slipped as far as it moves.
    step_limit: largest stable explicit step at the first state, cycles; or inf.
    inaccurate_from, worst: count from which on the errors are above rtol, inf if never; the largest ones from there on.
    held_from: count from which on a hold acts, inf if never. jump_cycle: first jump to another branch, NaN if none.
    """

    largest_rates: FloatArray
    most_rate: float = 0.0
    step_limit: float = math.inf
    inaccurate_from: float = math.inf
    worst: Estimate = NOTHING
    held_from: float = math.inf
    jump_cycle: float = math.nan


@packable
@dataclass(frozen=True)
class WearState:
    """A wearing joint at one cycle count; the next step depends on this state only.

    cycle: count. point: periodic state with its depth and tangential history. rate, energy_rate (n_contact,): of its
    wear, m per cycle, and of the energy that friction dissipates, J/m2 per cycle. guide: for the reference solution.
    next_length: largest length of the next step, cycles.
    lag, half_width: of a followed frequency: phase lag, rad, and change of the frequency over that of the lag, rad/s.
    """

    cycle: float
    point: State
    rate: FloatArray
    checked: Checked
    record: Record
    guide: Guide
    last: LastStep = LastStep()
    next_length: float = 1.0
    lag: float = 0.5 * math.pi
    half_width: float = 0.0
    energy_rate: FloatArray = field(default_factory=lambda: np.full(1, np.nan))

    @property
    def at(self) -> Evaluation:
        """Evaluation of the periodic state."""
        return self.point.evaluation

    @property
    def depth(self) -> FloatArray:
        """Worn depth (n_contact,), m."""
        return self.at.wear_depth


def slip_at_most(at: Evaluation) -> float:
    """Slip work, J, if every pair slipped as far as it moves. The static slip included: where all pairs stick, the
    vibration alone is round-off.
    """
    pressed = np.abs(at.force_t[:, 0]).max(axis=1)
    return float(pressed @ np.linalg.norm(at.displacement_h[:, 1:], axis=(1, 2)))


class WearingJoint:
    """The joint of one wear history.

    case: with the resolution of the start. start: unworn state, which exists; its load is that of the history.
    area (n_contact,): m2.
    shifts: whether the target is a shift of the resonance, which each state then reports.
    run: counts the iterations, limits the time, and has a factorisation from one solve to the next. A fresh one lets
        the next solve depend on the state alone.
    """

    def __init__(self, case: Case, start: StartState, request: WearRequest) -> None:
        if request.steps is None:
            case = replace(case, settings=case.settings.of_steps)
        self.case, self.start, self.request, self.area = case, start, request, case.model.contact.area
        self.shifts = request.until is not None and request.until.quantity == "frequency_shift"
        self._work = wearing_work(request.law, case.model.contact, request.wear_coefficient)
        self.run = Run(case.settings.tolerance)

    def joint_of(self, state: WearState) -> Joint:
        """The joint of a state."""
        return state.point.joint(self.case)

    def wearing_work(self, state: WearState) -> WearingWork:
        """Of the pairs by the wear law, at the frequency and with the friction of a state."""
        return self._work.at(state.point.omega / (2.0 * math.pi)).rubbing(self.joint_of(state).contact.friction)

    def gain(self, cycles: float) -> FloatArray:
        """Growth of the depth over wearing work (n_contact,), m/J, in h cycles: `h k_w / alpha`, Eqs. (7), (24)."""
        return cycles * self.request.wear_coefficient / self.area

    def unworn_state(self, periodic: PeriodicState | None = None) -> WearState:
        """The state at the start, or another one with its harmonics and samples, evaluated and not solved again."""
        start, nothing = self.start, np.zeros(self.area.size + 1)
        known = periodic or start.state
        assert known is not None
        point = evaluated(self.case, known)
        # the stability of a start state has been checked
        judged_h, accurate = point.evaluation.predicted_h, start.outcome is Outcome.CONVERGED
        checked = Checked(left_out(point), start.by_resolution, accurate, judged_h)
        return self.with_rates(WearState(0.0, point, nothing, checked, Record(nothing), Guide((), 0.0)))

    @cached_property
    def by_sweep(self) -> Estimate:
        """Errors of the start state by its sweep: the differences of vibration and wear rate to the state of the
        reference sweep; unknown where a reference sweep was lost.
        """
        start, reference = self.start, self.start.reference
        if reference is None:
            return UNKNOWN if math.isinf(start.wear_rate_error) else NOTHING
        own, other = self.unworn_state(), self.unworn_state(reference)
        apart, whole = own.rate * self.area - other.rate * self.area, self.volume_rate(own)
        rate = float(in_whole(apart)) / whole if whole > 0.0 else 0.0
        return Estimate(vibration_change(own.at, other.at), rate)

    def with_rates(self, state: WearState) -> WearState:
        """The state with its wear rates, Eqs. (7), (21), (25)."""
        wearing, contact = self.wearing_work(state), self.joint_of(state).contact
        rate = self.gain(1.0) * contact.wear_factor[0] * wearing.work(*worn_by(state.at))
        energy_rate = friction_limit(contact.friction, state.at.slip_work) / self.area
        slip = slip_at_most(state.at)
        most = self.request.wear_coefficient * (wearing.largest_factor * slip) * float(contact.wear_factor[0].max())
        most = max(state.record.most_rate, most)
        rates = rate * self.area
        largest = np.maximum(state.record.largest_rates, np.abs(np.append(rates, rates.sum())))
        record = replace(state.record, largest_rates=largest, most_rate=most)
        return replace(state, rate=rate, energy_rate=energy_rate, record=record)

    def volume_rate(self, state: WearState) -> float:
        """Wear rate of all pairs together, m3 per cycle."""
        return float((state.rate * self.area).sum())

    def wears(self, state: WearState) -> bool:
        """Whether the wear rate of a state is above the round-off of the slip by the static load, or its contact
        changes.
        """
        return self.volume_rate(state) > ROUND_OFF * state.record.most_rate or self.change_rate(state) > 0.0

    def change_rate(self, state: WearState) -> float:
        """Largest relative change of an evolving contact in a cycle; 0 for slip that is round-off."""
        rate = self.joint_of(state).contact.relative_change(state.energy_rate)
        slips = state.at.slip_work.sum() > ROUND_OFF * slip_at_most(state.at)
        return rate if slips else 0.0

    def solve(
        self, balance: Balance, start: FloatArray, state: WearState, most: int = NEAR_ITERATIONS
    ) -> WearState | None:
        """The state before with the solution of a balance from a first predicted force (n_rel, 2H+1), N, or None."""
        if self.request.follow is None:
            point = self.run.state(balance, start, most=most)
            return None if point is None else self.with_rates(replace(state, point=point))
        case, lag = state.point.case(self.case), state.lag
        if self.request.follow.of == "peak":
            peak = solve_at_peak(case, balance, start, lag, self.run, most)
            solved, lag = (None, lag) if peak is None else peak
        else:
            solved = solve_at_lag(case, balance, start, lag, self.run, most)
        if solved is None:
            return None
        turn = math.nan if solved.reduced is None else abs(float(solved.reduced[0, 0]))
        if math.isnan(turn) and state.half_width == 0.0:
            turn = abs(rise_of_response(solved, self.run, PEAK_RISE * case.settings.rtol)[1])
        half_width = state.half_width if math.isnan(turn) else 1.0 / max(turn, 1e-300)
        point = state_of(solved.balance.joint, solved.at)
        return self.with_rates(replace(state, point=point, lag=lag, half_width=half_width))

    def at_followed(self, state: WearState) -> WearState | Failure:
        """The state at the frequency that is followed, with its depth and its tangential history."""
        if self.request.follow is None:
            return state
        balance = Balance(self.joint_of(state), state.at.start_history, state.depth, energy=state.at.energy)
        return self.solve(balance, state.at.predicted_h, state, MOST_ITERATIONS) or self.lost(state)

    def lost(self, state: WearState) -> Failure:
        """The end of a history whose frequency leaves its range, or beyond whose last state none is found."""
        wanted, frequency = self.request.follow, state.point.omega / (2.0 * math.pi)
        assert wanted is not None
        reason = "ends: no state beyond is found to go on with"
        if not wanted.low <= frequency <= wanted.high:
            reason = f"is out of the range from {wanted.low:g} to {wanted.high:g} Hz"
        at = f"at cycle {in_digits(state.cycle)} and {frequency:.6g} Hz"
        return Failure(Outcome.RESONANCE_LOST, f"{at} the {wanted.of} {reason}")

    def frequency_error(self, state: WearState) -> float:
        """Error of a followed frequency, Hz; 0 for a given one. The phase lag is wrong by as much as the amplitude, and
        every amplitude that is less than the largest one by its error may be the largest one.
        """
        if self.request.follow is None:
            return 0.0
        lag = state.checked.estimate.response
        if self.request.follow.of == "peak":
            lag = math.sqrt(2.0 * lag) + PEAK_RISE * self.case.settings.rtol
        return state.half_width * lag / (2.0 * math.pi)
