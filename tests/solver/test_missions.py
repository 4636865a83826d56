"""Missions: blocks in order, computed many times, against wear histories, exact volumes and missions one by one."""

import re
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from solver import Block, MissionHistory, Outcome, Passage, SolverSettings, integrate_mission, march_wear
from solver.contact.wear_law import WearLaw, WearTable
from solver.harmonic_balance.state import Failure
from solver.missions import history as integrating
from solver.missions.block_run import Begun, BlockCase, BlockRun, run_block
from solver.missions.history import integrate_missions, unworn_course
from solver.missions.mission import Mission
from solver.missions.passage import (
    FIRST_FREQUENCIES,
    MOST_FREQUENCIES,
    Swept,
    SweptState,
    delay_of,
    find_states,
    in_order,
    interval_errors,
    parts_of,
    run_passage,
    states_at,
)
from solver.missions.step import Step, attempt_step
from solver.packing import Packed
from solver.results.history import StartState
from solver.settings import Resolution, WearTarget
from solver.wear.slow_time import Guide
from studies.scenes.den_hartog import DenHartogSlider
from studies.scenes.sdof_slider import Parameters as SliderParameters
from tests.solver.models import scene

SETTINGS = SolverSettings(harmonics=3, samples=64)
WEAR, FRICTION = 1.1e-11, 0.5


@lru_cache
def slider():
    """A mass on a support, pressed by a spring that wear relaxes."""
    return scene("sdof_slider")


def two_blocks(begin="continue", cycles=200.0):
    """Two blocks that slip."""
    return (
        Block(slider(), 160.0, 10.0, FRICTION, cycles, begin, "cruise"),
        Block(slider(), 150.0, 14.0, FRICTION, 1.5 * cycles, begin),
    )


def integrate(blocks, missions, **more):
    return integrate_mission(blocks, WEAR, missions, settings=SETTINGS, **more)


# --- one block ---


@pytest.mark.slow
@pytest.mark.parametrize(("missions", "n_blocks", "begin"), [(1, 1, "up"), (4, 1, "continue"), (1, 2, "continue")])
def test_a_mission_is_a_wear_history_in_parts(missions, n_blocks, begin):
    cycles = 4e4 / (missions * n_blocks)
    history = integrate((Block(slider(), 160.0, 10.0, FRICTION, cycles, begin),) * n_blocks, np.arange(missions + 1))
    counts = cycles * np.arange(missions * n_blocks + 1.0)
    whole = march_wear(slider(), 160.0, 10.0, FRICTION, WEAR, counts, settings=SETTINGS)
    assert history.outcome is whole.outcome is Outcome.CONVERGED
    rows = np.arange(missions + 1) * n_blocks
    bars = history.wear_depth_error + whole.wear_depth_error[rows]
    assert (np.abs(history.wear_depth - whole.wear_depth[rows]) <= bars).all()
    assert (bars <= 0.02 * whole.wear_depth[rows]).all()
    end = history.response_end[-1, -1]
    assert abs(end - whole.response[-1]) < (history.response_error[-1, -1] + whole.response_error[-1]) * abs(end)
    np.testing.assert_array_equal(history.response_begin[0, 0], whole.response[0])


@pytest.mark.slow
def test_depths_of_a_table_count_from_the_unworn_joint():
    law = WearLaw("table", table=WearTable((0.0,), (0.0, 2e-5, 4e-5), ((1.0, 0.2, 0.0),)))
    half = Block(slider(), 160.0, 10.0, FRICTION, 2e4, "up")
    history = integrate((half, half), 1, law=law)
    whole = march_wear(slider(), 160.0, 10.0, FRICTION, WEAR, [2e4, 4e4], settings=SETTINGS, law=law)
    bars = history.wear_depth_error[-1] + whole.wear_depth_error[-1]
    assert (np.abs(history.wear_depth[-1] - whole.wear_depth[-1]) < bars).all()
    assert (bars < 0.05 * whole.wear_depth[-1]).all()
    assert history.block_volume[-1, 1] < 0.8 * history.block_volume[-1, 0]


# --- exact volumes ---


