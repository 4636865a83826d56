"""A branch of periodic states along the frequency."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np

from solver.adapt import Refined, lighter, refine
from solver.arc import JUMP, follow_arc
from solver.balance import Balance
from solver.certificate import certify
from solver.clock import computing_time
from solver.doubling import doubles_period
from solver.estimate import UNKNOWN
from solver.history import StartState
from solver.joint import Case, build_case
from solver.linear import JacobianSolver
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome, describe_error
from solver.packed import Packed
from solver.packing import pack, unpack
from solver.path import Effort, OutOfTimeError, PathPoint, follow_naturally, vibration_change
from solver.response import periodic_state, solve_first_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.settling import settle
from solver.stability import is_stable

LEAD_INS = (
    0.3,
    0.05,
)  # of the first frequency: a sweep begins outside its range, so that one frequency knows its branch
FINE = 0.001  # of the frequency: steps that a sweep may always take
SPAN = 0.05  # of the frequency: natural length of arc-length steps
OTHER_STARTS = (Resolution((1,), 64), Resolution((1, 2, 3), 256), Resolution(all_orders(15), 256))
FEW_PAIRS = 12  # up to which a state that is not accurate is sought from nothing as well: impacts have many others
COSTLY = 2500  # unknowns from which a branch is followed with fewer harmonics than its states are refined to
LIGHT = 1600  # unknowns of a state that a branch is followed with then
ALIKE = 0.2  # relative difference of the first harmonics of such a state to the refined one
MOST_ITERATIONS = 2500  # from one frequency to the next
REFRESH = 100  # iterations after which the kept factorisation is given up at the next frequency, as in `march`
MOST_LANDINGS = 6  # ends of branches on the way from one frequency to the next

_CARRIED = ("point", "failure", "branch", "fold")

Sweep = Literal["up", "down"]


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float,
    excitation_amplitude: float,
    frequencies: FloatArray,
    sweep: Sweep,
    settings: SolverSettings,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at the frequencies (Hz, ascending): index and state, one by one.

    "up" follows the branch from the lowest frequency, "down" from the highest, each from 30 % outside the range. Where
    the branch ends at a fold it is followed by arc length until it reaches the next frequency in a stable state, which
    is where a slow sweep of the machine would land if the branch is one curve; where that fails, the structure is left
    to settle in time from the last state, and at last the state is sought from nothing.
    excitation_amplitude in N. Each state starts from the tangential history of the one before.
    keep: called now and then, after the state was taken from the iterator, with the progress of the sweep. resume: such
        progress of a sweep with the same arguments (frequencies beyond those passed may differ, but not the highest
        one), from which this one goes on: the remaining states are the same to the last bit, but for `run_time`.
    """
    order = np.arange(frequencies.size) if sweep == "up" else np.arange(frequencies.size)[::-1]
    omegas = 2.0 * np.pi * frequencies
    penalty_omega = float(omegas.max())
    line = _Line(build_case(model, friction_coefficient, penalty_omega, settings), excitation_amplitude)
    n_done, refreshed = 0, 0
    if resume is not None:
        n_done, carried = unpack(resume)
        line.take_up(carried)
        refreshed = line.effort.iterations
    started = computing_time()
    for place in range(n_done, order.size):
        index = order[place]
        spent = line.effort.iterations
        line.fold = float("nan")
        line.effort.deadline = started + settings.time_limit
        message = ""
        try:
            outcome, refined = line.advance(float(omegas[index]), sweep)
        except OutOfTimeError:
            outcome, refined = Outcome.TIME_LIMIT, None
        except Exception as error:
            # one bad point is one bad point: the sweep goes on from the state before
            outcome, refined, message = Outcome.EXCEPTION, None, describe_error(error)
        now = computing_time()
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
                branch=line.branch,
                fold_frequency=line.fold / (2.0 * np.pi),
                message=message,
            ),
        )
        started = now
        if line.effort.iterations >= refreshed + REFRESH:
            progress = pack((place + 1, line.carried()))
            # with or without anybody who keeps it, so that all sweeps take the same way
            line.take_up(unpack(progress)[1])
            refreshed = line.effort.iterations
            if keep is not None:
                keep(progress)


