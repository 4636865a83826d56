"""A joint that wears: where it is excited, the data common to all states of a history, a kept factorisation.

A followed frequency is an unknown with one more equation: a given phase lag of the vibration
(`solver.continuation.phase_lag`), or that of the largest amplitude (`solver.continuation.largest_response`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.accuracy.harmonic_levels import left_out
from solver.contact.wear_law import ARCHARD, WearingWork, WearLaw, wearing_work
from solver.continuation.largest_response import accepted_rise, rise_of_response, solve_at_peak
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.phase_lag import solve_at_lag
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.harmonic_balance.state import Failure, State, final_history
from solver.model import FloatArray
from solver.newton.run import MOST_ITERATIONS, Run
from solver.outcome import Outcome, in_digits
from solver.results.history import StartState
from solver.settings import FollowedFrequency, Resolution
from solver.stability.floquet import is_stable
from solver.structure.joint import Case, Hold, Joint
from solver.wear.rate_slope import explicit_step_limit
from solver.wear.state import Choice, LastStep, WearState


@dataclass(frozen=True)
class Fixed:
    """The frequency of the unworn state."""

    follows = False

    def solve(
        self, _: Case, balance: Balance, start: FloatArray, state: WearState, run: Run, most: int | None = None
    ) -> WearState | None:
        """The state with the solution of a balance; None where it is not found.

        start (n_rel, 2H+1): first predicted force, N. state: the state before. run, most: as in `Run.solve`.
        """
        point = run.state(balance, start, most=most or NEAR_ITERATIONS)
        return None if point is None else replace(state, point=point)

    def lost(self, _: WearState, failure: Failure, /) -> Failure:
        """The end of a history where a search behind its last state has failed."""
        return failure


FIXED = Fixed()


@dataclass(frozen=True)
class Following(Fixed):
    """Phase resonance or the largest amplitude in a range. A state may be unstable at fixed frequency."""

    wanted: FollowedFrequency

    follows = True

    def solve(
        self, case: Case, balance: Balance, start: FloatArray, state: WearState, run: Run, most: int | None = None
    ) -> WearState | None:
        """As in `Fixed`; the frequency of the balance is the first one."""
        lag, most = state.lag, most or NEAR_ITERATIONS
        if self.wanted.of == "peak":
            peak = solve_at_peak(case, balance, start, lag, run, most)
            found, lag = (None, lag) if peak is None else peak
        else:
            found = solve_at_lag(case, balance, start, lag, run, most)
        if found is None:
            return None
        turn = math.nan if found.reduced is None else abs(float(found.reduced[0, 0]))
        if math.isnan(turn) and state.half_width == 0.0:
            turn = abs(rise_of_response(found, run, accepted_rise(case.settings.rtol))[1])
        half_width = state.half_width if math.isnan(turn) else 1.0 / max(turn, 1e-300)
        point = State(found.at, final_history(found.balance, found.at))
        return replace(state, point=point, omega=float(found.values[0]), lag=lag, half_width=half_width)

    def error(self, state: WearState, response_error: float, rtol: float) -> float:
        """Error of the frequency of a state, Hz, by the relative error of its response and rtol.

        The phase of the vibration, and so the phase lag, is wrong by as much as the amplitude. The amplitude is flat at
        its maximum: every amplitude that is less than the largest one by its error may be the largest one.
        """
        lag = response_error
        if self.wanted.of == "peak":
            lag = math.sqrt(2.0 * response_error) + accepted_rise(rtol)
        return state.half_width * lag / (2.0 * math.pi)

    def out_of_range(self, state: WearState) -> Failure | None:
        """The end of a history whose frequency leaves its range; None within."""
        frequency, wanted = state.omega / (2.0 * math.pi), self.wanted
        if wanted.low <= frequency <= wanted.high:
            return None
        said = f"at cycle {in_digits(state.cycle)} the {wanted.of} is at {frequency:.6g} Hz"
        return Failure(Outcome.RESONANCE_LOST, f"{said}, out of the range from {wanted.low:g} to {wanted.high:g} Hz")

    def lost(self, state: WearState, _: Failure, /) -> Failure:
        """As in `Fixed`."""
        at = f"at cycle {in_digits(state.cycle)} and {state.omega / (2.0 * math.pi):.6g} Hz"
        said = f"the {self.wanted.of} ends {at}: no state beyond is found to go on with"
        return Failure(Outcome.RESONANCE_LOST, said)


@dataclass
class WearingJoint:
    """The joint of one wear history.

    case: model, friction and settings, with the resolution and the hold of the last state that was used.
    start: unworn state, which exists; its load is that of the history.
    wear_coefficient: 1/Pa. law: part of the slip work that wears.
    where: at which frequency.
    run: counts the iterations, limits the time, and keeps a factorisation from one solve to the next.
    """

    case: Case
    start: StartState
    wear_coefficient: float
    law: WearLaw = ARCHARD
    where: Fixed = FIXED
    excitation_amplitude: float = field(init=False)
    wearing: WearingWork = field(init=False)
    run: Run = field(init=False)
    _joint: Joint | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        assert self.start.state is not None
        self.excitation_amplitude = self.start.state.excitation_amplitude
        self.wearing = wearing_work(self.law, self.case.model.contact, self.case.friction_coefficient)
        self.run = Run(self.case.settings.tolerance)

    @property
    def area(self) -> FloatArray:
        """Area of the pairs (n_contact,), m2."""
        return self.case.model.contact.area

    def joint(self, resolution: Resolution, hold: Hold | None, omega: float) -> Joint:
        """The joint with these harmonics and samples, whose change drops the factorisation, at a frequency, rad/s."""
        if self._joint is None or resolution != self.case.resolution or hold is not self.case.hold:
            case = self.case if hold is self.case.hold else self.case.held(hold)
            self.case = case.at(resolution)
            self._joint = self.case.joint(omega, self.excitation_amplitude)
            self.drop_factor()
        elif omega != self._joint.omega:
            self._joint = self.case.joint(omega, self.excitation_amplitude)
        return self._joint

    def at(self, state: WearState) -> Joint:
        """The joint of a state."""
        return self.joint(state.resolution, state.hold, state.omega)

    def drop_factor(self) -> None:
        """Drop the kept factorisation, so that the next solve depends on the state alone."""
        self.run = self.run.fresh()

    def is_stable(self, joint: Joint, at: Evaluation) -> bool:
        """Whether a state is stable at constant wear depth."""
        return is_stable(Balance(joint, at.history, at.wear_depth), at, self.run)

    def rate(self, at: Evaluation) -> FloatArray:
        """Wear rate (n_contact,), m per cycle, Eqs. (7), (21), (25)."""
        return self.gain(1.0) * self.wearing.work(*worn_by(at))

    def gain(self, cycles: float) -> FloatArray:
        """Growth of the depth over wearing work (n_contact,), m/J, in h cycles: `h k_w / alpha`, Eqs. (7), (24)."""
        return cycles * self.wear_coefficient / self.area

    def begin(self, step_limit: float = math.nan, *, of_reference: bool = False) -> WearState:
        """The unworn state, or that of the reference sweep where there is one. It is evaluated, not solved again.

        step_limit: largest stable explicit step, cycles; NaN if unknown.
        """
        start = self.start
        state = start.reference if of_reference and start.reference is not None else start.state
        assert state is not None
        balance = Balance(self.joint(start.resolution, None, state.omega), state.start_history, state.wear_depth)
        at = balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h))
        estimate = Estimate(start.response_error, start.wear_rate_error)
        unknown = np.full(self.area.size + 1, np.nan)
        begun = WearState(
            0.0,
            state.omega,
            State(at, final_history(balance, at)),
            start.resolution,
            Choice(left_out(start.resolution.orders, at), estimate, start.outcome is Outcome.CONVERGED),
            rates=unknown,
            largest_rates=np.zeros_like(unknown),
            step_limit=step_limit,
            # the stability of a start state has been checked
            judged_h=at.predicted_h,
        )
        return self.noted(begun)

    def accepted(self, state: WearState, end: WearState, length: float) -> WearState:
        """The end of a step of `length` cycles from a state; end: that state with the solution of the step."""
        last = LastStep(length, state.depth, state.point.evaluation.predicted_h, state.omega, state.resolution)
        return self.noted(replace(end, cycle=state.cycle + length, previous=last))

    def noted(self, state: WearState) -> WearState:
        """The state with its wear rates, and with the limit of the explicit step from the first state that wears on."""
        at = state.point.evaluation
        volumes = self.rate(at) * self.area
        # the static slip included: where all pairs stick, the vibration alone is round-off
        pressed = np.abs(at.force_t[:, 0]).max(axis=1)
        moved = float(pressed @ np.linalg.norm(at.displacement_h[:, 1:], axis=(1, 2)))
        most = self.wear_coefficient * (self.wearing.largest_factor * moved)
        rates = np.append(volumes, volumes.sum())
        largest = np.maximum(state.largest_rates, np.abs(rates))
        state = replace(state, rates=rates, largest_rates=largest, most_rate=max(state.most_rate, most))
        if np.isnan(state.step_limit) and state.wears:
            limit = explicit_step_limit(self.at(state), at, self.gain(1.0), self.wearing, self.run)
            state = replace(state, step_limit=limit)
        return state

    def at_followed(self, state: WearState) -> WearState | Failure:
        """The state at the frequency that is followed, with its depths and its tangential history."""
        if not self.where.follows:
            return state
        at = state.point.evaluation
        balance = Balance(self.at(state), at.history, at.wear_depth)
        found = self.where.solve(self.case, balance, at.predicted_h, state, self.run, MOST_ITERATIONS)
        return found or self.where.lost(state, Failure(Outcome.RESONANCE_LOST))