def exact_growth(blocks, missions):
    """Volumes worn by each block (n_block,), m3, by Den Hartog's form and the differential equation of the depth."""
    p = SliderParameters()
    depth, worn = 0.0, np.zeros(len(blocks))

    def rate(block, frequency, depth):
        form = DenHartogSlider(p.mass, p.stiffness, block.excitation_amplitude, 2.0 * np.pi * frequency)
        force = p.normal_load - p.normal_stiffness * depth
        assert form.holds(FRICTION * force)
        return WEAR * force / p.area * 4.0 * float(form.amplitude(np.array(FRICTION * force)))

    for place in [*range(len(blocks))] * missions:
        block = blocks[place]
        if isinstance(block.frequency, Passage):
            passage = block.frequency
            ends, way = (passage.start, passage.stop), np.sign(passage.stop - passage.start)

            def rise(at, w, block=block, way=way):
                return [way * rate(block, at, w[0]) * at / block.frequency.rate]
        else:
            ends = (0.0, block.cycles)

            def rise(_, w, block=block):
                return [rate(block, block.frequency, w[0])]

        after = float(solve_ivp(rise, ends, [depth], rtol=1e-9, atol=1e-18).y[0, -1])
        worn[place] += (after - depth) * p.area
        depth = after
    return worn


EXACT = SolverSettings(harmonics=25, samples=512, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "missions", "settings"),
    [
        ((("ramp", 160.0, 10.0, 1e3),), 20, EXACT),
        ((("up", 160.0, 10.0, 3e3),), 3, EXACT),
        ((("up", 160.0, 10.0, 4e4),), 3, SolverSettings()),
        ((("continue", 160.0, 10.0, 2e3), ("continue", 150.0, 14.0, 4e3)), 3, SolverSettings()),
        (((None, Passage(150.0, 165.0, 0.2), 10.0, None),), 3, SolverSettings()),
    ],
    ids=["many", "sweep", "long", "continue", "passage"],
)
def test_the_error_holds_the_steps_within_a_block(blocks, missions, settings, monkeypatch):
    """Against the exact differential equation: at least the true error, and not many times more."""
    # without damping the delay of a passage is not known
    monkeypatch.setattr("solver.missions.passage.delay_of", lambda *_: (0.0, 0.0))
    given = tuple(Block(slider(), f, load, FRICTION, cycles, begin) for begin, f, load, cycles in blocks)
    history = integrate_mission(given, WEAR, missions, settings=settings)
    exact = exact_growth(given, missions)
    apart = abs(history.worn_volume[-1] / exact.sum() - 1.0)
    assert apart < history.error_estimate < max(10.0 * apart, 0.5 * settings.rtol)
    assert (np.abs(history.block_volume[-1] / exact - 1.0) < history.block_volume_error[-1]).all()
    assert history.outcome is Outcome.CONVERGED


# --- states that keep nothing of their way ---


def begun_again(block, depth):
    """A block at an even depth by its own way, and as at the depth 0 before."""
    mission, pairs = Mission((block,), WEAR, (0, 2), SETTINGS), np.ones(block.model.contact.n_contact)
    first, own = (run_block(BlockCase(mission, 0, at * pairs)) for at in (0.0, depth))
    return own, run_block(BlockCase(mission, 0, depth * pairs, begun=first.begun))


@pytest.mark.slow
def test_a_way_is_gone_again_only_where_the_state_depends_on_it():
    """Not where the pair slips; where a pair sticks through the same nodes; where much changes by another way."""
    slipping = Block(slider(), 160.0, 10.0, FRICTION, 500.0, "up")
    own, again = begun_again(slipping, 8e-6)
    np.testing.assert_allclose(again.growth, own.growth, rtol=1e-6)
    np.testing.assert_allclose(again.response, own.response, rtol=1e-6)
    assert again.iterations < 20 < own.iterations
    assert again.begun is not None
    own, again = begun_again(Block(scene("dovetail_sector", mesh=1), 212.6, 0.5, FRICTION, 10.0, "up"), 5e-9)
    np.testing.assert_allclose(again.response, own.response, rtol=5e-3)
    assert again.iterations < 0.8 * own.iterations
    own, again = begun_again(slipping, 6e-5)
    assert again.iterations >= own.iterations
    np.testing.assert_array_equal(again.growth, own.growth)


