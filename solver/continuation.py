"""A branch of periodic states along the frequency."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Literal

import numpy as np

from solver.adapt import UNKNOWN, Refined, refine
from solver.balance import Balance
from solver.history import StartState
from solver.joint import Case, build_case
from solver.linear import JacobianSolver
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.path import Effort, PathPoint, follow_arc, follow_naturally
from solver.response import periodic_state, solve_first_state
from solver.settings import SolverSettings

LEAD_IN = 0.05  # of the first frequency: a sweep begins outside its range, so that a single frequency knows its branch
FINE = 0.001  # of the frequency: steps that a sweep may always take

Sweep = Literal["up", "down"]


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float,
    excitation_amplitude: float,
    frequencies: FloatArray,
    sweep: Sweep,
    settings: SolverSettings,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at the frequencies (Hz, ascending): index and state, one by one.

    "up" follows the branch from the lowest frequency, "down" from the highest, each from a little outside the range. At
    a fold the branch is followed by arc length until it reaches the next frequency, which is where a slow sweep of the
    machine would land if the branch is one curve; where that fails the state is sought from nothing.
    excitation_amplitude in N. Each state starts from the tangential history of the one before.
    """
    order = np.arange(frequencies.size) if sweep == "up" else np.arange(frequencies.size)[::-1]
    omegas = 2.0 * np.pi * frequencies
    penalty_omega = float(omegas.max())
    line = _Line(build_case(model, friction_coefficient, penalty_omega, settings), excitation_amplitude)
    started = time.thread_time()
    for index in order:
        spent = line.effort.iterations
        outcome, refined = line.advance(float(omegas[index]), sweep)
        now = time.thread_time()
        state, estimate = None, UNKNOWN
        if refined is not None:
            joint = refined.case.joint(float(omegas[index]), excitation_amplitude)
            state, estimate = periodic_state(joint, refined.point), refined.estimate
        yield (
            int(index),
            StartState(
                outcome=outcome,
                state=state,
                penalty_omega=penalty_omega,
                resolution=line.case.resolution,
                response_error=estimate.response,
                wear_rate_error=estimate.wear_rate,
                newton_iterations=line.effort.iterations - spent,
                run_time=now - started,
            ),
        )
        started = now


class _Line:
    """The last state of a sweep and how it goes on."""

    def __init__(self, case: Case, excitation_amplitude: float) -> None:
        self.case = case
        self.excitation_amplitude = excitation_amplitude
        self.unworn = np.zeros(case.model.contact.n_contact)
        self.solver = JacobianSolver()
        self.effort = Effort()
        self.point: PathPoint | None = None
        self.failure = Outcome.START_FAILED

    def advance(self, omega: float, sweep: Sweep) -> tuple[Outcome, Refined | None]:
        """State at the next angular frequency, rad/s, with the harmonics that it needs."""
        try:
            if self.point is None:
                self.point = self._first(omega * (1.0 - LEAD_IN if sweep == "up" else 1.0 + LEAD_IN))
            reached = self._next(omega) if self.point is not None else None
            reached = reached or self._first(omega)
            if reached is None:
                return self.failure if self.point is None else Outcome.BRANCH_LOST, None
            refined = refine(self.case, omega, self.excitation_amplitude, reached, self.effort)
        except np.linalg.LinAlgError:
            return Outcome.SINGULAR, None
        if refined.case is not self.case:
            self.solver = JacobianSolver()
        self.case, self.point = refined.case, refined.point
        return (Outcome.CONVERGED, refined) if refined.accurate else (Outcome.INACCURATE, None)

    def _first(self, omega: float) -> PathPoint | None:
        self.failure, found = solve_first_state(
            self.case, omega, self.excitation_amplitude, self.unworn, self.solver, self.effort
        )
        return None if found is None else PathPoint(omega, found.evaluation, found.history)

    def _next(self, omega: float) -> PathPoint | None:
        assert self.point is not None
        tolerance = self.case.settings.tolerance
        point, arrived = follow_naturally(
            self._balance_at, self.point, omega, self.solver, tolerance, self.effort, fine=FINE * omega
        )
        if arrived:
            return point
        return follow_arc(self._balance_at, point, omega, 0.05 * omega, tolerance, self.effort)

    def _balance_at(self, omega: float, history: FloatArray) -> Balance:
        joint = self.case.joint(omega, self.excitation_amplitude)
        return Balance(joint, history, self.unworn, np.zeros_like(self.unworn))
