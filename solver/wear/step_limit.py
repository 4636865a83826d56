"""Limits of a step on the slow time scale: where the explicit scheme becomes unstable, and where no step is a result.

The explicit limit is predicted from the exact tangents. The wear rate g(W) of the joint falls where wear takes load off
a pair. An explicit Euler step, Eq. (20), multiplies a disturbance of W by 1 + h dg/dW: it grows where h exceeds 2 / mu,
mu the largest positive eigenvalue of -dg/dW. With an implicit step the Jacobian of the balance is J_h = J + h Z E G,
where E puts the depths into the static normal displacements and G dp = dg, and the motion follows the depth as
dp = -J^-1 Z E dW. So -dg/dW = G J^-1 Z E, whose eigenvalues other than zero are those of J^-1 (J_h - J) / h: no other
matrix is needed than the two Jacobians.

Whether a step is a result is judged by how much of the preload it moves. Worn depth lets the parts come nearer to each
other where it is uniform, and takes the load off a pair where it is not. A step is no result where what it wears would
move many times all normal forces at once: an explicit step then wears by a wear rate that its pairs had long lost, and
an implicit one by one that they have only where they are left.
This fraction is that of the linear static structure, with the tangents of pairs that slip free: it asks nothing of the
vibration, which may change at will where a branch ends, and it is zero where wear does not act back on the joint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.contact.wear_law import WearingWork
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import BoolArray, FloatArray
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import JacobianSolver
from solver.structure.joint import Joint
from solver.wear.options import WEAR


def explicit_step_limit(
    joint: Joint, at: Evaluation, gain: FloatArray, wearing: WearingWork, solver: JacobianSolver
) -> float:
    """Largest stable explicit step of Eq. (20) at a state.

    The eigenvalues are those that Arnoldi's method knows after `arnoldi_products` solves; complex ones count where the
    real part is the larger one.

    Parameters
    ----------
    joint, at
        The joint and its converged state.
    gain
        (n_contact,), `archard.wear_gain` of one cycle, m/J.
    wearing
        What of the slip work wears. How a table itself depends on the depth is left out: only what the motion does.
    solver
        Solves with the Jacobian of the state.

    Returns
    -------
    float
        h, cycles; inf where the wear rate falls nowhere.
    """
    rate = gain * wearing.work(*worn_by(at))
    if not rate.max(initial=0.0) > 0.0:
        return float("inf")
    frozen = Balance.frozen(joint, at.history, at.wear_depth)
    # a step in which the fastest pair wears as much as the joint moves: both Jacobians differ in more than round-off
    step = float(np.abs(at.displacement_h).max()) / float(rate.max())
    plain = frozen.linearise(at)
    worn = replace(frozen, wear_gain=step * gain, wearing=replace(wearing, depth_held=True)).linearise(at)
    shape = at.predicted_h.shape

    def product(vector: FloatArray) -> FloatArray:
        predicted = vector.reshape(shape)
        return solver.solve(plain, worn.apply(predicted) - plain.apply(predicted)).ravel()

    start = product(np.random.default_rng(0).normal(size=at.predicted_h.size))
    if not np.all(np.isfinite(start)) or not start.any():
        return float("inf")
    n_wearing = int(np.count_nonzero(rate))
    values = ritz_values(product, start, min(WEAR.arnoldi_products, n_wearing))[0]
    falling = values.real[np.isfinite(values) & (values.real > np.abs(values.imag))]
    # below round-off of the largest there is nothing
    fastest = float(falling.max(initial=0.0))
    return 2.0 * step / fastest if fastest > 1e-12 * float(np.abs(values).max(initial=0.0)) else float("inf")


def moved_fraction(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> float:
    """Fraction of the mean normal forces, in their norm, that wear down to `wear_depth` (n_contact,), m, moves.

    before: state at the start of the step. Pairs that are open all period long carry nothing and hold nothing, tangents
    of pairs that slip follow.
    """
    normal, free, worn, preload = _parts(joint, before, wear_depth)
    stiffness = joint.structure.static_stiffness
    force = stiffness @ worn
    if free.any():
        # a root that is free to slide along its slot has no stiffness there, and no force either
        followed = np.linalg.lstsq(stiffness[np.ix_(free, free)], force[free])[0]
        force = force - stiffness[:, free] @ followed
    moved = float(np.linalg.norm(force[normal]))
    return moved / preload if preload > 0.0 else 0.0


def _parts(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> tuple[BoolArray, BoolArray, FloatArray, float]:
    """Rows of pressed normals, rows that follow, worn depth on the rows, m, and norm of the normal forces, N."""
    pair, component = joint.component_index // 3, joint.component_index % 3
    stuck = (before.status_t == STICK).all(axis=1)
    opened = (before.status_t == SEPARATED).all(axis=1)
    free = np.where(component == 0, opened[pair], ~stuck[pair])
    normal = (component == 0) & ~free
    preload = float(np.linalg.norm(before.force_h[pair[normal], 0, 0]))
    return normal, free, np.where(normal, (wear_depth - before.wear_depth)[pair], 0.0), preload


def too_long(joint: Joint, before: Evaluation, wear_depth: FloatArray, cycle: float, length: float) -> str | None:
    """Why a step, or a jump, that wears down to a depth is no result; None where it is one.

    Parameters
    ----------
    joint, before
        The joint and its state at the start of the step.
    wear_depth
        (n_contact,), m, at the end of the step.
    cycle, length
        Count at the start of the step, and its length in cycles.

    Returns
    -------
    str or None
        A sentence with the length of a step that would do.
    """
    normal, _, worn, preload = _parts(joint, before, wear_depth)
    # with all tangents held: then none need be followed
    held = float(np.linalg.norm((joint.structure.static_stiffness @ worn)[normal]))
    if held <= WEAR.largest_moved_load * preload:
        return None
    fraction = moved_fraction(joint, before, wear_depth)
    if fraction <= WEAR.largest_moved_load:
        return None
    advised = length * WEAR.advised_moved_load / fraction
    return (
        f"wearing on for {length:.3g} cycles at once from cycle {cycle:.6g} on moves {fraction:.2g} times the"
        f" normal forces of the joint: at most {advised:.2g} cycles at once would do"
    )
