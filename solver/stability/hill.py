"""Stability of a periodic state by Hill's method: the sign of a determinant, and the exponents of a small joint.

Let the harmonic amplitudes vary slowly as exp(sigma t). A disturbance of a state then obeys

    [Z_r(i n w + sigma) du/dp + dlambda/dp] p' = 0,

Hill's equation in the unknown p of the balance. Its determinant is real for real sigma, that of the Jacobian, Eq. (16),
at sigma = 0, and positive for sigma towards infinity, where the structure is stiff and the sign is that of du/dp. So a
negative determinant at sigma = 0 means an odd number of real, positive growth rates: Floquet multipliers on the real
axis beyond +1. A branch changes the sign at each fold, and the part between two folds is unstable.

The test is made at each state of a branch. It sees neither an even number of such multipliers nor multipliers elsewhere
outside the unit circle: `floquet` computes the multipliers of reported states. Disturbances of friction are taken as
slow, with the closure over one period.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigvals

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import ComplexArray
from solver.newton.run import Run
from solver.structure.condensation import relative_indices
from solver.structure.fourier import build_basis, derivative
from solver.structure.joint import Joint

# Real part over omega from which an exponent is infinite, that of a displacement without mass made finite by round-off:
# in random scenes from 8e10 on, those of the joint -88 to 0.
_INFINITE = 100.0
_HALF = 0.499  # imaginary part over omega from which a multiplier counts as real and negative
_SAMPLES = 4096  # of the contact law: impacts change the multipliers by what lies between two samples


def is_stable(balance: Balance, at: Evaluation, run: Run) -> bool:
    """False where a state has an odd number of real multipliers beyond +1 at a fixed wear depth.

    balance: of the state at a fixed wear depth: the vibration is fast, the wear is slow.
    """
    return bool(run.solver.determinant_sign(balance.linearise(at)) >= 0.0)


def hill_size(joint: Joint) -> int:
    """Size of the eigenvalue problem of `hill_multipliers`."""
    return (2 * len(joint.model.linear[0].mass) + joint.component_index.size) * len(joint.basis.synthesis)


def hill_multipliers(joint: Joint, at: Evaluation) -> ComplexArray:
    """Floquet multipliers exp(2 pi sigma / omega) of a state of a small real joint without masses on rigid ground.

    A disturbance x(t) exp(sigma t), with x of the period of the state, obeys the linearised balance of all
    displacements x and of the predicted forces p of the pairs, with d = d/dt + sigma in place of d/dt:

        M d^2 x + C d x + K x + S^T dlambda/dp p = 0,        S x = du/dp p.

    In harmonics this is an eigenvalue problem for sigma. Of the copies `sigma + i k omega` of an exponent, which the
    truncated series gives ever worse, the ones with the smallest imaginary parts count (Moore, SIAM J. Numer. Anal. 42
    (2005) 2553). `monodromy` puts impacts on whole time steps and needs very many of them. The 196 states of the
    vibro-impact curve, CPU s and largest error of four multipliers of up to 3.19: 2.5 and 0.02, by `monodromy` 11.7 and
    0.56; at the upper fold, where a multiplier is 1, 1.0006 and 0.79 + 0.44 i.
    """
    fine = replace(joint, basis=build_basis(joint.basis.orders, _SAMPLES))
    balance = Balance(fine, at.history, at.wear_depth)
    tangent = balance.linearise(balance.evaluate(at.predicted_h))
    linear, m = joint.model.linear[0], len(fine.basis.synthesis)
    n, n_rel = len(linear.mass), joint.component_index.size
    size = float(np.abs(linear.stiffness).max())
    # time in 1 / omega, forces over the largest stiffness
    mass, damping, stiffness = (
        np.asarray(np.real(part) * (joint.omega**power / size), np.float64)
        for part, power in ((linear.mass, 2), (linear.damping, 1), (linear.stiffness, 0))
    )
    rate = derivative(np.eye(m), np.array(fine.basis.orders, np.float64)).T
    motion, force = tangent.matrices(np.arange(joint.contact.n_contact)).reshape(2, n_rel * m, n_rel * m)
    select = np.kron(np.eye(n)[relative_indices(joint.contact)[0]], np.eye(m))
    eye, left = np.eye(n * m), np.zeros((2 * n * m + n_rel * m, 2 * n * m + n_rel * m))
    right, one = left.copy(), np.eye(m)
    x, v, p = slice(0, n * m), slice(n * m, 2 * n * m), slice(2 * n * m, None)
    left[x, v] = right[x, x] = eye
    left[v, x] = -np.kron(mass, rate @ rate) - np.kron(damping, rate) - np.kron(stiffness, one)
    left[v, v] = -2.0 * np.kron(mass, rate) - np.kron(damping, one)
    left[v, p] = -select.T @ force
    left[p, x], left[p, p] = select, -size * motion
    right[v, v] = np.kron(mass, one)
    return _chosen(eigvals(left, right), 2 * int(np.linalg.matrix_rank(mass)))


def _chosen(exponents: ComplexArray, number: int) -> ComplexArray:
    """Multipliers of the exponents, over omega, with the smallest imaginary parts, each once."""
    finite = exponents[(np.abs(exponents.real) < _INFINITE) & (np.abs(exponents.imag) <= 1.0 - _HALF)]
    # both copies of a real and negative multiplier lie at the edge of the strip
    negative = np.abs(finite.imag) >= _HALF
    finite = finite[~negative | (finite.imag > 0.0)]
    finite = finite[np.argsort(np.abs(finite.imag), kind="stable")][:number]
    multipliers = np.exp(2.0 * np.pi * finite)
    edge = np.abs(finite.imag) >= _HALF
    return np.where(edge, -np.abs(multipliers), multipliers)
