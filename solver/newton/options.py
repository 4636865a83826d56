"""Tuning constants of Newton's method and of its linear solvers: meaning, unit, evidence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NewtonOptions:
    """Dimensionless numbers and counts; none of them changes what a converged state is, only whether it is found."""

    # --- iteration ---
    # Iterations of one solve. Cold starts near a resonance take up to 40, warm ones 2 to 5 (prototypes of the solver).
    iterations: int = 30
    # Full steps in a row without a new lowest residual, after which steps are halved instead.
    full_steps: int = 6
    # Shortest halved step, over the full one.
    shortest_step: float = 1.0 / 128.0
    # Residual over the lowest one so far, from which the iteration returns to the best point at once.
    divergence: float = 1e6

    # --- GMRES and Arnoldi's method ---
    # Relative residual of a Newton direction: each iteration gains up to three digits with it.
    forcing: float = 1e-3
    # Products over which the residual has to fall below `stagnation_ratio` of itself, else the cycle ends.
    stagnation_products: int = 20
    stagnation_ratio: float = 0.75
    # Singular value over the largest one: directions below it are left out of a solution that does not converge.
    null_space: float = 1e-5
    # Relative to the vector or to a pair that slips: less is round-off, no new direction. Accuracy is 2e-16.
    round_off: float = 1e-11
    # Products with the Jacobian from which the sign of its determinant is judged.
    arnoldi_products: int = 24
    # Real part of the eigenvalues, 1 with an exact factorisation, that is taken as certainly positive.
    certain_real_part: float = 0.15

    # --- which factorisation ---
    # Unknowns up to which a dense factorisation of this Jacobian costs less than one iteration with a kept one.
    dense_unknowns: int = 250
    # Products with a kept factorisation that was exact before a new one is made: a new one takes as long.
    exact_products: int = 12
    # The same where a new one would not be exact either.
    kept_products: int = 30
    # The same for the march through the period: GMRES finds resonances one by one.
    period_products: int = 80
    # Cycles of GMRES with a new factorisation that is not exact.
    restarts: int = 6

    # --- slip space (slip_preconditioner) ---
    # Relative displacements up to which a joint counts as small: impacts couple most harmonics and directions there.
    few_displacements: int = 40
    # Directions that are factorised with nothing left out: 48 pairs with five harmonics near a resonance have as many.
    exact_directions: int = 600
    # The same of a small joint, where no other factorisation steers well.
    exact_directions_of_few: int = 2500
    # The same where the sign of the determinant is not certain otherwise.
    sign_directions: int = 4000
    # Directions that are factorised where those below `partial_cutoff` of a slipping pair are left out.
    partial_directions: int = 1000
    partial_cutoff: float = 0.05
    # Shift of all eigenvalues, 1 for a pair that sticks. A joint that slips as a whole may lie anywhere along its slip:
    # an eigenvalue that is zero but for round-off would give the determinant any sign.
    neutral_shift: float = 1e-8

    # --- groups of harmonics (preconditioner) and march through the period (period_preconditioner) ---
    # Unknowns of the lowest harmonics that are factorised together; higher ones one by one.
    low_unknowns: int = 800
    # Periods of the march: slip forgets what was before it.
    march_periods: int = 2
    # Difference of stiffness from that of most harmonics, over the penalty, that is taken into account.
    resonant_difference: float = 0.2
    # Most such differences in a harmonic, and powers of the difference by which they are found.
    resonances: int = 6
    power_iterations: int = 2


NEWTON = NewtonOptions()
