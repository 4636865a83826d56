"""Where the explicit scheme becomes unstable, predicted from the exact tangents.

The wear rate g(W) of the joint falls where wear takes load off a pair. An explicit Euler step multiplies a disturbance
of W by 1 + h dg/dW: it grows where h exceeds 2 / mu, mu the largest positive eigenvalue of -dg/dW. With an implicit
step the Jacobian of the balance is J_h = J + h Z E G, where E puts the depths into the static normal displacements and
G dp = dg, and the motion follows the depth as dp = -J^-1 Z E dW. So -dg/dW = G J^-1 Z E, whose eigenvalues other than
zero are those of J^-1 (J_h - J) / h: no other matrix is needed than the two Jacobians.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.archard import wear_growth
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import JacobianSolver

PRODUCTS = 16  # products of Arnoldi's method, one linear solve each


def explicit_step_limit(balance: Balance, at: Evaluation, gain: FloatArray, solver: JacobianSolver) -> float:
    """Largest stable explicit step h at a state, cycles; inf where the wear rate falls nowhere.

    gain (n_contact,): `archard.wear_gain` of one cycle, m/J. The eigenvalues are those that Arnoldi's method knows
    after `PRODUCTS` solves; complex ones count where the real part is the larger one.
    """
    rate = wear_growth(gain, at.slip_work)
    if not rate.max(initial=0.0) > 0.0:
        return float("inf")
    frozen = balance_without_wear(balance, at)
    # a step in which the fastest pair wears as much as the joint moves: both Jacobians differ in more than round-off
    step = float(np.abs(at.displacement_h).max()) / float(rate.max())
    plain = frozen.linearise(at)
    wearing = replace(frozen, wear_gain=step * gain).linearise(at)
    shape = at.predicted_h.shape

    def product(vector: FloatArray) -> FloatArray:
        predicted = vector.reshape(shape)
        return solver.solve(plain, wearing.apply(predicted) - plain.apply(predicted)).ravel()

    start = product(np.random.default_rng(0).normal(size=at.predicted_h.size))
    if not np.all(np.isfinite(start)) or not start.any():
        return float("inf")
    n_wearing = int(np.count_nonzero(rate))
    values = ritz_values(product, start, min(PRODUCTS, n_wearing))
    falling = values.real[np.isfinite(values) & (values.real > np.abs(values.imag))]
    # below round-off of the largest there is nothing
    fastest = float(falling.max(initial=0.0))
    return 2.0 * step / fastest if fastest > 1e-12 * float(np.abs(values).max(initial=0.0)) else float("inf")


def balance_without_wear(balance: Balance, at: Evaluation) -> Balance:
    """The balance of a state at its wear depth, held."""
    return Balance.frozen(balance.joint, at.history, at.wear_depth)
