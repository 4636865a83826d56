"""The course of a joint over its missions: what is kept of each step, read at any number of missions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.model import FloatArray
from solver.packing import packable
from solver.results.history import StartState
from solver.wear.interpolation import depth_within
from solver.wear.solutions import Like

RESPONSES = ("response_begin", "response_end", "response_peak_begin", "response_peak_end")
"""Names of the responses in a node, (n_block, n_response), m: first harmonic and largest magnitude over a period."""


@packable
@dataclass(frozen=True)
class MissionNode:
    """The end of a step over missions, of which the last mission was computed.

    mission: missions computed so far.
    growth (n_block, n_contact): depth worn by each block so far, m.
    rate (n_block, n_contact): depth worn by each block in the last mission, m; in the first node in the first mission.
    local (n_contact,): sum of the local errors of the steps and of the errors of the blocks so far, m.
    values: `RESPONSES` of the last mission, with the relative errors `response_error` and `growth_error` (n_block,) of
        its blocks by their states.
    likes: of each block, for the reference solution.
    carried: state at the end of the last block, for a first block that continues; of the last node only.
    frequencies, begun: of each block, see `BlockRun`; of the last node only.
    """

    mission: int
    growth: FloatArray
    rate: FloatArray
    local: FloatArray
    values: dict[str, NDArray[Any]] | None = None
    likes: tuple[Like, ...] = ()
    carried: StartState | None = None
    frequencies: tuple[tuple[float, ...], ...] = ()
    begun: tuple[StartState | None, ...] = ()

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
    inaccurate (n_block,): largest error of a state of each block above rtol, 0 where there is none.
    sweep_rate (n_block,): largest `BlockRun.sweep_rate` of each block.
    held, cut_off: number of missions from which on a block has `BlockRun.held`, `BlockRun.cut_off`; inf if never.
    iterations: Newton iterations.
    """

    nodes: tuple[MissionNode, ...]
    failure: Failure | None
    inaccurate: FloatArray
    sweep_rate: FloatArray
    held: float = float("inf")
    cut_off: float = float("inf")
    iterations: int = 0

    @classmethod
    def begun(cls, n_block: int, n_contact: int) -> MissionCourse:
        """The course before the first step."""
        nothing = np.zeros((n_block, n_contact))
        return cls((MissionNode(0, nothing, nothing, nothing[0]),), None, np.zeros(n_block), np.zeros(n_block))

    def longer(self, node: MissionNode, runs: tuple[BlockRun, ...]) -> MissionCourse:
        """The course with another step; runs: blocks that were computed for it, in the order of the mission."""
        before, n_block = self.nodes[-1], len(self.inaccurate)
        kept = MissionNode(0, before.growth, node.rate, before.local) if before.mission == 0 else before
        found = {
            name: np.array([max(getattr(run, name) for run in runs[place::n_block]) for place in range(n_block)])
            for name in ("inaccurate", "sweep_rate")
        }
        seen = {name: any(getattr(run, name) for run in runs) for name in ("held", "cut_off")}
        return MissionCourse(
            nodes=(*self.nodes[:-1], _without_state(kept), node),
            failure=None,
            inaccurate=np.maximum(self.inaccurate, found["inaccurate"]),
            sweep_rate=np.maximum(self.sweep_rate, found["sweep_rate"]),
            held=min(self.held, before.mission if seen["held"] else np.inf),
            cut_off=min(self.cut_off, before.mission if seen["cut_off"] else np.inf),
            iterations=self.iterations + sum(run.iterations for run in runs),
        )

    @property
    def ends(self) -> FloatArray:
        """Missions (n_node,) at the ends of the steps, the start first."""
        return np.array([node.mission for node in self.nodes], np.float64)

    def growth_at(self, missions: FloatArray) -> FloatArray:
        """Depth worn by each block (n, n_block, n_contact), m, at numbers of missions; NaN beyond the last step."""
        ends, found = self.ends, np.full((missions.size, *self.nodes[0].growth.shape), np.nan)
        for row in np.flatnonzero(missions <= ends[-1]):
            place = max(int(np.searchsorted(ends, missions[row], "left")), 1)
            found[row] = growth_within(
                self.nodes[max(place - 1, 0)], self.nodes[min(place, len(ends) - 1)], missions[row]
            )
        return found

    def values_at(self, missions: FloatArray) -> dict[str, NDArray[Any]]:
        """Values of the nodes (n, n_block, ...) in the missions that end at some numbers, by name.

        They are linear in the worn volume between the computed missions, as the vibration depends on the wear.
        At the number 0 those of the first mission; NaN beyond the last step. Empty before the first mission.
        """
        computed, read = self.nodes[1:], dict[str, NDArray[Any]]()
        if not computed:
            return read
        worn, depths = np.array([node.depth.sum() for node in computed]), self.growth_at(missions).sum(axis=(1, 2))
        place = np.clip(np.searchsorted(self.ends[1:], missions, "left") - 1, 0, None)
        beyond, reached = np.minimum(place + 1, len(computed) - 1), missions <= self.ends[-1]
        width, ahead = worn[beyond] - worn[place], np.nan_to_num(depths - worn[place])
        share = np.clip(np.divide(ahead, width, out=np.zeros_like(width), where=width > 0.0), 0.0, 1.0)
        nodes = [{"rate": node.rate, "local": node.local, **(node.values or {})} for node in computed]
        for name in nodes[0]:
            values = np.array([node[name] for node in nodes])
            first, weights = values[place], share.reshape(-1, *[1] * (values.ndim - 1))
            rows = first + weights * (values[beyond] - first)
            rows[~reached] = np.nan
            read[name] = rows
        return read


def growth_within(before: MissionNode, after: MissionNode, mission: float) -> FloatArray:
    """Depth worn by each block (n_block, n_contact), m, within a step, as in `solver.wear.interpolation`."""
    length = float(after.mission - before.mission)
    share = np.array([(mission - before.mission) / length if length else 1.0])
    ends = [(node.growth.ravel(), node.rate.ravel()) for node in (before, after)]
    within = depth_within(share, length, ends[0], ends[1], smooth=True)
    return np.asarray(within.reshape(after.growth.shape))


def _without_state(node: MissionNode) -> MissionNode:
    """The node without the states for the next mission."""
    return MissionNode(node.mission, node.growth, node.rate, node.local, node.values, node.likes)
