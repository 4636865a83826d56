"""The state with which a block begins that continues the block before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.clock import computing_time
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance
from solver.loading_history.frequency_sweep import Found, FrequencySweep
from solver.loading_history.sweep_start import Sweep
from solver.missions.blocks import Block, worn
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import OutOfTimeError, solve_balance
from solver.outcome import Outcome, describe_error
from solver.results.history import StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings
from solver.structure.joint import build_case

_NO_RESOLUTION = Resolution((1,), 4)


def continue_block(block: Block, depth: FloatArray, carried: StartState, settings: SolverSettings) -> StartState:
    """The state of a block that keeps the tangential history of the block before, or the reason why there is none.

    Parameters
    ----------
    block
        The block.
    depth
        (n_contact,), m, worn before the block.
    carried
        State at the end of the block before.
    settings
        Numerical settings, with the time that is left.
    """
    began, lost = computing_time(), replace(carried, state=None, reference=None, newton_iterations=0)
    try:
        found = _Continuation(block, depth, settings, carried).state()
    except OutOfTimeError:
        found = replace(lost, outcome=Outcome.TIME_LIMIT)
    except np.linalg.LinAlgError:
        found = replace(lost, outcome=Outcome.SINGULAR)
    except Exception as error:
        # an error spoils one mission only: the study goes on
        found = replace(lost, outcome=Outcome.EXCEPTION, message=describe_error(error))
    return replace(found, run_time=computing_time() - began)


class _Continuation:
    """The way from the last state of a block to the first state of the next one."""

    def __init__(self, block: Block, depth: FloatArray, settings: SolverSettings, carried: StartState) -> None:
        self.block, self.settings, self.start = block, settings, carried
        self.model = worn(block.model, depth)
        self.iterations = 0
        self.deadline = computing_time() + settings.time_limit

    def state(self) -> StartState:
        """The state of the block: at the present depth, then at its amplitude and frequency."""
        assert self.start.state is not None
        before, amplitude = self.start.state, self.block.excitation_amplitude
        self._settle()
        ways = [("ramp", before.omega / (2.0 * np.pi), amplitude)]
        frequency, _ = self.block.steady
        if frequency != before.omega / (2.0 * np.pi):
            smaller = min(amplitude, before.excitation_amplitude)
            on_the_way = ("sweep", frequency, smaller)
            ways = [on_the_way, ("ramp", frequency, amplitude)] if amplitude > smaller else [*ways, on_the_way]
        for kind, at, load in ways:
            if self.start.state is not None:
                self._go(kind == "ramp", at, load)
        return replace(self.start, newton_iterations=self.iterations)

    def _settle(self) -> None:
        """Solve the state at the present depth, which a longer or an extrapolated step may have changed."""
        start = self.start
        assert start.state is not None
        case = build_case(
            self.model, self.block.friction_coefficient, start.penalty_omega, self.settings, start.resolution
        )
        joint, state = case.joint(start.state.omega, start.state.excitation_amplitude), start.state
        unworn = np.zeros_like(state.wear_depth)
        balance = Balance.frozen(joint, state.start_history, unworn)
        first = balance.predict(state.displacement_h, state.contact_force_h)
        line = FrequencySweep(
            self.model, self.block.friction_coefficient, state.excitation_amplitude, "up", self.settings
        )
        line.set_deadline(self.deadline)
        found = solve_balance(balance, first, JacobianSolver(), self.settings.tolerance, line.budget)
        self.iterations += line.budget.iterations
        if not found.converged:
            self.start = replace(start, state=None, outcome=Outcome.BRANCH_LOST)
            return
        self.start = replace(start, state=periodic_state(joint, PathPoint(0.0, found.evaluation, state.start_history)))

    def _go(self, ramp: bool, frequency: float, amplitude: float) -> None:
        """Go to another amplitude, N, or to another frequency, Hz, if it is another one."""
        start = self.start
        assert start.state is not None
        before, omega = start.state, 2.0 * np.pi * frequency
        if (before.excitation_amplitude == amplitude) if ramp else (before.omega == omega):
            return
        case = build_case(
            self.model, self.block.friction_coefficient, start.penalty_omega, self.settings, start.resolution
        )
        joint = case.joint(before.omega, before.excitation_amplitude)
        balance = Balance.frozen(joint, before.start_history, np.zeros_like(before.wear_depth))
        at = balance.evaluate(balance.predict(before.displacement_h, before.contact_force_h))
        parameter = before.excitation_amplitude / amplitude if ramp else before.omega
        sweep: Sweep = "ramp" if ramp else "up" if omega > before.omega else "down"
        line = FrequencySweep(self.model, self.block.friction_coefficient, amplitude, sweep, self.settings)
        line.set_deadline(self.deadline)
        found = Found(Outcome.UNSETTLED)
        if line.go_on_from(case, PathPoint(parameter, at, final_history(balance, at)), frequency):
            found = line.advance(frequency)
        self.iterations += line.n_iterations
        estimate = found.estimate if found.state is not None else Estimate(np.nan, np.nan)
        self.start = StartState(
            outcome=found.outcome,
            state=found.state,
            penalty_omega=start.penalty_omega,
            resolution=found.resolution or _NO_RESOLUTION,
            response_error=estimate.response,
            wear_rate_error=estimate.wear_rate,
            newton_iterations=0,
            run_time=0.0,
            branch=start.branch + found.branch,
            fold_frequency=found.fold / (2.0 * np.pi),
            message=found.message,
            reference=found.reference,
        )
