"""How wear acts back: derivatives of the wear rates, the limit of explicit steps, and the load that a step moves.

The motion follows the depths as dp = -J^-1 Z E dW, where E puts the depths into the static normal displacements, and
the rates follow the motion as dg = G dp. A table of factors adds its own derivative with respect to the depth.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.harmonic_balance.dlft import Evaluation, worn_by
from solver.harmonic_balance.state import Failure
from solver.model import BoolArray, FloatArray
from solver.newton.krylov import SIGN_PRODUCTS, ritz_values
from solver.outcome import Outcome, in_digits
from solver.structure.joint import Joint
from solver.wear.wearing_joint import WearingJoint, WearState

LARGEST_MOVED_LOAD = 10.0
"""Largest change of the normal forces in a step, over these forces, both as norms. For smaller changes the error of the
worn volume is a sufficient warning (27 % with 0.6)."""


def rate_slope(setup: WearingJoint, state: WearState, pairs: BoolArray) -> FloatArray:
    """Derivative dg/dW (n_contact, n_contact), 1 per cycle, with one column a pair; those not in `pairs` are 0."""
    slope = np.zeros((pairs.size, pairs.size))
    slope[:, pairs] = _rate_changes(setup, state, np.eye(pairs.size)[pairs], fixed_factors=False).T
    return slope


def _rate_changes(setup: WearingJoint, state: WearState, depths: FloatArray, *, fixed_factors: bool) -> FloatArray:
    """Changes dg (k, n_contact), m per cycle, of the wear rates of a state with changes of the depths, m, as exact as a
    Newton direction. fixed_factors: whether the factors of a table keep their values.
    """
    at, joint, balance, gain = state.at, setup.joint_of(state), setup.balance_of(state), setup.gain(1.0)
    fixed = replace(setup.wearing, depth_held=True)
    growth = replace(balance, wear_gain=gain, wearing=fixed).linearise(at).growth_tangent
    found = depths * (gain * (fixed if fixed_factors else setup.wearing).slopes(*worn_by(at))[2])
    closing = np.where(joint.component_index % 3 == 0, depths[:, joint.component_index // 3], 0.0)
    # nothing acts back on a constant normal force
    acting = closing.any(axis=1)
    if acting.any():
        rights = np.zeros((int(acting.sum()), *at.predicted_h.shape))
        rights[:, :, 0] = -closing[acting] @ joint.structure.static_stiffness
        steps = setup.run.steps(balance, at, rights)
        moved = np.array([joint.to_pairs(step).reshape(growth.shape) for step in steps])
        found[acting] += (growth * moved).sum(axis=2)
    return found


def explicit_step_limit(setup: WearingJoint, state: WearState) -> float:
    """Largest stable explicit step of Eq. (20) at a state, cycles; inf where the wear rate of no pair falls.

    A step multiplies a disturbance of W by 1 + h dg/dW: 2 over the largest positive eigenvalue of -dg/dW, by Arnoldi's
    method. A complex one counts where its real part is larger than its imaginary part.
    """
    wears = setup.rate(state.at) > 0.0

    def product(depths: FloatArray) -> FloatArray:
        return np.asarray(-_rate_changes(setup, state, depths[None], fixed_factors=True)[0])

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


def too_long(setup: WearingJoint, state: WearState, wear_depth: FloatArray, length: float) -> Failure | None:
    """Why a step or a jump of some cycles to depths (n_contact,), m, is rejected, and how long it may be; else None."""
    for free_tangents in (False, True):
        fraction = moved_fraction(setup.joint_of(state), state.at, wear_depth, free_tangents=free_tangents)
        if fraction <= LARGEST_MOVED_LOAD:
            return None
    # a hundredth of the limit; a usual step of the dovetail root moves 0.001 to 0.01 of the normal forces
    advised = length * LARGEST_MOVED_LOAD / 100.0 / fraction
    on, times, most = in_digits(length, 3), in_digits(fraction, 2), in_digits(advised, 2)
    said = f"wearing on for {on} cycles at once from cycle {in_digits(state.cycle)} on moves {times} times the normal"
    return Failure(Outcome.STEP_TOO_LONG, f"{said} forces of the joint: at most {most} cycles at once would do")
