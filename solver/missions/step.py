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

Z is found by one step of Newton's method from the parabola through three nodes before. The derivative of R is the
product of the flows of the linearised wear rates of the blocks. By how much it misses the change of the wear since the
last node is a part of the error of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.model import FloatArray
from solver.wear.course import Node
from solver.wear.step import allowed_error

RunMission = Callable[[FloatArray, bool], tuple[BlockRun, ...] | Failure]
"""Computes the blocks of a mission: depth before (n_contact,), m, and whether slopes are asked for."""

Nodes = tuple[Node, ...]
"""Ends of steps, of which the last missions were computed, with the depths and rates of all blocks in one row. Values
(n_block, ...) by their names in `BlockRun`, and `local` (n_contact,): sum of the errors of steps and blocks, m."""


@dataclass(frozen=True)
class Step:
    """A computed step: its end, the blocks of its last mission, and its estimated local error over the allowed one."""

    node: Node
    runs: tuple[BlockRun, ...]
    ratio: float


@dataclass(frozen=True)
class Formula:
    """The step from at least three nodes before: `Z = base + factor R(Z)`.

    base (n_block, n_contact): m, by blocks.
    first, ahead (n_contact,): Z, and the depth at the end, of the parabola through three nodes before, m.
    error_factor: error over the difference of the end to `ahead`.
    """

    base: FloatArray
    factor: float
    first: FloatArray
    ahead: FloatArray
    error_factor: float

    @classmethod
    def of(cls, nodes: Nodes, length: int, area: FloatArray) -> Formula:
        """The formula of a step of some missions."""
        past, before, now = (node.depth.reshape(-1, area.size) for node in nodes[-3:])
        h, (b, a) = float(length), np.diff([node.count for node in nodes[-3:]])
        last = (now - before) / a
        turn = (last - (before - past) / b) / (a + b)
        first, ahead = ((now + at * last + at * (at + a) * turn).sum(axis=0) for at in (h - 1.0, h))
        whole = 2.0 * h - 1.0 + a
        base = now + (h - 1.0) * h / whole * last
        factor = float((h - 1.0) * (h - 1.0 + a) / whole)
        return cls(base, factor, np.maximum(first, base.sum(axis=0)), ahead, float(factor / (h + a + b)))


def attempt_step(nodes: Nodes, length: int, area: FloatArray, run: RunMission, share: float) -> Step | Failure:
    """A step over missions; over more than one from the third mission on.

    nodes: ends of the last three steps, or of all. area (n_contact,): m2. share: as in `allowed_error`.
    """
    now = nodes[-1]
    depth_now, rate_before = (row.reshape(-1, area.size).sum(axis=0) for row in (now.depth, now.rate))
    if length == 1:
        runs = run(depth_now, False)
        return runs if isinstance(runs, Failure) else _one_mission(nodes, area, runs, share)
    formula, unit = Formula.of(nodes, length, area), np.eye(area.size)
    base, factor, first = formula.base.sum(axis=0), formula.factor, formula.first
    runs = run(first, True)
    if isinstance(runs, Failure):
        return runs
    whole, rates = unit, np.array([each.growth for each in runs])
    for each in runs:
        assert each.slope is not None
        whole = (unit + each.slope) @ whole
    slope, rate = whole - unit, rates.sum(axis=0)
    depth = np.maximum(first + np.linalg.solve(unit - factor * slope, base + factor * rate - first), base)
    # the correction of the depth is shared by the blocks in proportion to their wear
    rates = rates * np.divide((depth - base) / factor, rate, out=np.ones_like(rate), where=rate > 0.0)
    end, moved = depth + rates.sum(axis=0), first - (depth_now - rate_before)
    missed = np.abs(rate - rate_before - slope @ moved)
    part = np.abs(depth - first) @ area / max(float(np.abs(moved) @ area), 1e-300)
    error = np.abs(formula.error_factor * (end - formula.ahead)) + factor * part * missed
    most = allowed_error(share, float(depth_now @ area), float(end @ area), now.count, length)
    after = _end_of(now, length, formula.base + (factor + 1.0) * rates, rates, runs, error)
    return Step(after, runs, float(np.nan_to_num(error @ area / most, nan=np.inf)))


def _one_mission(nodes: Nodes, area: FloatArray, runs: tuple[BlockRun, ...], share: float) -> Step:
    """A step of one mission, whose error is 0; its ratio is that of two missions, for the length of the next step."""
    now, rates = nodes[-1], np.array([each.growth for each in runs])
    grown = now.depth.reshape(rates.shape)
    end = _end_of(now, 1, grown + rates, rates, runs, np.zeros(area.size))
    if len(nodes) < 3:
        return Step(end, runs, 0.0)
    two, (b, a) = Formula.of(nodes, 2, area), np.diff([node.count for node in nodes[-3:]])
    # the error grows with the third divided difference
    growth = 2.0 * (2.0 + a) * (2.0 + a + b) / ((1.0 + a) * (1.0 + a + b))
    before, after = grown.sum(axis=0), (grown + rates).sum(axis=0)
    error = two.error_factor * growth * float(np.abs(after - two.first) @ area)
    most = 2.0 * allowed_error(share, float(before @ area), float(after @ area), now.count, 1)
    return Step(end, runs, float(min(0.25 * error / most, 1.0)))


def values_of(runs: tuple[BlockRun, ...]) -> dict[str, Any]:
    """Values (n_block, ...) of the blocks, by their names."""
    names = ("response", "response_peak", "response_error", "growth_error")
    return {name: np.array([getattr(run, name) for run in runs]) for name in names}


def _end_of(
    now: Node, length: int, growth: FloatArray, rates: FloatArray, runs: tuple[BlockRun, ...], error: FloatArray
) -> Node:
    """The end of a step from its growth, its last mission, (n_block, n_contact), m, and its error (n_contact,), m."""
    values = values_of(runs)
    # the error of a block that wears nothing may be unknown
    of_blocks = np.where(rates > 0.0, values["growth_error"][:, None] * np.fmax(rates, 1e-300), 0.0).sum(axis=0)
    local = now.values["local"] + error + length * of_blocks
    guides = tuple(run.guide for run in runs)
    return Node(now.count + length, growth.ravel(), rates.ravel(), values | {"local": local}, guides)