class _Line:
    """The last state of a sweep and how it goes on.

    light: the last state with fewer harmonics, where its own are too many to follow a branch with. branch: folds jumped
    over so far. fold: rad/s, the fold at which the branch was left last, NaN if none.
    """

    def __init__(self, case: Case, excitation_amplitude: float) -> None:
        self.case = case
        self.excitation_amplitude = excitation_amplitude
        self.unworn = np.zeros(case.model.contact.n_contact)
        self.solver = JacobianSolver()
        self.effort = Effort()
        self.point: PathPoint | None = None
        self.light: Refined | None = None
        self.failure = Outcome.START_FAILED
        self.branch = 0
        self.fold = float("nan")

    def carried(self) -> dict[str, Any]:
        """What goes on from frequency to frequency, to be packed."""
        values = {name: getattr(self, name) for name in _CARRIED}
        light = None
        if self.light is not None:
            light = (self.light.case.resolution, self.light.point, self.light.estimate, self.light.accurate)
        return values | {"resolution": self.case.resolution, "iterations": self.effort.iterations, "light": light}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has carried so far, without its kept factorisation."""
        for name in _CARRIED:
            setattr(self, name, carried[name])
        self.case = self.case.at(carried["resolution"])
        self.effort.iterations = carried["iterations"]
        self.solver = JacobianSolver()
        self.light = None
        if carried["light"] is not None:
            resolution, *others = carried["light"]
            self.light = Refined(self.case.at(resolution), *others)

    def advance(self, omega: float, sweep: Sweep) -> tuple[Outcome, Refined | None]:
        """State at the next angular frequency, rad/s, with the harmonics that it needs."""
        if self.point is None:
            self._lead_in(omega, sweep)
        self.effort.limit = self.effort.iterations + MOST_ITERATIONS
        try:
            refined = self._lightly(omega)
            if refined is None:
                reached = self._next(omega) if self.point is not None else None
                reached = reached or self._first(omega)
                if reached is not None:
                    refined = refine(self.case, omega, self.excitation_amplitude, reached, self.effort)
                    if not refined.accurate and refined.case.model.contact.n_contact <= FEW_PAIRS:
                        refined = self._afresh(omega) or refined
        except np.linalg.LinAlgError:
            return Outcome.SINGULAR, None
        if refined is None:
            lost = (
                self.failure
                if self.point is None or self.failure in (Outcome.UNSTABLE, Outcome.ADRIFT)
                else Outcome.BRANCH_LOST
            )
            return lost, None
        if refined.case is not self.case:
            self.solver = JacobianSolver()
        self.case, self.point = refined.case, refined.point
        self.light = lighter(refined, omega, self.excitation_amplitude, LIGHT, self.effort) if self._costly() else None
        if not refined.accurate:
            return Outcome.INACCURATE, None
        joint = refined.case.joint(omega, self.excitation_amplitude)
        certificate = certify(joint, refined.point.evaluation)
        if not certificate.holds(self.case.settings.tolerance):
            return Outcome.CERTIFICATE_FAILED, None
        if doubles_period(refined.case, joint, refined.point.evaluation, self.effort):
            return Outcome.PERIOD_DOUBLED, None
        return Outcome.CONVERGED, refined

    def _costly(self) -> bool:
        n_rel = int(np.count_nonzero(self.case.model.contact.dofs >= 0))
        return n_rel * (2 * len(self.case.resolution.orders) + 1) > COSTLY

    def _lightly(self, omega: float) -> Refined | None:
        """State at the next frequency by way of states with few harmonics; None where there is none, or where this way
        is not sure: it jumps, or its end is not like the refined state.
        """
        if self.light is None:
            return None
        before = self.case, self.point, self.solver, self.branch, self.fold
        self.case, self.point, self.solver = self.light.case, self.light.point, JacobianSolver()
        reached = self._next(omega)
        if reached is not None and self.branch == before[3]:
            refined = refine(self.case, omega, self.excitation_amplitude, reached, self.effort)
            one, other = (point.evaluation.displacement_h[:, :, 1:3] for point in (reached, refined.point))
            if refined.accurate and np.linalg.norm(one - other) <= ALIKE * np.linalg.norm(other):
                return refined
        self.case, self.point, self.solver, self.branch, self.fold = before
        return None

    def _afresh(self, omega: float) -> Refined | None:
        """An accurate state from nothing with other harmonics, where those of the branch are a dead end."""
        before = self.case, self.solver
        for resolution in OTHER_STARTS[1:]:
            point = self._first_at(omega, resolution)
            refined = None
            if point is not None:
                refined = refine(self.case, omega, self.excitation_amplitude, point, self.effort)
            if refined is not None and refined.accurate:
                return refined
        self.case, self.solver = before
        return None

    def _lead_in(self, omega: float, sweep: Sweep) -> None:
        """A state outside the range; none where there is none, or where the structure is singular there."""
        for share in LEAD_INS:
            try:
                self.point = self._first(omega * (1.0 - share if sweep == "up" else 1.0 + share))
            except np.linalg.LinAlgError:
                continue
            if self.point is not None:
                return

    def _first(self, omega: float) -> PathPoint | None:
        """A state from nothing; where the harmonics of the line find none, with others."""
        others = OTHER_STARTS if self.case.settings.automatic else ()
        why = Outcome.START_FAILED
        for attempt, resolution in enumerate((self.case.resolution, *others)):
            found = self._first_at(omega, resolution)
            if found is not None:
                return found
            # the first attempt says why there is none
            why = self.failure if attempt == 0 else why
            if why is Outcome.STATIC_FAILED:
                break
        self.failure = why
        return None

    def _first_at(self, omega: float, resolution: Resolution) -> PathPoint | None:
        """A state from nothing with these harmonics and samples, as far as they are not fixed."""
        case, solver = self.case.at(allowed(resolution, self.case.settings)), JacobianSolver()
        self.failure, found = solve_first_state(
            case, omega, self.excitation_amplitude, self.unworn, solver, self.effort
        )
        if found is None:
            return None
        self.case, self.solver = case, solver
        return PathPoint(omega, found.evaluation, found.history)

    def _next(self, omega: float) -> PathPoint | None:
        assert self.point is not None
        tolerance = self.case.settings.tolerance
        start = self.point
        for _ in range(MOST_LANDINGS):
            if self.effort.exhausted:
                break
            point, arrived = follow_naturally(
                self._balance_at, start, omega, self.solver, tolerance, self.effort, fine=FINE * omega
            )
            if arrived and self._stays(point):
                return point
            # natural steps may have led onto an unstable part, nobody knows where: then the walk begins before them
            end = start if arrived else point
            arc = follow_arc(
                self._balance_at, end, omega, SPAN * omega, self.solver, tolerance, self.effort, self._stays
            )
            if arc.point is not None:
                self.branch += len(arc.jumps)
                self.fold = arc.jumps[0] if arc.jumps and np.isnan(self.fold) else self.fold
                return arc.point
            landed = self._settled(end, omega, arc.folds)
            if landed is None or landed.parameter == omega:
                return landed
            start = landed
        return None

    def _settled(self, end: PathPoint, omega: float, folds: tuple[float, ...]) -> PathPoint | None:
        """State that the structure settles to from the end of a branch, a little beyond it on the way to omega."""
        beyond = end.parameter + float(np.clip(omega - end.parameter, -FINE * omega, FINE * omega))
        joint, before = (self.case.joint(at, self.excitation_amplitude) for at in (beyond, end.parameter))
        self.failure, found = settle(
            self.case, joint, self.unworn, end.evaluation, before, end.history, self.solver, self.effort
        )
        if found is None:
            return None
        if vibration_change(end.evaluation, found.evaluation) > JUMP:
            self.branch += 1
            # an arc that broke off behind the fold has found it all the same
            farthest = max((end.parameter, *folds), key=lambda at: (at - end.parameter) * (omega - end.parameter))
            self.fold = farthest if np.isnan(self.fold) else self.fold
        return PathPoint(beyond, found.evaluation, found.history)

    def _stays(self, point: PathPoint) -> bool:
        balance = self._balance_at(point.parameter, point.evaluation.history)
        return is_stable(balance.linearise(point.evaluation), self.solver)

    def _balance_at(self, omega: float, history: FloatArray) -> Balance:
        joint = self.case.joint(omega, self.excitation_amplitude)
        return Balance(joint, history, self.unworn, np.zeros_like(self.unworn))
