"""One step over many missions: the missions between are left out, and the wear of one mission is the rate.

A mission takes the depth W before it to W + R(W) after it; R is the wear of its blocks, one after the other. A step
from n to n + H computes only its last mission, which begins at the depth Z. The parabola through the depths at n - a, n
(the two nodes before) and n + H has this mission for its last one, p(n + H) - p(n + H - 1) = R(Z) with
Z = p(n + H - 1), so that

    Z = W(n) + (H - 1) H / (2H - 1 + a) (W(n) - W(n - a)) / a + (H - 1) (H - 1 + a) / (2H - 1 + a) R(Z),
    W(n + H) = Z + R(Z).

This is the backward difference formula of second order for sequences (Petzold, SIAM J. Numer. Anal. 18 (1981) 455). For
H = 1 it is the mission itself, for large H the BDF2 of `solver.wear.step`, with its stability: blocks that adapt the
pressures against each other within few missions do not shorten a step. All factors are positive, so that wear never
falls, and each block has its part of the sum. With the third divided difference w of the nodes, the local error is

    e = w H (H + a) (H - 1) (H - 1 + a) / (2H - 1 + a).

Z is found by Newton's method. The derivative of R is the product of the flows of the linearised wear rates of the
blocks, corrected by Broyden's method where a second iteration is needed. As the parabola through three nodes before is
near, one mission is enough for most steps: by how much the derivative misses the change of the wear since the last
node is a part of the error of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.wear.step import allowed_error

RunMission = Callable[[FloatArray, bool], tuple[BlockRun, ...] | Failure]
"""Computes the blocks of a mission: depth before (n_contact,), m, and whether slopes are asked for."""

MOST_ITERATIONS = 6
"""Most missions computed for a step. Sliders and roots need 1 to 3."""

DEPTH_TOLERANCE = 0.1
"""Error of the depth before the mission, as worn volume, over the allowed error of the step."""


@packable
@dataclass(frozen=True)
class MissionNode:
    """The end of a step over missions, of which the last mission was computed.

    mission: missions computed so far. growth (n_block, n_contact): depth worn by each block so far, m.
    rate (n_block, n_contact): in the last mission, m; in the first node in the first mission.
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


@dataclass(frozen=True)
class Step:
    """A step that was computed. node: its end. ratio: estimated local error over the allowed one."""

    node: MissionNode
    ratio: float


@dataclass(frozen=True)
class Formula:
    """The step from at least three nodes before: `Z = base + factor R(Z)`.

    base (n_block, n_contact): m, by blocks.
    first, ahead (n_contact,): Z, and the depth at the end, of the parabola through three nodes before, m.
    share: error over the difference of the end to `ahead`.
    """

    base: FloatArray
    factor: float
    first: FloatArray
    ahead: FloatArray
    share: float

    @classmethod
    def of(cls, nodes: tuple[MissionNode, ...], length: int) -> Formula:
        """The formula of a step of some missions."""
        past, before, now = nodes[-3:]
        h, a, b = float(length), float(now.mission - before.mission), float(before.mission - past.mission)
        last = (now.growth - before.growth) / a
        turn = (last - (before.growth - past.growth) / b) / (a + b)
        first, ahead = ((now.growth + at * last + at * (at + a) * turn).sum(axis=0) for at in (h - 1.0, h))
        whole = 2.0 * h - 1.0 + a
        base = now.growth + (h - 1.0) * h / whole * last
        factor = (h - 1.0) * (h - 1.0 + a) / whole
        return cls(base, factor, np.maximum(first, base.sum(axis=0)), ahead, factor / (h + a + b))


