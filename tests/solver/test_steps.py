"""Single steps on the slow time scale, their control, and the limits of their length."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver import build_model
from solver.arguments import worn_model
from solver.continuation.first_state import solve_static_state
from solver.continuation.natural import LARGEST_STEP_RATIO, SMALLEST_STEP_RATIO
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.wear import problem as control
from solver.wear.check import choose_harmonics
from solver.wear.step import moved_fraction, rate_slope
from solver.wear.wearing_joint import Given, WearingJoint, WearRequest, WearState
from tests.solver.models import branch_states, case_of, dovetail, march_wear, scene, state_at
from tests.solver.worn_slider import AREA, problem


def states_of(steps, n_steps, rtol=1e-2):
    """The unworn state and those behind each of the first steps."""
    of = problem(steps, rtol)
    states = [of.with_first_length(of.unworn_state())]
    for _ in range(n_steps):
        states.append(of.step(states[-1]))
        assert isinstance(states[-1], WearState)
    return states


def read(states):
    """Counts, depths, m, and rates, m per cycle."""
    return np.array([(state.cycle, state.depth[0], state.rate[0]) for state in states]).T


@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_a_given_step_follows_its_own_equation(scheme):
    states = states_of(Given(4000.0, scheme), 3)
    count, depth, rate = read(states)
    assert count.tolist() == [0.0, 4000.0, 8000.0, 12000.0]
    # W + h g(W) if explicit, W_new = W + h g(W_new) if implicit
    taken = rate[:-1] if scheme == "explicit" else rate[1:]
    assert np.diff(depth) == pytest.approx(4000.0 * taken, rel=1e-9)
    # the difference to the trapezoidal rule
    expected = 0.5 * 4000.0 * np.abs(np.diff(rate)) * AREA
    assert [state.last.error for state in states[1:]] == pytest.approx(expected, rel=1e-9)


def test_by_the_largest_depth_every_explicit_step_wears_this_depth():
    # Eq. (22): one pair, so each step wears just that depth
    states = states_of(Given(np.inf, "explicit", 2e-6), 4)
    assert np.diff(read(states)[1]) == pytest.approx(np.full(4, 2e-6), rel=1e-9)


def test_adaptive_steps_are_as_exact_as_asked_for_and_no_shorter():
    rtol = 1e-2
    states = states_of(None, 12, rtol)
    at, depth, _ = read(states)
    lengths = np.diff(at)
    worn = np.maximum(np.diff(depth), depth[1:] * lengths / at[1:]) * AREA
    assert ([state.last.error for state in states[1:]] <= control.SMALL_SHARE * rtol * worn).all()
    assert (lengths[1:] <= LARGEST_STEP_RATIO * lengths[:-1] * (1.0 + 1e-12)).all()
    assert states_of(None, 12, 1e-4)[-1].cycle < 0.5 * at[-1]


def failing(monkeypatch, fails):
    """Attempts at steps, of which some fail: schemes and lengths of all."""
    own, tried = control.attempt_step, list[tuple[str, float]]()

    def attempt(work, state, length, scheme):
        tried.append((scheme, length))
        return None if fails(tried) else own(work, state, length, scheme)

    monkeypatch.setattr(control, "attempt_step", attempt)
    return tried


def test_a_step_that_is_not_found_is_shortened_and_in_the_end_an_euler_step(monkeypatch):
    first = states_of(None, 0)[0].next_length
    with monkeypatch.context() as patch:
        tried = failing(patch, lambda tried: len(tried) == 1)
        states = states_of(None, 1)
    assert tried[:2] == [("adaptive", first), ("adaptive", SMALLEST_STEP_RATIO * first)]
    assert states[1].cycle == tried[-1][1]
    failing(monkeypatch, lambda tried: tried[-1][0] == "adaptive")
    length, depth, rate = read(states_of(None, 1))[:, 1]
    assert length == pytest.approx(control.FINE_STEP * first, rel=2e-3)
    assert depth == pytest.approx(length * rate, rel=1e-6)


@pytest.mark.parametrize(("found_from", "end", "doublings"), [(3.0, np.inf, 2), (3.0, 3.5, None), (99.0, np.inf, None)])
def test_a_longer_step_goes_across_corners_at_which_every_short_one_ends(monkeypatch, found_from, end, doublings):
    of = problem()
    # so short a step changes less than the tolerance
    of.run = of.run.with_tolerance(1e-10)
    first = of.with_first_length(of.unworn_state())
    shortest = control.FINE_STEP * first.next_length

    def fails(tried):
        """All steps up to the shortest one, the Euler step, and some longer ones behind it."""
        euler = any(scheme != "adaptive" for scheme, _ in tried)
        return not euler or tried[-1][0] != "adaptive" or tried[-1][1] <= found_from * shortest

    tried = failing(monkeypatch, fails)
    monkeypatch.setattr(control, "jump", lambda *_: Failure(Outcome.MARCH_FAILED, "lost"))
    of.limit = end * shortest
    found = of.step(first)
    if doublings is None:
        assert found == Failure(Outcome.MARCH_FAILED, "lost")
    else:
        assert isinstance(found, WearState)
        assert tried[-2:] == [("adaptive", 2.0 * shortest), ("adaptive", 4.0 * shortest)]
        assert found.cycle == 2.0**doublings * shortest
        assert found.last.error > 0.0


def test_a_step_whose_error_is_not_known_is_refused(monkeypatch):
    usual, attempt = np.diff(read(states_of(None, 6))[0]), control.attempt_step
    longest = 0.5 * usual.max()

    def unsure(wearing, state, length, scheme):
        end = attempt(wearing, state, length, scheme)
        return end if length <= longest else replace(end, last=replace(end.last, heat_error=np.nan))

    monkeypatch.setattr(control, "attempt_step", unsure)
    assert np.diff(read(states_of(None, 6))[0]).max() <= longest


def test_a_given_step_that_is_not_found_is_shortened_and_later_ones_end_at_multiples_again(monkeypatch):
    tried = failing(monkeypatch, lambda tried: len(tried) == 1)
    states = states_of(Given(4000.0), 6)
    assert [length for _, length in tried] == [4000.0, 1000.0, 2000.0, 1000.0, 2000.0, 2000.0, 4000.0]
    assert read(states)[0][[3, 5, 6]].tolist() == [4000.0, 8000.0, 12_000.0]


def test_a_step_to_the_last_count_ends_there_to_the_last_digit():
    of = problem(Given(1e9))
    state, ends = replace(of.unworn_state(), cycle=500.1), np.linspace(2000.0, 2100.0, 999)
    # the sum of the count and of what is left is less
    of.limit = float(next(end for end in ends if state.cycle + (end - state.cycle) < end))
    assert of.step(state).cycle == of.limit


def test_a_state_with_other_harmonics_has_the_wear_rate_of_its_own_motion():
    work = problem()
    work.case = replace(work.case, settings=SolverSettings("auto", 512, rtol=1e-4))
    state = work.unworn_state()
    chosen = choose_harmonics(work, state, anew=True)
    assert chosen.point.resolution != state.point.resolution
    assert chosen.rate == pytest.approx(work.gain(1.0) * chosen.at.slip_work, rel=1e-12, abs=0.0)
    assert work.volume_rate(chosen) == pytest.approx(float(chosen.rate @ work.area))
    assert abs(chosen.rate / state.rate - 1.0).max() > 1e-4


COARSE_BLADE = SolverSettings(harmonics=3, samples=64)
STIFFNESS, SLIDE, WEAR = 1e6, 1e-4, 1e-10  # N/m, of each pair towards the block; m, amplitude of the sliding; 1/Pa
LIMIT = 2.0 / (WEAR / 1e-4 * 4.0 * SLIDE * STIFFNESS)
"""N_1 - N_2 falls by k (W_1 - W_2), and each depth grows by k_w / alpha N 4 X a cycle: 2 over k_w / alpha 4 X k."""


def test_the_share_is_that_by_which_the_normal_forces_change():
    # without friction the pairs stay closed and slide freely: the static state is linear in the depth
    depth = 2e-7 * np.random.default_rng(1).uniform(size=16)
    joint, worn = (
        case_of(worn_model(dovetail(), each), 0.0, 1335.0, COARSE_BLADE).joint(1335.0, 0.0) for each in (None, depth)
    )
    states = [solve_static_state(each, Run(1e-10)).evaluation for each in (joint, worn)]
    before, after = (state.force_h[:, 0, 0] for state in states)
    change = np.linalg.norm(after - before) / np.linalg.norm(before)
    assert change > 0.01
    assert moved_fraction(joint, states[0], depth) == pytest.approx(change, rel=1e-6, abs=0.0)


@pytest.mark.slow
def test_a_wear_coefficient_in_the_wrong_unit_is_a_step_too_long_and_the_step_that_is_advised_is_not():
    (start,) = branch_states(dovetail(), 0.5, 0.5, [2.0 * np.pi * 212.5], COARSE_BLADE)

    def worn(scheme, step, cycles):
        return march_wear(dovetail(), 0.5, start, 1.1e-5, step, scheme, np.array([0.0, cycles]), COARSE_BLADE)

    for scheme in ("explicit", "implicit"):
        refused = worn(scheme, 1000.0, 5000.0)
        assert refused.outcome is Outcome.STEP_TOO_LONG
    advised = float(refused.message.split("at most ")[1].split()[0])
    assert 1e-4 < advised < 1e-2
    assert worn("explicit", advised, 20.0 * advised).outcome is Outcome.CONVERGED


def test_the_derivatives_of_the_wear_are_those_of_the_solved_states():
    model = scene("cylinder_on_flat", 3, strips=24)
    start, case, _ = state_at(model, 0.6, 1.0, 2.0 * np.pi * 20.0, COARSE_BLADE, "ramp")
    work = WearingJoint(case, start, WearRequest(1e-4, Given(1.0), np.array([0.0, 1.0])))
    state = work.unworn_state()
    work.run = Run(1e-13)
    joint, at = work.joint_of(state), state.at
    gain, slips = work.gain(1.0), at.slip_work > 0.0
    slopes = rate_slope(work, state, slips)
    step = 1e-5 * float((gain * at.slip_work).max() / np.abs(slopes).max())
    for pair in np.flatnonzero(slips):
        rates = []
        for sign in (1.0, -1.0):
            depth = at.wear_depth + sign * step * np.eye(slips.size)[pair]
            solved = Run(1e-13).state(Balance(joint, at.start_history, depth), at.predicted_h)
            rates.append(gain * solved.evaluation.slip_work)
        wanted = (rates[0] - rates[1]) / (2.0 * step)
        # as exact as a Newton direction
        assert slopes[:, pair] == pytest.approx(wanted, abs=1e-2 * np.abs(wanted).max())


@lru_cache
def seesaw(share, scheme):
    """A block pressed with 100 N on two springs with a pair at the end of each: what one pair loses the other takes.

    The pairs slide with an amplitude of `SLIDE` whatever presses them: the friction is next to nothing. Displacements:
    closing and sliding of the first pair, of the second pair, and the block.
    """
    stiffness = np.diag([STIFFNESS, 1e5, STIFFNESS, 1e5, 2.001 * STIFFNESS])
    stiffness[[0, 2, 4, 4], [4, 4, 0, 2]] = -STIFFNESS
    load = {"load_static": [0.0, 0.0, 0.0, 0.0, 100.0], "load_harmonic": [0.0, 1e5 * SLIDE, 0.0, 1e5 * SLIDE, 0.0]}
    more = load | {"response": [1], "gap": [0.0, 1e-6]}
    model = build_model(np.diag([0.0] * 4 + [1.0]), 1e-6 * stiffness, stiffness, [[0, 1, -1], [2, 3, -1]], 1e-4, **more)
    settings, step = SolverSettings(3, 128), share * LIMIT
    (start,) = branch_states(model, 1e-4, 1.0, [100.0], settings)
    return march_wear(model, 1e-4, start, WEAR, step, scheme, np.linspace(0.0, 20 * step, 21), settings)


def test_the_limit_of_the_explicit_step_is_that_of_the_closed_form():
    assert seesaw(0.4, "explicit").step_limit == pytest.approx(LIMIT, rel=0.01, abs=0.0)


@pytest.mark.parametrize(
    ("share", "scheme", "oscillates"),
    [(0.4, "explicit", False), (1.3, "explicit", True), (1.3, "implicit", False), (10.0, "implicit", False)],
)
def test_beyond_the_limit_the_explicit_scheme_oscillates(share, scheme, oscillates):
    found = seesaw(share, scheme)
    assert (np.diff(found.wear_depth, axis=0) >= 0.0).all()
    # both pairs wear as much in the end where the scheme is stable
    last = np.diff(found.wear_depth[-2:], axis=0)[0]
    assert (abs(last[0] - last[1]) < 0.02 * last.sum()) is not oscillates
    # the error bar says so
    assert not oscillates or found.error_estimate > SolverSettings().rtol
