"""A step on the slow time scale as one balance: explicit or implicit Euler, or BDF2; and how wear acts back.

- explicit, Eqs. (20), (23): W_(n+1) = W_n + h g(W_n), a given depth;
- implicit, Eqs. (24) to (26): W_(n+1) = W_n + h g(W_(n+1));
- adaptive: backward differences of second order (BDF2). With w = h_n / h_(n-1), the ratio of two steps,

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

  an implicit Euler step from a depth that is already worn and with a shorter h. It is zero-stable for w < 1 + sqrt(2);
  both factors are positive, so that wear never falls. The local error follows from the difference to an explicit
  formula of the same order (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

  The first step, also after a jump, is an implicit Euler step. Its error is the difference to the trapezoidal rule.

The wear of other pairs changes the force of a pair, which slides a little in each cycle at its friction limit. Where it
ends depends on the path of the force: one slide for the whole step is an error of first order in its length. So the
tangential history of a step is that of a straight path from the state before to the end that is sought
(`solver.contact.slow_slide`), and Newton's method finds both at once. Dovetail, 16 pairs that slide for 2.8e5 cycles:
18.61 and 18.60 mm3 with `rtol` 1e-2 and 1e-3.

The motion follows the depths as dp = -J^-1 Z E dW, where E puts the depths into the static normal displacements, and
the rates follow the motion as dg = G dp. A table of factors adds its own derivative with respect to the depth.
"""

import math
from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.continuation.natural import SMOOTH_CHANGE
from solver.continuation.transient import RUNAWAY
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.harmonic_balance.state import Failure, vibration_size
from solver.model import BoolArray, FloatArray
from solver.newton.krylov import SIGN_PRODUCTS, ritz_values
from solver.outcome import Outcome, in_digits
from solver.settings import Scheme
from solver.structure.joint import Joint
from solver.wear.wearing_joint import LastStep, WearingJoint, WearState

LARGEST_MOVED_LOAD = 10.0
"""Largest change of the normal forces in a step, over these forces, both as norms. For smaller changes the error of the
worn volume is a sufficient warning (27 % with 0.6)."""


def attempt_step(wearing: WearingJoint, state: WearState, length: float, scheme: Scheme) -> WearState | None:
    """The state after a step of `length` cycles by one balance; None where none is found near its prediction."""
    # rows: depths and dissipated energies
    now, rate = state.at.slow, np.array([state.rate, state.energy_rate])
    given, implicit_cycles = (now + length * rate, 0.0) if scheme == "explicit" else (now, length)
    w, grown = 0.0, np.zeros_like(now)
    if scheme == "adaptive" and (before := state.last.before) is not None:
        w, grown = length / state.last.length, now - before.evaluation.slow
        given = now + w**2 / (1.0 + 2.0 * w) * grown
        implicit_cycles = (1.0 + w) / (1.0 + 2.0 * w) * length
    start = wearing.joint_of(state), state.point.next_history, given[0], wearing.gain(implicit_cycles)
    more = wearing.wearing_work(state), state.at.predicted_t, given[1], implicit_cycles / wearing.area
    balance, predicted = first_guess(wearing, state, Balance(*start, *more), length)
    end = wearing.solve(balance, predicted, state)
    if end is None or _surprise(state, end, predicted) > SMOOTH_CHANGE or _runs_away(state, end):
        return None
    error = 0.5 * length * (np.array([end.rate, end.energy_rate]) - rate)
    if w > 0.0:
        explicit = now + (1.0 + w) * length * rate - w**2 * grown
        own, other = (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w)), (1.0 + 1.0 / w) / 6.0
        error = own / (own + other) * (end.at.slow - explicit)
    counted = np.abs(error[0]), wearing.case.model.contact.acting(np.abs(error[1]))
    last = LastStep(state.point, length, *(float(each @ wearing.area) for each in counted))
    return replace(end, cycle=state.cycle + length, last=last)