@pytest.mark.slow
@pytest.mark.parametrize("begin", ["up", "continue"])
def test_an_interrupted_mission_with_such_states_goes_on_to_the_last_bit(begin):
    blocks = tuple(replace(block, begin=begin) for block in two_blocks())
    mission, kept = Mission(blocks, WEAR, (0, 6), SETTINGS), list[Packed]()
    whole = integrate_missions(mission, keep=kept.append)
    for place in (0, len(kept) // 2, len(kept) - 2):
        assert equal(integrate_missions(mission, resume=kept[place]), whole)


# --- many missions against missions one by one, with blocks whose wear is known exactly ---

# Both pairs slip in both blocks. Wear takes load from one pair to the other, so that the depths of the pairs come to
# differ by a constant, which is another one in each block.
RATES = np.array([[2e-9, 1e-9], [1e-9, 2.5e-9]])  # m per cycle of the unworn pairs, by block
LOSS = 2e-3 * np.array([1.0, 0.8])[:, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]])  # 1 per cycle


def pairs():
    """Two pairs, of which only the areas count here."""
    one = scene("two_masses")
    contact = replace(one.contact, area=np.array([1e-4, 2e-4]), surface=("one", "other"))
    return replace(one, contact=contact)


def exact_run(case):
    """The wear of `dW/dn = r - L W` through a block; the reference solution wears a little more."""
    rate, loss = RATES[case.place] * (1.0 if case.guide is None else 1.001), LOSS[case.place]
    slope = expm(-case.block.steady[1] * loss) - np.eye(2)
    # `r - L W` lies in the range of L but for uniform wear
    values, vectors = np.linalg.eigh(loss)
    n = case.block.steady[1]
    decay = np.where(values > 1e-12, -np.expm1(-values * n) / np.where(values > 1e-12, values, 1.0), n)
    growth = vectors @ (decay * (vectors.T @ (rate - loss @ case.depth)))
    response = np.array([[complex(depth.sum())] for depth in (case.depth, case.depth + growth)])
    slope = slope if case.with_slope else None
    return BlockRun(growth, response, np.abs(response), slope, guide=Guide((), 1.0))


@pytest.fixture
def exact_blocks(monkeypatch):
    """Blocks of exactly known wear; the list has an entry for each run."""
    computed: list[int] = []

    def run(case):
        computed.append(1)
        return exact_run(case)

    monkeypatch.setattr(integrating, "run_block", run)
    return computed


def known_blocks(missions, cycles=1.0, **more):
    model = pairs()
    blocks = (Block(model, 1.0, 1.0, 0.5, cycles), Block(model, 2.0, 1.0, 0.5, 2.0 * cycles))
    return Mission(blocks, 1.0, missions, SETTINGS, **more)


def exactly_known(missions, cycles=1.0, **more):
    return integrate_missions(known_blocks(missions, cycles, **more))


def equal(one, other):
    """Whether two histories are equal to the last bit, but for their run time."""
    names = [field.name for field in fields(MissionHistory) if field.name != "run_time"]
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name not in ("message", "outcome"))
        for name in names
    )


@pytest.mark.slow
@pytest.mark.parametrize(("cycles", "limit"), [(0.1, 20), (30.0, 30)])
def test_two_thousand_missions_agree_with_missions_one_by_one(exact_blocks, cycles, limit):
    """The longer the blocks, the more they adapt the pressures against each other within few missions."""
    rows = (0, 1, 7, 200, 1000, 2000)
    once = exactly_known(rows, cycles, largest_step=1)
    n_once = len(exact_blocks)
    many = exactly_known(rows, cycles)
    assert many.outcome is once.outcome is Outcome.CONVERGED
    bars = many.wear_depth_error + once.wear_depth_error
    assert (np.abs(many.wear_depth - once.wear_depth) <= bars).all()
    np.testing.assert_array_equal(many.wear_depth[:2], once.wear_depth[:2])
    assert many.error_estimate < SETTINGS.rtol
    of_blocks = many.block_volume_error * many.block_volume + once.block_volume_error * once.block_volume
    assert (np.abs(many.block_volume - once.block_volume) <= of_blocks).all()
    # each mission is two blocks and their reference solution
    computed = (len(exact_blocks) - n_once) / 4
    assert computed < limit
    assert n_once == 2000 * 4
    assert many.missions[-1] == many.steps.sum() == many.last_mission == 2000


