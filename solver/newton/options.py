"""Tuning constants of Newton's method and of its linear solvers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NewtonOptions:
    """Counts and ratios: for each its meaning and the evidence for its value.

    They influence success and cost of a solve, not the converged state.
    """

    # iteration
    iterations: int = 30
    """Most iterations of one solve. Prototypes took 2 to 5 from a warm start, up to 40 from a cold one near a
    resonance."""
    full_steps: int = 6
    """Full steps in a row without a new lowest residual before steps are halved. Twice as many find equal states. With
    three the dovetail gets another static state at a friction coefficient of 1000."""
    shortest_step: float = 1.0 / 128.0
    """Shortest step as a fraction of the full step: seven halvings."""
    divergence: float = 1e6
    """Ratio of the residual to the lowest one so far, above which the iteration returns to the best point at once."""

    # GMRES and Arnoldi's method
    forcing: float = 1e-3
    """Relative residual of a Newton direction: an iteration gains up to three digits. With half and twice this value
    the states of the dovetail are equal to 1e-6."""
    stagnation_products: int = 20
    """A cycle ends unless its residual falls by the factor `stagnation_ratio` over so many products."""
    stagnation_ratio: float = 0.75
    """Reduction of the residual, see `stagnation_products`."""
    null_space: float = 1e-5
    """Ratio to the largest singular value: smaller directions are left out of a solution that does not converge.
    Ratio to the largest pivot: a cycle with a smaller one is not recycled."""
    recycled_directions: int = 30
    """Directions kept from solve to solve with a factorisation. Products a solve for 48 pairs: 12.4 with 0, 9.0 with
    30, 8.3 with 60 in an equal time."""
    round_off: float = 1e-11
    """Fraction of a vector, or of a slipping pair: less is no new direction. Double precision has 2e-16."""
    sign_products: int = 16
    """Fewest products of Arnoldi's method for the sign of a determinant."""
    sign_check: int = 4
    """Products between two computations of the eigenvalues."""
    certain_real_part: float = 0.15
    """Real part above which an eigenvalue is certainly positive; 1 for an exact factorisation."""
    settled: float = 0.1
    """Residual over modulus of an eigenvalue below which its sign is known."""

    # which factorisation
    dense_unknowns: int = 250
    """Unknowns up to which a dense factorisation of each Jacobian costs less than iterations with a kept one."""
    products: int = 80
    """Most products of a GMRES cycle with a factorisation that is not exact, and of Arnoldi's method for the sign of a
    determinant. GMRES finds resonances one by one. At 160 pairs, eigenvalues at 0.01 converge with 32."""
    exact_products: int = 12
    """Most products with a kept factorisation of an earlier Jacobian that was exact; a new one takes as long."""
    restarts: int = 6
    """Most cycles of GMRES with a new factorisation that is not exact. Most cycles that converge with products in
    single precision only: a joint that slips as a whole moves far under small forces."""

    # slip space
    small_joint_displacements: int = 40
    """Relative displacements up to which a joint is small: impacts couple most harmonics and directions."""
    most_directions: int = 2500
    """Most directions of an exact factorisation of a small joint, for which no other preconditioner is good, and of any
    joint where the sign of the determinant is not certain otherwise. Takes 0.5 s."""
    exact_directions: int = 600
    """Most directions of an exact factorisation: 48 pairs with five harmonics near a resonance have as many."""
    partial_directions: int = 1000
    """Number of the largest directions, factorised where neither the whole space nor the march applies: for more than
    some 20 masses on sliders. Takes 50 ms."""
    neutral_shift: float = 1e-8
    """Shift of the eigenvalues, which are 1 for a pair that sticks. The position of a joint that slips as a whole is
    arbitrary along its slip: round-off in a zero eigenvalue would give the determinant any sign."""

    # march through the period
    march_periods: int = 2
    """Periods of the march: slip removes the influence of the start."""
    resonant_difference: float = 0.2
    """Fraction of the penalty: larger differences to the median stiffness of the harmonics are taken into account."""
    resonances: int = 6
    """Most such differences of a harmonic."""


NEWTON = NewtonOptions()
