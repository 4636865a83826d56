"""One step over many missions: the missions between are left out, and the wear of one mission is the rate.

A mission takes the depth W before it to W + R(W) after it; R is the wear of its blocks, one after the other. Over many
missions the depth is a smooth sequence W(n). A step from n to n + H computes only its last mission, which begins at
the depth Z. The parabola through the depths at n - a, n (the two nodes before) and n + H has this mission for its
last one, p(n + H) - p(n + H - 1) = R(Z) with Z = p(n + H - 1), so that

    Z = W(n) + (H - 1) H / (2H - 1 + a) (W(n) - W(n - a)) / a + (H - 1) (H - 1 + a) / (2H - 1 + a) R(Z),
    W(n + H) = Z + R(Z).

This is the backward difference formula of second order for sequences (Petzold, SIAM J. Numer. Anal. 18 (1981) 455). For
H = 1 it is the mission itself, for large H the BDF2 of `solver.wear.bdf2`, with its stability: blocks that adapt the
pressures against each other within few missions do not shorten a step. All factors are positive, so that wear never
falls, and each block has its part of the sum. With the third divided difference w of the nodes, the local error is

    e = w H (H + a) (H - 1) (H - 1 + a) / (2H - 1 + a).

Z is found by Newton's method. The derivative of R is the product of the flows of the linearised wear rates of the
blocks, corrected by Broyden's method where a second iteration is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockRun
from solver.missions.blocks import Mission
from solver.missions.course import MissionNode
from solver.missions.options import MISSIONS
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.results.history import StartState

RunBlock = Callable[[int, FloatArray, StartState | None, bool], BlockRun]
"""Computes a block: place, depth before (n_contact,), m, state that it continues, whether the slope is asked for."""

Allowed = Callable[[float, float, int, int], float]
"""Allowed error of a step, m3: worn volumes at its start and end, m3, number of missions at its start, its length."""


@dataclass(frozen=True)
class Step:
    """A step that was computed.

    node: its end.
    runs: of all blocks, in order, once for each mission that was computed.
    error: estimated local error, as worn volume, m3.
    """

    node: MissionNode
    runs: tuple[BlockRun, ...]
    error: float


def run_mission(
    mission: Mission,
    computed: int,
    depth: FloatArray,
    carried: StartState | None,
    run: RunBlock,
    *,
    with_slopes: bool = False,
) -> tuple[BlockRun, ...] | Failure:
    """Compute the blocks of one mission. computed: missions before, for messages; depth (n_contact,), m: before."""
    runs: list[BlockRun] = []
    for place in range(len(mission.blocks)):
        found = run(place, depth, carried, with_slopes)
        if not found.completed:
            said = f"in mission {computed + 1}, {mission.called(place)}"
            return Failure(found.failure.outcome, ": ".join(filter(None, (said, found.failure.message))))
        runs.append(found)
        depth, carried = depth + found.growth, found.last
    return tuple(runs)


def take_step(
    mission: Mission, nodes: tuple[MissionNode, ...], length: int, run: RunBlock, allowed: Allowed
) -> Step | Failure:
    """A step over missions; over more than one from the third mission on.

    Parameters
    ----------
    mission
        The blocks.
    nodes
        Ends of all steps before.
    length
        H, missions.
    run
        Computes a block.
    allowed
        Allowed error of a step.
    """
    now = nodes[-1]
    if length == 1:
        runs = run_mission(mission, now.mission, now.depth, now.carried, run)
        return (
            runs
            if isinstance(runs, Failure)
            else Step(_node(now, 1, now.growth, runs, np.zeros_like(now.depth)), runs, 0.0)
        )
    formula = _Formula.of(nodes, length)
    found = _solve(mission, now, formula, run, allowed)
    if isinstance(found, Failure):
        return found
    before, runs, left = found
    rates = np.array([each.growth for each in runs[-len(mission.blocks) :]])
    # the last correction of the depth is shared by the blocks in proportion to their wear
    whole, wanted = rates.sum(axis=0), (before - formula.base.sum(axis=0)) / formula.factor
    rates = rates * np.divide(wanted, whole, out=np.ones_like(whole), where=whole > 0.0)
    growth = formula.base + formula.factor * rates
    end = growth.sum(axis=0) + rates.sum(axis=0)
    error = formula.error_of(end) + left
    node = _node(now, length, growth, runs[-len(mission.blocks) :], error, rates)
    return Step(node, runs, float(error @ mission.area))


@dataclass(frozen=True)
class _Formula:
    """The step from the nodes before: `Z = base + factor R(Z)`, by blocks (n_block, n_contact).

    first: Z of the parabola through three nodes before, m.
    ahead: its depth at the end of the step, m.
    share: error over the difference of the end to `ahead`.
    """

    base: FloatArray
    factor: float
    first: FloatArray
    ahead: FloatArray
    share: float
    length: int

    @classmethod
    def of(cls, nodes: tuple[MissionNode, ...], length: int) -> _Formula:
        """The formula of a step of some missions behind at least three nodes."""
        past, before, now = nodes[-3:]
        h, a, b = float(length), float(now.mission - before.mission), float(before.mission - past.mission)
        last = (now.growth - before.growth) / a
        turn = (last - (before.growth - past.growth) / b) / (a + b)
        first, ahead = (now.growth + at * last + at * (at + a) * turn for at in (h - 1.0, h))
        whole = 2.0 * h - 1.0 + a
        base = now.growth + (h - 1.0) * h / whole * last
        share = (h - 1.0) * (h - 1.0 + a) / (whole * (h + a + b))
        factor = (h - 1.0) * (h - 1.0 + a) / whole
        return cls(base, factor, np.maximum(first.sum(axis=0), base.sum(axis=0)), ahead.sum(axis=0), share, length)

    def error_of(self, end: FloatArray) -> FloatArray:
        """Local error (n_contact,), m, of the depth at the end of the step."""
        return np.abs(self.share * (end - self.ahead))


def _solve(
    mission: Mission, now: MissionNode, formula: _Formula, run: RunBlock, allowed: Allowed
) -> tuple[FloatArray, tuple[BlockRun, ...], FloatArray] | Failure:
    """The depth Z (n_contact,), m, all blocks that were computed, and its last correction (n_contact,), m."""
    base, factor, depth = formula.base.sum(axis=0), formula.factor, formula.first
    computed, slope, last = list[BlockRun](), np.zeros((base.size, base.size)), None
    start, missions = float(now.depth @ mission.area), now.mission + formula.length - 1
    for iteration in range(MISSIONS.step_iterations):
        runs = run_mission(mission, missions, depth, now.carried, run, with_slopes=iteration == 0)
        if isinstance(runs, Failure):
            return runs
        computed.extend(runs)
        rate = np.sum([each.growth for each in runs], axis=0)
        if last is None:
            slope = mission_slope(runs)
        else:
            moved, change = depth - last[0], rate - last[1]
            slope = slope + np.outer(change - slope @ moved, moved) / max(float(moved @ moved), 1e-300)
        last = depth, rate
        missing = base + factor * rate - depth
        try:
            depth = np.maximum(depth + np.linalg.solve(np.eye(base.size) - factor * slope, missing), base)
        except np.linalg.LinAlgError:
            break
        if not np.isfinite(depth).all():
            break
        left = np.abs(depth - last[0])
        end = float((depth + (depth - base) / factor) @ mission.area)
        if left @ mission.area <= MISSIONS.depth_tolerance * allowed(start, end, now.mission, formula.length):
            return depth, tuple(computed), left
    said = f"the depth before mission {missions + 1}, {formula.length} missions at once, was not found"
    return Failure(Outcome.MARCH_FAILED, said)


def mission_slope(runs: tuple[BlockRun, ...]) -> FloatArray:
    """Derivative (n_contact, n_contact) of the wear of a mission with respect to the depth before it."""
    unit = np.eye(runs[0].growth.size)
    whole = unit
    for each in runs:
        assert each.slope is not None
        whole = (unit + each.slope) @ whole
    return np.asarray(whole - unit)


def _node(
    now: MissionNode,
    length: int,
    before: FloatArray,
    runs: tuple[BlockRun, ...],
    error: FloatArray,
    rates: FloatArray | None = None,
) -> MissionNode:
    """The end of a step, from the depths by block before its last mission, m, and the blocks of this mission."""
    rates = np.array([run.growth for run in runs]) if rates is None else rates
    values = {
        f"{name}_{end}": np.array([getattr(run, of)[row] for run in runs])
        for name, of in (("response", "response"), ("response_peak", "peak"))
        for row, end in enumerate(("begin", "end"))
    }
    values |= {name: np.array([getattr(run, name) for run in runs]) for name in ("response_error", "growth_error")}
    # the error of a block that wears nothing may be unknown
    of_blocks = np.where(rates > 0.0, values["growth_error"][:, None] * np.fmax(rates, 1e-300), 0.0).sum(axis=0)
    return MissionNode(
        now.mission + length,
        before + rates,
        rates,
        now.local + error + length * of_blocks,
        values,
        tuple(run.like for run in runs if run.like is not None),
        runs[-1].last,
        tuple(run.frequencies for run in runs),
        tuple(run.begun for run in runs),
    )