def test_a_step_is_of_second_order_and_its_error_is_known(monkeypatch):
    """After exact missions 0, H and 2H: against missions one by one."""
    mission = known_blocks((0, 64))
    monkeypatch.setattr("solver.missions.step.allowed_error", lambda *_: 1e-16)
    nodes = list(unworn_course(mission).nodes)

    def run(depth, with_slope):
        runs = []
        for place in (0, 1):
            runs.append(exact_run(BlockCase(mission, place, depth, with_slope=with_slope)))
            depth = depth + runs[-1].growth
        return tuple(runs)

    def step(before, length):
        taken = attempt_step(tuple(before), length, mission.area, run, 1.0)
        assert isinstance(taken, Step)
        return taken

    while nodes[-1].count < 48:
        nodes.append(step(nodes, 1).node)
    errors = []
    for length in (1, 2, 4, 8, 16):
        taken = step(nodes[: 2 * length + 1 : length], length)
        one, other = (node.depth.reshape(2, -1).sum(axis=0) for node in (taken.node, nodes[3 * length]))
        apart = np.abs(one - other) @ mission.area
        if length > 1:
            assert apart == pytest.approx(1e-16 * taken.ratio, rel=0.15)
            np.testing.assert_allclose(taken.node.depth, nodes[3 * length].depth, rtol=5e-3)
        errors.append(apart)
    assert errors[0] < 1e-12 * float(nodes[-1].depth @ np.tile(mission.area, 2))
    assert 6.0 < errors[4] / errors[3] < 8.5


def test_a_target_ends_the_missions(exact_blocks):
    rows = tuple(range(0, 2001, 50))
    whole = exactly_known(rows, 0.3)
    value = 0.2 * float(whole.wear_depth[-1].max())
    history = exactly_known(rows, 0.3, until=WearTarget("wear_depth", value))
    once = exactly_known(rows, 0.3, until=WearTarget("wear_depth", value), largest_step=1)
    assert once.missions_to_target == pytest.approx(history.missions_to_target, abs=history.missions_to_target_error)
    assert 0.0 < history.missions_to_target_error < 0.05 * history.missions_to_target
    assert np.isnan(history.worn_volume[-1])
    assert np.isnan(whole.missions_to_target)


def test_a_block_that_fails_at_once_is_computed_in_shorter_steps(monkeypatch):
    """And one that fails in a single mission ends the history there, with what was computed."""

    def run(case):
        nonlocal deepest
        found, depth = exact_run(case), float(case.depth.max())
        if depth > limit or (case.guide is None and depth > deepest + 4e-8):
            return Failure(Outcome.MARCH_FAILED, "lost")
        deepest = max(deepest, depth + float(found.growth.max()))
        return found

    monkeypatch.setattr(integrating, "run_block", run)
    limit, deepest = 1.0, 0.0
    history = exactly_known((0, 60), 1.0)
    assert history.outcome is Outcome.CONVERGED
    assert 4 <= history.steps.max() <= 8
    limit, deepest = 0.5 * float(history.wear_depth[-1].max()), 0.0
    history = exactly_known((0, 60), 1.0)
    assert history.outcome is Outcome.MARCH_FAILED
    assert re.fullmatch(r"in mission \d+, block [12]: lost", history.message)
    assert 2 < history.last_mission < 60
    assert np.isnan(history.worn_volume[-1])


@pytest.mark.slow
def test_missions_of_the_slider_agree_with_missions_one_by_one():
    """Amplitude and frequency change from block to block."""
    many, once = (integrate(two_blocks(cycles=300.0), [3, 6], largest_step=most) for most in (None, 1))
    assert many.outcome is once.outcome is Outcome.CONVERGED
    assert many.steps.tolist() == [1, 1, 2, 2]
    assert (np.abs(many.wear_depth - once.wear_depth) <= many.wear_depth_error + once.wear_depth_error).all()
    assert (np.abs(many.block_volume - once.block_volume) <= many.block_volume_error * many.block_volume).all()
    assert many.error_estimate < 2.0 * SETTINGS.rtol
    for name in ("response_begin", "response_end", "response_peak_begin", "response_peak_end"):
        one, other = (np.linalg.norm(getattr(of, name), axis=2) for of in (many, once))
        assert (np.abs(one - other) <= many.response_error * one + once.response_error * other).all()
    assert (many.response_error < 0.1).all()
    # less load, less friction: the vibration grows
    assert (np.diff(np.abs(once.response_end[:, :, 0]), axis=0)[1:] > 0.0).all()


# --- passages ---


