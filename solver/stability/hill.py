"""Stability of a periodic state by Hill's method: the sign of the determinant of its Jacobian, Eq. (16).

Let the harmonic amplitudes vary slowly as exp(sigma t). A disturbance of a state then obeys

    [Z_r(i n w + sigma) du/dp + dlambda/dp] p' = 0,

Hill's equation in the unknown p of the balance. Its determinant is real for real sigma and is that of the Jacobian at
sigma = 0. For sigma towards infinity the structure is so stiff that the determinant has the sign of that of du/dp,
which is not negative: a pair takes between none (stuck: its columns are those of the identity) and all (open) of the
predicted force away. The same sign belongs to the joint that is stuck all over (identity) and to the one that is
open all over (Z_n / eps: the square of a modulus for each complex harmonic, a positive definite static stiffness).
So a negative determinant at sigma = 0 means an odd number of real, positive growth rates: Floquet multipliers on the
real axis beyond +1. A branch changes the sign at each fold, and the part between two folds is unstable.

The test costs next to nothing beside a Newton iteration and is made at each state of a branch. The test sees neither an
even number of such multipliers nor multipliers elsewhere outside the unit circle: `floquet` computes the multipliers of
reported states. Disturbances of friction are taken as slow, with the closure over one period.
"""

from __future__ import annotations

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.newton.run import Run


def is_stable(balance: Balance, at: Evaluation, run: Run) -> bool:
    """False where a state has an odd number of real multipliers beyond +1 at a fixed wear depth.

    balance: of the state at a fixed wear depth: the vibration is fast, the wear is slow.
    """
    return bool(run.solver.determinant_sign(balance.linearise(at)) >= 0.0)
