"""Single steps on the slow time scale, their control, and the state that they take and give."""

from dataclasses import replace

import numpy as np
import pytest

from solver.accuracy.error_estimate import Estimate
from solver.accuracy.harmonic_levels import left_out
from solver.continuation.natural import LARGEST_STEP_RATIO, SMALLEST_STEP_RATIO
from solver.harmonic_balance.state import Failure
from solver.outcome import Outcome
from solver.settings import Scheme, SolverSettings
from solver.wear import step as control
from solver.wear.check import chosen_for_another
from solver.wear.step import Adaptive, Given, LargestDepth, Step, WearLine
from tests.solver.worn_slider import AREA, END, begun

SCHEMES: tuple[Scheme, ...] = ("explicit", "implicit")


def steps_of(rule, n_steps, end=np.inf):
    """The unworn state and those behind each of the first steps, and the steps."""
    work, state = begun()
    line = WearLine(work, rule, end)
    states, steps = [line.begin(state)], []
    for _ in range(n_steps):
        step = line.step(states[-1])
        assert isinstance(step, Step)
        steps.append(step)
        states.append(step.state)
    return states, steps


def depths(states):
    return np.array([state.depth[0] for state in states])


def rates(states):
    """m per cycle."""
    return np.array([state.rates[-1] for state in states]) / AREA


def counts(states):
    return np.array([state.cycle for state in states])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_given_step_follows_its_own_equation(scheme):
    states, steps = steps_of(Given(4000.0, scheme), 3, END)
    assert counts(states).tolist() == [0.0, 4000.0, 8000.0, 12000.0]
    rate = rates(states)
    # W + h g(W) if explicit, W_new = W + h g(W_new) if implicit
    taken = rate[:-1] if scheme == "explicit" else rate[1:]
    assert np.diff(depths(states)) == pytest.approx(4000.0 * taken, rel=1e-9)
    # the difference to the trapezoidal rule
    expected = 0.5 * 4000.0 * np.abs(np.diff(rate)) * AREA
    assert [step.error for step in steps] == pytest.approx(expected, rel=1e-9)


def test_by_the_largest_depth_every_explicit_step_wears_this_depth():
    # Eq. (22): one pair, so each step wears just that depth
    states, _ = steps_of(LargestDepth(2e-6), 4, END)
    assert np.diff(depths(states)) == pytest.approx(np.full(4, 2e-6), rel=1e-9)


def test_without_an_end_each_step_wears_as_much_as_the_first_and_is_at_most_twice_the_last():
    states, _ = steps_of(Given(2e4), 12)
    lengths, rate = np.diff(counts(states)), rates(states)
    slower = np.maximum.accumulate(rate) / rate
    allowed = np.concatenate([[2e4], LARGEST_STEP_RATIO * lengths[:-1]])
    assert lengths == pytest.approx(np.minimum(allowed, 2e4 * slower[:-1]), rel=1e-12)
    assert lengths[-1] > 2.0 * lengths[0]


def test_adaptive_steps_are_as_exact_as_asked_for_and_no_shorter():
    rtol = 1e-2
    states, steps = steps_of(Adaptive(rtol), 12)
    at, worn = counts(states), depths(states) * AREA
    lengths = np.diff(at)
    for place, step in enumerate(steps):
        at_mean_rate = worn[place + 1] * lengths[place] / at[place + 1]
        allowed = control.STEP_ERROR_FRACTION * rtol * max(worn[place + 1] - worn[place], at_mean_rate)
        assert step.error <= allowed
    assert (lengths[1:] <= LARGEST_STEP_RATIO * lengths[:-1] * (1.0 + 1e-12)).all()
    assert (steps_of(Adaptive(1e-4), 12)[0][-1]).cycle < 0.5 * at[-1]


def failing(monkeypatch, fails):
    """Attempts at adaptive steps, of which some fail: lengths of all, and those of the Euler steps."""
    own, tried, euler = control.attempt_step, list[float](), list[float]()

    def attempt(work, state, length, scheme):
        (tried if scheme == "adaptive" else euler).append(length)
        return None if fails(len(tried), length, scheme) else own(work, state, length, scheme)

    monkeypatch.setattr(control, "attempt_step", attempt)
    return tried, euler


