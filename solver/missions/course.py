"""The course of a joint over its missions: what is kept of each step, read at any number of missions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.missions.blocks import Mission
from solver.model import FloatArray
from solver.packing import packable
from solver.wear.interpolation import fraction_where

Values = dict[str, NDArray[Any]]


@packable
@dataclass(frozen=True)
class MissionNode:
    """The end of a step over missions, of which the last mission was computed.

    mission: missions computed so far.
    growth (n_block, n_contact): depth worn by each block so far, m.
    rate (n_block, n_contact): depth worn by each block in the last mission, m; in the first node in the first mission.
    local (n_contact,): sum of the local errors of the steps and of the errors of the blocks so far, m.
    runs: the blocks of the last mission; without values in the first node.
    """

    mission: int
    growth: FloatArray
    rate: FloatArray
    local: FloatArray
    runs: tuple[BlockRun, ...]

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
    def unworn(cls, mission: Mission) -> MissionCourse:
        """The course before the first step."""
        n_block, nothing = len(mission.blocks), np.zeros((len(mission.blocks), mission.area.size))
        unknown = np.full((2, len(mission.blocks[0].model.response_names)), np.nan)
        runs = (BlockRun(nothing[0], unknown.astype(complex), unknown),) * n_block
        return cls((MissionNode(0, nothing, np.full_like(nothing, np.nan), nothing[0], runs),))

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
        steps = pairwise(self.nodes)
        return next((one.mission for one, end in steps if any(getattr(run, name) for run in end.runs)), math.inf)

    def largest(self, name: str) -> FloatArray:
        """Largest `BlockRun.inaccurate` or `BlockRun.sweep_rate` (n_block,) of each block; 0 without missions."""
        return np.asarray(np.max([[getattr(run, name) for run in node.runs] for node in self.nodes], axis=0))

    def growth_at(self, missions: FloatArray) -> FloatArray:
        """Depth worn by each block (n, n_block, n_contact), m, at numbers of missions; NaN beyond the last step.

        A cubic within each step, whose slopes are limited so that no depth falls: at most three times the mean slope
        (Fritsch and Carlson 1980).
        """
        from scipy.interpolate import CubicHermiteSpline  # where it is used: it takes a while to load

        growth, rates = (np.array([getattr(node, name) for node in self.nodes]) for name in ("growth", "rate"))
        if len(growth) == 1:
            return np.where(missions[:, None, None] > 0.0, np.nan, growth)
        mean = np.diff(growth, axis=0) / np.diff(self.ends)[:, None, None]
        most = 3.0 * np.minimum(np.append(mean[:1], mean, axis=0), np.append(mean, mean[-1:], axis=0))
        within = CubicHermiteSpline(self.ends, growth, np.minimum(rates, most), extrapolate=False)
        return np.asarray(within(missions))

    def values_at(self, missions: FloatArray) -> Values:
        """Values (n, n_block, ...) of the blocks in the missions that end at some numbers, by their names in `BlockRun`
        and `MissionNode`.

        They are linear in the worn volume between the computed missions, as the vibration depends on the wear.
        At the number 0 those of the first mission; NaN beyond the last step, and before any mission was computed.
        """
        computed = self.nodes[1:] or self.nodes
        worn, depths = np.array([node.depth.sum() for node in computed]), self.growth_at(missions).sum(axis=(1, 2))
        place = np.clip(np.searchsorted([node.mission for node in computed], missions, "left") - 1, 0, None)
        beyond = np.minimum(place + 1, len(computed) - 1)
        width, ahead = worn[beyond] - worn[place], np.nan_to_num(depths - worn[place])
        share = np.clip(np.divide(ahead, width, out=np.zeros_like(width), where=width > 0.0), 0.0, 1.0)
        share[missions > self.ends[-1]] = np.nan
        read: Values = {name: np.array([getattr(node, name) for node in computed]) for name in ("rate", "local")}
        for name in ("response", "peak", "response_error", "growth_error"):
            read[name] = np.array([[getattr(run, name) for run in node.runs] for node in computed])
        for name, values in read.items():
            weights = share.reshape(-1, *[1] * (values.ndim - 1))
            read[name] = values[place] + weights * (values[beyond] - values[place])
        return read

    def missions_to_target(self, mission: Mission) -> float:
        """Number of missions at which the target is reached, inf if never."""
        target = mission.until
        if target is None or worn_by(mission, self.nodes[-1].growth) < target.value:
            return math.inf
        place = next(n for n, node in enumerate(self.nodes) if worn_by(mission, node.growth) >= target.value)
        low, length = self.ends[place - 1], float(np.diff(self.ends)[place - 1])

        def worn_at(fraction: float) -> float:
            return worn_by(mission, self.growth_at(np.array([low + fraction * length]))[0])

        return float(low + length * fraction_where(target.value, worn_at))


def worn_by(mission: Mission, growth: FloatArray) -> float:
    """Wear to compare with the target, from the depths worn by each block: volume, m3, or largest depth, m."""
    depth = growth.sum(axis=0)
    assert mission.until is not None
    if mission.until.quantity == "wear_depth":
        return float(depth.max(initial=0.0))
    return float(depth @ mission.area)
