"""One step over many missions: operator splitting, extrapolated to missions that are flown one by one.

A mission maps the depth before to the depth after: its blocks wear one after the other. Many missions n at once are
approximated by the same blocks, each with n times its cycles. Each block is integrated by its own stable scheme, so
that the length of the step is limited by its accuracy only. The error against n missions one by one comes from the order of
the blocks, which do not commute: a step of n missions misses n (n - 1) times a constant, to leading order. For n = 1
there is no error.

So a step is flown twice, at once (A) and in two parts (B) of n_1 + n_2 = n missions, and extrapolated,

    W = W_B + (W_B - W_A) e_B / (e_A - e_B),      e_A = n (n - 1),  e_B = n_1 (n_1 - 1) + n_2 (n_2 - 1),

pair by pair and for each block: second order in n, and exactly the missions one by one for n = 1 and n = 2 (Hairer,
Lubich, Wanner, Geometric Numerical Integration, II.4 and III.5, for splitting and its order).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.missions.block_run import BlockRun
from solver.missions.blocks import Mission
from solver.missions.course import MissionNode, responses_of
from solver.model import FloatArray
from solver.results.history import StartState
from solver.wear.state import Failure

Fly = Callable[[int, FloatArray, StartState | None, tuple[int, ...]], BlockRun]
"""Flies a block: its place, the depth before (n_contact,), m, the state that it continues, and the missions to read."""


@dataclass(frozen=True)
class Flight:
    """The blocks of a mission in order, each for a number of missions at once; the last one may have failed."""

    runs: tuple[BlockRun, ...]

    @property
    def failure(self) -> Failure | None:
        """Reason why it was not flown to its end."""
        return None if self.runs[-1].completed else self.runs[-1].failure

    @property
    def growth(self) -> FloatArray:
        """Depth worn by each block (n_block, n_contact), m."""
        return np.array([run.growth[-1] for run in self.runs])


@dataclass(frozen=True)
class Step:
    """A step that was flown.

    node: its end.
    runs: of all blocks, in order.
    order_error: change of the worn volume by the order of the blocks, between the step at once and in two parts, over
        the worn volume; 0 for a single mission.
    """

    node: MissionNode
    runs: tuple[BlockRun, ...]
    order_error: float


def missions_read(length: int, half: int = 0) -> tuple[int, ...]:
    """Missions at which a block is read that is flown for `length` missions at once, of which `half` may be taken."""
    return tuple(sorted({0, 1, length - 1, length, *({half - 1, half} if half else ())} - {-1}))


def fly(
    mission: Mission, node: MissionNode, length: int, run: Fly, half: int = 0, first: BlockRun | None = None
) -> Flight:
    """Fly the blocks from the end of a step, each for `length` missions at once; first: the first block, if known."""
    depth, carried, runs = node.growth.sum(axis=0), node.carried, []
    for place in range(len(mission.blocks)):
        known = first if place == 0 else None
        runs.append(known or run(place, depth, carried, missions_read(length, half)))
        if not runs[-1].completed:
            break
        depth, carried = depth + runs[-1].growth[-1], runs[-1].last
    return Flight(tuple(runs))


def after(node: MissionNode, flight: Flight) -> MissionNode:
    """The node behind a flight that was flown at once."""
    runs = flight.runs
    mission = node.mission + runs[0].missions[-1]
    return MissionNode(
        mission, node.growth + flight.growth, None, responses_of(node.mission, runs), carried=runs[-1].last
    )


def take_step(mission: Mission, node: MissionNode, parts: tuple[int, ...], run: Fly) -> Step | Failure:
    """A step over one mission, or over missions in two parts.

    Parameters
    ----------
    mission
        The blocks.
    node
        Start of the step.
    parts
        Missions of the parts: (n,) without, (n_1, n_2) with extrapolation.
    run
        Flies a block.
    """
    if len(parts) == 1:
        flight = fly(mission, node, parts[0], run)
        return flight.failure or Step(_with_likes(after(node, flight), flight), flight.runs, 0.0)
    whole = fly(mission, node, sum(parts), run, half=parts[0])
    if whole.failure is not None:
        return whole.failure
    # both begin with one block from one state
    shared = None if mission.continued_by(0) else whole.runs[0].up_to(parts[0])
    one = fly(mission, node, parts[0], run, first=shared)
    if one.failure is not None:
        return one.failure
    middle = after(node, one)
    other = fly(mission, middle, parts[1], run)
    if other.failure is not None:
        return other.failure
    end, runs = after(middle, other), (*whole.runs, *one.runs, *other.runs)
    return _extrapolated(mission, (node, middle, end), whole, Step(_with_likes(end, one), runs, 0.0))


def _with_likes(node: MissionNode, flight: Flight) -> MissionNode:
    likes = tuple(run.like for run in flight.runs if run.like is not None)
    return MissionNode(node.mission, node.growth, node.half, node.responses, likes, node.error, node.carried)


def _extrapolated(
    mission: Mission, nodes: tuple[MissionNode, MissionNode, MissionNode], whole: Flight, step: Step
) -> Step:
    """The step in two parts (start, middle, end), extrapolated with the step at once."""
    start, middle, end = nodes
    errors = [n * (n - 1) for n in (middle.mission - start.mission, end.mission - middle.mission)]
    missed, at_once = sum(errors), (end.mission - start.mission) * (end.mission - start.mission - 1)
    grown = end.growth - start.growth
    apart = grown - whole.growth
    # no pair grows by extrapolation alone, or loses wear
    full = np.maximum(grown + missed / (at_once - missed) * apart, 0.0)
    to_half = np.clip(middle.growth - start.growth + errors[0] / (at_once - missed) * apart, 0.0, full)
    volume = float(grown.sum(axis=0) @ mission.area)
    changed = float(np.abs(apart.sum(axis=0)) @ mission.area)
    order_error = changed / volume if volume > 0.0 else 0.0
    node = MissionNode(
        end.mission,
        start.growth + full,
        (middle.mission, start.growth + to_half),
        (*middle.responses, *end.responses),
        step.node.likes,
        # the extrapolation takes the leading error away: what remains is its square, relatively
        order_error**2 * volume if missed else 0.0,
        end.carried,
    )
    return Step(node, step.runs, order_error)