def _surprise(state: WearState, end: WearState, predicted: FloatArray) -> float:
    """Distance of the vibration at the end of a step from its prediction (n_rel, 2H+1), N, over the vibration before.

    Dovetail, 16 and 48 pairs: up to 0.08 in 50 adaptive histories under random loads, up to 0.2 in most given steps of
    250 to 2000 cycles, and 0.25 to 0.53 where such a step lands on another branch.
    """
    apart = float(np.linalg.norm(end.at.predicted_h[:, 1:] - predicted[:, 1:]))
    return apart / vibration_size(state.at)


def _runs_away(state: WearState, end: WearState) -> bool:
    """Whether a step moves the mean position of a pair `RUNAWAY` times as far as the pairs vibrate or wear in it: where
    every pair slips, nothing determines the position of a root along its slot, and Newton's method takes any (dovetail,
    212.43 Hz, 1.19 N, `rtol` 0.1: 31 m in 1300 cycles). Then the step is shorter, or the position held (`jump`).
    """
    moved = np.abs(end.at.displacement_h[:, 1:, 0] - state.at.displacement_h[:, 1:, 0])
    vibrates, wears = np.abs(end.at.displacement_h[:, :, 1:]).max(), np.abs(end.depth - state.depth).max()
    return float(moved.max()) > RUNAWAY * float(max(vibrates, wears))


