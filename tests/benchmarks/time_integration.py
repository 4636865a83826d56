"""Wear of a reduced model once more, by nonsmooth time integration: a second opinion.

`python -m tests.benchmarks.time_integration [--mesh 1] [--frequency 212.42] [--each 20] [--steps 250]` prints worn
volume and tip amplitude of the bundled dovetail root; `--single 16000` takes the first cycles one by one.
`--friction 0.3 --energy 0 1e5 --frictions 0.3 0.5` lets the friction of a pair rise with the energy that it dissipates.
`--approach ramp --periods 50 --cycles 0` shows the unworn motion after a fast ramp, `--sectors 48 --diameter 16 --steps
120` a travelling wave on three sectors, after which it repeats. Nothing of the solver is used but the model.

- Time: backward differences of second order whose three weights are exact for the excitation frequency. With them
  M x'' + C x' + K x + S^T lambda = f becomes x = G (r - S^T lambda) at each step, and the relative displacements of the
  pairs are u = S x = u_free - D lambda with a constant matrix D = S G S^T.
- Contact, implicit and without penalty: Signorini u_N <= gap + depth, lambda_N >= 0, one of them equal; Coulomb with
  the increment of u_T over a step along lambda_T, zero inside the cone. Newton's method on the set of open, sticking
  and slipping pairs.
- Wear: the depth of a pair grows after each period by k_w / area times the sum of lambda_N |increment of u_T|, times
  the cycles for which a period stands, without jumps after which the motion would have to settle anew.
- The first mode of the glued joint dies out slowly, in some 300 periods. While the joint wears, and while an unworn
  motion settles, its complex amplitude goes several times as far in each period as by itself (projective integration,
  Gear and Kevrekidis, SIAM J. Sci. Comput. 24 (2003) 1091), at most the cycles for which the period stands, and fewer
  where the mode beats. The motion lags behind the wear: 1e5 cycles, 40 and 20 cycles a period: 1.8830 and 1.8824 mm3 at
  212.42 Hz, 0.7306 and 0.7204 at 213 Hz; 250 or 500 steps differ by 0.01 %.
- The friction history of sticking pairs converges more slowly than the volume, as the root of the cycles of a period:
  at 212.5 Hz, 16 000 cycles, a pair that sticks is 0.20, 0.11, 0.06 um from its place with 20, 5, 1.5 cycles a period.
  Where a pair only just slips this decides: there, `--single 16000` takes the first cycles one by one.
"""

import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numba import njit

from solver.model import ComplexArray, FloatArray, ReducedModel
from studies import build_scene
from tests.benchmarks.frame import Table, arguments
from tests.rings import ring_of_sectors

_LOAD_STEPS = 20  # of the static load
_CONTACT_ITERATIONS = 90
_SETTLED = 1e-4  # relative distance of the amplitude of the glued mode to its end, if nothing but this mode changed
_SETTLED_WORK = 1e-3  # relative change of the slip work over a period
_FAINT_WORK = 1e-5  # of the work of the excitation: slip work below which no change counts
_MOST_PERIODS = 3000
_HELD = 1000  # periods after a run-up or ramp, in which the first mode dies out to 0.1 %
_AHEAD = 15.0  # periods in one of the glued mode; |1 + 15 (mu - 1)| < 1 for its multiplier mu
_BEAT = 0.08  # relative difference of the changes of the mode in two periods, above which fewer are taken in one


class Structure(NamedTuple):
    """A model at one frequency and amplitude, for steps of equal length.

    - omega, step: rad/s, s.
    - weights (3,): of the derivative, 1/s: `weights @ (x now, before, before that)`.
    - inertia, drag (n, n): M and C. flexibility (n, n): G, m/N.
    - static (n,), cosine, sine (n,): loads, N. limits: friction coefficients (n_contact,).
    - pairs (3 n_contact, n): S, zero rows for none; contact (3 n_contact, 3 n_contact): D, m/N.
    - load (n_contact,): constant normal forces, N.
    - mode (n,), rate: mass-normalised glued mode that the excitation moves most, its exponent, 1/s; zeros for none.
    """

    omega: float
    step: float
    weights: FloatArray
    inertia: FloatArray
    drag: FloatArray
    flexibility: FloatArray
    static: FloatArray
    cosine: FloatArray
    sine: FloatArray
    limits: FloatArray
    pairs: FloatArray
    contact: FloatArray
    load: FloatArray
    mode: ComplexArray
    rate: complex


