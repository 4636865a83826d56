"""Passages of a mission through a range of frequencies: their integral, their delay, their choice of frequencies."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from solver import Block, Outcome, Passage, SolverSettings
from solver.missions import passage as passages
from solver.missions.block_run import BlockInput
from solver.missions.mission import MissionRequest
from solver.model import with_friction
from solver.results.history import StartState
from solver.settings import Resolution
from tests.solver.models import scene

WEAR, SETTINGS = 1.1e-11, SolverSettings(harmonics=3, samples=64)


def state(frequency, density, branch=0, response=0.0):
    nan = float("nan")
    start = StartState(Outcome.CONVERGED, None, nan, Resolution((1,), 4), 0.0, 0.0, 0, 0.0, branch, 1.5)
    return passages.SweptState(
        frequency, start, np.array([density]), np.zeros(1), np.array([response + 0j]), np.array([response])
    )


def test_the_error_of_the_trapezoidal_rule_is_known_on_both_sides_of_a_jump():
    """A parabola a m/Hz up to the jump at 1.5 Hz, a constant behind it."""
    before = [state(at, at**2) for at in (0.0, 0.5, 1.0, 1.5 - 1e-6)]
    behind = [state(at, 5.0, 1) for at in (1.5 + 1e-6, 2.0, 3.0)]
    errors = passages.interval_errors(before + behind, np.array([2.0]))
    np.testing.assert_allclose(errors[:3], 2.0 * 0.5**3 / 6.0, rtol=1e-4)
    assert 0.0 < errors[3] < 1e-5
    np.testing.assert_allclose(errors[4:], 0.0, atol=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_frequencies_of_a_passage_wear_one_after_the_other(order):
    """`dy/df = g(f) - L(f) y`, up and down, with a derivative by the depth before; against its integration."""
    at = np.linspace(0.0, 1.0, 201)
    loss = np.array([[1.0, -1.0], [-0.5, 0.5]])

    def rates(f):
        return np.array([1.0 + f, 2.0 * (1.0 - f)]), -(1.0 + 3.0 * f) * loss

    states = [replace(state(f, 0.0), density=rates(f)[0]) for f in at][::order]
    grown, slope = passages.wear_in_order(states, [rates(of.frequency)[1] for of in states])
    ends = (0.0, 1.0)[::order]

    def end(before):
        def rise(f, y):
            density, derivative = rates(f)
            return order * (density + derivative @ y)

        return solve_ivp(rise, ends, before, rtol=1e-10, atol=1e-12).y[:, -1]

    np.testing.assert_allclose(grown, end(np.zeros(2)), rtol=1e-4)
    np.testing.assert_allclose(slope @ [0.1, 0.0], end(np.array([0.1, 0.0])) - end(np.zeros(2)) - [0.1, 0.0], rtol=1e-3)


@pytest.mark.slow
def test_a_vibration_is_late_by_its_decay_time():
    """The free slider with 6 N s/m and 0.1 kg decays by exp(-30 t): at 7 Hz/s it is late by 7/30 Hz."""

    def case(rate, damping=6.0):
        # too little wear to change the pressures on the way
        model = with_friction(scene("sdof_slider", damping=damping), 0.5)
        block = Block(model, Passage(180.0, 220.0, rate), 10.0, None)
        return BlockInput(MissionRequest((block,), 1e-6 * WEAR, (0, 1), SETTINGS), block, np.zeros((2, 1)))

    fast, slow = passages.run_passage(case(7.0)), passages.run_passage(case(0.07))
    assert fast.sweep_rate == pytest.approx(7.0 / (30.0 / (2.0 * np.pi)) ** 2)
    assert slow.sweep_rate == pytest.approx(0.01 * fast.sweep_rate)
    # as if the largest wear over frequency were missed, or added, over the lag
    states = passages.states_at(case(7.0), np.linspace(190.0, 210.0, 41))
    assert isinstance(states, list)
    most = max(float(each.density[0]) for each in states)
    assert fast.growth_error - slow.growth_error == pytest.approx(6.93 / 30.0 * most / fast.growth[0], rel=0.02)
    # nothing dies out without damping
    assert passages.delay_of(case(7.0, damping=0.0), states) == (np.inf, np.inf)


def swept_with(monkeypatch, density, depth, near=None):
    """A passage from 1 to 2 Hz with given wear, m/Hz, of the frequency, at a depth before, m."""

    def states(_case, frequencies):
        return [state(at, density(at), response=1e-3) for at in frequencies]

    monkeypatch.setattr(passages, "states_at", states)
    passage = Passage(1.0, 2.0, 1e-4)
    block = Block(scene("sdof_slider"), passage, 10.0, None, begin="up")
    mission = MissionRequest((block,), WEAR, (0, 1), SETTINGS)
    swept = passages.find_states(BlockInput(mission, block, np.array([[depth], [0.0]]), earlier=near))
    assert isinstance(swept, passages.Swept)
    return swept


def test_a_passage_says_that_the_modelled_contact_is_cut_off():
    model = with_friction(scene("sdof_slider"), 0.5)
    for edge in (False, True):
        cut = replace(model, contact=replace(model.contact, edge=np.array([edge])))
        block = Block(cut, Passage(150.0, 165.0, 7.0), 10.0, None)
        found = passages.run_passage(
            BlockInput(MissionRequest((block,), WEAR, (0, 1), SETTINGS), block, np.zeros((2, 1)))
        )
        assert found.cut_off is edge


def test_wear_that_is_round_off_or_without_any_limit_asks_for_few_frequencies(monkeypatch):
    """The integral over the steady states of a resonance without any limit is infinite; the error says so."""
    noise = np.random.default_rng(0)
    assert len(swept_with(monkeypatch, lambda _: 1e-14 * noise.uniform(), 1e-6).states) == passages.FIRST_FREQUENCIES
    swept = swept_with(monkeypatch, lambda at: 1e-12 / max(abs(at - 1.3), 1e-12), 0.0)
    assert len(swept.states) < 150 < passages.MOST_NODES
    assert swept.error > SETTINGS.rtol * float(passages.parts_of(swept.states).sum()) * 1e-4


def test_the_next_passage_begins_with_the_frequencies_that_count(monkeypatch):
    """A peak of the wear: its frequencies are kept, and found anew after it has moved; those behind it are dropped."""

    def peak(middle):
        return lambda at: 1e-9 / (1.0 + ((at - middle) / 0.02) ** 2)

    first = swept_with(monkeypatch, peak(1.3), 0.0)
    again = swept_with(monkeypatch, peak(1.3), 0.0, first.needed)
    assert len(first.states) > len(again.states) - 2 >= passages.FIRST_FREQUENCIES
    moved = swept_with(monkeypatch, peak(1.7), 0.0, first.needed)
    for swept, middle in ((first, 1.3), (again, 1.3), (moved, 1.7)):
        exact = 2e-11 * (np.arctan((2.0 - middle) / 0.02) - np.arctan((1.0 - middle) / 0.02))
        assert passages.parts_of(swept.states).sum() == pytest.approx(exact, rel=SETTINGS.rtol)
    assert sum(1.2 < at < 1.4 for at in moved.needed) < 0.6 * sum(1.2 < at < 1.4 for at in first.needed)
