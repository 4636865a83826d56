"""Limits of a step: of the explicit scheme against a closed form, and of the share of the preload that a step moves."""

from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.first_state import solve_static_state
from solver.harmonic_balance.dlft import Balance
from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from solver.wear.rate_slope import moved_fraction, rate_slope
from solver.wear.wearing_joint import WearingJoint
from tests.solver.models import branch_states, dovetail, march_wear, scene

OMEGA = 2.0 * np.pi * 212.5
FRICTION = 0.5
CYCLES = np.array([0.0, 1000.0, 5000.0])
COARSE = SolverSettings(harmonics=3, samples=64)
STIFFNESS = 1e6  # N/m, of each pair towards the block
SEESAW = SolverSettings(3, 128)
SEESAW_WEAR = 1e-10  # 1/Pa
AREA = 1e-4
SLIDE = 1e-4  # m, amplitude of the sliding


def static_states(friction, *depths):
    """The joint and its static states at depths (16,), m."""
    joint = build_case(dovetail(), friction, OMEGA, COARSE).joint(OMEGA, 0.0)
    return joint, [solve_static_state(joint, worn, Run(1e-10)).evaluation for worn in depths]


def test_the_share_is_that_by_which_the_normal_forces_change():
    # without friction the pairs stay closed and slide freely: the static state is linear in the depth
    depth = 2e-7 * np.random.default_rng(1).uniform(size=16)
    joint, states = static_states(0.0, np.zeros(16), depth)
    before, after = (state.force_h[:, 0, 0] for state in states)
    change = np.linalg.norm(after - before) / np.linalg.norm(before)
    assert change > 0.01
    assert moved_fraction(joint, states[0], depth) == pytest.approx(change, rel=1e-6, abs=0.0)


@pytest.mark.slow
def test_a_wear_coefficient_in_the_wrong_unit_is_a_step_too_long_and_the_step_that_is_advised_is_not():
    (start,) = branch_states(dovetail(), FRICTION, 0.5, [OMEGA], COARSE)

    def worn(scheme, step, cycles):
        return march_wear(dovetail(), FRICTION, start, 1.1e-5, step, scheme, cycles, COARSE)

    for scheme in ("explicit", "implicit"):
        refused = worn(scheme, 1000.0, CYCLES)
        assert refused.outcome is Outcome.STEP_TOO_LONG
        assert "from cycle 0 on" in refused.message
    advised = float(refused.message.split("at most ")[1].split()[0])
    assert 1e-4 < advised < 1e-2
    assert worn("explicit", advised, 20.0 * advised * np.array([0.0, 1.0])).outcome is Outcome.CONVERGED


def test_the_derivatives_of_the_wear_are_those_of_the_solved_states():
    model = scene("cylinder_on_flat", 3, strips=24)
    (start,) = branch_states(model, 0.6, 1.0, [2.0 * np.pi * 20.0], COARSE, "ramp")
    case = build_case(model, 0.6, start.penalty_omega, COARSE, start.resolution)
    work = WearingJoint(case, start, AREA)
    state = work.begin()
    work.run = Run(1e-13)
    joint, at = work.joint_of(state), state.at
    gain, slips = work.gain(1.0), at.slip_work > 0.0
    slopes = rate_slope(work, state, slips)
    step = 1e-5 * float((gain * at.slip_work).max() / np.abs(slopes).max())
    for pair in np.flatnonzero(slips):
        rates = []
        for sign in (1.0, -1.0):
            depth = at.wear_depth + sign * step * np.eye(slips.size)[pair]
            solved = Run(1e-13).solve(Balance(joint, at.history, depth), at.predicted_h)
            rates.append(gain * solved.evaluation.slip_work)
        wanted = (rates[0] - rates[1]) / (2.0 * step)
        # as exact as a Newton direction
        assert slopes[:, pair] == pytest.approx(wanted, abs=1e-2 * np.abs(wanted).max())


def seesaw():
    """A block pressed with 100 N on two springs with a pair at the end of each: what one pair loses the other takes.

    The pairs slide with an amplitude of `SLIDE` whatever presses them: the friction is next to nothing. Displacements:
    closing and sliding of the first pair, of the second pair, and the block.
    """
    stiffness = np.diag([STIFFNESS, 1e5, STIFFNESS, 1e5, 2.001 * STIFFNESS])
    stiffness[[0, 2, 4, 4], [4, 4, 0, 2]] = -STIFFNESS
    linear = LinearModel(
        mass=np.diag([0.0, 0.0, 0.0, 0.0, 1.0]),
        damping=1e-6 * stiffness,
        stiffness=stiffness,
        load_static=np.array([0.0, 0.0, 0.0, 0.0, 100.0]),
        load_harmonic=np.array([0.0, 1e5 * SLIDE, 0.0, 1e5 * SLIDE, 0.0], complex),
        response=np.array([[0.0, 1.0, 0.0, 0.0, 0.0]]),
    )
    contact = ContactInterface(
        dofs=np.array([[0, 1, -1], [2, 3, -1]]),
        area=np.full(2, AREA),
        gap=np.array([0.0, 1e-6]),
        normal_load=np.zeros(2),
        position=np.full((2, 3), np.nan),
        surface=("left", "right"),
    )
    return ReducedModel({0: linear}, contact, ("slide",))


def exact_limit():
    """N_1 - N_2 falls by k (W_1 - W_2), and each depth grows by k_w / alpha N 4 X a cycle: 2 over k_w / alpha 4 X k."""
    return 2.0 / (SEESAW_WEAR / AREA * 4.0 * SLIDE * STIFFNESS)


@lru_cache
def history(share, scheme):
    model = seesaw()
    (start,) = branch_states(model, 1e-4, 1.0, [100.0], SEESAW)
    step = share * exact_limit()
    return march_wear(model, 1e-4, start, SEESAW_WEAR, step, scheme, np.linspace(0.0, 20 * step, 21), SEESAW)


def test_the_limit_of_the_explicit_step_is_that_of_the_closed_form():
    assert history(0.5, "explicit").step_limit == pytest.approx(exact_limit(), rel=0.01, abs=0.0)
    # a property of the state and not of the scheme
    assert history(0.5, "implicit").step_limit == history(0.5, "explicit").step_limit


@pytest.mark.parametrize(
    ("share", "scheme", "oscillates"),
    [(0.4, "explicit", False), (1.3, "explicit", True), (1.3, "implicit", False), (10.0, "implicit", False)],
)
def test_beyond_the_limit_the_explicit_scheme_oscillates(share, scheme, oscillates):
    found = history(share, scheme)
    assert (np.diff(found.wear_depth, axis=0) >= 0.0).all()
    # both pairs wear as much in the end where the scheme is stable
    last = np.diff(found.wear_depth[-2:], axis=0)[0]
    assert (abs(last[0] - last[1]) < 0.02 * last.sum()) is not oscillates
    # the error bar says so
    assert not oscillates or found.error_estimate > SEESAW.rtol