def state(frequency, density, branch=0, response=0.0):
    nan = float("nan")
    start = StartState(Outcome.CONVERGED, None, nan, Resolution((1,), 4), 0.0, 0.0, 0, 0.0, branch, 1.5)
    return SweptState(frequency, start, np.array([density]), np.array([response + 0j]), np.array([response]))


def test_the_error_of_the_trapezoidal_rule_is_known_on_both_sides_of_a_jump():
    """A parabola a m/Hz up to the jump at 1.5 Hz, a constant behind it."""
    before = [state(at, at**2) for at in (0.0, 0.5, 1.0, 1.5 - 1e-6)]
    behind = [state(at, 5.0, 1) for at in (1.5 + 1e-6, 2.0, 3.0)]
    errors = interval_errors(before + behind, np.array([2.0]))
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
    grown, slope = in_order(states, [rates(of.frequency)[1] for of in states])
    ends = (0.0, 1.0)[::order]

    def end(before):
        def rise(f, y):
            density, derivative = rates(f)
            return order * (density + derivative @ y)

        return solve_ivp(rise, ends, before, rtol=1e-10, atol=1e-12).y[:, -1]

    np.testing.assert_allclose(grown, end(np.zeros(2)), rtol=1e-4)
    np.testing.assert_allclose(slope @ [0.1, 0.0], end(np.array([0.1, 0.0])) - end(np.zeros(2)) - [0.1, 0.0], rtol=1e-3)


def passing(passage, wear=WEAR, settings=SETTINGS):
    """A passage of the damped slider."""
    block = Block(scene("sdof_slider", damping=6.0), passage, 10.0, FRICTION)
    return BlockCase(Mission((block,), wear, (0, 1), settings), 0, np.zeros(1))


@pytest.mark.slow
def test_a_vibration_is_late_by_its_decay_time():
    """The free slider with 6 N s/m and 0.1 kg decays by exp(-30 t): at 7 Hz/s it is late by 7/30 Hz."""

    undamped = Mission((Block(slider(), Passage(180.0, 220.0, 7.0), 10.0, FRICTION),), WEAR, (0, 1), SETTINGS)

    def case(rate):
        # too little wear to change the pressures on the way
        return passing(Passage(180.0, 220.0, rate), 1e-6 * WEAR)

    fast, slow = run_passage(case(7.0)), run_passage(case(0.07))
    assert fast.sweep_rate == pytest.approx(7.0 / (30.0 / (2.0 * np.pi)) ** 2)
    assert slow.sweep_rate == pytest.approx(0.01 * fast.sweep_rate)
    # as if the largest wear over frequency were missed, or added, over the lag
    states = states_at(case(7.0), np.linspace(190.0, 210.0, 41))
    assert isinstance(states, list)
    most = max(float(each.density[0]) for each in states)
    assert fast.growth_error - slow.growth_error == pytest.approx(6.93 / 30.0 * most / fast.growth[0], rel=0.02)
    # nothing dies out without damping
    assert delay_of(replace(case(7.0), mission=undamped), states) == (np.inf, np.inf)


@pytest.mark.slow
def test_the_reference_of_a_passage_takes_its_resolutions_and_estimates_no_errors():
    settings = SolverSettings(rtol=2e-3)
    case = passing(Passage(185.0, 215.0, 5.0), settings=settings)
    fine = run_passage(case)
    assert fine.guide is not None
    as_reference = replace(case, guide=fine.guide)
    reference = run_passage(as_reference)
    assert reference.iterations < fine.iterations
    known, estimated = (states_at(of, np.array([200.0])) for of in (as_reference, case))
    assert known[0].start.response_error == known[0].start.wear_rate_error == 0.0
    assert estimated[0].start.response_error > 0.0
    assert estimated[0].start.wear_rate_error > 0.0
    assert reference.growth == pytest.approx(fine.growth, rel=settings.rtol)
    # at the ends both solve the same state
    np.testing.assert_allclose(reference.response, fine.response, rtol=1e-6)


def swept_with(monkeypatch, density, depth, near=()):
    """A passage from 1 to 2 Hz with given wear, m/Hz, of the frequency, at a depth before, m."""

    def states(_case, frequencies):
        return [state(at, density(at), response=1e-3) for at in frequencies]

    monkeypatch.setattr("solver.missions.passage.states_at", states)
    passage = Passage(1.0, 2.0, 1e-4)
    block = Block(scene("sdof_slider"), passage, 10.0, FRICTION, begin="up")
    mission, begun = Mission((block,), WEAR, (0, 1), SETTINGS), Begun(near) if near else None
    swept = find_states(BlockCase(mission, 0, np.array([depth]), begun=begun))
    assert isinstance(swept, Swept)
    return swept


