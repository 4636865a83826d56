"""Missions: blocks in order, computed many times, against wear histories, exact volumes and missions one by one."""

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.linalg import expm

from solver import Block, Outcome, Passage, SolverSettings, integrate_mission, march_wear
from solver.accuracy.refinement import refine
from solver.accuracy.resolved_state import UNKNOWN, Estimate
from solver.contact.wear_law import WearLaw, WearTable
from solver.harmonic_balance.state import Failure
from solver.missions import history as integrating
from solver.missions.block_run import BlockInput, BlockResult, find_start, run_block
from solver.missions.history import integrate_missions, unworn_course
from solver.missions.mission import MissionRequest
from solver.missions.step import MissionStep, attempt_step
from solver.model import with_friction
from solver.packing import Packed
from solver.settings import Resolution, WearTarget
from solver.wear.slow_time import Guide
from tests.solver.models import assert_same, dovetail, scene

SETTINGS = SolverSettings(harmonics=3, samples=64)
WEAR, FRICTION = 1.1e-11, 0.5


@lru_cache
def slider():
    """A mass on a support, pressed by a spring that wear relaxes."""
    return scene("sdof_slider")


def as_computed(*blocks):
    """The blocks whose models have their friction."""
    return tuple(replace(each, model=with_friction(each.model, each.friction_coefficient)) for each in blocks)


def two_blocks(begin="continue"):
    """Two blocks that slip."""
    first = Block(slider(), 160.0, 10.0, FRICTION, 200.0, begin, "cruise")
    return first, Block(slider(), 150.0, 14.0, FRICTION, 300.0, begin)


def integrate(blocks, missions, **more):
    return integrate_mission(blocks, WEAR, missions, settings=SETTINGS, **more)


@pytest.mark.slow
@pytest.mark.parametrize(("missions", "n_blocks", "begin"), [(1, 1, "up"), (2, 2, "continue")])
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


ONE_BEHIND_THE_OTHER = [("continue", 160.0, 10.0, 2e3), ("continue", 150.0, 14.0, 4e3)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "missions", "settings", "exact"),
    [
        ([("ramp", 160.0, 10.0, 1e3)], 20, SolverSettings(25, 512, rtol=0.05), [1.2076143466974352e-09]),
        ([("up", 160.0, 10.0, 3e3)], 3, SolverSettings(25, 512, rtol=0.05), [5.559797329067593e-10]),
        ([("up", 160.0, 10.0, 4e4)], 3, SolverSettings(), [5.629726223754903e-09]),
        (ONE_BEHIND_THE_OTHER, 3, SolverSettings(), [3.6516954779539405e-10, 9.097643454233896e-10]),
        ([(None, Passage(150.0, 165.0, 0.2), 10.0, None)], 3, SolverSettings(), [2.000055442282875e-09]),
    ],
    ids=["many", "sweep", "long", "continue", "passage"],
)
def test_the_error_holds_the_steps_within_a_block(blocks, missions, settings, exact, monkeypatch):
    """At least the true error, and not many times more. exact: volumes worn by each block, m3, by Den Hartog's form and
    the differential equation of the depth, dW/dn = k_w N 4 X(mu N) / alpha with N = N_0 - k_N W.
    """
    # without damping the delay of a passage is not known
    monkeypatch.setattr("solver.missions.passage.delay_of", lambda *_: (0.0, 0.0))
    given = tuple(Block(slider(), f, load, FRICTION, cycles, begin) for begin, f, load, cycles in blocks)
    history = integrate_mission(given, WEAR, missions, settings=settings)
    apart = abs(history.worn_volume[-1] / sum(exact) - 1.0)
    assert apart < history.error_estimate < max(10.0 * apart, 0.6 * settings.rtol)
    assert (np.abs(history.block_volume[-1] / exact - 1.0) < history.block_volume_error[-1]).all()
    assert history.outcome is Outcome.CONVERGED


def test_a_block_that_continues_begins_with_the_errors_of_the_last_state():
    (first, _) = blocks = as_computed(*two_blocks())
    result = run_block(BlockInput(MissionRequest(blocks, WEAR, (0, 2), SolverSettings()), first, np.zeros((2, 1))))
    last = result.last
    assert last.by_resolution == Estimate(last.response_error, last.wear_rate_error, last.by_resolution.weight)


