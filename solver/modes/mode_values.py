"""The values of a point of a nonlinear mode, from its state."""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.dlft import Evaluation
from solver.model import BoolArray, ReducedModel
from solver.modes.mode_point import ModePoint
from solver.results.mode_values import ModeValues, without_state
from solver.settings import ROUND_OFF
from solver.structure.fourier import to_complex


def values_of(model: ReducedModel, point: ModePoint) -> ModeValues:
    """Values of a point of a mode of a model."""
    ended = (point.outcome, point.message)
    effort = (point.newton_iterations, point.run_time)
    state, problem = point.state, point.problem
    if state is None or problem is None or point.errors is None:
        linear = model.linear[0]
        sizes = (len(linear.response), len(linear.mass), model.contact.n_contact)
        return without_state(*ended, sizes, *effort)
    joint, at, resolution = problem.joint_of(state), state.state.evaluation, problem.case.resolution
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
    least = ROUND_OFF * np.abs(at.state_t).max(axis=(1, 2))
    return np.asarray((at.status_t == SLIP) & (moved > least[:, None]))
