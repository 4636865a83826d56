"""The course of a joint over its missions: what is kept of each step, read at any number of missions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.model import FloatArray
from solver.packing import packable
from solver.wear.interpolation import depth_within

Values = dict[str, NDArray[Any]]

_OF_RUNS = ("response", "peak", "response_error", "growth_error")


@packable
@dataclass(frozen=True)
class MissionNode:
    """The end of a step over missions, of which the last mission was computed.

    mission: missions computed so far.
    growth (n_block, n_contact): depth worn by each block so far, m.
    rate (n_block, n_contact): depth worn by each block in the last mission, m; in the first node in the first mission.
    local (n_contact,): sum of the local errors of the steps and of the errors of the blocks so far, m.
    runs: the blocks of the last mission; none in the first node.
    """

    mission: int
    growth: FloatArray
    rate: FloatArray
    local: FloatArray
    runs: tuple[BlockRun, ...] = ()

    @property
    def depth(self) -> FloatArray:
        """Worn depth (n_contact,), m."""
        return np.asarray(self.growth.sum(axis=0))


@packable
@dataclass(frozen=True)
class MissionCourse:
    """Steps over the missions so far.

    nodes: ends of the steps, the start first.
    failure: reason of the end; None before the end.
    iterations: Newton iterations of all blocks that were computed.
    """

    nodes: tuple[MissionNode, ...]
    failure: Failure | None = None
    iterations: int = 0

    @classmethod
    def unworn(cls, n_block: int, n_contact: int) -> MissionCourse:
        """The course before the first step."""
        nothing = np.zeros((n_block, n_contact))
        return cls((MissionNode(0, nothing, nothing, nothing[0]),))

    def longer(self, node: MissionNode, iterations: int) -> MissionCourse:
        """The course with another step. Only its last node keeps what the next mission takes over."""
        before = self.nodes[-1]
        # the reference solution begins as the first mission
        runs = [replace(run, last=None, begun=run.begun if before.mission == 1 else None) for run in before.runs]
        before = replace(before, rate=node.rate if before.mission == 0 else before.rate, runs=tuple(runs))
        return MissionCourse((*self.nodes[:-1], before, node), None, self.iterations + iterations)

    @property
    def ends(self) -> FloatArray:
        """Missions (n_node,) at the ends of the steps, the start first."""
        return np.array([node.mission for node in self.nodes], np.float64)

    def first_with(self, name: str) -> float:
        """Number of missions from which on a block has `BlockRun.held` or `BlockRun.cut_off`; inf if never."""
        steps = zip(self.nodes, self.nodes[1:], strict=False)
        return next(
            (before.mission for before, node in steps if any(getattr(run, name) for run in node.runs)), math.inf
        )

    def largest(self, name: str) -> FloatArray:
        """Largest `BlockRun.inaccurate` or `BlockRun.sweep_rate` (n_block,) of each block; 0 without missions."""
        found = [[getattr(run, name) for run in node.runs] for node in self.nodes[1:]]
        return np.max(found, axis=0) if found else np.zeros(len(self.nodes[0].growth))

    def growth_at(self, missions: FloatArray) -> FloatArray:
        """Depth worn by each block (n, n_block, n_contact), m, at numbers of missions; NaN beyond the last step."""
        ends, found = self.ends, np.full((missions.size, *self.nodes[0].growth.shape), np.nan)
        for row in np.flatnonzero(missions <= ends[-1]):
            place = max(int(np.searchsorted(ends, missions[row], "left")), 1)
            before, after = self.nodes[place - 1], self.nodes[min(place, len(ends) - 1)]
            found[row] = growth_within(before, after, missions[row])
        return found

    def values_at(self, missions: FloatArray, n_response: int) -> Values:
        """Values of the nodes (n, n_block, ...) in the missions that end at some numbers, by name.

        They are linear in the worn volume between the computed missions, as the vibration depends on the wear.
        At the number 0 those of the first mission; NaN beyond the last step, and before any mission was computed.
        """
        computed, (n_block, n_contact) = self.nodes[1:], self.nodes[0].growth.shape
        if not computed:
            shapes = ((n_block, 2, n_response), (n_block, 2, n_response), (n_block,), (n_block,))
            named = {**dict(zip(_OF_RUNS, shapes, strict=True)), "rate": (n_block, n_contact), "local": (n_contact,)}
            return {name: np.full((missions.size, *shape), np.nan) for name, shape in named.items()}
        worn, depths = np.array([node.depth.sum() for node in computed]), self.growth_at(missions).sum(axis=(1, 2))
        place = np.clip(np.searchsorted(self.ends[1:], missions, "left") - 1, 0, None)
        beyond = np.minimum(place + 1, len(computed) - 1)
        width, ahead = worn[beyond] - worn[place], np.nan_to_num(depths - worn[place])
        share = np.clip(np.divide(ahead, width, out=np.zeros_like(width), where=width > 0.0), 0.0, 1.0)
        share[missions > self.ends[-1]] = np.nan
        stored = {name: np.array([[getattr(run, name) for run in node.runs] for node in computed]) for name in _OF_RUNS}
        stored |= {name: np.array([getattr(node, name) for node in computed]) for name in ("rate", "local")}
        read: Values = {}
        for name, values in stored.items():
            weights = share.reshape(-1, *[1] * (values.ndim - 1))
            read[name] = values[place] + weights * (values[beyond] - values[place])
        return read


def growth_within(before: MissionNode, after: MissionNode, mission: float) -> FloatArray:
    """Depth worn by each block (n_block, n_contact), m, within a step, as in `solver.wear.interpolation`."""
    length = float(after.mission - before.mission)
    share = np.array([(mission - before.mission) / length if length else 1.0])
    ends = [(node.growth.ravel(), node.rate.ravel()) for node in (before, after)]
    within = depth_within(share, length, ends[0], ends[1], smooth=True)
    return np.asarray(within.reshape(after.growth.shape))
