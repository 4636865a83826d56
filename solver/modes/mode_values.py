"""What is reported of a point of a nonlinear mode: plain numbers and arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.dlft import Evaluation
from solver.model import BoolArray, ComplexArray, FloatArray, ReducedModel
from solver.modes.mode_point import ModePoint
from solver.outcome import Outcome
from solver.packing import packable
from solver.structure.fourier import to_complex

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


def values_of(model: ReducedModel, point: ModePoint) -> ModeValues:
    """Values of a point of a mode of a model."""
    ended = (point.outcome, point.message)
    effort = (point.newton_iterations, point.run_time)
    state, problem = point.state, point.problem
    if state is None or problem is None or point.errors is None:
        linear, nothing = model.linear[0], np.full(model.contact.n_contact, np.nan)
        vectors = (np.full(len(linear.response), np.nan, complex), np.full(len(linear.mass), np.nan, complex))
        return ModeValues(*ended, np.nan, np.nan, np.nan, np.nan, *vectors, nothing, nothing, 0, 0, *effort)
    joint, at, resolution = problem.joint_of(state), state.point.evaluation, problem.case.resolution
    response = to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0]
    return ModeValues(
        *ended,
        state.omega / (2.0 * np.pi),
        state.damping_ratio,
        float(point.errors[0]) / (2.0 * np.pi),
        float(point.errors[1]),
        response,
        state.shape,
        _slips(at).mean(axis=1),
        (at.status_t == SEPARATED).mean(axis=1),
        resolution.highest,
        resolution.samples,
        *effort,
    )


def _slips(at: Evaluation) -> BoolArray:
    """Samples (n_contact, N) in which a pair slips; a pair at its friction limit that does not move sticks."""
    moved = np.abs(np.diff(at.state_t, axis=2)).max(axis=1)
    least = ACCURACY.round_off_change * np.abs(at.state_t).max(axis=(1, 2))
    return np.asarray((at.status_t == SLIP) & (moved > least[:, None]))
