"""How a small disturbance of a periodic state grows: exponents of the linear structure, Hill's equation, monodromy.

The monodromy integrates a disturbance (dy, dlambda) of displacements and contact force over one period,

    M dy'' + C dy' + K dy + dlambda = 0,                                                                     (1)

with the derivative of the contact law at each sample (`contact.law`), by BDF2: the contact holds displacements
suddenly, which needs damping at high rates. In N samples it damps a vibration at r times the frequency of the state by
the fraction `(2 pi r)^4 / (4 N^3)`. Pairs that stick or are open during the whole period need no law.

A travelling wave of nodal diameter d couples sectors. With the phase theta = w t + 2 pi s d / N of sector s, a
disturbance is the sum of x_n(t) exp(i n theta), whose part n obeys the structure of nodal diameter n d. So m sectors at
equal distances in theta are integrated, with the m parts of smallest |n|; m = N / gcd(N, d) are all sectors that move
differently. After a period over m each sector is where the next one was, with the m-th root of the multipliers.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import eigvals

from solver.compliant_contact import stiffened
from solver.contact.coulomb import SEPARATED, STICK
from solver.contact.element import SampledLaw
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import BoolArray, ComplexArray, FloatArray, IntArray, LinearModel, ReducedModel
from solver.settings import FEWEST_SAMPLES
from solver.stability.ring_steps import RingSteps, build_steps
from solver.structure.fourier import build_basis, derivative
from solver.structure.joint import Joint
from solver.structure.ring import RingModel, RingStructure

SMALL_SAMPLES = 512
"""Samples of the law in a period of a small joint: 72 scenes with one pair lie on the right side of 1, most within
0.01. A quarter for larger joints: within 0.003 with 48 pairs."""

HILL_SAMPLES = 8 * SMALL_SAMPLES
"""Samples of the contact law for Hill's equation, and most of them in time."""

EXPENSIVE_UNKNOWNS = 1000
"""Unknowns of an expensive dense solve: above, no odd harmonics above 79, no 3 N + 2 samples to compare, and no
eigenvalues of Hill's matrix (255 unknowns take 0.15 s, 800 take 3 s). With 600 slider, blocks, waves and impacts are
equal."""

# Real part over omega from which an exponent is infinite, that of a displacement without mass made finite by round-off:
# in random scenes from 8e10 on, those of the joint -88 to 0.
_INFINITE = 1e3
ROUNDING = float(np.finfo(np.float64).eps)
_HALF = 0.499  # imaginary part over omega from which a multiplier counts as real and negative


class Monodromy(NamedTuple):
    """Integration of disturbances through N samples of a period, with n displacements and p switching pairs.

    - response (n, 2n): motion without contact forces from the known parts of acceleration and velocity, m per sample.
      spread (n, 3p): motion under unit contact forces, m/N. Of a ring its steps by waves, and none.
    - inverse (N, 3p, 3p): contact forces from the right-hand side of the law.
    - past (N, p, 3, 12): right-hand side of the law from `du` without contact forces, `du'`, known velocity, `dv'`.
    - by_inner, inner_by_motion, kept: as in `SampledLaw`, the first one also a part of the right-hand side.
    - places (12p,): rows of these four motions, and 4n for a displacement that does not exist.
    - turn (4n + p q,): rows of a disturbance as seen from the next sector. n_sectors: m. n_blades: of all sectors.

    n and p count the displacements and pairs of all m sectors, N the samples of a period over m.
    A disturbance (4n + p q, j) has displacements and velocities (m per sample), both now and at the sample before, and
    the inner states of the pairs.
    """

    response: Any
    spread: Any
    inverse: FloatArray
    past: FloatArray
    by_inner: FloatArray
    inner_by_motion: FloatArray
    kept: FloatArray
    places: IntArray
    turn: IntArray
    n_sectors: int
    n_blades: int


