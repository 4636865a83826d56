"""A mass at a wall that wears away: the branch with impacts ends, the mass falls on the other one, wear goes on."""

from functools import lru_cache

import numpy as np
import pytest

from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.outcome import Outcome
from solver.settings import SolverSettings
from tests.references import vibro_impact_orbit
from tests.solver.models import branch_states, march_wear

OMEGA = 1.5
FORCE = 0.02
GAP = 0.1
SETTINGS = SolverSettings(11, 128)
WEAR = 1e-7  # 1/Pa
AREA = 1e-4


def worn_wall(pressed=0.0):
    """`vibro_impact` with a second displacement of its pair: a massless slide along the wall, moved by its own load.

    The friction is so small that the mass does not feel it. Another pair, pressed by `pressed`, wears all the time.
    """
    stiffness = np.zeros((4, 4))
    stiffness[np.ix_([0, 2], [0, 2])] = [[100.0, -100.0], [-100.0, 101.0]]
    stiffness[1, 1] = stiffness[3, 3] = 1.0
    linear = LinearModel(
        mass=np.diag([0.0, 0.0, 1.0, 0.0]),
        damping=np.diag([0.0, 0.01, 0.05, 0.01]),
        stiffness=stiffness,
        load_static=np.zeros(4),
        load_harmonic=np.array([0.0, 5.0, 1.0, 5.0], complex),
        response=np.array([[0.0, 0.0, 1.0, 0.0]]),
    )
    contact = ContactInterface(
        dofs=np.array([[0, 1, -1], [-1, 3, -1]]),
        area=np.full(2, AREA),
        gap=np.array([GAP, 0.0]),
        normal_load=np.array([0.0, pressed]),
        position=np.full((2, 3), np.nan),
        surface=("wall", "side"),
    )
    return ReducedModel({0: linear}, contact, ("mass",))


@lru_cache
def start(sweep="up"):
    (found,) = branch_states(worn_wall(1.0), 1e-3, FORCE, [OMEGA], SETTINGS, sweep)
    assert found.outcome is Outcome.CONVERGED
    return found


@lru_cache
def history(step, scheme, end=1000.0):
    cycles = np.linspace(0.0, end, 21)
    return march_wear(worn_wall(1.0), 1e-3, start(), WEAR, step, scheme, cycles, SETTINGS)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "impacts"), [(0.98, True), (1.02, False)])
def test_the_exact_branch_ends_at_the_depth_of_the_jump(share, impacts):
    depth = share * history(5.0, "implicit").wear_depth[-1, 0]
    orbit = vibro_impact_orbit(1.0, 0.05, 1.0, FORCE, 100.0, GAP + depth, OMEGA, sweep_start=0.7)
    assert (abs(orbit.harmonic(0)) > 0.05) == impacts


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), [("explicit", 50.0), ("implicit", 1000.0), ("adaptive", 0.0)])
def test_the_jump_is_found_and_the_march_goes_on(scheme, step):
    found = history(step, scheme)
    assert found.outcome is Outcome.CONVERGED
    assert 0.0 < found.jump_cycle < 1000.0
    before, after = found.cycles < found.jump_cycle, found.cycles > 1.02 * found.jump_cycle + 1.0
    linear = FORCE / abs(1 - OMEGA**2 + 0.05j * OMEGA)
    assert np.abs(found.response[-1, 0]) == pytest.approx(linear, rel=1e-3, abs=0.0)
    assert np.abs(found.response[0, 0]) > 5 * linear
    assert before.any()
    assert after.any()
    # what wears the wall is over, the other pair wears on
    assert (found.wear_depth[after, 0] == found.wear_depth[-1, 0]).all()
    assert found.wear_depth[-1, 1] > found.wear_depth[0, 1]
    assert (np.diff(found.wear_depth, axis=0) >= 0.0).all()
    # each state is one at its own depth, so the branch ends there whatever the step
    assert found.wear_depth[-1, 0] == pytest.approx(history(5.0, "implicit").wear_depth[-1, 0], rel=0.05, abs=0.0)


@pytest.mark.slow
def test_the_jump_cycle_does_not_depend_much_on_the_step():
    fine = history(5.0, "implicit").jump_cycle
    assert history(50.0, "implicit").jump_cycle == pytest.approx(fine, rel=0.1, abs=0.0)
    assert history(0.0, "adaptive").jump_cycle == pytest.approx(fine, rel=0.02, abs=0.0)


def test_on_the_branch_without_impacts_nothing_jumps():
    found = march_wear(worn_wall(1.0), 1e-3, start("down"), WEAR, 50.0, "implicit", np.array([0.0, 1000.0]), SETTINGS)
    assert found.outcome is Outcome.CONVERGED
    assert np.isnan(found.jump_cycle)
    assert not found.wear_depth[:, 0].any()
