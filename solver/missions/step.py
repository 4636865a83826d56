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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockResult
from solver.model import ContactInterface, FloatArray
from solver.outcome import absolute
from solver.wear.slow_time import Node
from solver.wear.step import allowed_error

RunMission = Callable[[FloatArray, bool], tuple[BlockResult, ...] | Failure]
"""Computes the blocks of a mission: depths, m, and dissipated energies, J/m2, before (2, n_contact), and whether slopes
are asked for.
"""


@dataclass(frozen=True)
class MissionStep:
    """A computed step: its end, the blocks of its last mission, and its estimated local error over the allowed one."""

    node: Node
    results: tuple[BlockResult, ...]
    ratio: float


def attempt_step(
    nodes: Sequence[Node], length: int, contact: ContactInterface, run_mission: RunMission, share: float
) -> MissionStep | Failure:
    """A step over missions; over more than one from the third mission on.

    nodes: ends of steps so far, of which the last missions were computed, with the depths and rates of all blocks in
        one row, and with values (n_block, ...) by their names in `BlockResult`, and `local` (n_contact,): sum of the
        errors of steps and blocks, m. contact: unworn. share: as in `allowed_error`.
    """
    area, now = contact.area, nodes[-1]
    unit, rate_before = np.eye(area.size), now.rate.reshape(-1, area.size).sum(axis=0)
    # first axis: depths and dissipated energies
    *earlier, slow = (node.slow.reshape(2, -1, area.size) for node in nodes[-3:])
    base = slow
    first = ahead = slow.sum(axis=1)
    depth_now, factor, error_factor = first[0], 0.0, 0.0
    if length > 1:
        past, before = earlier
        h, (b, a) = float(length), np.diff([node.count for node in nodes[-3:]])
        last = (base - before) / a
        turn = (last - (before - past) / b) / (a + b)
        first, ahead = ((base + at * last + at * (at + a) * turn).sum(axis=1) for at in (h - 1.0, h))
        base = base + (h - 1.0) * h / (2.0 * h - 1.0 + a) * last
        factor = float((h - 1.0) * (h - 1.0 + a) / (2.0 * h - 1.0 + a))
        first, error_factor = np.maximum(first, base.sum(axis=1)), float(factor / (h + a + b))
    results = run_mission(first, length > 1)
    if isinstance(results, Failure):
        return results
    energy_rates = np.array([each.dissipated for each in results])
    energy = base[1] + (factor + 1.0) * energy_rates
    # the mission was computed with the contact at an energy that was extrapolated
    energy_error = np.abs(base[1].sum(axis=0) + factor * energy_rates.sum(axis=0) - first[1])
    energy_error += np.abs(error_factor * (energy.sum(axis=0) - ahead[1]))
    (base, _), (first, _), (ahead, _) = base, first, ahead
    rates, error = np.array([each.growth for each in results]), np.zeros(area.size)
    if length > 1:
        whole, rate, least = unit, rates.sum(axis=0), base.sum(axis=0)
        for each in results:
            assert each.slope is not None
            whole = (unit + each.slope) @ whole
        slope = whole - unit
        depth = np.maximum(first + np.linalg.solve(unit - factor * slope, least + factor * rate - first), least)
        # the correction of the depth is shared by the blocks in proportion to their wear
        rates = rates * np.divide((depth - least) / factor, rate, out=np.ones_like(rate), where=rate > 0.0)
        moved = first - (depth_now - rate_before)
        part = np.abs(depth - first) @ area / max(float(np.abs(moved) @ area), 1e-300)
        missed = np.abs(rate - rate_before - slope @ moved)
        error = np.abs(error_factor * (depth + rates.sum(axis=0) - ahead)) + factor * part * missed
    growth = base + (factor + 1.0) * rates
    most = allowed_error(share, float(depth_now @ area), float(growth.sum(axis=0) @ area), now.count, length)
    values = values_of(results)
    of_blocks = absolute(values["growth_error"][:, None], rates).sum(axis=0)
    values["local"] = now.values["local"] + error + length * of_blocks
    guides = tuple(each.guide for each in results)
    slow_now = energy.ravel(), energy_rates.ravel()
    end = Node(now.count + length, growth.ravel(), rates.ravel(), *slow_now, values, guides)
    ratio = float(error @ area) / most
    if length > 1:
        heat = float(slow[1].sum(axis=0) @ area), float(energy.sum(axis=0) @ area)
        of_energy = float(contact.acting(energy_error) @ area) / allowed_error(share, *heat, now.count, length)
        # of numpy: one that is NaN stays NaN
        ratio = float(np.maximum(ratio, of_energy))
    return MissionStep(end, results, ratio)


def values_of(results: tuple[BlockResult, ...]) -> dict[str, Any]:
    """Values (n_block, ...) of the blocks, by their names."""
    names = ("response", "response_peak", "response_error", "growth_error")
    return {name: np.array([getattr(each, name) for each in results]) for name in names}
