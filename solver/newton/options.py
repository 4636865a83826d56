"""Tuning constants of Newton's method and of its linear solvers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NewtonOptions:
    """Counts and ratios; each with its meaning and the evidence for its value.

    They decide whether a state is found and at what cost, not what a converged state is.
    """

    # iteration
    iterations: int = 30
    """Of one solve. Prototypes took 2 to 5 from a warm start, up to 40 from a cold one near a resonance."""
    full_steps: int = 6
    """Full steps in a row without a new lowest residual, after which steps are halved instead. Twice as many find the
    same states; with three the dovetail comes to another static state at a friction coefficient of 1000."""
    shortest_step: float = 1.0 / 128.0
    """Of the full step: seven halvings."""
    divergence: float = 1e6
    """Residual over the lowest one so far, from which the iteration returns to the best point at once."""

    # GMRES and Arnoldi's method
    forcing: float = 1e-3
    """Relative residual of a Newton direction: up to three digits are gained in an iteration. With half and twice as
    much the dovetail has the same states to 1e-6."""
    stagnation_products: int = 20
    """Products over which the residual has to fall below `stagnation_ratio` of itself, else the cycle ends."""
    stagnation_ratio: float = 0.75
    """Of the residual, see `stagnation_products`."""
    null_space: float = 1e-5
    """Singular value over the largest one: directions below it are left out of a solution that does not converge.
    Pivots over the largest one: a cycle with smaller ones is not recycled."""
    recycled_directions: int = 30
    """Directions that are kept from solve to solve with a factorisation: 48 pairs take 9.0 products a solve with them,
    12.4 without; with 60 8.3, in the same time."""
    round_off: float = 1e-11
    """Of a vector, or of a pair that slips: less is no new direction. Double precision has 2e-16."""
    sign_products: int = 16
    """Products of Arnoldi's method from which on the sign of a determinant is judged."""
    sign_check: int = 4
    """Products between two looks at the eigenvalues."""
    certain_real_part: float = 0.15
    """Of the eigenvalues, 1 where the factorisation is exact: above it they are certainly positive."""
    settled: float = 0.1
    """Residual of an eigenvalue over its modulus below which its sign is known."""

    # which factorisation
    dense_unknowns: int = 250
    """Unknowns up to which a dense factorisation of each Jacobian costs less than iterations with a kept one."""
    products: int = 80
    """In a cycle of GMRES with any other factorisation, and of Arnoldi's method for the sign of a determinant: GMRES
    finds resonances one by one. At 160 pairs 32 settle the eigenvalues that lie at 0.01."""
    exact_products: int = 12
    """Products with a kept factorisation that was exact before a new one is made, which takes as long."""
    restarts: int = 6
    """Cycles of GMRES with a new factorisation that is not exact; and of cycles that converged, but by products in
    single precision: a joint that slips as a whole moves far under small forces."""

    # slip space
    small_joint_displacements: int = 40
    """Relative displacements up to which a joint is small: impacts couple most harmonics and directions there."""
    most_directions: int = 2500
    """Directions factorised with nothing left out of a small joint, for which no other factorisation is a good
    preconditioner, and of any joint where the sign of the determinant is not certain otherwise. Takes 0.5 s."""
    exact_directions: int = 600
    """Directions factorised with nothing left out: 48 pairs with five harmonics near a resonance have as many."""
    partial_directions: int = 1000
    """The largest directions, that are factorised where neither the whole space nor the march will do: for more than
    some 20 masses on sliders. A factorisation of as many takes 50 ms."""
    neutral_shift: float = 1e-8
    """Shift of the eigenvalues, 1 for a pair that sticks. A joint that slips as a whole may lie anywhere along its
    slip: an eigenvalue that is zero but for round-off would give the determinant any sign."""

    # march through the period
    march_periods: int = 2
    """Periods of the march: slip forgets what was before it."""
    resonant_difference: float = 0.2
    """Of the penalty: larger differences of stiffness from that of most harmonics are taken into account."""
    resonances: int = 6
    """Such differences in a harmonic, at most."""


NEWTON = NewtonOptions()
