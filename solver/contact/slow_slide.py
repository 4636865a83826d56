"""Where the anchors of pairs go between two periodic states while the predicted force changes slowly.

A pair sticks as long as its tangential state x lies in the friction discs of all samples of the period, with the
centres `p_T(t)` and the radii `mu p_N(t)`, Eqs. (13)-(15). While the predicted force moves on from one state to the
next, a disc that reaches x takes it along, along its normal: the sweeping process of the intersection C of the discs
(Moreau, J. Differ. Equ. 26 (1977) 347). It is followed in equal parts of a straight path, at each by the projection

    x_k = argmin |x - x_(k-1)|,   x in C(k / n),

onto one disc or onto a corner of two. Where C is empty, the pair slips or opens in each period, and no place is at
rest: C is a point when the pair comes to stick again, so that it does not matter where x was before. The derivative by
the predicted force at the end of the path is the product of those of the projections, from the last to the first. A
corner does not depend on the place before.

Floats and arrays only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from solver.model import FloatArray, IntArray
from solver.settings import ROUND_OFF

PARTS = 32
"""Parts of a path. Dovetail, 16 pairs that slide for 2.8e5 cycles, `rtol` 1e-2: 18.606, 18.607, 18.607, 18.610,
18.611 mm3 with 512, 128, 32, 16, 8 parts."""

MOST_PROJECTIONS = 50
"""Most changes of the one or two discs of a projection; two or three are usual."""

INSIDE = 1e-10
"""Distance of a place from the border of its discs over their radius: the march through the period then finds that the
pair sticks. Well below the tolerance of the residual."""


class Path(NamedTuple):
    """Predicted forces first, last (n_contact, 3, N), N, at both ends of a straight path, friction coefficients
    (n_contact,), and the tangential state at its start (n_contact, 2), N.
    """

    first: FloatArray
    last: FloatArray
    friction: FloatArray
    state: FloatArray


@njit(cache=True)
def slide_along(pairs: IntArray, path: Path, out: FloatArray) -> None:
    """Tangential states of some pairs (n,) at the end of a path into out (n_contact, 2), N."""
    none = np.zeros((0, 7))
    for pair in pairs:
        first, last, state = path.first[pair], path.last[pair], path.state[pair]
        out[pair, 0], out[pair, 1], _ = _slide(first, last, path.friction[pair], state, none)


@njit(cache=True)
def slide_tangent(pairs: IntArray, path: Path, synthesis: FloatArray, out: FloatArray) -> None:
    """Derivatives of the states of `slide_along` by the harmonics of the predicted force at the end of the path, into
    out (n_contact, 2, 3m). synthesis (m, N): as in `FourierBasis`.
    """
    m, n_samples = synthesis.shape
    steps = np.empty((PARTS, 7))
    weights = np.empty((n_samples, 2, 3))
    for pair in pairs:
        first, last, state = path.first[pair], path.last[pair], path.state[pair]
        count = _slide(first, last, path.friction[pair], state, steps)[2]
        if count:
            _weigh(steps[:count], path.friction[pair], weights)
            for n in range(n_samples):
                for i in range(2):
                    for component in range(3):
                        weight = weights[n, i, component]
                        if weight != 0.0:
                            for k in range(m):
                                out[pair, i, component * m + k] += weight * synthesis[k, n]


@njit(cache=True)
def _slide(
    first: FloatArray, last: FloatArray, friction: float, state: FloatArray, steps: FloatArray
) -> tuple[float, float, int]:
    """State at the end of a path (3, N), and the number of projections, which are noted in `steps` (n, 7) where there
    is room: sample, other sample or -1, fraction of the path, and the unit normals at both; of a single disc in place
    of the second one its radius over the distance before.
    """
    n_samples = first.shape[1]
    discs, near, margin = np.empty((3, n_samples)), np.empty(n_samples, np.int64), np.empty(n_samples)
    reach = 0.0
    for n in range(n_samples):
        ends = np.inf
        for force in (first, last):
            apart = np.sqrt((force[1, n] - state[0]) ** 2 + (force[2, n] - state[1]) ** 2)
            ends = min(ends, friction * force[0, n] - apart)
        margin[n] = ends
        reach = max(reach, -4.0 * ends)
    # a margin is concave along a straight path: a state inside at both ends is inside between
    if reach == 0.0:
        return state[0], state[1], 0
    while True:
        n_near = 0
        for n in range(n_samples):
            if margin[n] <= reach:
                near[n_near] = n
                n_near += 1
        x_1, x_2, count, farthest = _follow(first, last, friction, state, near[:n_near], discs, steps)
        if farthest <= reach:
            return x_1, x_2, count
        reach = np.inf


@njit(cache=True)
def _follow(
    first: FloatArray,
    last: FloatArray,
    friction: float,
    state: FloatArray,
    near: IntArray,
    discs: FloatArray,
    steps: FloatArray,
) -> tuple[float, float, int, float]:
    """As `_slide` with the discs of some samples `near`, and the farthest distance from the start."""
    x_1, x_2, count, farthest, unused = state[0], state[1], 0, 0.0, np.empty(7)
    for part in range(1, PARTS + 1):
        along = part / PARTS
        worst, violated, open_ = -1, 0.0, False
        for place in range(near.size):
            n = near[place]
            normal = first[0, n] + along * (last[0, n] - first[0, n])
            radius = (1.0 - INSIDE) * friction * normal
            c_1 = first[1, n] + along * (last[1, n] - first[1, n])
            c_2 = first[2, n] + along * (last[2, n] - first[2, n])
            discs[0, place], discs[1, place], discs[2, place] = c_1, c_2, radius
            apart = (x_1 - c_1) ** 2 + (x_2 - c_2) ** 2
            if radius <= 0.0:
                open_ = True
            elif apart > radius * radius:
                outside = np.sqrt(apart) - radius
                if outside > violated:
                    worst, violated = place, outside
        if worst < 0 and not open_:
            continue
        one, other = -1, -1
        if not open_:
            one, other = _nearest(x_1, x_2, discs, near.size, worst)
        if one >= 0:
            note = steps[count] if count < len(steps) else unused
            note[0], note[1], note[2] = near[one], near[other] if other >= 0 else -1, along
            x_1, x_2 = _project(x_1, x_2, discs, one, other, note)
            count, farthest = count + 1, max(farthest, np.hypot(x_1 - state[0], x_2 - state[1]))
    return x_1, x_2, count, farthest


@njit(cache=True)
def _project(x_1: float, x_2: float, discs: FloatArray, one: int, other: int, note: FloatArray) -> tuple[float, float]:
    """Projection onto one disc, or onto the nearest corner of two; its entries 3 to 6 of `_slide` are noted."""
    c_1, c_2, radius = discs[0, one], discs[1, one], discs[2, one]
    if other < 0:
        size = np.hypot(x_1 - c_1, x_2 - c_2)
        note[3], note[4], note[5] = (x_1 - c_1) / size, (x_2 - c_2) / size, radius / size
        return c_1 + radius * note[3], c_2 + radius * note[4]
    _, x_1, x_2 = _corner(x_1, x_2, discs, one, other, -1)
    note[3], note[4] = (x_1 - c_1) / radius, (x_2 - c_2) / radius
    note[5], note[6] = (x_1 - discs[0, other]) / discs[2, other], (x_2 - discs[1, other]) / discs[2, other]
    return x_1, x_2


@njit(cache=True)
def _outside(x_1: float, x_2: float, discs: FloatArray, place: int) -> float:
    """Distance from a disc, 0 within round-off of it."""
    distance = np.sqrt((x_1 - discs[0, place]) ** 2 + (x_2 - discs[1, place]) ** 2) - discs[2, place]
    return distance if distance > 0.01 * INSIDE * discs[2, place] else 0.0


@njit(cache=True)
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


@njit(cache=True)
def _nearest(x_1: float, x_2: float, discs: FloatArray, n_discs: int, worst: int) -> tuple[int, int]:
    """The disc, or the two, whose border is nearest to x within all discs; (-1, -1) where they have no common point.

    Each round takes in the disc that the place found so far violates most; the distance to x grows from round to round.
    """
    one, other, new = -1, -1, worst
    for _ in range(MOST_PROJECTIONS):
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
                return -1, -1
            one, other = new, partner
        new, violated = -1, 0.0
        for place in range(n_discs):
            outside = _outside(y_1, y_2, discs, place)
            if outside > violated and place != one and place != other:
                new, violated = place, outside
        if new < 0:
            return one, other
    return -1, -1


@njit(cache=True)
def _weigh(steps: FloatArray, friction: float, weights: FloatArray) -> None:
    """Derivatives (N, 2, 3) of the end of a path by the predicted forces at its end, from its projections (n, 7)."""
    weights[:] = 0.0
    later = np.eye(2)
    for count in range(len(steps) - 1, -1, -1):
        one, other, along = int(steps[count, 0]), int(steps[count, 1]), steps[count, 2]
        u_1, u_2 = steps[count, 3], steps[count, 4]
        if other >= 0:
            v_1, v_2 = steps[count, 5], steps[count, 6]
            area = u_1 * v_2 - u_2 * v_1
            _weigh_normal(weights[one], later, (v_2 / area, -v_1 / area), (u_1, u_2), along, friction)
            _weigh_normal(weights[other], later, (-u_2 / area, u_1 / area), (v_1, v_2), along, friction)
            return
        _weigh_normal(weights[one], later, (u_1, u_2), (u_1, u_2), along, friction)
        # across the normal the place before counts with the ratio, the centre with the rest
        ratio = steps[count, 5]
        for i in range(2):
            across = later[i, 1] * u_1 - later[i, 0] * u_2
            weights[one, i, 1] -= along * (1.0 - ratio) * across * u_2
            weights[one, i, 2] += along * (1.0 - ratio) * across * u_1
            later[i, 0], later[i, 1] = -ratio * across * u_2, ratio * across * u_1
        if np.abs(later).max() < ROUND_OFF:
            return


@njit(cache=True)
def _weigh_normal(
    weight: FloatArray,
    later: FloatArray,
    moved: tuple[float, float],
    normal: tuple[float, float],
    along: float,
    friction: float,
) -> None:
    """Add to the weight (2, 3) of a sample: a disc moves the place by `moved` for each unit along its normal."""
    for i in range(2):
        push = along * (later[i, 0] * moved[0] + later[i, 1] * moved[1])
        weight[i, 0] += push * friction * (1.0 - INSIDE)
        weight[i, 1] += push * normal[0]
        weight[i, 2] += push * normal[1]