def test_wear_that_is_round_off_asks_for_no_more_frequencies(monkeypatch):
    noise = np.random.default_rng(0)
    assert len(swept_with(monkeypatch, lambda _: 1e-25 * noise.uniform(), 0.0).states) == FIRST_FREQUENCIES
    assert len(swept_with(monkeypatch, lambda _: 1e-14 * noise.uniform(), 1e-6).states) == FIRST_FREQUENCIES


def test_a_resonance_without_any_limit_does_not_ask_for_frequencies_without_end(monkeypatch):
    """The integral over its steady states is infinite; the error tells that it is not known."""
    swept = swept_with(monkeypatch, lambda at: 1e-12 / max(abs(at - 1.3), 1e-12), 0.0)
    assert len(swept.states) < 150 < MOST_FREQUENCIES
    assert swept.error > SETTINGS.rtol * float(parts_of(swept.states).sum()) * 1e-4


def test_the_next_passage_begins_with_the_frequencies_that_count(monkeypatch):
    """A peak of the wear: its frequencies are kept, and found anew after it has moved; those behind it are dropped."""

    def peak(middle):
        return lambda at: 1e-9 / (1.0 + ((at - middle) / 0.02) ** 2)

    first = swept_with(monkeypatch, peak(1.3), 0.0)
    again = swept_with(monkeypatch, peak(1.3), 0.0, first.needed)
    assert len(first.states) > len(again.states) - 2 >= FIRST_FREQUENCIES
    moved = swept_with(monkeypatch, peak(1.7), 0.0, first.needed)
    for swept, middle in ((first, 1.3), (again, 1.3), (moved, 1.7)):
        exact = 2e-11 * (np.arctan((2.0 - middle) / 0.02) - np.arctan((1.0 - middle) / 0.02))
        assert parts_of(swept.states).sum() == pytest.approx(exact, rel=SETTINGS.rtol)
    assert sum(1.2 < at < 1.4 for at in moved.needed) < 0.6 * sum(1.2 < at < 1.4 for at in first.needed)


# --- what users may get wrong ---

PASSAGE = {"frequency": Passage(2.0, 3.0, 1.0), "cycles": None}


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"begin": "sweep"}, "begin"),
        ({"cycles": 0.0}, "cycles"),
        ({"cycles": None}, "cycles"),
        ({"frequency": Passage(2.0, 2.0, 1.0), "cycles": None}, "frequency.stop"),
        ({"frequency": Passage(2.0, 3.0, -1.0), "cycles": None}, "frequency.rate"),
        ({**PASSAGE, "cycles": 1.0}, "cycles"),
        ({**PASSAGE, "begin": "down"}, "begin"),
        ({"frequency": np.nan}, "frequency"),
        ({"excitation_amplitude": 0.0}, "excitation_amplitude"),
        ({"friction_coefficient": [0.1, 0.2]}, "friction_coefficient"),
        ({"friction_coefficient": 0.4}, "begin"),
        ({"model": scene("sdof_slider", area=2e-4)}, "model"),
    ],
)
def test_a_wrong_block_is_named(changed, key):
    one, other = two_blocks()
    with pytest.raises(ValueError, match=rf"blocks\[[01]\].*: {key}"):
        integrate((one, replace(other, **changed)), 10)


@pytest.mark.parametrize(
    "wrong",
    [
        {"missions": [1.5]},
        {"missions": 0},
        {"blocks": ()},
        {"largest_step": 1.5},
        {"until": WearTarget("frequency_shift", 0.1)},
        {"sweep": "continue"},
    ],
)
def test_a_wrong_mission_is_a_sentence(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        integrate(**{"blocks": two_blocks(), "missions": 10, **wrong})


def test_a_block_without_a_start_state_is_an_outcome():
    """The time is over before the first state."""
    history = integrate_mission(two_blocks("up"), WEAR, 10, settings=replace(SETTINGS, time_limit=0.0))
    assert history.outcome is Outcome.TIME_LIMIT
    assert history.last_mission == 0
    assert np.isnan(history.worn_volume[1:]).all()
