"""Travelling waves on the coarse dovetail sector: states over the resonances, what they wear, and how it all ends."""

from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.first_state import solve_first_state
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, final_history
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import branch_states, dovetail, march_wear

SETTINGS = SolverSettings(harmonics=3, samples=64)
FRICTION = 0.5
WEAR = 1.1e-11  # 1/Pa
CYCLES = np.linspace(0.0, 2e4, 5)
# three times 20 nodal diameters are more than half of the 47 sectors
RESONANCE = {3: 214.638, 20: 215.031}  # Hz, of the glued structure
OFFSETS = (-0.2, 0.0, 1.0)  # Hz


@lru_cache
def starts(nodal_diameter, amplitude):
    omegas = 2.0 * np.pi * (RESONANCE[nodal_diameter] + np.array(OFFSETS))
    return tuple(branch_states(dovetail(3, nodal_diameter), FRICTION, amplitude, omegas, SETTINGS))


@lru_cache
def histories(nodal_diameter, amplitude):
    return tuple(
        march_wear(dovetail(3, nodal_diameter), FRICTION, start, WEAR, 1000.0, "adaptive", CYCLES, SETTINGS)
        for start in starts(nodal_diameter, amplitude)
    )


@lru_cache
def state(nodal_diameter):
    """A state in which pairs slip, a little below the resonance."""
    omega = 2.0 * np.pi * (RESONANCE[nodal_diameter] - 0.3)
    case = build_case(dovetail(3, nodal_diameter), FRICTION, omega, SETTINGS)
    point = solve_first_state(case, omega, 0.5, np.zeros(16), Run(case.settings.tolerance))
    assert isinstance(point, State)
    assert point.evaluation.slip_work.sum() > 1e-9
    return case, State(point.evaluation, point.history, omega)


@pytest.mark.slow
def test_histories_are_computed_to_their_end_and_wear_at_the_resonance():
    for history in histories(20, 0.5):
        assert history.outcome is Outcome.CONVERGED
        assert history.last_cycle == CYCLES[-1]
        assert (np.diff(history.worn_volume) >= 0.0).all()
    volumes = [float(history.worn_volume[-1]) for history in histories(20, 0.5)]
    assert 1e-11 < volumes[1] < 1e-8
    assert volumes[2] < 1e-6 * volumes[1]


@pytest.mark.slow
def test_the_structure_settles_to_the_state_that_the_balance_has():
    """Steps in time know nothing of the balance of a travelling wave but its matrices: from rest they lead to a state
    whose motion differs from that raised gradually by the friction history alone.
    """
    case, point = state(3)
    omega = point.parameter
    joint, quiet = case.joint(omega, 0.5), case.joint(omega, 0.0)
    rest = solve_first_state(case, omega, 1e-6, np.zeros(16), Run(case.settings.tolerance))
    assert isinstance(rest, State)
    settled = relax_to_periodic(case, joint, np.zeros(16), rest, quiet, Run(case.settings.tolerance))
    assert isinstance(settled, State)
    one, other = (
        joint.structure.response_h(joint.to_relative(at.evaluation.displacement_h))[0, 1:3] for at in (point, settled)
    )
    assert np.linalg.norm(one - other) < 0.05 * np.linalg.norm(one)
    kept = Balance(joint, settled.evaluation.history, np.zeros(16)).evaluate(settled.evaluation.predicted_h)
    assert kept.scaled_residual() < 2.0 * SETTINGS.tolerance
    again = final_history(Balance(joint, settled.history, np.zeros(16)), settled.evaluation)
    assert np.abs(again - settled.history).max() <= 1e-9 * np.abs(settled.history).max()