class Motion(NamedTuple):
    """State at the end of a step: displacements, m, velocities, m/s (2, n), now and before; forces, N, of the pairs.

    work (n_contact,): lambda_N times slip over the last period, J. responses (n_steps, n): its displacements, m.
    """

    x: FloatArray
    v: FloatArray
    force: FloatArray
    work: FloatArray
    responses: FloatArray


def fitted_weights(omega: float, step: float) -> FloatArray:
    """Weights (3,) of a backward difference that is exact for constants and for exp(i omega t)."""
    turn = np.exp(-1j * omega * step * np.arange(3))
    rows = np.array([np.ones(3), turn.real, turn.imag])
    return np.linalg.solve(rows, np.array([0.0, 0.0, omega]))


def build(model: ReducedModel, friction: float, frequency: float, amplitude: float, n_steps: int) -> Structure:
    """The model in `n_steps` steps of a period at a frequency, Hz, under an excitation amplitude, N."""
    linear, omega = model.linear[0], 2.0 * np.pi * frequency
    step = 2.0 * np.pi / omega / n_steps
    weights = fitted_weights(omega, step)
    mass, damping, stiffness = (np.real(part) for part in (linear.mass, linear.damping, linear.stiffness))
    dofs = model.contact.dofs
    free = np.setdiff1d(np.arange(len(mass)), dofs[dofs >= 0])
    mode, rate = np.zeros(len(mass), dtype=complex), 0.0 + 0.0j
    if free.size and np.abs(mass[np.ix_(free, free)]).max() > 0.0:
        squares, shapes = scipy.linalg.eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)])
        moved = np.abs(shapes.T @ linear.load_harmonic[free]) / np.abs(squares - omega**2)
        most = squares[np.argmax(moved)]
        # two modes of one frequency make the wave on a ring of sectors
        shapes = shapes[:, np.abs(squares - most) <= 1e-6 * most]
        mode[free] = shapes @ (shapes.T @ linear.load_harmonic[free])
        size = np.sqrt(np.real(mode.conj() @ mass @ mode))
        if size > 0.0:
            mode = mode / size
            rate = complex(-0.5 * np.real(mode.conj() @ damping @ mode), np.sqrt(most))
    flexibility = np.linalg.inv(weights[0] ** 2 * mass + weights[0] * damping + stiffness)
    pairs = np.where(dofs.reshape(-1, 1) >= 0, np.eye(len(mass))[dofs.ravel()], 0.0)
    return Structure(
        omega, step, weights, mass, damping, flexibility, linear.load_static,
        amplitude * linear.load_harmonic.real, -amplitude * linear.load_harmonic.imag, np.full(len(dofs), friction),
        pairs, pairs @ flexibility @ pairs.T, np.where(dofs[:, 0] < 0, model.contact.normal_load, 0.0), mode, rate,
    )  # fmt: skip


@njit(cache=True)
def solve_contact(
    s: Structure, free: FloatArray, before: FloatArray, gap: FloatArray, force: FloatArray
) -> tuple[FloatArray, bool]:
    """Contact forces (3 n_contact,), N, of a step, and whether they were found.

    free, before (3 n_contact,): displacements without contact forces, and those of the last step, m. gap (n_contact,):
    depth included, m. force: first guess, N.
    """
    contact, n = s.contact, gap.size
    for iteration in range(_CONTACT_ITERATIONS):
        moved = free - contact @ force
        matrix, right = np.eye(3 * n), np.zeros(3 * n)
        for i in range(n):
            a = 3 * i
            normal = right[a] = s.load[i]
            if contact[a, a] > 0.0:
                normal = force[a] + (moved[a] - gap[i]) / contact[a, a]
                if normal <= 0.0:
                    continue
                matrix[a], right[a] = contact[a] / contact[a, a], (free[a] - gap[i]) / contact[a, a]
            size = max(contact[a + 1, a + 1], contact[a + 2, a + 2])
            if size == 0.0:
                continue
            # zero along a tangent that the pair does not have
            pull = force[a + 1 : a + 3] + (moved[a + 1 : a + 3] - before[a + 1 : a + 3]) / size
            most, length = s.limits[i] * normal, np.hypot(pull[0], pull[1])
            for k in range(2):
                row = a + 1 + k
                if contact[row, row] == 0.0:
                    continue
                if length <= most:
                    matrix[row], right[row] = contact[row] / size, (free[row] - before[row]) / size
                    continue
                # lambda_T = mu lambda_N pull / |pull|, linearised in lambda
                matrix[row, a] = -s.limits[i] * pull[k] / length
                for j in range(2):
                    turn = most / length * ((k == j) - pull[k] * pull[j] / length**2)
                    matrix[row, a + 1 + j] -= turn
                    matrix[row] += turn * contact[a + 1 + j] / size
                    right[row] += turn * (free[a + 1 + j] - before[a + 1 + j]) / size
        change = np.linalg.solve(matrix, right) - force
        # shorter steps where the sets go round in circles
        force = force + (1.0 if iteration < 20 else 0.5) * change
        if np.abs(change).max() <= 1e-10 * (np.abs(force).max() + 1e-30):
            return force, True
    return force, False


