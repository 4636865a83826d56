"""Limits of a step on the slow time scale: where the explicit scheme becomes unstable, and where no step is a result.

Explicit limit, from the exact tangents: the wear rate g(W) of the joint falls where wear takes load off a pair. An
explicit Euler step, Eq. (20), multiplies a disturbance of W by 1 + h dg/dW. The disturbance grows where h exceeds
2 / mu, with mu the largest positive eigenvalue of -dg/dW. The Jacobian of the balance of an implicit step is
J_h = J + h Z E G, where E puts the depths into the static normal displacements and G dp = dg. The motion follows the
depth as dp = -J^-1 Z E dW. So -dg/dW = G J^-1 Z E, and its nonzero eigenvalues are those of J^-1 (J_h - J) / h: the two
Jacobians suffice.

Largest meaningful step: uniform wear brings the parts closer, nonuniform wear takes load off a pair. A step is rejected
where its wear would move many times all normal forces at once. An explicit step then uses a wear rate that the pairs
have lost during the step. An implicit step uses a wear rate that the pairs only have at its end. The moved fraction of
the normal forces is computed with the linear static structure, with free tangents of pairs that slip. So the fraction
does not depend on the vibration, which may change arbitrarily at the end of a branch, and the fraction is zero where
wear does not act back on the joint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.contact.wear_law import WearingWork
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import BoolArray, FloatArray
from solver.newton.krylov import SIGN_PRODUCTS, ritz_values
from solver.newton.run import Run
from solver.structure.joint import Joint
from solver.wear.options import WEAR


def explicit_step_limit(joint: Joint, at: Evaluation, gain: FloatArray, wearing: WearingWork, run: Run) -> float:
    """Largest stable explicit step of Eq. (20) at a state.

    The eigenvalues come from Arnoldi's method with at most `SIGN_PRODUCTS` solves. A complex eigenvalue counts
    where its real part is larger than its imaginary part.

    Parameters
    ----------
    joint, at
        The joint and its converged state.
    gain
        (n_contact,), growth of the depth per wearing work in one cycle, m/J.
    wearing
        Part of the slip work that wears. Its own dependence on the depth is neglected.
    run
        Solves with the Jacobian of the state.

    Returns
    -------
    float
        h, cycles; inf where the wear rate of no pair falls.
    """
    rate = gain * wearing.work(*worn_by(at))
    if not rate.max(initial=0.0) > 0.0:
        return float("inf")
    frozen = Balance(joint, at.history, at.wear_depth)
    # a step in which the fastest pair wears as much as the joint moves: both Jacobians differ in more than round-off
    step = float(np.abs(at.displacement_h).max()) / float(rate.max())
    plain = frozen.linearise(at)
    worn = replace(frozen, wear_gain=step * gain, wearing=replace(wearing, depth_held=True)).linearise(at)
    shape = at.predicted_h.shape

    def product(vector: FloatArray) -> FloatArray:
        predicted = vector.reshape(shape)
        return run.solver.solve(plain, worn.apply(predicted) - plain.apply(predicted)).ravel()

    start = product(np.random.default_rng(0).normal(size=at.predicted_h.size))
    if not np.all(np.isfinite(start)) or not start.any():
        return float("inf")
    n_wearing = int(np.count_nonzero(rate))
    values = ritz_values(product, start, min(SIGN_PRODUCTS, n_wearing))[0]
    falling = values.real[np.isfinite(values) & (values.real > np.abs(values.imag))]
    # a value below the round-off of the largest one is zero
    fastest = float(falling.max(initial=0.0))
    return 2.0 * step / fastest if fastest > 1e-12 * float(np.abs(values).max(initial=0.0)) else float("inf")


def moved_fraction(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> float:
    """Change of the mean normal forces by wear, relative to these forces, both as norms.

    Pairs that are open throughout the period carry no force. The tangents of pairs that slip are free.

    before: state at the start of the step.
    wear_depth (n_contact,): depth at the end of the step, m.
    """
    normal, free, worn, preload = _parts(joint, before, wear_depth)
    stiffness = joint.structure.static_stiffness
    force = stiffness @ worn
    if free.any():
        # a root that is free to slide along its slot has neither stiffness nor force in this direction
        followed = np.linalg.lstsq(stiffness[np.ix_(free, free)], force[free])[0]
        force = force - stiffness[:, free] @ followed
    moved = float(np.linalg.norm(force[normal]))
    return moved / preload if preload > 0.0 else 0.0


def _parts(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> tuple[BoolArray, BoolArray, FloatArray, float]:
    """Rows of the normals in contact, free rows, worn depth on the rows, m, and norm of the normal forces, N."""
    pair, component = joint.component_index // 3, joint.component_index % 3
    stuck = (before.status_t == STICK).all(axis=1)
    opened = (before.status_t == SEPARATED).all(axis=1)
    free = np.where(component == 0, opened[pair], ~stuck[pair])
    normal = (component == 0) & ~free
    preload = float(np.linalg.norm(before.force_h[pair[normal], 0, 0]))
    return normal, free, np.where(normal, (wear_depth - before.wear_depth)[pair], 0.0), preload


def too_long(joint: Joint, before: Evaluation, wear_depth: FloatArray, cycle: float, length: float) -> str | None:
    """Reason to reject a step or a jump because of its wear; None where there is no reason.

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
        A sentence with the length of a step that would be accepted.
    """
    normal, _, worn, preload = _parts(joint, before, wear_depth)
    # a bound without free tangents, which is cheaper
    held = float(np.linalg.norm((joint.structure.static_stiffness @ worn)[normal]))
    if held <= WEAR.largest_moved_load * preload:
        return None
    fraction = moved_fraction(joint, before, wear_depth)
    if fraction <= WEAR.largest_moved_load:
        return None
    # a hundredth of the limit; a usual step of the dovetail root moves 0.001 to 0.01 of the normal forces
    advised = length * WEAR.largest_moved_load / 100.0 / fraction
    return (
        f"wearing on for {length:.3g} cycles at once from cycle {cycle:.6g} on moves {fraction:.2g} times the"
        f" normal forces of the joint: at most {advised:.2g} cycles at once would do"
    )