def begun_again(block, depth):
    """A block at an even depth by its own way, and as at the depth 0 before."""
    mission, pairs = MissionRequest(as_computed(block), WEAR, (0, 2), SETTINGS), np.ones(block.model.contact.n_contact)
    (block,) = mission.blocks
    first, own = (run_block(BlockInput(mission, block, np.array([at * pairs, 0.0 * pairs]))) for at in (0.0, depth))
    return own, run_block(BlockInput(mission, block, np.array([depth * pairs, 0.0 * pairs]), earlier=first.sweep))


@pytest.mark.slow
def test_a_way_is_gone_again_only_where_the_state_depends_on_it():
    """Not where the pair slips; where much changes by another way."""
    slipping = Block(slider(), 160.0, 10.0, FRICTION, 500.0, "up")
    own, again = begun_again(slipping, 8e-6)
    np.testing.assert_allclose(again.growth, own.growth, rtol=1e-6)
    np.testing.assert_allclose(again.response, own.response, rtol=1e-6)
    assert again.iterations < 20 < own.iterations
    assert again.sweep is not None
    own, again = begun_again(slipping, 6e-5)
    assert again.iterations >= own.iterations
    np.testing.assert_array_equal(again.growth, own.growth)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "cycles", "kept"), [((212.3, 1.3, 0.35), 1500.0, True), ((212.5, 0.5, 0.5), 5000.0, False)]
)
def test_an_earlier_sweep_serves_as_long_as_its_choices_do(where, cycles, kept):
    """Also with other harmonics of its nodes; a vibration that differs by 0.35 needs errors of its own."""
    (block,) = blocks = as_computed(Block(dovetail(5), *where, cycles))
    unworn = BlockInput(MissionRequest(blocks, WEAR, (0, 2), SETTINGS), block, np.zeros((2, 16)))
    start, sweep = find_start(unworn)
    worn = replace(unworn, worn=cycles * np.array([unworn.wearing_joint(start)[1].rate, np.zeros(16)]))
    earlier = replace(sweep, resolution=Resolution((1, 2, 3, 4, 5), 64))
    again, after = find_start(replace(worn, earlier=earlier))
    assert again.outcome is Outcome.CONVERGED
    assert (after is earlier) is (again.response_error == start.response_error) is kept


@pytest.mark.parametrize(("frequency", "cycles"), [(160.0, 200.0), (Passage(150.0, 165.0, 2.0), None)])
def test_the_error_of_a_mission_whose_states_have_no_other_to_compare_with_is_not_known(frequency, cycles, monkeypatch):
    unknown = "solver.loading_history.start_states.refine", lambda *given: replace(refine(*given), estimate=UNKNOWN)
    monkeypatch.setattr(*unknown)
    sticking = Block(slider(), 160.0, 0.1, FRICTION, 200.0)
    history = integrate((Block(slider(), frequency, 10.0, FRICTION, cycles), sticking), 1)
    assert history.outcome is Outcome.INACCURATE
    # of the second block it is known that nothing wears, not how it vibrates
    assert history.block_volume_error.tolist() == [[0.0, 0.0], [np.inf, 0.0]]
    assert history.worn_volume_error[1] == history.wear_depth_error[1, 0] == history.error_estimate == np.inf
    assert np.isinf(history.response_error).all()


@pytest.mark.slow
@pytest.mark.parametrize("begin", ["up", "continue"])
def test_an_interrupted_mission_with_such_states_goes_on_to_the_last_bit(begin):
    mission, kept = MissionRequest(as_computed(*two_blocks(begin)), WEAR, (0, 6), SETTINGS), list[Packed]()
    whole = integrate_missions(mission, keep=kept.append)
    for place in (0, len(kept) // 2, len(kept) - 2):
        assert_same(integrate_missions(mission, resume=kept[place]), whole)


# --- many missions against missions one by one, with blocks whose wear is known exactly ---

# Both pairs slip in both blocks. Wear takes load from one pair to the other, so that the depths of the pairs come to
# differ by a constant, which is another one in each block.
RATES = np.array([[2e-9, 1e-9], [1e-9, 2.5e-9]])  # m per cycle of the unworn pairs, by block
LOSS = 2e-3 * np.array([1.0, 0.8])[:, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]])  # 1 per cycle