def first_guess(wearing: WearingJoint, state: WearState, balance: Balance, length: float) -> tuple[Balance, FloatArray]:
    """The balance of a step with its first frequency, and the first predicted force (n_rel, 2H+1), N:
    extrapolated from the last step, or those of the state where this residual is lower.
    """
    point, now, before = state.point, state.at.predicted_h, state.last.before
    if before is None or before.resolution != point.resolution:
        return balance, now
    further, there = length / state.last.length, balance
    ahead = now + further * (now - before.evaluation.predicted_h)
    if wearing.request.follow is not None:
        moved = replace(point, omega=point.omega + further * (point.omega - before.omega))
        there = replace(balance, joint=moved.joint(wearing.case))
    end = there.evaluate(ahead)
    if end.scaled_residual() > balance.evaluate(now).scaled_residual():
        return balance, now
    return there, ahead


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3: a share of its wear, or of its wear at the mean rate so far if more.

    before, after: worn volumes, m3. count, length: cycles or missions at its start, and of the step.
    """
    return max(share * max(after - before, after * length / (count + length)), 1e-300)


def rate_slope(wearing: WearingJoint, state: WearState, pairs: BoolArray) -> FloatArray:
    """Derivative dg/dW (n_contact, n_contact), 1 per cycle, with one column a pair; those not in `pairs` are 0."""
    slope = np.zeros((pairs.size, pairs.size))
    slope[:, pairs] = _rate_changes(wearing, state, np.eye(pairs.size)[pairs], fixed_factors=False).T
    return slope


def _rate_changes(wearing: WearingJoint, state: WearState, depths: FloatArray, *, fixed_factors: bool) -> FloatArray:
    """Changes dg (k, n_contact), m per cycle, of the wear rates of a state with changes of the depths, m, as exact as a
    Newton direction. fixed_factors: whether the factors of a table keep their values.
    """
    joint, at = wearing.joint_of(state), state.at
    gain = wearing.gain(1.0) * joint.contact.wear_factor[0]
    force_tangent, work_tangent, _ = joint.law.tangent(at)
    by_work, by_force, by_depth = (gain * part for part in wearing.wearing_work(state).slopes(*worn_by(at)))
    growth = by_work[:, None] * work_tangent + by_force[:, None] * force_tangent[:, 0]
    changes = depths * (0.0 if fixed_factors else by_depth)
    closing = np.where(joint.component_index % 3 == 0, depths[:, joint.component_index // 3], 0.0)
    # nothing acts back on a constant normal force
    acting = closing.any(axis=1)
    if acting.any():
        rights = np.zeros((int(acting.sum()), *at.predicted_h.shape))
        rights[:, :, 0] = -closing[acting] @ joint.structure.static_stiffness
        steps = wearing.run.steps(Balance(joint, at.start_history, state.depth, energy=at.energy), at, rights)
        moved = np.array([joint.to_pairs(step).reshape(growth.shape) for step in steps])
        changes[acting] += (growth * moved).sum(axis=2)
    return changes


def explicit_step_limit(wearing: WearingJoint, state: WearState) -> float:
    """Largest stable explicit step of Eq. (20) at a state, cycles; inf where the wear rate of no pair falls.

    A step multiplies a disturbance of W by 1 + h dg/dW: 2 over the largest positive eigenvalue of -dg/dW, by Arnoldi's
    method. A complex one counts where its real part is larger than its imaginary part.
    """
    wears = state.rate > 0.0

    def product(depths: FloatArray) -> FloatArray:
        return np.asarray(-_rate_changes(wearing, state, depths[None], fixed_factors=True)[0])

    # depths of pairs whose rates follow no depth do not matter
    start = product(np.where(wears, np.random.default_rng(0).normal(size=wears.size), 0.0))
    if not np.isfinite(start).all() or not start.any():
        return math.inf
    values = ritz_values(product, start, min(SIGN_PRODUCTS, int(np.count_nonzero(wears))))[0]
    falling = values.real[np.isfinite(values) & (values.real > np.abs(values.imag))]
    # a value below the round-off of the largest one is zero
    fastest = float(falling.max(initial=0.0))
    return 2.0 / fastest if fastest > 1e-12 * float(np.abs(values).max(initial=0.0)) else math.inf


def moved_fraction(joint: Joint, before: Evaluation, wear_depth: FloatArray, *, free_tangents: bool = True) -> float:
    """Change of the mean normal forces by wear to depths (n_contact,), m, relative to these forces, both as norms.

    Of the linear static structure, from the state before the step. free_tangents: whether the tangents of pairs that
    slip are free; if not, a bound, which is cheaper.
    """
    pair, component = joint.component_index // 3, joint.component_index % 3
    stuck = (before.status_t == STICK).all(axis=1)
    opened = (before.status_t == SEPARATED).all(axis=1)
    free = np.where(component == 0, opened[pair], ~stuck[pair])
    normal = (component == 0) & ~free
    preload = float(np.linalg.norm(before.force_h[pair[normal], 0, 0]))
    stiffness = joint.structure.static_stiffness
    force = stiffness @ np.where(normal, (wear_depth - before.wear_depth)[pair], 0.0)
    if free_tangents and free.any():
        # a root that is free to slide along its slot has neither stiffness nor force in this direction
        force = force - stiffness[:, free] @ np.linalg.lstsq(stiffness[np.ix_(free, free)], force[free])[0]
    moved = float(np.linalg.norm(force[normal]))
    return moved / preload if preload > 0.0 else 0.0


def too_long(wearing: WearingJoint, state: WearState, wear_depth: FloatArray, length: float) -> Failure | None:
    """Why a step or a jump of some cycles to depths (n_contact,), m, is rejected, and how long it may be; else None."""
    for free_tangents in (False, True):
        fraction = moved_fraction(wearing.joint_of(state), state.at, wear_depth, free_tangents=free_tangents)
        if fraction <= LARGEST_MOVED_LOAD:
            return None
    # a hundredth of the limit; a usual step of the dovetail root moves 0.001 to 0.01 of the normal forces
    advised = length * LARGEST_MOVED_LOAD / 100.0 / fraction
    on, times, most = in_digits(length, 3), in_digits(fraction, 2), in_digits(advised, 2)
    moves = f"wearing on for {on} cycles at once from cycle {in_digits(state.cycle)} on moves {times} times the normal"
    return Failure(Outcome.STEP_TOO_LONG, f"{moves} forces of the joint: at most {most} cycles at once would do")