def test_a_step_that_is_not_found_is_shortened_and_in_the_end_an_euler_step(monkeypatch):
    first = steps_of(Adaptive(1e-2), 0)[0][0].length
    with monkeypatch.context() as patch:
        tried, _ = failing(patch, lambda n, _, scheme: scheme == "adaptive" and n == 1)
        states, _ = steps_of(Adaptive(1e-2), 1)
    assert tried[:2] == [first, SMALLEST_STEP_RATIO * first]
    assert counts(states)[1] == tried[-1]
    failing(monkeypatch, lambda _, __, scheme: scheme == "adaptive")
    states, _ = steps_of(Adaptive(1e-2), 1)
    length = counts(states)[1]
    assert length == pytest.approx(control.SHORTEST_SLOW_STEP * first, rel=2e-3)
    assert depths(states)[1] == pytest.approx(length * rates(states)[1], rel=1e-6)


@pytest.mark.parametrize(("found_from", "end", "doublings"), [(3.0, np.inf, 2), (3.0, 3.5, None), (40.0, np.inf, None)])
def test_a_longer_step_goes_across_corners_at_which_every_short_one_ends(monkeypatch, found_from, end, doublings):
    work, state = begun()
    first = WearLine(work, Adaptive(1e-2), np.inf).begin(state)
    shortest, euler = control.SHORTEST_SLOW_STEP * first.length, list[float]()

    def fails(_, length, scheme):
        return scheme != "adaptive" or not euler or length <= found_from * shortest

    tried, euler = failing(monkeypatch, fails)
    monkeypatch.setattr(control, "jump", lambda *_: Failure(Outcome.MARCH_FAILED))
    step = WearLine(work, Adaptive(1e-2), end * shortest).step(first)
    if doublings is None:
        assert step == Failure(Outcome.MARCH_FAILED)
    else:
        assert isinstance(step, Step)
        assert tried[-2:] == [2.0 * shortest, 4.0 * shortest]
        assert step.state.cycle == 2.0**doublings * shortest
        assert step.error > 0.0


def test_a_given_step_that_is_not_found_is_shortened_and_later_ones_end_at_multiples_again(monkeypatch):
    own, tried = control.attempt_step, list[float]()

    def attempt(work, state, length, scheme):
        tried.append(length)
        return None if len(tried) == 1 else own(work, state, length, scheme)

    monkeypatch.setattr(control, "attempt_step", attempt)
    states, _ = steps_of(Given(4000.0), 6, END)
    assert tried == [4000.0, 1000.0, 2000.0, 1000.0, 2000.0, 2000.0, 4000.0]
    assert counts(states)[[3, 5, 6]].tolist() == [4000.0, 8000.0, 12_000.0]


def test_a_step_of_second_order_solves_its_own_equation(monkeypatch):
    # no error is refused, so that steps grow as they may
    monkeypatch.setattr(control, "STEP_ERROR_FRACTION", 1e9)
    states, _ = steps_of(Adaptive(1e-2), 3)
    depth, rate, h = depths(states), rates(states), np.diff(counts(states))
    assert depth[1] == pytest.approx(h[0] * rate[1], rel=1e-9)
    w, grown = h[1:] / h[:-1], np.diff(depth)
    expected = w**2 / (1 + 2 * w) * grown[:-1] + (1 + w) / (1 + 2 * w) * h[1:] * rate[2:]
    assert grown[1:] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("harmonics", "share", "error", "anew"),
    [
        ("auto", 1.0, 0.8e-2, False),
        # so much more is left out that the error may be above rtol
        ("auto", 0.4, 0.8e-2, True),
        ("auto", 0.4, 1e-4, False),
        # so little that fewer harmonics may do
        ("auto", 100.0, 0.8e-2, True),
        # chosen for a joint in which nothing slips
        ("auto", 1.0, 0.0, True),
        # given ones stay
        (5, 0.01, 0.8e-2, False),
    ],
)
def test_harmonics_are_chosen_again_by_the_force_that_is_left_out(harmonics, share, error, anew):
    """share: what was left out of the force when harmonics were chosen, over what is now."""
    work, state = begun()
    work.case = replace(work.case, settings=SolverSettings(harmonics, 64, rtol=1e-2))
    now = left_out(state.resolution.orders, state.point.evaluation)
    assert 1e-4 < now < 0.5
    state = replace(state, left_out=share * now, estimate=Estimate(error, error), accurate=True)
    assert chosen_for_another(work, state) is anew
