"""Where the anchors of pairs go between two periodic states while the predicted force changes slowly.

A pair sticks as long as its tangential state x lies in the friction discs of all samples of the period, with the
centres `p_T(t)` and the radii `mu p_N(t)`, Eqs. (13)-(15). While the predicted force moves on from one state to the
next, a disc that reaches x takes it along, along its normal: the sweeping process of the intersection C of the discs
(Moreau, J. Differ. Equ. 26 (1977) 347). It is followed in equal parts of a straight path, at each by the projection

    x_k = argmin |x - x_(k-1)|,   x in C(k / n),

onto one disc or onto a corner of two. Where C is empty, the pair slips or opens in each period, and no place is at
rest. When it comes to stick again, C begins as the point at which two discs touch, wherever x was before. The
derivative by the predicted force at the end of the path is the product of those of the projections, from the last to
the first.

Floats and arrays only.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.model import FloatArray, IntArray
from solver.settings import NEGLIGIBLE, ROUND_OFF

PARTS = 32
"""Parts of a path. Dovetail, 16 pairs that slide for 2.8e5 cycles, `rtol` 1e-2: 18.606, 18.607, 18.607, 18.610,
18.611 mm3 with 512, 128, 32, 16, 8 parts. With 16 and 64 blocks, waves and impacts are equal."""

ROUNDS = 40
"""Halvings of the part within which the discs get a common point: their common part is then as long as 1e-6 radii. Also
most changes of the one or two discs of a projection; two or three are usual."""

INSIDE = 0.1 * ROUND_OFF
"""Distance of a place from the border of its discs over their radius: the march through the period then finds that the
pair sticks. Well below the tolerance of the residual."""

NOTES = 18
"""Entries of a noted step: sample, other sample or -1, the derivatives (2, 3) of the place by the predicted forces at
both, and (2, 2) by the place before, row by row."""


class Path(NamedTuple):
    """Predicted forces first, last (n_contact, 3, N), N, at both ends of a straight path, friction coefficients
    (n_contact,), and the tangential state at its start (n_contact, 2), N.
    """

    first: FloatArray
    last: FloatArray
    friction: FloatArray
    state: FloatArray


class Way(NamedTuple):
    """Path of one pair. near (n,): samples whose discs are looked at; discs (3, N): their centres and radii, N."""

    first: FloatArray
    last: FloatArray
    friction: float
    near: IntArray
    discs: FloatArray


def slide_along(pairs: IntArray, path: Path, out: FloatArray) -> None:
    """Tangential states of some pairs (n,) at the end of a path into out (n_contact, 2), N."""
    _slide(pairs, path, out, np.empty((pairs.size, 1, NOTES)))


def slide_tangent(pairs: IntArray, path: Path, synthesis: FloatArray, out: FloatArray) -> None:
    """Derivatives of the states of `slide_along` by the harmonics of the predicted force at the end of the path, and by
    the friction coefficient there, into out (n_contact, 2, 3m + 1). synthesis (m, N): as in `FourierBasis`.
    """
    # with the same function: each one more is a second of compiling
    notes = np.empty((pairs.size, 2 * PARTS + 3, NOTES))
    _trace_back(pairs, path, _slide(pairs, path, np.empty_like(path.state), notes), notes, synthesis, out)


@njit(cache=True)
def _slide(pairs: IntArray, path: Path, out: FloatArray, notes: FloatArray) -> IntArray:
    """As `slide_along`; returns the numbers of steps (n,). notes (n, k, NOTES): of the first k - 1 steps."""
    n_samples, counts = path.first.shape[2], np.zeros(pairs.size, np.int64)
    near, margin, discs = np.empty(n_samples, np.int64), np.empty(n_samples), np.empty((3, n_samples))
    for place, pair in enumerate(pairs):
        first, last, friction, state = path.first[pair], path.last[pair], path.friction[pair], path.state[pair]
        x_1, x_2, reach = state[0], state[1], 0.0
        for n in range(n_samples):
            ends = np.inf
            for force in (first, last):
                apart = np.sqrt((force[1, n] - x_1) ** 2 + (force[2, n] - x_2) ** 2)
                ends = min(ends, friction * force[0, n] - apart)
            margin[n] = ends
            reach = max(reach, -4.0 * ends)
        # a margin is concave along a straight path: a state inside at both ends is inside between
        farthest = np.inf if reach > 0.0 else 0.0
        while farthest > reach:
            n_near = 0
            for n in range(n_samples):
                if margin[n] <= reach:
                    near[n_near] = n
                    n_near += 1
            way = Way(first, last, friction, near[:n_near], discs)
            x_1, x_2, counts[place], farthest = _follow(way, state, notes[place])
            reach = np.inf if farthest > reach else reach
        out[pair, 0], out[pair, 1] = x_1, x_2
    return counts


@njit(cache=True)
def _trace_back(
    pairs: IntArray, path: Path, counts: IntArray, notes: FloatArray, synthesis: FloatArray, out: FloatArray
) -> None:
    """As `slide_tangent`, from the noted steps.

    later (2, 2), weights (N, 6): derivatives of the end of a path by the place after a step and by the forces, by rows.
    """
    m, n_samples = synthesis.shape
    weights, later = np.empty((n_samples, 6)), np.empty(4)
    for place, pair in enumerate(pairs):
        weights[:] = 0.0
        later[0] = later[3] = 1.0
        later[1] = later[2] = 0.0
        # from the last step to the first
        for step in range(counts[place] - 1, -1, -1):
            if max(abs(later[0]), abs(later[1]), abs(later[2]), abs(later[3])) <= ROUND_OFF:
                break
            note = notes[place, step]
            for row in range(2):
                one, other = later[2 * row], later[2 * row + 1]
                for of in range(2):
                    sample, start = int(note[of]), 2 + 6 * of
                    if sample >= 0:
                        for k in range(3):
                            weights[sample, 3 * row + k] += one * note[start + k] + other * note[start + 3 + k]
                for k in range(2):
                    later[2 * row + k] = one * note[14 + k] + other * note[16 + k]
        for n in range(n_samples):
            for entry in range(6):
                weight = weights[n, entry]
                if weight != 0.0:
                    for k in range(m):
                        out[pair, entry // 3, entry % 3 * m + k] += weight * synthesis[k, n]
                    if entry % 3 == 0 and path.friction[pair] > 0.0:
                        # of the radius mu p_N at the end
                        out[pair, entry // 3, 3 * m] += weight * path.last[pair, 0, n] / path.friction[pair]


@register_jitable
def _follow(way: Way, state: FloatArray, notes: FloatArray) -> tuple[float, float, int, float]:
    """As `_slide` for one pair, with the discs of some samples, and the farthest distance from the start."""
    x_1, x_2, count, farthest, slips = state[0], state[1], 0, 0.0, False
    last = len(notes) - 1
    for part in range(PARTS + 1):
        along = part / PARTS
        common, one, other = _nearest(way, along, x_1, x_2)
        if not common:
            slips = True
            continue
        if slips:
            # the fraction of the path at which the discs come to have a common point
            slips, low, begin = False, along - 1.0 / PARTS, along
            for _ in range(ROUNDS):
                middle = 0.5 * (low + begin)
                if _nearest(way, middle, x_1, x_2)[0]:
                    begin = middle
                else:
                    low = middle
            _, one, other = _nearest(way, begin, x_1, x_2)
            if one >= 0:
                x_1, x_2 = _project(way, begin, x_1, x_2, one, other, notes[last])
            x_1, x_2 = _meet(way, begin, x_1, x_2, notes[min(count, last)])
            count, farthest = count + 1, max(farthest, np.hypot(x_1 - state[0], x_2 - state[1]))
            common, one, other = _nearest(way, along, x_1, x_2)
        if one >= 0:
            x_1, x_2 = _project(way, along, x_1, x_2, one, other, notes[min(count, last)])
            count, farthest = count + 1, max(farthest, np.hypot(x_1 - state[0], x_2 - state[1]))
    return x_1, x_2, count, farthest


@register_jitable
def _nearest(way: Way, along: float, x_1: float, x_2: float) -> tuple[bool, int, int]:
    """Whether all discs have a common point at a fraction of the path, and the disc, or the two, on whose border the
    one nearest to x lies: -1 where x lies within all.

    Each round takes in the disc that the place found so far violates most; the distance to x grows from round to round.
    """
    one, other, new, violated, discs = -1, -1, -1, 0.0, way.discs
    for place in range(way.near.size):
        n = way.near[place]
        normal = way.first[0, n] + along * (way.last[0, n] - way.first[0, n])
        if normal <= 0.0:
            return False, -1, -1
        discs[0, place] = way.first[1, n] + along * (way.last[1, n] - way.first[1, n])
        discs[1, place] = way.first[2, n] + along * (way.last[2, n] - way.first[2, n])
        radius = discs[2, place] = (1.0 - INSIDE) * way.friction * normal
        apart = (x_1 - discs[0, place]) ** 2 + (x_2 - discs[1, place]) ** 2
        if apart > radius * radius and np.sqrt(apart) - radius > violated:
            new, violated = place, np.sqrt(apart) - radius
    for _ in range(ROUNDS):
        if new < 0:
            return True, one, other
        y_1, y_2 = x_1, x_2
        size = np.hypot(x_1 - discs[0, new], x_2 - discs[1, new])
        alone = size > discs[2, new]
        if alone:
            y_1 = discs[0, new] + discs[2, new] / size * (x_1 - discs[0, new])
            y_2 = discs[1, new] + discs[2, new] / size * (x_2 - discs[1, new])
            for place in (one, other):
                alone = alone and (place < 0 or _outside(y_1, y_2, discs, place) == 0.0)
        if alone:
            one, other = new, -1
        else:
            best, partner = np.inf, -1
            for place, third in ((one, other), (other, one)):
                if place >= 0:
                    distance, z_1, z_2 = _corner(x_1, x_2, discs, new, place, third)
                    if distance < best:
                        best, partner, y_1, y_2 = distance, place, z_1, z_2
            if partner < 0:
                return False, -1, -1
            one, other = new, partner
        new, violated = -1, 0.0
        for place in range(way.near.size):
            outside = _outside(y_1, y_2, discs, place)
            if outside > violated and place != one and place != other:
                new, violated = place, outside
    return False, -1, -1


@register_jitable
def _outside(x_1: float, x_2: float, discs: FloatArray, place: int) -> float:
    """Distance from a disc, 0 within round-off of it."""
    distance = np.sqrt((x_1 - discs[0, place]) ** 2 + (x_2 - discs[1, place]) ** 2) - discs[2, place]
    return distance if distance > 0.01 * INSIDE * discs[2, place] else 0.0


@register_jitable
def _corner(x_1: float, x_2: float, discs: FloatArray, one: int, other: int, third: int) -> tuple[float, float, float]:
    """The corner of two discs that is nearest to x among those inside of a third one (-1: none): its distance, inf
    where there is none, and the corner.
    """
    way_1, way_2 = discs[0, other] - discs[0, one], discs[1, other] - discs[1, one]
    between = np.hypot(way_1, way_2)
    r, s = discs[2, one], discs[2, other]
    if between == 0.0 or between > r + s or between < abs(r - s):
        return np.inf, x_1, x_2
    n_1, n_2 = way_1 / between, way_2 / between
    along = 0.5 * (between + (r - s) * (r + s) / between)
    across = np.sqrt(max((r - along) * (r + along), 0.0))
    best, y_1, y_2 = np.inf, x_1, x_2
    for side in range(2):
        height = across if side == 0 else -across
        z_1, z_2 = discs[0, one] + along * n_1 - height * n_2, discs[1, one] + along * n_2 + height * n_1
        distance = np.hypot(z_1 - x_1, z_2 - x_2)
        if distance < best and (third < 0 or _outside(z_1, z_2, discs, third) == 0.0):
            best, y_1, y_2 = distance, z_1, z_2
    return best, y_1, y_2


@register_jitable
def _project(
    way: Way, along: float, x_1: float, x_2: float, one: int, other: int, note: FloatArray
) -> tuple[float, float]:
    """Projection onto one disc, or onto the nearest corner of two, as `_nearest` has found them; and its note."""
    discs, grown = way.discs, (1.0 - INSIDE) * way.friction
    c_1, c_2, radius = discs[0, one], discs[1, one], discs[2, one]
    note[:] = 0.0
    note[0], note[1] = way.near[one], -1.0
    if other < 0:
        size = np.hypot(x_1 - c_1, x_2 - c_2)
        u_1, u_2, ratio = (x_1 - c_1) / size, (x_2 - c_2) / size, radius / size
        # across the normal the place before counts with the ratio, the centre with the rest
        note[14], note[17] = ratio * u_2 * u_2, ratio * u_1 * u_1
        note[15] = note[16] = -ratio * u_1 * u_2
        note[2], note[3], note[4] = along * grown * u_1, along * (1.0 - note[14]), -along * note[15]
        note[5], note[6], note[7] = along * grown * u_2, -along * note[16], along * (1.0 - note[17])
        return c_1 + radius * u_1, c_2 + radius * u_2
    _, x_1, x_2 = _corner(x_1, x_2, discs, one, other, -1)
    note[1] = way.near[other]
    u_1, u_2 = (x_1 - c_1) / radius, (x_2 - c_2) / radius
    v_1, v_2 = (x_1 - discs[0, other]) / discs[2, other], (x_2 - discs[1, other]) / discs[2, other]
    # discs that only just touch have a corner that moves at any speed: least sine of the angle between their borders
    area = u_1 * v_2 - u_2 * v_1
    area = np.copysign(max(abs(area), NEGLIGIBLE), area)
    for place, moved, normal in ((2, (v_2, -v_1), (u_1, u_2)), (8, (-u_2, u_1), (v_1, v_2))):
        for row in range(2):
            push, start = along * moved[row] / area, place + 3 * row
            note[start], note[start + 1], note[start + 2] = push * grown, push * normal[0], push * normal[1]
    return x_1, x_2


@register_jitable
def _meet(way: Way, along: float, x_1: float, x_2: float, note: FloatArray) -> tuple[float, float]:
    """The point at which two discs come to touch, at a fraction of the path at which all have a very small common part,
    with the place x in it, and its note: the fraction, too, depends on the forces at the end.
    """
    discs, grown = way.discs, (1.0 - INSIDE) * way.friction
    one = other = -1
    least = np.inf
    for place in range(way.near.size):
        room = discs[2, place] - np.hypot(x_1 - discs[0, place], x_2 - discs[1, place])
        if room < least:
            one, least = place, room
    least = np.inf
    for place in range(way.near.size):
        toward = (x_1 - discs[0, place]) * (x_1 - discs[0, one]) + (x_2 - discs[1, place]) * (x_2 - discs[1, one])
        room = discs[2, place] - np.hypot(x_1 - discs[0, place], x_2 - discs[1, place])
        if toward < 0.0 and room < least:
            other, least = place, room
    note[:] = 0.0
    note[0], note[1] = way.near[one], -1.0
    if other < 0:
        # a pair that was open, or three discs: the place goes with the first one
        note[3] = note[7] = along
        return x_1, x_2
    note[1] = way.near[other]
    between = np.hypot(discs[0, other] - discs[0, one], discs[1, other] - discs[1, one])
    n = (discs[0, other] - discs[0, one]) / between, (discs[1, other] - discs[1, one]) / between
    share, across = discs[2, one] / between, (-n[1], n[0])
    # the gap of both discs closes at a rate; the derivatives of the gap are -grown, -n and -grown, n
    i, j = way.near[one], way.near[other]
    gap, speed_1, speed_2 = 0.0, 0.0, 0.0
    for row in range(2):
        # the point is that of the first disc along n; across, both centres share it
        for k in range(2):
            turned = share * across[row] * across[k]
            note[3 + 3 * row + k], note[9 + 3 * row + k] = (1.0 if row == k else 0.0) - turned, turned
        note[2 + 3 * row] = grown * n[row]
    for k in range(3):
        one_moves, other_moves = way.last[k, i] - way.first[k, i], way.last[k, j] - way.first[k, j]
        gap += -grown * (one_moves + other_moves) if k == 0 else n[k - 1] * (other_moves - one_moves)
        speed_1 += note[2 + k] * one_moves + note[8 + k] * other_moves
        speed_2 += note[5 + k] * one_moves + note[11 + k] * other_moves
    for k in range(3):
        by_one, by_other = (-grown, -grown) if k == 0 else (-n[k - 1], n[k - 1])
        for row in range(2):
            speed = (speed_1 if row == 0 else speed_2) / gap if gap < 0.0 else 0.0
            note[2 + 3 * row + k] = along * (note[2 + 3 * row + k] - speed * by_one)
            note[8 + 3 * row + k] = along * (note[8 + 3 * row + k] - speed * by_other)
    return discs[0, one] + discs[2, one] * n[0], discs[1, one] + discs[2, one] * n[1]
