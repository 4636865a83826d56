"""The points of a nonlinear mode at given amplitudes, one by one."""

from __future__ import annotations

import math
from collections.abc import Iterator
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
        way.budget.deadline = computing_time() + settings.time_limit
        try:
            yield index, way.point(float(amplitudes[index]))
        except OutOfTimeError:
            yield index, ModePoint(Outcome.TIME_LIMIT)
        except np.linalg.LinAlgError:
            yield index, ModePoint(Outcome.SINGULAR)
        except Exception as error:
            # an error spoils one point only
            yield index, ModePoint(Outcome.EXCEPTION, describe_error(error))


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

    def order(self, amplitudes: FloatArray) -> list[int]:
        """Indices of the amplitudes in the order in which the sweeps pass them."""
        values = [float(amplitude) for amplitude in amplitudes]
        if self._direction == "up":
            return sorted(range(len(values)), key=lambda index: values[index])
        return sorted(range(len(values)), key=lambda index: (top_of(values[index]), -values[index]))

    def point(self, amplitude: float) -> ModePoint:
        """The point at the next amplitude."""
        if self._rest is None:
            self._rest = find_rest(*self._asked, self.budget)
        if isinstance(self._rest, tuple):
            return ModePoint(*self._rest)
        if self._direction == "up" and not self._rest.glued:
            said = 'the joint has no such mode while its pairs stick: give direction = "down", from large amplitudes'
            return ModePoint(Outcome.START_FAILED, said)
        if self._direction == "up" and amplitude < first_amplitude(self._rest):
            nodes = first_node(self._rest, amplitude, self.budget)
            return self._failed() if nodes is None else judge_point(nodes.problem, nodes.here, None, self.budget)
        sweep = self._raised() if self._direction == "up" else self._lowered(top_of(amplitude))
        if sweep is None:
            return self._failed()
        sweep.advance_to(amplitude)
        return solve_point(sweep, amplitude, self.budget)

    def _failed(self) -> ModePoint:
        return ModePoint(Outcome.START_FAILED, "the mode was not found at its first amplitude")

    def _raised(self) -> AmplitudeSweep | None:
        """The sweep with rising amplitude; None where it does not begin."""
        assert isinstance(self._rest, Rest)
        if self._up is None:
            nodes = first_node(self._rest, first_amplitude(self._rest), self.budget)
            self._up = None if nodes is None else AmplitudeSweep(nodes, 1.0, self.budget)
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
                nodes = sliding_node(self._rest, top, self.budget)
            elif (raised := self._raised()) is not None:
                raised.advance_to(top)
                nodes = Nodes(raised.nodes.problem, (raised.ahead or raised.nodes.here,))
            if nodes is None:
                return None
            self._down = top, AmplitudeSweep(nodes, -1.0, self.budget)
        return self._down[1]
