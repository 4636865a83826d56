"""One step over many missions: operator splitting, corrected for the order of the blocks.

A mission maps the depth before to the depth after: its blocks wear one after the other. Many missions n at once are
approximated by the same blocks, each with n times its cycles. Each block is integrated by its own stable scheme, so
that the length of the step is limited by its accuracy only. The error against n missions one by one comes from the
order of the blocks, which do not commute. To leading order it is a constant times n (n - 1), and with the blocks in
reverse order the same constant times -n (n + 1) (Hairer, Lubich, Wanner, Geometric Numerical Integration, III.5). For
one mission there is no error.

So a step is flown twice, at once in reverse order (A) and in two parts in order (B), n_1 + n_2 = n missions. Both give

    W = W_B + (W_B - W_A) e_B / (e_A - e_B),      e_A = -n (n + 1),  e_B = n_1 (n_1 - 1) + n_2 (n_2 - 1),

pair by pair and for each block: of second order in n, and exactly the missions one by one for n = 2. W is a mean of
both, with weights of at least 1/3 and 1/2: no wear falls. Where the wear of a step adapts the pressures fully, W_A and
W_B have those of the first and of the last block, and their difference shows how much they differ.

A mission of which some blocks continue others, but not all, cannot be flown in reverse: there A is in order, too, with
e_A = n (n - 1).
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
    """The blocks of a mission, in order of the mission, each flown for a number of missions at once."""

    runs: tuple[BlockRun, ...]

    @property
    def growth(self) -> FloatArray:
        """Depth worn by each block (n_block, n_contact), m."""
        return np.array([run.growth[-1] for run in self.runs])


@dataclass(frozen=True)
class Step:
    """A step that was flown.

    node: its end.
    runs: of all blocks, in order.
    order_error: error of the step in two parts by the order of the blocks, pair by pair, over its worn volume; 0 for a
        single mission.
    """

    node: MissionNode
    runs: tuple[BlockRun, ...]
    order_error: float


def missions_read(length: int) -> tuple[int, ...]:
    """Missions at which a block is read that is flown for `length` missions at once."""
    return tuple(sorted({0, 1, length - 1, length}))


def fly(mission: Mission, node: MissionNode, length: int, run: Fly, *, reverse: bool = False) -> Flight | Failure:
    """Fly the blocks from the end of a step, each for `length` missions at once."""
    depth, carried = node.growth.sum(axis=0), node.carried
    runs: dict[int, BlockRun] = {}
    for place in range(len(mission.blocks))[:: -1 if reverse else 1]:
        found = run(place, depth, carried, missions_read(length))
        if not found.completed:
            return found.failure
        runs[place] = found
        depth, carried = depth + found.growth[-1], found.last
    return Flight(tuple(runs[place] for place in sorted(runs)))


def after(node: MissionNode, flight: Flight) -> MissionNode:
    """The node behind missions that were flown at once, in order."""
    runs = flight.runs
    likes = tuple(run.like for run in runs if run.like is not None)
    responses = responses_of(node.mission, runs)
    mission = node.mission + runs[0].missions[-1]
    return MissionNode(mission, node.growth + flight.growth, None, responses, likes, carried=runs[-1].last)


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
    n = sum(parts)
    if len(parts) == 1:
        flight = fly(mission, node, n, run)
        return flight if isinstance(flight, Failure) else Step(after(node, flight), flight.runs, 0.0)
    whole = fly(mission, node, n, run, reverse=mission.reversible)
    if isinstance(whole, Failure):
        return whole
    one = fly(mission, node, parts[0], run)
    if isinstance(one, Failure):
        return one
    middle = after(node, one)
    other = fly(mission, middle, parts[1], run)
    if isinstance(other, Failure):
        return other
    corrected, order_error = _corrected(mission, (node, middle, after(middle, other)), whole)
    return Step(corrected, (*whole.runs, *one.runs, *other.runs), order_error)


def _corrected(
    mission: Mission, nodes: tuple[MissionNode, MissionNode, MissionNode], whole: Flight
) -> tuple[MissionNode, float]:
    """The end of a step in two parts (start, middle, end) with the step at once, and its `order_error`."""
    start, middle, end = nodes
    n = end.mission - start.mission
    parts = middle.mission - start.mission, end.mission - middle.mission
    missed = [of * (of - 1) for of in parts]
    scale = 1.0 / ((-n * (n + 1) if mission.reversible else n * (n - 1)) - sum(missed))
    grown = end.growth - start.growth
    apart = grown - whole.growth
    # in order only, a correction may be larger than the wear: it is limited, and the step is refused
    full = np.maximum(grown + sum(missed) * scale * apart, 0.0)
    to_half = np.clip(middle.growth - start.growth + missed[0] * scale * apart, 0.0, full)
    # block by block: where blocks adapt the pressures against each other, their sum is the same in any order
    order = abs(scale) * sum(of * of for of in parts) * np.abs(apart).sum(axis=0)
    node = MissionNode(
        end.mission,
        start.growth + full,
        (middle.mission, start.growth + to_half),
        (*middle.responses, *end.responses),
        middle.likes,
        order if sum(missed) else None,
        end.carried,
    )
    volume = float(grown.sum(axis=0) @ mission.area)
    return node, float(order @ mission.area) / volume if volume > 0.0 else 0.0
