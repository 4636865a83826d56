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
    """Full steps in a row without a new lowest residual before steps are halved. Twice as many find equal states; with
    three, too, the static states of the dovetail are equal."""
    shortest_step: float = 1.0 / 128.0
    """Shortest step as a fraction of the full step: seven halvings. With six a random scene (`THROWN_OFF` in
    `tests/solver/test_homotopy.py`) gets no accurate state. Also the shortest natural step over the range to the target
    (where a shorter one is needed, the branch is assumed to fold), and the shortest relaxation step in periods."""

    # GMRES and Arnoldi's method
    forcing: float = 1e-3
    """Relative residual of a Newton direction: an iteration gains up to three digits. With half and twice this value
    the states of the dovetail are equal to 1e-6. Also the residual of a node of a sweep as a fraction of rtol: with a
    tenth and with ten times this value the motion of the dovetail is equal to 1e-4; with the tolerance of a result,
    nodes take 1.4 times the iterations."""
    settled: float = 0.1
    """Residual over modulus of an eigenvalue below which its sign is known, and real part above which an eigenvalue is
    certainly positive (all are 1 for an exact factorisation). With 0.15 for the real part the same cases are equal."""

    products: int = 80
    """Most products of a GMRES cycle, and of Arnoldi's method for a determinant or for Floquet multipliers. GMRES finds
    resonances one by one. At 160 pairs, eigenvalues at 0.01 converge with 32."""

    kept_products: int = 25
    """Most products of a solve with a kept factorisation, before a new one is built, which takes as long as 20 products
    with 48 pairs. Histories of 16 and 48 pairs take equal times, within 10 %, with 12 to 80."""

    # choice of the factorisation
    dense_unknowns: int = 200
    """Unknowns up to which a Jacobian is factorised as it is. With 100 and 400, sweeps and histories of 16 and 48 pairs
    take equal times."""
    dear_unknowns: int = 1000
    """Unknowns of an expensive dense solve: above, no odd harmonics above 79, no homotopy in the harmonics, no 3 N + 2
    samples to compare, and no eigenvalues of Hill's matrix (255 unknowns take 0.15 s, 800 take 3 s)."""
    small_joint_displacements: int = 40
    """Relative displacements up to which a joint is small and its slip space is factorised: impacts couple most
    harmonics and directions, and products with any other factorisation are in vain (three pairs with 115 harmonics,
    `tests/solver/test_refinement.py`)."""
    most_directions: int = 2500
    """Most directions of a factorisation in the slip space, 0.4 s. For the sign of a determinant that is not certain
    otherwise, and for sliding masses, to which the march does not apply."""

    # march through the period
    march_periods: int = 2
    """Periods of the march: slip removes the influence of the start."""

    @property
    def sign_products(self) -> int:
        """Products of Arnoldi's method between two computations of the eigenvalues.

        With four in place of 16, 23 cases (12 random scenes, sliders, small joints) take equal iterations.
        """
        return self.products // 5

    @property
    def stagnation_products(self) -> int:
        """A GMRES cycle ends unless its residual is halved over so many products.

        Without this end the same cases are equal. The end saves products where a joint slides as a whole.
        """
        return self.products // 4


NEWTON = NewtonOptions()
