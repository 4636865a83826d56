"""Where a joint is excited while it wears: at a given frequency, or at one that follows the structure.

A followed frequency is an unknown with one more equation: a given phase lag of the vibration
(`solver.continuation.phase_lag`), or that of the largest amplitude (`solver.continuation.largest_response`). The lag of
the largest amplitude changes little from step to step, so that most steps take one or two solves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.continuation.largest_response import accepted_rise, rise_of_response, solve_at_peak
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.phase_lag import solve_at_lag
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, final_history
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import FollowedFrequency
from solver.structure.joint import Case
from solver.wear.state import Reached, WearState


@dataclass(frozen=True)
class Fixed:
    """The frequency of the unworn state."""

    follows = False

    def solve(
        self, _: Case, balance: Balance, start: FloatArray, state: WearState, run: Run, most: int | None = None
    ) -> Reached | None:
        """The state of a balance; None where it is not found.

        start (n_rel, 2H+1): first predicted force, N. state: the state before. run, most: as in `Run.solve`.
        """
        point = run.state(balance, start, most=most or NEAR_ITERATIONS)
        return None if point is None else Reached(point, state.omega, state.lag, state.half_width)

    def error(self, _: WearState, __: float, ___: float) -> float:
        """Error of the frequency of a state, Hz, by the relative error of its response and rtol."""
        return 0.0

    def out_of_range(self, _: WearState) -> Failure | None:
        """The end of a history whose frequency leaves its range; None within."""
        return None

    def lost(self, _: WearState) -> Failure | None:
        """What ends where no state is found behind a last one; None for a branch at constant frequency."""
        return None


@dataclass(frozen=True)
class Following(Fixed):
    """Phase resonance or the largest amplitude in a range. A state may be unstable at fixed frequency."""

    wanted: FollowedFrequency

    follows = True

    def solve(
        self, case: Case, balance: Balance, start: FloatArray, state: WearState, run: Run, most: int | None = None
    ) -> Reached | None:
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
        return Reached(State(found.at, final_history(found.balance, found.at)), float(found.values[0]), lag, half_width)

    def error(self, state: WearState, response_error: float, rtol: float) -> float:
        """As in `Fixed`.

        The phase of the vibration is wrong by as much as the amplitude, and so is the phase lag. The amplitude is flat
        at its maximum: every amplitude that is less than the largest one by its error may be the largest one.
        """
        lag = response_error
        if self.wanted.of == "peak":
            lag = math.sqrt(2.0 * response_error) + accepted_rise(rtol)
        return state.half_width * lag / (2.0 * math.pi)

    def out_of_range(self, state: WearState) -> Failure | None:
        """As in `Fixed`."""
        frequency, wanted = state.omega / (2.0 * math.pi), self.wanted
        if wanted.low <= frequency <= wanted.high:
            return None
        said = f"at cycle {state.cycle:.6g} the {wanted.of} is at {frequency:.6g} Hz"
        return Failure(Outcome.RESONANCE_LOST, f"{said}, out of the range from {wanted.low:g} to {wanted.high:g} Hz")

    def lost(self, state: WearState) -> Failure | None:
        """As in `Fixed`."""
        at = f"at cycle {state.cycle:.6g} and {state.omega / (2.0 * math.pi):.6g} Hz"
        said = f"the {self.wanted.of} ends {at}: no state beyond is found to go on with"
        return Failure(Outcome.RESONANCE_LOST, said)
