"""Tuning constants of all rooms: what counts as zero, finite differences, lengths of error-controlled steps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CommonOptions:
    """Fractions and ratios, each with its meaning and the evidence for its value."""

    # fractions that count as zero
    round_off: float = 1e-9
    """Fraction of a quantity that is round-off after a computation of many steps. Changes of a periodic tangential
    state: 1e-12 and below in good states. Eigenvalues of a stiffness over the largest one: 1e-15 for the free direction
    of the dovetail, -1.6e-6 for the next one, by spin softening. Its inverse is practically infinite."""
    negligible: float = 1e-6
    """Fraction of a quantity that has no meaning although it may be more than round-off: a vibration over its mean, at
    a tolerance of 1e-8; pressure and depth at the edge of a contact over the largest ones (strips that are open carry
    exactly 0; under a stroke whose scar is cut off the last one carries 0.96 of the largest pressure); the square of
    the frequency of a rigid motion (with 1e-4 the modes of dovetail and foot are equal to 1e-8)."""
    difference: float = 1e-7
    """Step of a finite difference over the natural size of its variable: round-off of 1e-16 gives an error of 1e-9.
    Derivatives by the frequency agree to 1e-5 with central differences a hundred times as long. With ten and a hundred
    times the value nonlinear modes are equal to 1e-9 and take up to 15 % longer."""

    # controlled steps of sweeps, on the slow time scale and over missions
    step_safety: float = 0.85
    """Length of a step over the length with the allowed error, and the largest factor on a step that was refused."""
    largest_step_ratio: float = 2.0
    """Largest ratio of two successive steps of a sweep, of an amplitude and on the slow time scale; BDF2 is zero-stable
    below 1 + sqrt(2). With 1.4 the damping of a nonlinear mode of the dovetail changes by 5e-6."""
    smallest_step_ratio: float = 0.25
    """Factor on a step whose end was not found, and smallest factor on a step that was refused."""


COMMON = CommonOptions()