@njit(cache=True)
def march(s: Structure, motion: Motion, gap: FloatArray, loads: FloatArray) -> tuple[Motion, bool]:
    """The motion after steps under the loads (n_steps, n), N, and whether each had contact forces."""
    x, v, force, found = motion.x.copy(), motion.v.copy(), motion.force, True
    work, seen = np.zeros(gap.size), np.zeros(loads.shape)
    for step in range(len(loads)):
        known = s.weights[1] * x[0] + s.weights[2] * x[1]
        past = s.weights[0] * known + s.weights[1] * v[0] + s.weights[2] * v[1]
        push = loads[step] - s.drag @ known - s.inertia @ past
        before = s.pairs @ x[0]
        force, found = solve_contact(s, s.pairs @ (s.flexibility @ push), before, gap, force)
        if not found:
            break
        x[1], v[1] = x[0], v[0]
        x[0] = seen[step] = s.flexibility @ (push - s.pairs.T @ force)
        v[0] = s.weights[0] * x[0] + known
        slip = s.pairs @ x[0] - before
        work += force[::3] * np.hypot(slip[1::3], slip[2::3])
    return Motion(x, v, force, work, seen), found


def advance(structure: Structure, motion: Motion, gap: FloatArray, loads: FloatArray) -> Motion:
    """The motion after steps under loads (n_steps, n), N. Raises RuntimeError where a step has no solution."""
    motion, found = march(structure, motion, gap, loads)
    if not found:
        raise RuntimeError("a step in time has no contact forces")
    return motion


def one_period(structure: Structure, motion: Motion, gap: FloatArray) -> Motion:
    """The motion a period later; it ends at phase 0 of the excitation."""
    n_steps = round(2.0 * np.pi / (structure.omega * structure.step))
    phases = 2.0 * np.pi * np.arange(1, n_steps + 1) / n_steps
    varying = np.outer(np.cos(phases), structure.cosine) + np.outer(np.sin(phases), structure.sine)
    return advance(structure, motion, gap, structure.static + varying)


def at_rest(model: ReducedModel, structure: Structure, gap: FloatArray) -> Motion:
    """Static state: the static load is raised in steps, with friction, and held; a drag omega^2 M holds loose parts."""
    s, none = structure, np.zeros((2, len(structure.static)))
    drag = s.omega**2 * s.inertia
    flexibility = np.linalg.inv(np.real(model.linear[0].stiffness) + drag)
    still = s._replace(
        inertia=0.0 * drag, drag=drag, weights=np.array([1.0, -1.0, 0.0]), flexibility=flexibility,
        contact=s.pairs @ flexibility @ s.pairs.T,
    )  # fmt: skip
    shares = np.minimum(np.arange(1, 5 * _LOAD_STEPS + 1) / _LOAD_STEPS, 1.0)
    start = Motion(none, none, np.zeros(len(s.pairs)), np.zeros(len(gap)), none)
    found = advance(still, start, gap, np.outer(shares, s.static))
    return found._replace(x=np.repeat(found.x[:1], 2, axis=0), v=none)


