"""What a wear history is wrong by: a second, coarser history beside it.

The companion starts from the state that the coarser sweep has come to and takes one step where the history takes two.
Both are the same computation of the same case, so that whatever makes an error grow on the way - pairs that stick
again, a resonance that passes, a branch that ends - makes their difference grow as well. That is what the sum of local
errors does not see. Euler steps are of first order: those of twice the length are wrong by twice as much, and the
difference is the error. Steps of second order are wrong by four times as much; where the wear rate has corners they
are of first order, so that the difference is taken as it is.

Explicit steps beyond what is stable for some pairs ratchet: with twice the length they may go the same wrong way. Their
companion takes implicit steps, whose error has the other sign.

The difference is that of the depths of all pairs, each by its magnitude: where the volumes of two histories cross their
profiles still differ.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.harmonic_levels import COSTLY, LIGHT, fewer, n_unknowns
from solver.harmonic_balance.converged import PathPoint
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import move_point
from solver.results.history import StartState
from solver.results.recorder import depth_within
from solver.settings import Scheme, SolverSettings
from solver.structure.joint import Case
from solver.wear.bdf2 import AdaptiveSteps
from solver.wear.trajectory import Trajectory

MOST_PARTS = 40
"""Steps, jumps included, in which the companion comes to the count of the history; else it begins there anew."""

SPARE = 500
"""Newton iterations that it may take beyond those of the history."""

AUTOMATIC = SolverSettings()
"""With these harmonics may be left out: what the companion misses is in the difference, too."""

_CARRIED = ("kept", "offset", "waiting", "followed", "start_share", "met")


class Companion:
    """The coarser history.

    kept (n_output, n_contact): its depths at the counts asked for, m, NaN where it has not come to. offset
    (n_contact,): m, difference of the depths at the last count at which it had to begin anew from the history itself.
    start_share: difference of the wear rates of both start states, pair by pair, over that of the joint: a later state
    that happens to be the same does not make the start better known. met: counts at which it has come to the history,
    and the difference of both there, as volume of all pairs, m3. waiting: steps of the history that it has still to
    follow. followed: harmonics and samples of the history for which its own were chosen.
    """

    def __init__(self, main: Trajectory, start: StartState, cycles: FloatArray) -> None:
        self.main = main
        coarse = replace(start, state=start.coarse or start.state)
        scheme: Scheme = "implicit" if main.scheme == "explicit" else main.scheme
        self.way = Trajectory(main.case, coarse, main.wear_coefficient, scheme)
        self.effort = self.way.effort
        self.way.bounded = False
        self.cycles = cycles
        self.kept = np.full((cycles.size, main.slip_work_error.size), np.nan)
        self.offset = np.zeros_like(main.slip_work_error)
        self.start_share = 0.0
        self.met: list[tuple[float, float]] = []
        self.waiting = 0
        self.followed = main.case.resolution
        self.steps: AdaptiveSteps | None = None

    def begin(self) -> None:
        """Take up its start state, behind that of the history."""
        # the limit of its steps is that of the history
        self.way.step_limit = self.main.step_limit
        self.way.take_start()
        self.kept[self.cycles == 0.0] = self.way.point.evaluation.wear_depth
        if self.main.scheme == "adaptive":
            self.steps = AdaptiveSteps(self.way, 1.0)
        if self.main.case.resolution != self.way.case.resolution and not self._take_case():
            self._begin_anew()
        if self.main.wears():
            area = self.main.joint.contact.area
            rate, other = self.main.rate() * area, self.way.rate() * area
            self.start_share = float(np.abs(rate - other).sum() / rate.sum())

    def carried(self) -> dict[str, Any]:
        """What goes on from step to step, to be packed."""
        own: dict[str, Any] = {name: getattr(self, name) for name in _CARRIED}
        return own | {"way": self.way.carried(), "steps": None if self.steps is None else self.steps.carried()}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has carried so far."""
        for name in _CARRIED:
            setattr(self, name, carried[name])
        self.way.take_up(carried["way"])
        if self.main.scheme == "adaptive":
            self.steps = AdaptiveSteps(self.way, 1.0)
            self.steps.take_up(carried["steps"])

    def follow(self, at_once: bool = False) -> None:
        """The history has taken a step. at_once: it is not known whether another one follows."""
        self.waiting += 1
        if self.waiting < 2 and not at_once:
            return
        self.waiting = 0
        self.effort.deadline = self.main.effort.deadline
        # one that has spent more has lost its way from jump to jump
        lost = self.effort.iterations > self.main.effort.iterations + SPARE
        lost = lost or (self.main.case.resolution != self.followed and not self._take_case())
        if lost or not self._catch_up():
            self._begin_anew()
        area, depth = self.main.joint.contact.area, self.main.point.evaluation.wear_depth
        differs = np.abs(self.offset + self.way.point.evaluation.wear_depth - depth)
        self.met.append((self.main.cycle, float(differs @ area)))

    def _catch_up(self) -> bool:
        """Steps to the count of the history; False where it does not come to it."""
        for _ in range(MOST_PARTS):
            if self.way.cycle >= self.main.cycle * (1.0 - 1e-12):
                return True
            if not self._step():
                return False
        return False

    def _step(self) -> bool:
        """One step to the count of the history, or as far as its branch goes and behind its end."""
        way = self.way
        length = self.main.cycle - way.cycle
        before = self._now()
        if self.steps is not None and self.steps.follow(length):
            self._keep(*before)
            return True
        arrived = way.advance(way.cycle + length)
        self._keep(*before)
        if self.steps is not None:
            self.steps.restart()
        if arrived:
            return True
        before = self._now()
        landed = way.jump(length)
        self._keep(*before)
        return landed

    def _now(self) -> tuple[float, FloatArray, FloatArray]:
        return self.way.cycle, self.way.point.evaluation.wear_depth, self.way.rate()

    def _keep(self, cycle: float, depth: FloatArray, rate: FloatArray) -> None:
        """Depths at the counts of a step that began with these."""
        way = self.way
        wanted = (self.cycles > cycle) & (self.cycles <= way.cycle)
        ends = (depth, rate), (way.point.evaluation.wear_depth, way.rate())
        fraction = (self.cycles[wanted] - cycle) / max(way.cycle - cycle, 1e-300)
        self.kept[wanted] = self.offset + depth_within(fraction, way.cycle - cycle, *ends, self.steps is not None)

    def _take_case(self) -> bool:
        """Go on with the harmonics and samples of the history, or with fewer where these are many; False where no
        state is found with them.
        """
        way, main = self.way, self.main
        resolution, n_rel = main.case.resolution, main.joint.component_index.size
        if n_unknowns(resolution, n_rel) > COSTLY:
            while n_unknowns(resolution, n_rel) > LIGHT and resolution.highest > 1:
                resolution = fewer(resolution, AUTOMATIC)
        self.followed = main.case.resolution
        case = main.case.at(resolution)
        return self._move(way.case, case, way.point)

    def _move(self, old: Case, case: Case, point: PathPoint) -> bool:
        """Take up a state of another case with the harmonics and samples of this one."""
        way = self.way
        joint = case.joint(self.main.joint.omega, self.main.joint.excitation_amplitude)
        moved = point if old is case else move_point(old, case, joint, point, way.effort)
        if moved is not None:
            way.case, way.joint, way.solver, way.last_change = case, joint, JacobianSolver(), None
            way.point = moved
        return moved is not None

    def _begin_anew(self) -> None:
        """Go on from the state of the history, with the difference that there is."""
        way, main = self.way, self.main
        wanted = (self.cycles > way.cycle) & (self.cycles <= main.cycle)
        self.offset = self.offset + way.point.evaluation.wear_depth - main.point.evaluation.wear_depth
        if not self._move(main.case, way.case, main.point):
            self._move(main.case, main.case, main.point)
        way.last_change, way.cycle = None, main.cycle
        self.kept[wanted] = main.point.evaluation.wear_depth + self.offset
        if self.steps is not None:
            self.steps.restart()
