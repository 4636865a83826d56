"""The course of a joint over its missions: what is kept of each step, read at any number of missions."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.missions.block_run import BlockRun
from solver.model import ComplexArray, FloatArray
from solver.packing import packable
from solver.results.history import StartState
from solver.wear.solutions import Like
from solver.wear.state import Failure


@packable
@dataclass(frozen=True)
class Responses:
    """Responses (n_block, n_response) at begin and end of the blocks of one mission.

    mission: missions flown before.
    response_begin, response_end: complex first harmonic, m.
    response_peak_begin, response_peak_end: largest magnitude over a period, m.
    response_error (n_block,): estimated relative error of these values.
    """

    mission: int
    response_begin: ComplexArray
    response_end: ComplexArray
    response_peak_begin: FloatArray
    response_peak_end: FloatArray
    response_error: FloatArray


@packable
@dataclass(frozen=True)
class MissionNode:
    """The end of a step over missions.

    mission: missions flown so far.
    growth (n_block, n_contact): depth worn by each block so far, m.
    half: number of missions within the step, and depth worn by each block there; None for a step of one mission.
    responses: of some missions of the step, in order.
    likes: of each block, for the reference solution.
    error (n_contact,): error of the step in two parts by the order of the blocks, m; None where there is none.
    carried: state at the end of the last block, for a first block that continues; of the last node only.
    """

    mission: int
    growth: FloatArray
    half: tuple[int, FloatArray] | None = None
    responses: tuple[Responses, ...] = ()
    likes: tuple[Like, ...] = ()
    error: FloatArray | None = None
    carried: StartState | None = None


@packable
@dataclass(frozen=True)
class MissionCourse:
    """Steps over the missions so far.

    nodes: ends of the steps, the start first.
    failure: reason of the end; None before the end.
    start_rates (n_block, n_contact): wear rates at the starts of the blocks of the first mission, m per cycle.
    start_errors (n_block,): estimated relative errors of these rates.
    inaccurate (n_block,): largest error of a state of each block above rtol, 0 where there is none.
    sweep_rate (n_block,): largest `BlockRun.sweep_rate` of each block.
    held, cut_off: number of missions from which on a block has `BlockRun.held`, `BlockRun.cut_off`; NaN if never.
    iterations: Newton iterations.
    """

    nodes: tuple[MissionNode, ...]
    failure: Failure | None
    start_rates: FloatArray
    start_errors: FloatArray
    inaccurate: FloatArray
    sweep_rate: FloatArray
    held: float = float("nan")
    cut_off: float = float("nan")
    iterations: int = 0

    @property
    def ends(self) -> FloatArray:
        """Missions (n_node,) at the ends of the steps, the start first."""
        return np.array([node.mission for node in self.nodes], np.float64)

    def growth_at(self, missions: FloatArray) -> FloatArray:
        """Depth worn by each block (n, n_block, n_contact), m, at numbers of missions; NaN beyond the last step."""
        ends, found = self.ends, np.full((missions.size, *self.nodes[0].growth.shape), np.nan)
        for row in np.flatnonzero(missions <= ends[-1]):
            place = max(int(np.searchsorted(ends, missions[row], "left")), 1)
            before, after = self.nodes[max(min(place, len(ends) - 1) - 1, 0)], self.nodes[min(place, len(ends) - 1)]
            found[row] = growth_within(before, after, float(missions[row]))
        return found

    def responses_at(self, missions: FloatArray) -> dict[str, NDArray[Any]]:
        """Values of `Responses` (n, n_block, ...) in the missions that end at some numbers, by name.

        They are linear between the missions whose responses are known. At the number 0 those of the first mission.
        """
        known = [of for node in self.nodes for of in node.responses]
        names = [each.name for each in fields(Responses)[1:]]
        at, reached = np.array([of.mission for of in known], np.float64), missions <= self.ends[-1]
        wanted = np.clip(missions - 1.0, 0.0, None)
        place = np.clip(np.searchsorted(at, wanted, "right") - 1, 0, len(at) - 1)
        beyond = np.minimum(place + 1, len(at) - 1)
        width = at[beyond] - at[place]
        share = np.clip(np.divide(wanted - at[place], width, out=np.zeros_like(wanted), where=width > 0.0), 0.0, 1.0)
        read = {}
        for name in names:
            values = np.array([getattr(of, name) for of in known])
            first, weights = values[place], share.reshape(-1, *[1] * (values.ndim - 1))
            rows = first + weights * (values[beyond] - first)
            rows[~reached] = np.nan
            read[name] = rows
        return read


def growth_within(before: MissionNode, after: MissionNode, mission: float) -> FloatArray:
    """Depth worn by each block (n_block, n_contact), m, within a step.

    A parabola through start, half and end. The growth up to the half is taken as at least a quarter and at most three
    quarters of its straight line, so that the depth never falls.
    """
    length = after.mission - before.mission
    share = (mission - before.mission) / length if length else 1.0
    grown = after.growth - before.growth
    if after.half is None:
        return np.asarray(before.growth + share * grown)
    middle = (after.half[0] - before.mission) / length
    # a parabola s + b s (1 - s) is monotone for |b| <= 1
    bend = np.clip(_ratio(after.half[1] - before.growth, grown) - middle, -middle * (1 - middle), middle * (1 - middle))
    return np.asarray(before.growth + (share + bend / (middle * (1 - middle)) * share * (1 - share)) * grown)


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)


def responses_of(first: int, runs: tuple[BlockRun, ...]) -> tuple[Responses, ...]:
    """Responses of the first and the last mission of a number of missions flown at once.

    first: missions flown before.
    """
    n = runs[0].missions[-1]
    found = []
    for mission in dict.fromkeys((0, n - 1)):
        begin = [0 if run.begins_alike else run.missions.index(mission) for run in runs]
        end = [run.missions.index(mission + 1) for run in runs]
        error = [run.response_error[[one, other]].max() for run, one, other in zip(runs, begin, end, strict=True)]
        found.append(
            Responses(
                first + mission,
                np.array([run.response[at] for run, at in zip(runs, begin, strict=True)]),
                np.array([run.response[at] for run, at in zip(runs, end, strict=True)]),
                np.array([run.peak[at] for run, at in zip(runs, begin, strict=True)]),
                np.array([run.peak[at] for run, at in zip(runs, end, strict=True)]),
                np.array(error),
            )
        )
    return tuple(found)