def amplitude_of_mode(structure: Structure, motion: Motion) -> complex:
    """Complex amplitude Q of the glued mode at the end of a period, phase 0: q = Re Q, q' = Re(i omega Q)."""
    share = structure.mode.conj() @ structure.inertia
    mean = share @ motion.responses.mean(axis=0)
    return complex(share @ motion.x[0] - mean - 1j * (share @ motion.v[0]) / structure.omega)


def push_mode(structure: Structure, motion: Motion, change: complex) -> Motion:
    """The motion with another amplitude of the glued mode, which moves no pair."""
    turns = change * np.exp(-1j * structure.omega * structure.step * np.arange(2))
    return motion._replace(
        x=motion.x + np.outer(turns, structure.mode).real,
        v=motion.v + np.outer(1j * structure.omega * turns, structure.mode).real,
    )


def settle(structure: Structure, motion: Motion, gap: FloatArray, work_change: float = _SETTLED_WORK) -> Motion:
    """The periodic motion to which a motion comes. Raises RuntimeError if it does not.

    work_change: relative change of the slip work over a period; a mass on rigid ground turns on whole steps only.
    """
    motion = one_period(structure, motion, gap)
    period = 2.0 * np.pi / structure.omega
    growth = np.exp((structure.rate - 1j * structure.omega) * period) - 1.0 if structure.rate else -1.0 + 0.0j
    # far from the resonance of the mode its beat would grow: there the joint sticks, and the end is known at once
    ahead = _AHEAD if abs(1.0 + _AHEAD * growth) < 1.0 else -1.0 / growth
    calm = 0
    for _ in range(_MOST_PERIODS):
        here, work = amplitude_of_mode(structure, motion), motion.work
        moved = one_period(structure, motion, gap)
        change = amplitude_of_mode(structure, moved) - here
        size = max(abs(here), 1e-300)
        faint = _FAINT_WORK * np.pi * size * abs(structure.mode.conj() @ (structure.cosine - 1j * structure.sine))
        still = np.abs(moved.work - work).max() <= work_change * max(float(moved.work.max()), faint)
        calm = calm + 1 if still and abs(change / growth) <= _SETTLED * size else 0
        if calm >= 2:
            return moved
        motion = push_mode(structure, moved, (ahead - 1.0) * change)
    raise RuntimeError(f"the motion does not settle in {_MOST_PERIODS} periods")


def run_up(frequency: float, amplitude: float, periods: int) -> FloatArray:
    """Frequencies, Hz, and amplitudes, N, (n_periods, 2): up, ever slower, after a ramp at 97 % of the frequency."""
    up = frequency * (1.0 - 0.03 * (1.0 - np.linspace(0.0, 1.0, periods)) ** 3)
    return np.concatenate([ramp(up[0], amplitude, 300), np.stack([up, np.full(periods, amplitude)], axis=1)])


def ramp(frequency: float, amplitude: float, periods: int) -> FloatArray:
    """Frequencies, Hz, and amplitudes, N, (periods, 2): the amplitude raised evenly at one frequency."""
    return np.stack([np.full(periods, frequency), amplitude * np.linspace(0.0, 1.0, periods + 1)[1:]], axis=1)


def driven(model: ReducedModel, friction: float, course: FloatArray, n_steps: int) -> tuple[Structure, Motion]:
    """Unworn motion after a course of frequencies, Hz, and amplitudes, N, (n_periods, 2), begun at rest."""
    structure = build(model, friction, *course[0], n_steps)
    motion = at_rest(model, structure, model.contact.gap)
    for frequency, amplitude in course.tolist():
        structure = build(model, friction, frequency, amplitude, n_steps)
        motion = one_period(structure, motion, model.contact.gap)
    return structure, motion


def loaded(model: ReducedModel, friction: float, course: FloatArray, n_steps: int) -> tuple[Structure, Motion]:
    """The motion to which that of `driven` settles."""
    held = np.concatenate([course, course[-1:].repeat(_HELD, axis=0)])
    structure, motion = driven(model, friction, held, n_steps)
    return structure, settle(structure, motion, model.contact.gap)


