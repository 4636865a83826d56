"""Tuning constants of the nonlinear modes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ModeOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    first_amplitude: float = 1e-6
    """First amplitude of a joint without static normal forces, m sqrt(kg)."""
    top_base: float = 4.0
    """Amplitudes are lowered from a power of this number, at least twice the amplitude of the point. All points with
    one such power have one way. With 8 the mode of the foot is equal to 1e-8."""
    sliding_starts: int = 4
    """Attempts to find a mode of a sliding joint, each at an amplitude higher by `top_base`. The slider needs two where
    the amplitude is below the smallest one of its mode."""
    largest_change: float = 0.3
    """Largest change of the frequency (relative) and of the damping ratio in one iteration. With 0.1 and with 1
    the modes of dovetail and foot are equal."""

    # message of a lost mode
    near_resonance: float = 0.02
    """Distance of a harmonic from a natural frequency, relative, that the message names."""
    resonant_order: int = 7
    """Highest harmonic that the message names: higher ones are always near some natural frequency."""


MODES = ModeOptions()