def exact_run(case):
    """The wear of `dW/dn = r - L W` through a block; the reference solution wears a little more."""
    flow, place = np.zeros((3, 3)), int(case.block.frequency) - 1
    flow[:2, :2], flow[:2, 2] = -LOSS[place], RATES[place] * (1.0 if case.guide is None else 1.001)
    change = expm(case.block.cycles * flow) - np.eye(3)
    growth = change[:2] @ np.append(case.depth, 1.0)
    response = np.array([[complex(depth.sum())] for depth in (case.depth, case.depth + growth)])
    slope = change[:2, :2] if case.with_slope else None
    return BlockResult(growth, np.zeros(2), response, np.abs(response), slope, guide=Guide((), 1.0))


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
    """Two pairs, of which only the areas count here; the frequencies are the numbers of the blocks."""
    one = scene("two_masses")
    contact = replace(one.contact, area=np.array([1e-4, 2e-4]), surface=("one", "other"))
    model = replace(one, contact=contact)
    blocks = (Block(model, 1.0, 1.0, 0.5, cycles), Block(model, 2.0, 1.0, 0.5, 2.0 * cycles))
    return MissionRequest(blocks, 1.0, missions, SETTINGS, **more)


def exactly_known(missions, cycles=1.0, **more):
    return integrate_missions(known_blocks(missions, cycles, **more))


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

    def run(worn, with_slope):
        runs = []
        for block in mission.blocks:
            runs.append(exact_run(BlockInput(mission, block, worn, with_slope=with_slope)))
            worn = worn + np.array([runs[-1].growth, np.zeros(2)])
        return tuple(runs)

    def step(before, length):
        taken = attempt_step(tuple(before), length, mission.blocks[0].model.contact, run, 1.0)
        assert isinstance(taken, MissionStep)
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


@pytest.mark.parametrize("outcome", [Outcome.UNSTABLE, Outcome.INACCURATE])
def test_stability_is_tested_where_a_target_ends_the_missions(monkeypatch, outcome):
    def run(case):
        found = exact_run(case)
        if not (case.with_switching and case.block.frequency == 1.0 and case.depth.any()):
            return found
        return Failure(outcome, "grows") if outcome is Outcome.UNSTABLE else replace(found, inaccurate=np.inf)

    monkeypatch.setattr(integrating, "run_block", run)
    history = exactly_known((0, 60), 1.0, until=WearTarget("wear_depth", 1e-7))
    assert history.outcome is outcome
    assert 1.0 < history.missions_to_target < 60.0
    assert np.isfinite(history.missions_to_target_error)


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


def test_a_reference_solution_that_fails_leaves_the_error_unknown(monkeypatch):
    def run(case):
        lost = case.guide is not None and case.depth.max() > 0.5 * float(whole.wear_depth[-1].max())
        return Failure(Outcome.MARCH_FAILED, "lost") if lost else exact_run(case)

    monkeypatch.setattr(integrating, "run_block", exact_run)
    whole = exactly_known((0, 10, 60))
    monkeypatch.setattr(integrating, "run_block", run)
    history = exactly_known((0, 10, 60))
    assert np.array_equal(history.worn_volume, whole.worn_volume)
    assert history.worn_volume_error[1] == whole.worn_volume_error[1] < SETTINGS.rtol
    assert history.worn_volume_error[2] == history.error_estimate == np.inf
    assert history.outcome is Outcome.INACCURATE


def test_a_block_without_a_start_state_is_an_outcome():
    """The time is over before the first state."""
    history = integrate_mission(two_blocks("up"), WEAR, 10, settings=replace(SETTINGS, time_limit=0.0))
    assert history.outcome is Outcome.TIME_LIMIT
    assert history.last_mission == 0
    assert np.isnan(history.worn_volume[1:]).all()
