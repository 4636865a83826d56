"""A dovetail root that slides all over: free along its slot, and held there once unequal wear drives it."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.coulomb import SLIP, STICK
from solver.harmonic_balance.dlft import Balance
from solver.histories import march_wear
from solver.outcome import Outcome
from solver.settings import Resolution, SolverSettings
from solver.structure.joint import build_case
from solver.wear.jump import creeps, free_slide
from studies import build_scene


def joint_and_state(retainer, status):
    model = build_scene("dovetail_sector", mesh=1, retention_stiffness=retainer)
    case = build_case(model, 0.3, 1332.0, SolverSettings(), Resolution((1,), 16))
    joint = case.joint(1332.0, 1.0)
    n_contact = model.contact.n_contact
    balance = Balance(joint, np.zeros((n_contact, 2)), np.zeros(n_contact))
    pressed = np.zeros((n_contact, 3, 3))
    pressed[:, 0, 0] = 100.0
    at = balance.evaluate(joint.to_relative(pressed))
    return case, joint, replace(at, status_t=np.full_like(at.status_t, status))


def test_a_hold_moves_no_state_and_takes_up_what_drives_it():
    case, joint, at = joint_and_state(0.0, SLIP)
    hold = free_slide(joint, at)
    axial = hold.direction.reshape(-1, 3)
    np.testing.assert_allclose(np.abs(axial[:, 1]), 0.25, rtol=1e-6)
    held = case.held(hold).joint(joint.omega, joint.excitation_amplitude).structure
    motion = joint.to_relative(at.displacement_h)
    elastic = at.residual - joint.to_relative(at.force_h)
    np.testing.assert_allclose(held.apply(motion) - held.force_h(), elastic, atol=1e-6)
    before = joint.structure.static_stiffness @ hold.direction
    after = held.static_stiffness @ hold.direction
    np.testing.assert_allclose(after - before, hold.stiffness * hold.direction, atol=1e-3)
    assert not creeps(joint, hold, at)
    # 100 N on each of 16 pairs, friction 0.3: 1e-5 of it is 4.8e-3 N
    assert not creeps(joint, replace(hold, position=hold.position + 4.7e-3 / hold.stiffness), at)
    assert creeps(joint, replace(hold, position=hold.position + 4.9e-3 / hold.stiffness), at)


def test_nothing_is_held_where_a_pair_sticks_or_a_retainer_holds():
    assert free_slide(*joint_and_state(0.0, STICK)[1:]) is None
    assert free_slide(*joint_and_state(1e7, SLIP)[1:]) is None


@pytest.mark.slow
def test_a_root_that_begins_to_slide_all_over_wears_on():
    model = build_scene("dovetail_sector", mesh=1)
    history = march_wear(model, 212.0, 1.0, 0.3, 1.1e-11, 20_000.0)
    assert history.outcome in (Outcome.CONVERGED, Outcome.INACCURATE)
    # with a retainer of 1e6 N/m 8.7007, of 1e7 N/m 8.7015
    assert abs(1e9 * history.worn_volume[-1] - 8.701) < 1e-2 * 8.701
