"""A joint that wears: its state, from which a history goes on, and how its states are solved.

A followed frequency is an unknown with one more equation: a given phase lag of the vibration, or that of the largest
amplitude (`solver.continuation.phase_lag`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.resolved_state import NOTHING, Estimate, left_out
from solver.contact.wear_law import ARCHARD, WearLaw, wearing_work
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.phase_lag import accepted_rise, rise_of_response, solve_at_lag, solve_at_peak
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.harmonic_balance.state import Failure, State, final_history
from solver.model import FloatArray
from solver.newton.run import MOST_ITERATIONS, Run
from solver.outcome import Outcome, in_digits
from solver.packing import packable
from solver.results.history import PeriodicState, StartState
from solver.results.state_report import evaluated
from solver.settings import FollowedFrequency, Resolution
from solver.structure.joint import Case, Hold, Joint

NO_WEAR = 1e-12
"""Fraction of `WearState.most_rate`: a joint that wears less sticks, and its rate is round-off."""


@packable
@dataclass(frozen=True)
class LastStep:
    """The last step, for BDF2 and for the extrapolation to the next state.

    length: cycles. At its start: depth (n_contact,), m, predicted_h (n_rel, 2H+1), N, omega, rad/s, resolution.
    """

    length: float
    depth: FloatArray
    predicted_h: FloatArray
    omega: float
    resolution: Resolution


@packable
@dataclass(frozen=True)
class WearState:
    """A wearing joint at one cycle count; the next step depends on this state only.

    cycle: count. omega: of the excitation, rad/s. point: periodic state with its depth and tangential history.
    resolution: harmonics and samples; resolutions: those from a cycle count on.
    left_out, estimate, accurate: of the state for which they were chosen: fraction of the contact force in harmonics
        that are left out, errors, and whether these are below rtol (True for given harmonics).
    rate (n_contact,): wear rate, m per cycle. rates, largest_rates (n_contact + 1,): of the pairs and, last, of all
        together, and their largest values so far, m3 per cycle. most_rate: if every pair slipped as far as it moves.
    step_limit: largest stable explicit step at the first state, cycles; NaN where nothing wears.
    previous: the last step; None at the first state and after a jump. error: local error of the last step, m3.
    length, first_length: largest length of the next step, and length of the first adaptive step, cycles.
    judged_h (n_rel, 2H+1): predicted force at the last stability check, N.
    lag, half_width: of a followed frequency: phase lag, rad, and change of the frequency over that of the lag, rad/s.
    hold, held_from: soft hold of the mean position, None without, and the count from which on it acts, inf if never.
    jump_cycle: count of the first jump to another branch, NaN if none.
    inaccurate_from, worst: count from which on the errors are above rtol, inf if never; the largest ones from there on.
    """

    cycle: float
    omega: float
    point: State
    resolution: Resolution
    left_out: float
    estimate: Estimate
    accurate: bool
    rate: FloatArray
    rates: FloatArray
    largest_rates: FloatArray
    judged_h: FloatArray
    resolutions: tuple[tuple[float, Resolution], ...] = ()
    most_rate: float = 0.0
    step_limit: float = math.nan
    previous: LastStep | None = None
    error: float = 0.0
    length: float = 1.0
    first_length: float = 0.0
    lag: float = 0.5 * math.pi
    half_width: float = 0.0
    hold: Hold | None = None
    held_from: float = math.inf
    jump_cycle: float = math.nan
    inaccurate_from: float = math.inf
    worst: Estimate = NOTHING

    @property
    def at(self) -> Evaluation:
        """Evaluation of the periodic state."""
        return self.point.evaluation

    @property
    def depth(self) -> FloatArray:
        """Worn depth (n_contact,), m."""
        return self.at.wear_depth

    @property
    def wears(self) -> bool:
        """Whether the wear rate is above the round-off of the slip by the static load."""
        return bool(self.rates[-1] > NO_WEAR * self.most_rate)


class WearingJoint:
    """The joint of one wear history.

    case: model, friction and settings. start: unworn state, which exists; its load is that of the history.
    wear_coefficient: 1/Pa. law: part of the slip work that wears.
    follow: what the frequency of the excitation follows, None for the frequency of the unworn state.
    area (n_contact,): m2. wearing: wearing work of the law.
    run: counts the iterations, limits the time, and has a factorisation from one solve to the next.
    """

    def __init__(
        self,
        case: Case,
        start: StartState,
        wear_coefficient: float,
        law: WearLaw = ARCHARD,
        follow: FollowedFrequency | None = None,
    ) -> None:
        assert start.state is not None
        self.case, self.start, self.wear_coefficient, self.follow = case, start, wear_coefficient, follow
        self.unworn, self.excitation_amplitude = start.state, start.state.excitation_amplitude
        self.area = case.model.contact.area
        self.wearing = wearing_work(law, case.model.contact, case.friction_coefficient)
        self.run = Run(case.settings.tolerance)
        self._last: tuple[Case, Joint] | None = None

    def case_and_joint(self, state: WearState) -> tuple[Case, Joint]:
        """Case and joint of a state. The last ones are stored; others drop the factorisation."""
        last = self._last
        if last is None or state.resolution != last[0].resolution or state.hold is not last[0].hold:
            case = replace(self.case, hold=state.hold).at(state.resolution)
            self.drop_factor()
        elif state.omega != last[1].omega:
            case = last[0]
        else:
            return last
        self._last = case, case.joint(state.omega, self.excitation_amplitude)
        return self._last

    def joint_of(self, state: WearState) -> Joint:
        """The joint of a state."""
        return self.case_and_joint(state)[1]

    def balance_of(self, state: WearState) -> Balance:
        """The balance that a state solves at constant wear depth."""
        return Balance(self.joint_of(state), state.at.history, state.depth)

    def drop_factor(self) -> None:
        """Drop the factorisation, so that the next solve depends on the state alone."""
        self.run = self.run.fresh()

    def is_stable(self, state: WearState) -> bool:
        """Whether a state is stable at constant wear depth."""
        return self.run.is_stable_finely(self.joint_of(state), state.at)

    def gain(self, cycles: float) -> FloatArray:
        """Growth of the depth over wearing work (n_contact,), m/J, in h cycles: `h k_w / alpha`, Eqs. (7), (24)."""
        return cycles * self.wear_coefficient / self.area

    def begin(self, of: PeriodicState | None = None) -> WearState:
        """The unworn state, or that of the reference sweep, evaluated and not solved again."""
        start, state = self.start, of or self.unworn
        balance, at = evaluated(self.case.at(start.resolution).joint(state.omega, self.excitation_amplitude), state)
        nothing = np.zeros(self.area.size + 1)
        begun = WearState(
            0.0,
            state.omega,
            State(at, final_history(balance, at)),
            start.resolution,
            left_out(start.resolution.orders, at),
            Estimate(start.response_error, start.wear_rate_error),
            accurate=start.outcome is Outcome.CONVERGED,
            rate=nothing,
            rates=nothing,
            largest_rates=nothing,
            # the stability of a start state has been checked
            judged_h=at.predicted_h,
        )
        return self.with_rates(begun)

    def begin_reference(self) -> WearState:
        """The unworn state of the reference solution.

        The state of the reference sweep has another tangential history, which may decide whether a pair goes on
        slipping while the joint wears. So the state is solved with twice the difference (dovetail, 212.5 Hz: 0.082 or
        0.106 mm3; both sweeps lead to 0.082, twice their difference to 0.097); where it is not found, that of the sweep
        is taken.
        """
        fine, reference = self.unworn, self.start.reference
        begun = self.begin(reference)
        if reference is None:
            return begun
        history = fine.start_history + 2.0 * (reference.start_history - fine.start_history)
        balance = Balance(self.joint_of(begun), history, begun.depth)
        point = self.run.state(balance, begun.at.predicted_h, most=NEAR_ITERATIONS)
        return begun if point is None else self.with_rates(replace(begun, point=point))

    def with_rates(self, state: WearState) -> WearState:
        """The state with its wear rates, Eqs. (7), (21), (25)."""
        rate = self.gain(1.0) * self.wearing.work(*worn_by(state.at))
        volumes = rate * self.area
        # the static slip included: where all pairs stick, the vibration alone is round-off
        pressed = np.abs(state.at.force_t[:, 0]).max(axis=1)
        moved = float(pressed @ np.linalg.norm(state.at.displacement_h[:, 1:], axis=(1, 2)))
        most = max(state.most_rate, self.wear_coefficient * (self.wearing.largest_factor * moved))
        rates = np.append(volumes, volumes.sum())
        largest = np.maximum(state.largest_rates, np.abs(rates))
        return replace(state, rate=rate, rates=rates, largest_rates=largest, most_rate=most)

    def solve(
        self, balance: Balance, start: FloatArray, state: WearState, most: int = NEAR_ITERATIONS
    ) -> WearState | None:
        """The state before with the solution of a balance from a first predicted force (n_rel, 2H+1), N, or None."""
        if self.follow is None:
            point = self.run.state(balance, start, most=most)
            return None if point is None else self.with_rates(replace(state, point=point))
        case, lag = self.case_and_joint(state)[0], state.lag
        if self.follow.of == "peak":
            peak = solve_at_peak(case, balance, start, lag, self.run, most)
            found, lag = (None, lag) if peak is None else peak
        else:
            found = solve_at_lag(case, balance, start, lag, self.run, most)
        if found is None:
            return None
        turn = math.nan if found.reduced is None else abs(float(found.reduced[0, 0]))
        if math.isnan(turn) and state.half_width == 0.0:
            turn = abs(rise_of_response(found, self.run, accepted_rise(case.settings.rtol))[1])
        half_width = state.half_width if math.isnan(turn) else 1.0 / max(turn, 1e-300)
        point = State(found.at, final_history(found.balance, found.at))
        omega = float(found.values[0])
        return self.with_rates(replace(state, point=point, omega=omega, lag=lag, half_width=half_width))

    def at_followed(self, state: WearState) -> WearState | Failure:
        """The state at the frequency that is followed, with its depths and its tangential history."""
        if self.follow is None:
            return state
        found = self.solve(self.balance_of(state), state.at.predicted_h, state, MOST_ITERATIONS)
        return found or self.lost(state)

    def lost(self, state: WearState) -> Failure:
        """The end of a history whose frequency leaves its range, or beyond whose last state none is found."""
        wanted, frequency = self.follow, state.omega / (2.0 * math.pi)
        assert wanted is not None
        said = "ends: no state beyond is found to go on with"
        if not wanted.low <= frequency <= wanted.high:
            said = f"is out of the range from {wanted.low:g} to {wanted.high:g} Hz"
        at = f"at cycle {in_digits(state.cycle)} and {frequency:.6g} Hz"
        return Failure(Outcome.RESONANCE_LOST, f"{at} the {wanted.of} {said}")

    def frequency_error(self, state: WearState) -> float:
        """Error of a followed frequency, Hz; 0 for a given one. The phase lag is wrong by as much as the amplitude, and
        every amplitude that is less than the largest one by its error may be the largest one.
        """
        if self.follow is None:
            return 0.0
        lag = state.estimate.response
        if self.follow.of == "peak":
            lag = math.sqrt(2.0 * lag) + accepted_rise(self.case.settings.rtol)
        return state.half_width * lag / (2.0 * math.pi)
