"""Wear beyond an end: a branch with impacts that ends, a root that slides all over, and a run that was interrupted."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver import build_model
from solver.contact.coulomb import SLIP, STICK
from solver.continuation.transient import Transient
from solver.harmonic_balance.dlft import Balance
from solver.histories import march_wear as march_model
from solver.outcome import Outcome
from solver.packing import Packed, unpack
from solver.settings import Resolution, SolverSettings
from solver.wear.jump import creeps, free_slide
from solver.wear.problem import WearProblem
from studies import build_scene
from tests.references import vibro_impact_orbit
from tests.solver.models import assert_same, branch_states, case_of, march_wear

OMEGA = 1.5
FORCE = 0.02
GAP = 0.1
IMPACT = SolverSettings(11, 128)
WALL_WEAR = 1e-7  # 1/Pa
WALL_AREA = 1e-4


def worn_wall():
    """`vibro_impact` with a second displacement of its pair: a massless slide along the wall, moved by its own load.

    The friction is so small that the mass does not feel it. Another pair, pressed by 1 N, wears all the time.
    """
    stiffness = np.diag([100.0, 1.0, 101.0, 1.0])
    stiffness[0, 2] = stiffness[2, 0] = -100.0
    more = {"load_harmonic": [0.0, 5.0, 1.0, 5.0], "response": [2], "gap": [GAP, 0.0], "normal_load": [0.0, 1.0]}
    mass, damping = np.diag([0.0, 0.0, 1.0, 0.0]), np.diag([0.0, 0.01, 0.05, 0.01])
    return build_model(mass, damping, stiffness, [[0, 1, -1], [-1, 3, -1]], WALL_AREA, **more)


@lru_cache
def wall_start(sweep="up"):
    (found,) = branch_states(worn_wall(), 1e-3, FORCE, [OMEGA], IMPACT, sweep)
    assert found.outcome is Outcome.CONVERGED
    return found


@lru_cache
def wall_history(step, scheme):
    cycles = np.linspace(0.0, 1000.0, 21)
    return march_wear(worn_wall(), 1e-3, wall_start(), WALL_WEAR, step, scheme, cycles, IMPACT)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "impacts"), [(0.98, True), (1.02, False)])
def test_the_exact_branch_ends_at_the_depth_of_the_jump(share, impacts):
    depth = share * wall_history(5.0, "implicit").wear_depth[-1, 0]
    orbit = vibro_impact_orbit(1.0, 0.05, 1.0, FORCE, 100.0, GAP + depth, OMEGA, begin=0.7)
    assert (abs(orbit.harmonic(0)) > 0.05) == impacts


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), [("explicit", 50.0), ("implicit", 1000.0), ("adaptive", 0.0)])
def test_the_jump_is_found_and_the_march_goes_on(scheme, step):
    found = wall_history(step, scheme)
    assert found.outcome.complete
    assert 0.0 < found.jump_cycle < 1000.0
    after = found.cycles > 1.02 * found.jump_cycle + 1.0
    linear = FORCE / abs(1 - OMEGA**2 + 0.05j * OMEGA)
    assert np.abs(found.response[-1, 0]) == pytest.approx(linear, rel=1e-3, abs=0.0)
    assert np.abs(found.response[0, 0]) > 5 * linear
    assert after.any()
    # what wears the wall is over, the other pair wears on
    assert (found.wear_depth[after, 0] == found.wear_depth[-1, 0]).all()
    assert found.wear_depth[-1, 1] > found.wear_depth[0, 1]
    assert (np.diff(found.wear_depth, axis=0) >= 0.0).all()
    # each state is one at its own depth, so the branch ends there whatever the step
    fine = wall_history(5.0, "implicit")
    assert found.wear_depth[-1, 0] == pytest.approx(fine.wear_depth[-1, 0], rel=0.05, abs=0.0)
    assert scheme != "adaptive" or found.jump_cycle == pytest.approx(fine.jump_cycle, rel=0.02, abs=0.0)


def test_on_the_branch_without_impacts_nothing_jumps():
    asked = WALL_WEAR, 50.0, "implicit", np.array([0.0, 1000.0]), IMPACT
    found = march_wear(worn_wall(), 1e-3, wall_start("down"), *asked)
    assert found.outcome is Outcome.CONVERGED
    assert np.isnan(found.jump_cycle)
    assert not found.wear_depth[:, 0].any()


# --- a dovetail root, free along its slot, is held there once unequal wear drives it ---


def joint_and_state(retainer, status):
    model = build_scene("dovetail_sector", mesh=1, retention_stiffness=retainer)
    case = case_of(model, 0.3, 1332.0, SolverSettings(), Resolution((1,), 16))
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
    sprung = replace(case, hold=hold).joint(joint.omega, joint.excitation_amplitude)
    held, transient = sprung.structure, Transient(sprung)
    motion = joint.to_relative(at.displacement_h)
    elastic = at.residual - joint.to_relative(at.force_h)
    np.testing.assert_allclose(held.apply(motion) - held.force_h, elastic, atol=1e-6)
    before = joint.structure.static_stiffness @ hold.direction
    after = held.static_stiffness @ hold.direction
    np.testing.assert_allclose(after - before, hold.stiffness * hold.direction, atol=1e-3)
    # an infinite step in time ends in the same balance
    relaxed = transient.step(transient.periodic(at), 0.0).structure
    np.testing.assert_allclose(relaxed.static_stiffness, held.static_stiffness, rtol=1e-12)
    np.testing.assert_allclose(relaxed.force_h, held.force_h, rtol=1e-12, atol=1e-12)
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
    history = march_model(model, 212.0, 1.0, 0.3, 1.1e-11, 20_000.0)
    assert history.outcome in (Outcome.CONVERGED, Outcome.INACCURATE)
    # with a retainer of 1e6 N/m 8.7007, of 1e7 N/m 8.7015
    assert abs(1e9 * history.worn_volume[-1] - 8.701) < 1e-2 * 8.701


@pytest.mark.slow
def test_a_history_goes_on_before_and_behind_a_jump(monkeypatch):
    """To the same bits, from some of the places where it was saved."""
    monkeypatch.setattr(WearProblem, "iterations_per_save", 30)
    cycles, kept = np.linspace(0.0, 1000.0, 5), list[Packed]()
    asked = worn_wall(), 1e-3, wall_start(), WALL_WEAR, 1.0, "adaptive", cycles, IMPACT
    whole = march_wear(*asked, keep=kept.append)
    places = [unpack(progress) for progress in kept]
    # within the history itself, and within the reference solution: from the last one backwards
    for stage in ([n for n, at in enumerate(places) if len(at) == length] for length in {len(at) for at in places}):
        for n in stage[:: -max(1, len(stage) // 2)][:2]:
            assert_same(march_wear(*asked, resume=kept[n]), whole)
    own = [solution.state.cycle for at in places if len(at) == 1 for solution in at.values()]
    assert min(own) < whole.jump_cycle < max(own)