def wear(
    model: ReducedModel, structure: Structure, motion: Motion, wear_coefficient: float, each: float, cycles: float,
    single: float = 0.0, evolution: tuple[list[float], list[float]] = ([0.0], [np.nan]),
) -> Iterator[tuple[float, FloatArray, FloatArray, Motion]]:  # fmt: skip
    """Cycle count, depths, m, dissipated energies, J/m2 (n_contact,), and motion after each period, in which the joint
    wears `each` cycles.

    single: cycles at the beginning, each of which is a period by itself. evolution: energies, J/m2, and the friction
    coefficients of a pair there, linear between; NaN: that of the structure.
    """
    energy = depth = np.zeros(model.contact.n_contact)
    cycle, work = 0.0, motion.work
    amplitude, change, ahead = amplitude_of_mode(structure, motion), 0.0j, _AHEAD
    while cycle < cycles * (1.0 - 1e-12):
        taken = min(each if cycle >= single else 1.0, cycles - cycle)
        moved = one_period(structure, motion, model.contact.gap + depth)
        slipped = taken * 0.5 * (work + moved.work) / model.contact.area
        depth, energy = depth + wear_coefficient * slipped, energy + structure.limits * slipped
        friction = np.interp(energy, *evolution)
        structure = structure._replace(limits=np.where(np.isnan(friction), structure.limits, friction))
        cycle, work, here, before = cycle + taken, moved.work, amplitude_of_mode(structure, moved), change
        change = here - amplitude
        # a worn joint has another resonance than a glued one: beside it the beat of the mode would grow
        beats = abs(change - before) > _BEAT * abs(change)
        # at most the cycles for which the period stands: a cycle by itself is integrated as it is
        ahead = min(max(0.8 * ahead, 1.0) if beats else 1.1 * ahead, _AHEAD, max(taken, 1.0))
        motion, amplitude = push_mode(structure, moved, (ahead - 1.0) * change), here + (ahead - 1.0) * change
        yield cycle, depth, energy, motion


def first_harmonic(structure: Structure, motion: Motion, rows: FloatArray) -> np.ndarray:
    """First harmonic (n_rows,), m, of some displacements; rows (n_rows, n)."""
    phase = 2.0 * np.pi * np.arange(1, len(motion.responses) + 1) / len(motion.responses)
    return 2.0 * (np.exp(-1j * phase) @ (motion.responses @ rows.T)) / len(phase)


def main() -> None:
    given = arguments(
        __doc__, mesh=1, steps=250, periods=1000, sectors=47, diameter=0, frequency=212.42, each=20.0, single=0.0,
        cycles=1e5, amplitude=0.5, friction=0.5, approach="up", energy=[0.0], frictions=[np.nan],
    )  # fmt: skip
    model = build_scene("dovetail_sector", mesh=given.mesh, n_sectors=given.sectors, nodal_diameter=given.diameter)
    n_apart = 1
    if given.diameter:
        model, n_pairs = ring_of_sectors(model), model.contact.n_contact
        n_apart = model.contact.n_contact // n_pairs
        assert given.steps % n_apart == 0, f"--steps: give a multiple of {n_apart}, so that all sectors move alike"
    course = (run_up if given.approach == "up" else ramp)(given.frequency, given.amplitude, given.periods)
    began = time.process_time()
    structure, motion = loaded(model, given.friction, course, given.steps)
    rows = np.real(model.linear[0].response)
    table = Table("cycles", "tip, mm", "worn, mm3", "slip work, J", "dissipated, J", "CPU s")

    def row(cycle: float, now: Motion, *slow: FloatArray) -> None:
        worn, dissipated = (float(each @ model.contact.area) / n_apart for each in slow)
        numbers = 1e9 * worn, now.work.sum() / n_apart, dissipated, time.process_time() - began
        table.row(f"{cycle:.0f}", 1e3 * float(abs(first_harmonic(structure, now, rows)[0])), *map(float, numbers))

    row(0.0, motion, *np.zeros((2, model.contact.n_contact)))
    shown, evolution = 0.05 * given.cycles, (given.energy, given.frictions)
    asked = structure, motion, 1.1e-11, given.each, given.cycles, given.single, evolution
    for cycle, depth, energy, now in wear(model, *asked):
        if cycle >= shown * (1.0 - 1e-12):
            shown += 0.05 * given.cycles
            row(cycle, now, depth, energy)


if __name__ == "__main__":
    main()
