"""The state with which a block begins that continues the block before, or that keeps nothing of its way."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.clock import computing_time
from solver.contact.coulomb import STICK
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, final_history, vibration_change
from solver.loading_history.frequency_sweep import Found, FrequencySweep
from solver.loading_history.path import LoadingPath
from solver.loading_history.sweep_start import Direction
from solver.missions.blocks import Block, worn
from solver.model import FloatArray
from solver.newton.run import Budget, OutOfTimeError, Run
from solver.outcome import Outcome, describe_error
from solver.results.history import StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings
from solver.stability.floquet import find_instability
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


def begin_again(
    block: Block, depth: FloatArray, begun: StartState, settings: SolverSettings, every: bool
) -> StartState | None:
    """The state to which the ramp or the sweep of a block leads, from that in a mission before, without its way.

    Where each pair slips or opens within the period, the tangential history of the way is forgotten, and the state
    follows from the depths alone. None where a pair sticks all the time, where the way has jumped over a fold, where
    there is no near stable state, or where the vibration has changed so much that the way may lead to another branch.

    Parameters
    ----------
    block
        The block.
    depth
        (n_contact,), m, worn before the block.
    begun
        State to which the way has led in a mission before.
    settings
        Numerical settings, with the time that is left.
    every
        For which states stability is tested, as in `find_instability`.

    Raises
    ------
    OutOfTimeError
        The time is over.
    """
    run = Run(settings.tolerance, Budget(deadline=computing_time() + settings.time_limit))
    path, before = _evaluated(block, depth, begun, settings)
    if begun.branch > 0 or not _forgets(before.evaluation):
        return None
    found = None
    with contextlib.suppress(np.linalg.LinAlgError):
        found = path.solve((before,), 1.0, run)
    if found is None or not _forgets(found.evaluation):
        return None
    if vibration_change(before.evaluation, found.evaluation) > CONTINUATION.smooth_change:
        return None
    joint = path.joint_at(1.0)
    if find_instability(path.case, joint, found.evaluation, run, every):
        return None
    state = periodic_state(joint, found)
    return replace(begun, state=state, reference=None, newton_iterations=run.budget.iterations)


def _evaluated(
    block: Block, depth: FloatArray, begun: StartState, settings: SolverSettings
) -> tuple[LoadingPath, State]:
    """The joint with these depths, and the vibration of a state in it."""
    state, model = begun.state, worn(block.model, depth)
    assert state is not None
    case = build_case(model, block.friction_coefficient, begun.penalty_omega, settings, begun.resolution)
    path = LoadingPath(case, state.excitation_amplitude, state.omega)
    balance = path.balance_at(1.0, state.start_history)
    at = balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h))
    return path, State(at, state.start_history, 1.0)


def _forgets(at: Evaluation) -> bool:
    """Whether each pair slips or opens within the period."""
    return not (at.status_t == STICK).all(axis=1).any()


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
        balance = Balance(joint, state.start_history, unworn)
        first = balance.predict(state.displacement_h, state.contact_force_h)
        run = Run(self.settings.tolerance, Budget(deadline=self.deadline))
        found = run.solve(balance, first)
        self.iterations += run.budget.iterations
        if not found.converged:
            self.start = replace(start, state=None, outcome=Outcome.BRANCH_LOST)
            return
        self.start = replace(start, state=periodic_state(joint, State(found.evaluation, state.start_history)))

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
        balance = Balance(joint, before.start_history, np.zeros_like(before.wear_depth))
        at = balance.evaluate(balance.predict(before.displacement_h, before.contact_force_h))
        parameter = before.excitation_amplitude / amplitude if ramp else before.omega
        sweep: Direction = "ramp" if ramp else "up" if omega > before.omega else "down"
        line = FrequencySweep(self.model, self.block.friction_coefficient, amplitude, sweep, self.settings)
        line.set_deadline(self.deadline)
        found = Found(Outcome.UNSETTLED)
        if line.go_on_from(case, State(at, final_history(balance, at), parameter), frequency):
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