def passed(of: Monodromy, disturbance: FloatArray) -> FloatArray:
    """Disturbances (4n + p q, j) a period over m later."""
    return _pass_period(of, disturbance) if of.spread is not None else _pass_period_of_ring(of, disturbance)


def _pass_period_of_ring(of: Monodromy, disturbance: FloatArray) -> FloatArray:
    """As `_pass_period`."""
    steps: RingSteps = of.response
    width = disturbance.shape[1]
    n, (n_pairs, n_inner) = steps.n_moving, of.kept.shape[1:]
    inner, (now, before, speed, speed_before) = disturbance[4 * n :], disturbance[: 4 * n].reshape(4, n, width)
    nothing = np.zeros((1, width))
    for inverse, past, by_inner, by_motion, kept in zip(
        of.inverse, of.past, of.by_inner, of.inner_by_motion, of.kept, strict=True
    ):
        known = 0.5 * before - 2.0 * now
        free = steps.motion(steps.by_given, 1.5 * known + 0.5 * speed_before - 2.0 * speed, known)
        of_pairs = np.concatenate([free, now, known, speed, nothing])[of.places].reshape(n_pairs, 12, width)
        right = past @ of_pairs + by_inner @ inner.reshape(n_pairs, n_inner, width)
        after = free - steps.motion(steps.by_force, inverse @ right.reshape(-1, width))
        moved = np.concatenate([after, nothing])[np.minimum(of.places.reshape(-1, 4, 3)[:, 0], n)]
        inner = (by_motion @ moved + kept[:, :, None] * inner.reshape(n_pairs, n_inner, width)).reshape(-1, width)
        now, before, speed, speed_before = after, now, 1.5 * after + known, speed
    return np.concatenate([now, before, speed, speed_before, inner])[of.turn]


@njit(cache=True)
def _pass_period(of: Monodromy, disturbance: FloatArray) -> FloatArray:
    """Disturbances (4n + p q, j) a period over m later. Compiled: for small joints a tenth of the time."""
    n, n_rows, width, n_inner = of.response.shape[0], of.inverse.shape[1], disturbance.shape[1], of.kept.shape[2]
    # rows of now, before, speed, speed_before; and of after, now, known, speed
    state, past, given = disturbance.copy(), np.empty((4 * n, width)), np.empty((2 * n, width))
    right, force, pushed = np.empty((n_rows, width)), np.empty((n_rows, width)), np.empty((n, width))
    for sample in range(of.inverse.shape[0]):
        for i in range(n):
            for j in range(width):
                # BDF2: v = 3/2 y + known; acceleration from v in the same way
                known = 0.5 * state[n + i, j] - 2.0 * state[i, j]
                given[i, j] = 1.5 * known + 0.5 * state[3 * n + i, j] - 2.0 * state[2 * n + i, j]
                given[n + i, j] = past[2 * n + i, j] = known
                past[n + i, j], past[3 * n + i, j] = state[i, j], state[2 * n + i, j]
        np.dot(of.response, given, past[:n])
        for row in range(n_rows):
            pair, i = row // 3, row % 3
            for j in range(width):
                total = 0.0
                for m in range(12):
                    place = of.places[12 * pair + m]
                    if place < 4 * n:
                        total += of.past[sample, pair, i, m] * past[place, j]
                for k in range(n_inner):
                    total += of.by_inner[sample, pair, i, k] * state[4 * n + pair * n_inner + k, j]
                right[row, j] = total
        np.dot(of.inverse[sample], right, force)
        np.dot(of.spread, force, pushed)
        for i in range(n):
            for j in range(width):
                after = past[i, j] - pushed[i, j]
                state[n + i, j], state[3 * n + i, j] = past[n + i, j], past[3 * n + i, j]
                state[i, j], state[2 * n + i, j] = after, 1.5 * after + past[2 * n + i, j]
        for inner in range(len(state) - 4 * n):
            pair, k = inner // n_inner, inner % n_inner
            for j in range(width):
                total = of.kept[sample, pair, k] * state[4 * n + inner, j]
                for i in range(3):
                    place = of.places[12 * pair + i]
                    if place < 4 * n:
                        total += of.inner_by_motion[sample, pair, k, i] * state[place, j]
                state[4 * n + inner, j] = total
    return state[of.turn]


