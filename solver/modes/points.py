"""The points of a nonlinear mode at given amplitudes, one by one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from solver.clock import computing_time
from solver.loading_history.sweep import Sweep
from solver.model import FloatArray, ReducedModel
from solver.modes.mode_balance import ModeState
from solver.modes.mode_path import ModePath
from solver.modes.mode_point import ModePoint, describe_loss, judge_point, problem_of, solve_point
from solver.modes.mode_start import Rest, find_rest, first_amplitude, first_node, sliding_node
from solver.modes.options import MODES
from solver.newton.run import Budget, OutOfTimeError, Run
from solver.outcome import Outcome, describe_error
from solver.settings import SolverSettings

Direction = Literal["up", "down"]


def follow_mode(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    amplitudes: FloatArray,
    number: int,
    direction: Direction,
    settings: SolverSettings,
) -> Iterator[tuple[int, ModePoint]]:
    """Points of a nonlinear mode: index and point, one by one, in the order of the way to them.

    Parameters
    ----------
    model, friction_coefficient
        The model, and the friction coefficient of all pairs or of each pair.
    amplitudes
        Modal amplitudes, m sqrt(kg), in any order.
    number, direction
        As in `solver.backbone`.
    settings
        Harmonics, samples, tolerances. The limit of time holds for each point with the way from the point before.
    """
    way = _Way(model, friction_coefficient, number, direction, settings)
    for index in way.order(amplitudes):
        began = computing_time()
        way.run.budget.deadline = began + settings.time_limit
        try:
            point = way.point(float(amplitudes[index]))
        except OutOfTimeError:
            point = ModePoint(Outcome.TIME_LIMIT)
        except np.linalg.LinAlgError:
            point = ModePoint(Outcome.SINGULAR)
        except Exception as error:
            # an error spoils one point only
            point = ModePoint(Outcome.EXCEPTION, describe_error(error))
        yield index, replace(point, newton_iterations=way.iterations, run_time=computing_time() - began)


def top_of(amplitude: float) -> float:
    """Amplitude, m sqrt(kg), from which the amplitude of a point is lowered."""
    return float(MODES.top_base ** math.ceil(math.log(2.0 * amplitude, MODES.top_base)))


@dataclass
class _Lowered:
    """A sweep with falling amplitude.

    - first: where it begins, with the harmonics of `path`.
    - raised: Newton iterations of the way to there.
    - sweep: the sweep, from its first point on.
    """

    path: ModePath
    first: ModeState
    raised: int
    sweep: Sweep[ModeState] | None = None


class _Way:
    """The sweeps to the points: one with rising amplitude, and one with falling amplitude from each `top_of`.

    - iterations: Newton iterations of the way to the last point and of this point, those of other points left out.
    """

    def __init__(
        self,
        model: ReducedModel,
        friction_coefficient: float | FloatArray | None,
        number: int,
        direction: Direction,
        settings: SolverSettings,
    ) -> None:
        self.run, self.iterations = Run(settings.tolerance), 0
        self._direction = direction
        self._asked = (model, friction_coefficient, number, settings)
        self._rest: Rest | tuple[Outcome, str] | None = None
        self._to_rest = self._to_first = 0
        self._up: Sweep[ModeState] | None = None
        self._tops: list[float] = []
        self._down: dict[float, _Lowered] = {}

    def order(self, amplitudes: FloatArray) -> list[int]:
        """Indices of the amplitudes in the order in which the sweeps pass them."""
        values = [float(amplitude) for amplitude in amplitudes]
        self._tops = sorted({top_of(value) for value in values})
        return sorted(range(len(values)), key=lambda index: values[index], reverse=self._direction == "down")

    def point(self, amplitude: float) -> ModePoint:
        """The point at the next amplitude."""
        before = self.run.budget.iterations
        if self._rest is None:
            self._rest = find_rest(*self._asked, self.run)
            self._to_rest = self.run.budget.iterations - before
        self.iterations = self._to_rest
        if isinstance(self._rest, tuple):
            return ModePoint(*self._rest)
        if self._direction == "up" and not self._rest.glued:
            said = 'the joint has no such mode while its pairs stick: give sweep = "down", from large amplitudes'
            return ModePoint(Outcome.START_FAILED, said)
        first = self._direction == "up" and amplitude < first_amplitude(self._rest)
        sweep = None if first else self._sweep_to(self._rest, amplitude)
        if sweep is None and not first:
            return self._failed()
        if self._direction == "down" and amplitude > self._down[top_of(amplitude)].first.parameter:
            # the mode could not be raised to the amplitude from which it is lowered
            assert self._up is not None
            return ModePoint(Outcome.BRANCH_LOST, describe_loss(self._up))
        before = self.run.budget.iterations
        try:
            if sweep is not None:
                return solve_point(sweep, amplitude, self.run)
            node = first_node(self._rest, amplitude, self.run)
            return self._failed() if node is None else judge_point(self._rest.problem, node, None, self.run)
        finally:
            self.iterations += self.run.budget.iterations - before
            self.iterations += 0 if sweep is None else sweep.n_iterations

    def _failed(self) -> ModePoint:
        return ModePoint(Outcome.START_FAILED, "the mode was not found at its first amplitude")

    def _sweep_to(self, rest: Rest, amplitude: float) -> Sweep[ModeState] | None:
        """The sweep at the node before an amplitude; None where it does not begin."""
        if self._direction == "up":
            raised = self._raised_to(rest, amplitude)
            self.iterations += self._to_first
            return raised
        down = self._lowered(rest, top_of(amplitude))
        if down is None:
            return None
        down.sweep = down.sweep or self._begun(down.path, down.first, -1.0)
        down.sweep.set_deadline(self.run.budget.deadline)
        down.sweep.advance_to(amplitude)
        self.iterations += down.raised
        return down.sweep

    def _raised_to(self, rest: Rest, amplitude: float) -> Sweep[ModeState] | None:
        """The sweep with rising amplitude at the node before an amplitude; None where it does not begin."""
        if self._up is None:
            before = self.run.budget.iterations
            node = first_node(rest, first_amplitude(rest), self.run)
            self._to_first = self.run.budget.iterations - before
            self._up = None if node is None else self._begun(ModePath(rest.problem), node, 1.0)
        if self._up is not None:
            self._up.set_deadline(self.run.budget.deadline)
            self._up.advance_to(amplitude)
        return self._up

    def _begun(self, path: ModePath, first: ModeState, direction: float) -> Sweep[ModeState]:
        """A sweep at its first node, with counts of its own: its nodes do not depend on the points asked for."""
        budget = Budget(deadline=self.run.budget.deadline)
        sweep: Sweep[ModeState] = Sweep(path, direction, budget, with_reference=True)
        sweep.begin(path, first)
        return sweep

    def _lowered(self, rest: Rest, wanted: float) -> _Lowered | None:
        """The sweep with falling amplitude from a top, m sqrt(kg); None where it does not begin.

        The mode is raised to all tops first, or as far as it goes. A joint that has its mode only while it slides
        begins at the top.
        """
        for top in self._tops:
            if top in self._down:
                continue
            first, path, before = None, ModePath(rest.problem), self.run.budget.iterations
            if not rest.glued:
                first = sliding_node(rest, top, self.run)
            elif (raised := self._raised_to(rest, top)) is not None:
                path = ModePath(problem_of(raised))
                first = raised.last if raised.ahead is None else raised.ahead.state
            if first is not None:
                spent = self.run.budget.iterations - before
                if self._up is not None and rest.glued:
                    spent = self._to_first + self._up.n_iterations
                self._down[top] = _Lowered(path, first, spent)
        return self._down.get(wanted)