def attempt_step(
    nodes: tuple[MissionNode, ...], length: int, area: FloatArray, run: RunMission, share: float
) -> Step | Failure:
    """A step over missions; over more than one from the third mission on.

    nodes: ends of all steps before. area (n_contact,): m2. share: allowed error as in `allowed_error`.
    """
    now = nodes[-1]
    if length == 1:
        runs = run(now.depth, False)
        return runs if isinstance(runs, Failure) else _one_mission(nodes, area, runs, share)
    formula, unit = Formula.of(nodes, length), np.eye(now.depth.size)
    base, factor, depth = formula.base.sum(axis=0), formula.factor, formula.first
    slope, last = np.zeros_like(unit), None
    rate_before = now.rate.sum(axis=0)
    depth_before = now.depth - rate_before
    for _ in range(MOST_ITERATIONS):
        runs = run(depth, last is None)
        if isinstance(runs, Failure):
            return runs
        rates = np.array([each.growth for each in runs])
        rate = rates.sum(axis=0)
        if last is None:
            slope = mission_slope(runs)
        else:
            moved, change = depth - last[0], rate - last[1]
            slope = slope + np.outer(change - slope @ moved, moved) / max(float(moved @ moved), 1e-300)
        last = depth, rate
        try:
            ahead = depth + np.linalg.solve(unit - factor * slope, base + factor * rate - depth)
        except np.linalg.LinAlgError:
            break
        if not np.isfinite(ahead).all():
            break
        depth = np.maximum(ahead, base)
        # the last correction of the depth is shared by the blocks in proportion to their wear
        wanted = (depth - base) / factor
        rates = rates * np.divide(wanted, rate, out=np.ones_like(rate), where=rate > 0.0)
        end = depth + rates.sum(axis=0)
        missed = np.abs(rate - rate_before - slope @ (last[0] - depth_before))
        part = np.abs(depth - last[0]) @ area / max(float(np.abs(last[0] - depth_before) @ area), 1e-300)
        left = factor * part * missed
        error = np.abs(formula.share * (end - formula.ahead)) + left
        most = allowed_error(share, float(now.depth @ area), float(end @ area), now.mission, length)
        ratio = float(error @ area) / most
        if ratio > 1.0 or left @ area <= DEPTH_TOLERANCE * most:
            return Step(_node(now, length, formula.base + (factor + 1.0) * rates, rates, runs, error), ratio)
    said = f"the depth before mission {now.mission + length}, {length} missions at once, was not found"
    return Failure(Outcome.MARCH_FAILED, said)


def _one_mission(nodes: tuple[MissionNode, ...], area: FloatArray, runs: tuple[BlockRun, ...], share: float) -> Step:
    """A step of one mission, whose error is 0; its ratio is that of two missions, for the length of the next step."""
    now, rates = nodes[-1], np.array([each.growth for each in runs])
    end = _node(now, 1, now.growth + rates, rates, runs, np.zeros_like(now.depth))
    if len(nodes) < 3:
        return Step(end, 0.0)
    a, b = (float(after.mission - before.mission) for before, after in ((nodes[-2], now), (nodes[-3], nodes[-2])))
    two = Formula.of(nodes, 2)
    # the error grows with the third divided difference
    growth = 2.0 * (2.0 + a) * (2.0 + a + b) / ((1.0 + a) * (1.0 + a + b))
    error = two.share * growth * float(np.abs(end.depth - two.first) @ area)
    most = 2.0 * allowed_error(share, float(now.depth @ area), float(end.depth @ area), now.mission, 1)
    return Step(end, min(0.25 * error / most, 1.0))


def mission_slope(runs: tuple[BlockRun, ...]) -> FloatArray:
    """Derivative (n_contact, n_contact) of the wear of a mission with respect to the depth before it."""
    unit = np.eye(runs[0].growth.size)
    whole = unit
    for each in runs:
        assert each.slope is not None
        whole = (unit + each.slope) @ whole
    return np.asarray(whole - unit)


def _node(
    now: MissionNode, length: int, growth: FloatArray, rates: FloatArray, runs: tuple[BlockRun, ...], error: FloatArray
) -> MissionNode:
    """The end of a step from its growth, its last mission, (n_block, n_contact), m, and its error (n_contact,), m."""
    known = np.array([run.growth_error for run in runs])[:, None]
    # the error of a block that wears nothing may be unknown
    of_blocks = np.where(rates > 0.0, known * np.fmax(rates, 1e-300), 0.0).sum(axis=0)
    kept = tuple(replace(run, slope=None) for run in runs)
    return MissionNode(now.mission + length, growth, rates, now.local + error + length * of_blocks, kept)