def build_monodromy(joint: Joint, at: Evaluation, n_samples: int, n_sectors: int = 1) -> Monodromy:
    """Monodromy of a state at a fixed wear depth, with at least so many samples of the contact law, a multiple of m.

    Raises numpy.linalg.LinAlgError where the structure is singular.
    """
    ring = joint.model if isinstance(joint.model, RingModel) else None
    apart = ring.phase_steps if ring else 1
    steps = -(-n_samples // (n_sectors * apart)) * apart
    fine = replace(joint, basis=build_basis(joint.basis.orders, steps * n_sectors))
    state = Balance(fine, at.start_history, at.wear_depth, energy=at.energy).evaluate(at.predicted_h)
    model, (switching, stuck) = stiffened(joint.model, joint.contact), integrated_pairs(joint, state)
    waves = model.linear[0] if isinstance(model.linear[0], RingStructure) else None
    dofs, moves = joint.contact.dofs, moving(joint, stuck)
    # displacements of the switching pairs among those that move, -1 for none
    n, first = np.count_nonzero(moves) * n_sectors, np.count_nonzero(moves) * np.arange(n_sectors)[:, None, None]
    place = np.where(dofs[switching] >= 0, first + (np.cumsum(moves) - 1)[dofs[switching]], -1).reshape(-1, 1, 3)
    rows = place.ravel()
    build = partial(build_steps, waves) if waves else partial(_dense_steps, model, n_sectors)
    response, spread, flexibility = build(moves, rows, fine.law.sample_step)
    sampled = list(vars(fine.law.sampled(state, np.flatnonzero(switching))).values())
    if ring:
        # the structure of a ring is taken at one time, at which each of its sectors has another phase
        at_phase = np.arange(steps)[:, None] + ring.phase_of_pairs[switching] * (steps // apart)
        sampled = [part[at_phase % steps, np.arange(part.shape[1])] for part in sampled]
    # each sector goes through its own part of the period
    law = SampledLaw(*(np.hstack(part.reshape(n_sectors, steps, *part.shape[1:])) for part in sampled))
    # of displacements and velocities, now and before, and of the inner states
    rows_of_sectors = (
        np.arange(4 * n).reshape(4, n_sectors, -1),
        4 * n + np.arange(law.kept[0].size).reshape(n_sectors, law.kept[0].size // n_sectors),
    )
    parts = (-law.by_motion - 1.5 * law.by_speed, law.by_last_motion, -law.by_speed, law.by_last_speed)
    return Monodromy(
        response=response,
        spread=spread,
        inverse=_inverse_of_law(law, flexibility),
        past=np.concatenate(parts, axis=3),
        by_inner=law.by_inner,
        inner_by_motion=law.inner_by_motion,
        kept=law.kept,
        places=np.where(place < 0, 4 * n, place + n * np.arange(4)[:, None]).ravel(),
        turn=np.concatenate([np.roll(each, 1, axis=-2).ravel() for each in rows_of_sectors]),
        n_sectors=n_sectors,
        n_blades=joint.model.n_sectors if ring else n_sectors,
    )


def _dense_steps(
    model: ReducedModel, n_sectors: int, moves: BoolArray, rows: IntArray, step: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`response`, `spread`, and motion (3p, 3p) of the switching pairs under their unit forces, m/N."""
    mass, damping, stiffness = _of_sectors(model, moves, n_sectors)
    inertia, drag = mass / step**2, damping / step
    compliance = np.asarray(np.linalg.inv(2.25 * inertia + 1.5 * drag + stiffness), np.float64)
    spread = np.where(rows >= 0, compliance[rows].T, 0.0)
    flexibility = np.where(rows[:, None] >= 0, spread[rows], 0.0)
    return -compliance @ np.hstack([inertia, drag]), np.ascontiguousarray(spread), flexibility


def _of_sectors(model: ReducedModel, moves: BoolArray, n_sectors: int) -> Iterator[FloatArray]:
    """Mass, damping, stiffness (m k, m k) of m sectors at equal distances in phase, in k displacements that move."""
    places = np.arange(n_sectors)
    harmonics = (places + n_sectors // 2) % n_sectors - n_sectors // 2
    waves = np.exp(2j * np.pi / n_sectors * np.outer(harmonics, places)) / np.sqrt(n_sectors)
    structures = [model.harmonic_structure(harmonic) for harmonic in harmonics.tolist()]
    for name in ("mass", "damping", "stiffness"):
        each = (getattr(linear, name)[np.ix_(moves, moves)] for linear in structures)
        whole = sum(np.kron(np.outer(wave, wave.conj()), part) for wave, part in zip(waves, each, strict=True))
        yield np.ascontiguousarray(np.real(whole))


def _inverse_of_law(law: SampledLaw, flexibility: FloatArray) -> FloatArray:
    """Inverse (N, 3p, 3p) of the law for the contact forces; flexibility (3p, 3p): motion under them, m/N."""
    n_samples, n_pairs = law.by_force.shape[:2]
    blocks, pairs = flexibility.reshape(n_pairs, 3, 3 * n_pairs), np.arange(n_pairs)
    inverse = np.empty((n_samples, 3 * n_pairs, 3 * n_pairs))
    # in parts, which bounds the memory of large joints
    for first in range(0, n_samples, FEWEST_SAMPLES):
        part = slice(first, first + FEWEST_SAMPLES)
        system = -((law.by_motion[part] + 1.5 * law.by_speed[part]) @ blocks)
        system.reshape(len(system), n_pairs, 3, n_pairs, 3)[:, pairs, :, pairs] += law.by_force[part].swapaxes(0, 1)
        inverse[part] = np.linalg.inv(system.reshape(len(system), 3 * n_pairs, 3 * n_pairs))
    return inverse


def moving(joint: Joint, fixed: BoolArray) -> BoolArray:
    """True for the displacements (n,) of the structure that move while the pairs `fixed` (n_contact,) stick."""
    dofs = joint.contact.dofs[fixed]
    moves = np.ones(len(joint.model.linear[0].load_static), bool)
    moves[dofs[dofs >= 0]] = False
    return moves


def switching_pairs(at: Evaluation) -> tuple[BoolArray, BoolArray]:
    """Pairs (n_contact,) that slip or open in a part of the period; pairs that stick during the whole period."""
    stuck = (at.status_t == STICK).all(axis=1)
    return ~stuck & ~(at.status_t == SEPARATED).all(axis=1), stuck


def integrated_pairs(joint: Joint, at: Evaluation) -> tuple[BoolArray, BoolArray]:
    """As `switching_pairs`. Of a ring a pair is the same in all sectors, and switches where it does in one of them: in
    each wave the displacements that move are those of one sector.
    """
    switching, stuck = switching_pairs(at)
    if not isinstance(joint.model, RingModel):
        return switching, stuck
    n = joint.model.n_sectors
    is_open, stuck = (np.tile(each.reshape(n, -1).all(axis=0), n) for each in (~switching & ~stuck, stuck))
    return ~is_open & ~stuck, stuck


def hill_multipliers(joint: Joint, at: Evaluation) -> ComplexArray:
    """Floquet multipliers exp(2 pi sigma / omega) of a state of a small real joint without masses on rigid ground.

    Empty where the eigenvalue problem is large. A disturbance x(t) exp(sigma t) obeys the linearised balance of all
    displacements x and predicted forces p, with d = d/dt + sigma:

        M d^2 x + C d x + K x + S^T dlambda/dp p = 0,        S x = du/dp p.

    Of the copies `sigma + i k omega` of an exponent those with the smallest imaginary parts count (Moore, SIAM J.
    Numer. Anal. 42 (2005) 2553). Largest error of the multipliers of the vibro-impact curve, up to 3.19, and CPU s:
    0.02 and 2.5, by time integration 0.56 and 11.7.
    """
    linear, m, n_rel = joint.model.linear[0], len(joint.basis.synthesis), joint.component_index.size
    n = len(linear.mass)
    if (2 * n + n_rel) * m > EXPENSIVE_UNKNOWNS:
        return np.empty(0, np.complex128)
    fine = replace(joint, basis=build_basis(joint.basis.orders, HILL_SAMPLES))
    balance = Balance(fine, at.start_history, at.wear_depth, energy=at.energy)
    tangent = balance.linearise(balance.evaluate(at.predicted_h))
    size = float(np.abs(linear.stiffness).max())
    # time in 1 / omega, forces over the largest stiffness
    mass, damping, stiffness = (
        np.asarray(np.real(part) * (joint.omega**power / size), np.float64)
        for part, power in ((linear.mass, 2), (linear.damping, 1), (linear.stiffness, 0))
    )
    rate = derivative(np.eye(m), np.array(fine.basis.orders, np.float64)).T
    motion, force = tangent.matrices(np.arange(joint.contact.n_contact)).reshape(2, n_rel * m, n_rel * m)
    select = np.kron(np.eye(n)[joint.contact.relative], np.eye(m))
    left = np.zeros((2 * n * m + n_rel * m, 2 * n * m + n_rel * m))
    right, one = left.copy(), np.eye(m)
    x, v, p = slice(0, n * m), slice(n * m, 2 * n * m), slice(2 * n * m, None)
    left[x, v] = right[x, x] = np.eye(n * m)
    left[v, x] = -np.kron(mass, rate @ rate) - np.kron(damping, rate) - np.kron(stiffness, one)
    left[v, v] = -2.0 * np.kron(mass, rate) - np.kron(damping, one)
    left[v, p] = -select.T @ force
    left[p, x], left[p, p] = select, -size * motion
    right[v, v] = np.kron(mass, one)
    exponents = eigvals(left, right)
    finite = exponents[(np.abs(exponents.real) < _INFINITE) & (np.abs(exponents.imag) <= 1.0 - _HALF)]
    # both copies of a real and negative multiplier lie at the edge of the strip
    finite = finite[(np.abs(finite.imag) < _HALF) | (finite.imag > 0.0)]
    finite = finite[np.argsort(np.abs(finite.imag), kind="stable")][: 2 * int(np.linalg.matrix_rank(mass))]
    multipliers = np.exp(2.0 * np.pi * finite)
    return np.asarray(np.where(np.abs(finite.imag) >= _HALF, -np.abs(multipliers), multipliers))


def linear_exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of all motions exp(sigma t) of a linear structure; moves (n,): displacements that move."""
    parts = [part[np.ix_(moves, moves)] for part in (linear.mass, linear.damping, linear.stiffness)]
    sizes, motions = np.linalg.eigh(parts[0])
    n = len(sizes)
    mass, damping, stiffness = (motions.conj().T @ part @ motions for part in parts)
    # motions without mass come first, as the mass has no negative eigenvalues but round-off
    light = int(np.count_nonzero(sizes <= n * ROUNDING * sizes.max(initial=0.0)))
    damping[:light][np.abs(damping[:light]) <= n * ROUNDING * np.abs(damping).max(initial=0.0)] = 0.0
    # y: all motions, v: velocities of those with mass; -K y - C v = sigma (C_light y_light + M v), sigma y_heavy = v.
    # A motion without mass and damping has an infinite exponent.
    heavy = n - light
    left = np.block([[-stiffness, -damping[:, light:]], [np.zeros((heavy, n)), np.eye(heavy)]])
    right = np.zeros_like(left)
    right[:n, :light], right[light:n, n:], right[n:, light:n] = damping[:, :light], mass[light:, light:], np.eye(heavy)
    found = eigvals(left, right)
    return np.asarray(found[np.isfinite(found)], np.complex128)
