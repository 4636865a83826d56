"""The points of a nonlinear mode at given amplitudes, one by one."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np

from solver.clock import computing_time
from solver.model import FloatArray, ReducedModel
from solver.modes.amplitude_sweep import AmplitudeSweep, Nodes
from solver.modes.mode_point import ModePoint, judge_point, solve_point
from solver.modes.mode_start import Rest, find_rest, first_amplitude, first_node, sliding_node
from solver.modes.options import MODES
from solver.newton.solve_balance import Budget, OutOfTimeError
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
        way.budget.deadline = began + settings.time_limit
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


class _Way:
    """The sweeps to the points: one with rising amplitude, and one with falling amplitude from each `top_of`."""

    def __init__(
        self,
        model: ReducedModel,
        friction_coefficient: float | FloatArray | None,
        number: int,
        direction: Direction,
        settings: SolverSettings,
    ) -> None:
        self.budget = Budget()
        self._direction = direction
        self._asked = (model, friction_coefficient, number, settings)
        self._rest: Rest | tuple[Outcome, str] | None = None
        self._up: AmplitudeSweep | None = None
        self._down: tuple[float, AmplitudeSweep] | None = None
        self._spent: Counter[str] = Counter()

    @property
    def iterations(self) -> int:
        """Newton iterations of the way to the last point and of this point, those of other points left out."""
        return self._spent.total()

    @contextmanager
    def _counted(self, part: str) -> Iterator[None]:
        """Counts the iterations of a part of the way."""
        before = self.budget.iterations
        try:
            yield
        finally:
            self._spent[part] += self.budget.iterations - before

    def order(self, amplitudes: FloatArray) -> list[int]:
        """Indices of the amplitudes in the order in which the sweeps pass them."""
        values = [float(amplitude) for amplitude in amplitudes]
        if self._direction == "up":
            return sorted(range(len(values)), key=lambda index: values[index])
        return sorted(range(len(values)), key=lambda index: (top_of(values[index]), -values[index]))

    def point(self, amplitude: float) -> ModePoint:
        """The point at the next amplitude."""
        self._spent["point"] = 0
        if self._rest is None:
            with self._counted("rest"):
                self._rest = find_rest(*self._asked, self.budget)
        if isinstance(self._rest, tuple):
            return ModePoint(*self._rest)
        if self._direction == "up" and not self._rest.glued:
            said = 'the joint has no such mode while its pairs stick: give direction = "down", from large amplitudes'
            return ModePoint(Outcome.START_FAILED, said)
        if self._direction == "up" and amplitude < first_amplitude(self._rest):
            with self._counted("point"):
                nodes = first_node(self._rest, amplitude, self.budget)
                return self._failed() if nodes is None else judge_point(nodes.problem, nodes.here, None, self.budget)
        sweep = self._sweep_to(amplitude)
        if sweep is None:
            return self._failed()
        with self._counted("point"):
            return solve_point(sweep, amplitude, self.budget)

    def _sweep_to(self, amplitude: float) -> AmplitudeSweep | None:
        """The sweep at the node before an amplitude; None where it does not begin."""
        if self._direction == "up":
            return self._raised_to(amplitude)
        top = top_of(amplitude)
        if self._down is None or self._down[0] != top:
            self._spent["lowered"] = 0
        sweep = self._lowered(top)
        if sweep is not None:
            with self._counted("lowered"):
                sweep.advance_to(amplitude)
        return sweep

    def _failed(self) -> ModePoint:
        return ModePoint(Outcome.START_FAILED, "the mode was not found at its first amplitude")

    def _raised_to(self, amplitude: float) -> AmplitudeSweep | None:
        """The sweep with rising amplitude at the node before an amplitude; None where it does not begin."""
        assert isinstance(self._rest, Rest)
        with self._counted("raised"):
            if self._up is None:
                nodes = first_node(self._rest, first_amplitude(self._rest), self.budget)
                self._up = None if nodes is None else AmplitudeSweep(nodes, 1.0, self.budget)
            if self._up is not None:
                self._up.advance_to(amplitude)
        return self._up

    def _lowered(self, top: float) -> AmplitudeSweep | None:
        """The sweep with falling amplitude from a top, m sqrt(kg); None where it does not begin.

        The mode is raised to the top, or as far as it goes. A joint that has its mode only while it slides begins at
        the top.
        """
        assert isinstance(self._rest, Rest)
        if self._down is None or self._down[0] != top:
            nodes: Nodes | None = None
            if not self._rest.glued:
                with self._counted("lowered"):
                    nodes = sliding_node(self._rest, top, self.budget)
            elif (raised := self._raised_to(top)) is not None:
                nodes = Nodes(raised.nodes.problem, (raised.ahead or raised.nodes.here,))
            if nodes is None:
                return None
            with self._counted("lowered"):
                self._down = top, AmplitudeSweep(nodes, -1.0, self.budget)
        return self._down[1]
