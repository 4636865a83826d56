"""What is reported of a point of a nonlinear mode: plain numbers and arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.packing import packable

OF_A_POINT = (
    "frequency",
    "damping_ratio",
    "frequency_error",
    "damping_error",
    "response",
    "shape",
    "slip_fraction",
    "open_fraction",
    "harmonics_used",
    "samples_used",
)
"""Values of a point that `solver.Backbone` has for each amplitude."""


@packable
@dataclass(frozen=True)
class ModeValues:
    """A point of a nonlinear mode. Its values are NaN where no state was found.

    - outcome, message, newton_iterations, run_time: as in `ModePoint`.
    - all others: as in `solver.Backbone`, at one amplitude.
    """

    outcome: Outcome
    message: str
    frequency: float
    damping_ratio: float
    frequency_error: float
    damping_error: float
    response: ComplexArray
    shape: ComplexArray
    slip_fraction: FloatArray
    open_fraction: FloatArray
    harmonics_used: int
    samples_used: int
    newton_iterations: int
    run_time: float


def without_state(
    outcome: Outcome,
    message: str,
    sizes: tuple[int, int, int] = (0, 0, 0),
    newton_iterations: int = 0,
    run_time: float = 0.0,
) -> ModeValues:
    """A point without state. sizes: numbers of responses, displacements and contact pairs."""
    nan = float("nan")
    response, shape, pairs = (np.full(size, nan) for size in sizes)
    vectors = (response.astype(complex), shape.astype(complex), pairs, pairs)
    return ModeValues(outcome, message, nan, nan, nan, nan, *vectors, 0, 0, newton_iterations, run_time)
