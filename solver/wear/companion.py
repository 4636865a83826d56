"""What a wear history is wrong by: a second, coarser history beside it.

The companion starts from the state that the coarser sweep has come to and takes one step where the history takes two.
Both are the same computation of the same case, so that whatever makes an error grow - pairs that stick
again, a resonance that passes, a branch that ends - makes their difference grow as well. That is what the sum of local
errors does not see. Euler steps are of first order: those of twice the length are wrong by twice as much, and the
difference is the error. Steps of second order are wrong by four times as much; where the wear rate has corners they
are of first order, so that the difference is taken as it is.

Explicit steps beyond what is stable for some pairs ratchet: with twice the length they may be wrong in the same
direction. Their companion takes implicit steps, whose error has the other sign.

The difference is that of the depths of all pairs, each by its magnitude: where the volumes of two histories cross their
profiles still differ.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict

import numpy as np

from solver.accuracy.harmonic_levels import fewer, n_unknowns, room_for
from solver.accuracy.options import ACCURACY
from solver.harmonic_balance.converged import PathPoint
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import move_point
from solver.packing import attributes, set_attributes
from solver.results.history import StartState
from solver.results.recorder import depth_within
from solver.settings import Resolution, Scheme, SolverSettings
from solver.structure.joint import Case
from solver.wear.bdf2 import AdaptiveState, AdaptiveSteps
from solver.wear.options import WEAR
from solver.wear.trajectory import Trajectory, TrajectoryState

AUTOMATIC = SolverSettings()
"""With these harmonics may be left out: what the companion misses is in the difference, too."""


class Lag(TypedDict):
    """What goes on from step to step: attributes of `Companion`."""

    kept: FloatArray
    offset: FloatArray
    waiting: int
    followed: Resolution
    start_error: float
    spare: int
    met: list[tuple[float, float]]


class CompanionState(TypedDict):
    """The same with the state of its trajectory and of its adaptive steps."""

    lag: Lag
    trajectory: TrajectoryState
    steps: AdaptiveState | None


class Companion:
    """The coarser history.

    kept (n_output, n_contact): its depths at the counts asked for, m, NaN where it has not come to. offset
    (n_contact,): m, difference of the depths at the last count at which it had to begin anew from the history itself.
    start_error: difference of the wear rates of both start states, pair by pair, over that of the joint: a later state
    that happens to be the same does not make the start better known. met: counts at which it has come to the history,
    and the difference of both there, as volume of all pairs, m3. waiting: steps of the history that it has still to
    follow. spare: Newton iterations that it may have taken beyond those of the history. followed: harmonics and
    samples of the history for which its own were chosen.
    """

    def __init__(self, main: Trajectory, start: StartState, cycles: FloatArray) -> None:
        self.main = main
        coarse = replace(start, state=start.coarse or start.state)
        scheme: Scheme = "implicit" if main.scheme == "explicit" else main.scheme
        self.trajectory = Trajectory(main.case, coarse, main.wear_coefficient, scheme, wear_law=main.wear_law)
        self.effort = self.trajectory.effort
        self.trajectory.bounded = False
        self.cycles = cycles
        self.kept = np.full((cycles.size, main.slip_work_error.size), np.nan)
        self.offset = np.zeros_like(main.slip_work_error)
        self.start_error = 0.0
        self.met: list[tuple[float, float]] = []
        self.waiting = 0
        self.spare = WEAR.companion_spare
        self.followed = main.case.resolution
        self.steps: AdaptiveSteps | None = None

    def begin(self) -> None:
        """Take up its start state, behind that of the history."""
        # the limit of its steps is that of the history
        self.trajectory.step_limit = self.main.step_limit
        self.trajectory.take_start()
        self.kept[self.cycles == 0.0] = self.trajectory.point.evaluation.wear_depth
        if self.main.scheme == "adaptive":
            self.steps = AdaptiveSteps(self.trajectory, 1.0)
        if self.main.case.resolution != self.trajectory.case.resolution and not self._take_case():
            self._begin_anew()
        if self.main.wears():
            area = self.main.joint.contact.area
            rate, other = self.main.rate() * area, self.trajectory.rate() * area
            self.start_error = float(np.abs(rate - other).sum() / rate.sum())

    def state_dict(self) -> CompanionState:
        """What goes on from step to step, to be packed."""
        steps = None if self.steps is None else self.steps.state_dict()
        return {"lag": attributes(self, Lag), "trajectory": self.trajectory.state_dict(), "steps": steps}

    def load_state(self, state: CompanionState) -> None:
        """Go on from the state of another one."""
        set_attributes(self, state["lag"])
        self.trajectory.load_state(state["trajectory"])
        if state["steps"] is not None:
            self.steps = AdaptiveSteps(self.trajectory, 1.0)
            self.steps.load_state(state["steps"])

    def follow(self, at_once: bool = False) -> FloatArray | None:
        """The history has taken a step. at_once: it is not known whether another one follows.

        Its depths less those of the history (n_contact,), m, where it has come to it; None where it waits.
        """
        self.waiting += 1
        if self.waiting < 2 and not at_once:
            return None
        self.waiting = 0
        self.effort.deadline = self.main.effort.deadline
        # one that has spent more is lost between jumps; behind them it may be found again
        lost = self.effort.iterations > self.main.effort.iterations + self.spare
        if lost and self.spare < WEAR.companion_most_spare:
            self.spare = self.effort.iterations - self.main.effort.iterations + WEAR.companion_spare
        lost = lost or (self.main.case.resolution != self.followed and not self._take_case())
        if lost or not self._catch_up():
            self._begin_anew()
        area, depth = self.main.joint.contact.area, self.main.point.evaluation.wear_depth
        differs = self.offset + self.trajectory.point.evaluation.wear_depth - depth
        self.met.append((self.main.cycle, float(np.abs(differs) @ area)))
        return np.asarray(differs)

    def _catch_up(self) -> bool:
        """Steps to the count of the history; False where it does not come to it."""
        for _ in range(WEAR.companion_steps):
            if self.trajectory.cycle >= self.main.cycle * (1.0 - 1e-12):
                return True
            if not self._step():
                return False
        return False

    def _step(self) -> bool:
        """One step to the count of the history, or as far as its branch goes and behind its end."""
        trajectory = self.trajectory
        length = self.main.cycle - trajectory.cycle
        before = self._now()
        if self.steps is not None and self.steps.follow(length):
            self._keep(*before)
            return True
        arrived = trajectory.advance(trajectory.cycle + length)
        self._keep(*before)
        if self.steps is not None:
            self.steps.restart()
        if arrived:
            return True
        before = self._now()
        landed = trajectory.jump(length)
        self._keep(*before)
        return landed

    def _now(self) -> tuple[float, FloatArray, FloatArray]:
        return self.trajectory.cycle, self.trajectory.point.evaluation.wear_depth, self.trajectory.rate()

    def _keep(self, cycle: float, depth: FloatArray, rate: FloatArray) -> None:
        """Depths at the counts of a step that began with these."""
        trajectory = self.trajectory
        wanted = (self.cycles > cycle) & (self.cycles <= trajectory.cycle)
        ends = (depth, rate), (trajectory.point.evaluation.wear_depth, trajectory.rate())
        fraction = (self.cycles[wanted] - cycle) / max(trajectory.cycle - cycle, 1e-300)
        self.kept[wanted] = self.offset + depth_within(
            fraction, trajectory.cycle - cycle, *ends, self.steps is not None
        )

    def _take_case(self) -> bool:
        """Go on with the harmonics and samples of the history, or with fewer where these are many; False where no
        state is found with them.
        """
        trajectory, main = self.trajectory, self.main
        resolution, n_rel = main.case.resolution, main.joint.component_index.size
        if n_unknowns(resolution, n_rel) > room_for(ACCURACY.costly_unknowns, n_rel):
            most = room_for(ACCURACY.coarse_unknowns, n_rel)
            while n_unknowns(resolution, n_rel) > most and resolution.highest > 1:
                resolution = fewer(resolution, AUTOMATIC)
        self.followed = main.case.resolution
        case = main.case.at(resolution)
        return self._move(trajectory.case, case, trajectory.point)

    def _move(self, old: Case, case: Case, point: PathPoint) -> bool:
        """Take up a state of another case with the harmonics and samples of this one."""
        trajectory = self.trajectory
        joint = case.joint(self.main.joint.omega, self.main.joint.excitation_amplitude)
        moved = point if old is case else move_point(old, case, joint, point, trajectory.effort)
        if moved is not None:
            trajectory.case, trajectory.joint, trajectory.solver, trajectory.last_change = (
                case,
                joint,
                JacobianSolver(),
                None,
            )
            trajectory.point = moved
        return moved is not None

    def _begin_anew(self) -> None:
        """Go on from the state of the history, with the difference that there is."""
        trajectory, main = self.trajectory, self.main
        wanted = (self.cycles > trajectory.cycle) & (self.cycles <= main.cycle)
        self.offset = self.offset + trajectory.point.evaluation.wear_depth - main.point.evaluation.wear_depth
        if not self._move(main.case, trajectory.case, main.point):
            self._move(main.case, main.case, main.point)
        trajectory.last_change, trajectory.cycle = None, main.cycle
        self.kept[wanted] = main.point.evaluation.wear_depth + self.offset
        if self.steps is not None:
            self.steps.restart()
