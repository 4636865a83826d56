"""Which tasks a study has, which points share one, and what the plan says of it."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence

import pytest

from solver.settings import SolverSettings
from studyrunner.cli import main
from studyrunner.plan.estimate import AUTOMATIC_HARMONICS, largest_memory, memory_a_rank
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import StartResult
from studyrunner.plan.tasks import TaskPlan
from studyrunner.study.study import Study
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import start_marches
from studyrunner.variables import CERTIFICATE

SHARED = ("axes.wear_coefficient=[0, 1e-12, 1e-11]", "axes.scheme=['adaptive', 'implicit', 'explicit']")
GRID = (
    "axes.frequency=[160, 150, 155]",
    "axes.wear_coefficient=[1e-11, 0]",
    "axes.excitation_amplitude=[1, 2]",
    "axes.step=[100, 1000]",
    "axes.scheme=['implicit', 'explicit']",
    "axes.sweep=['up', 'down']",
    "axes.harmonics=[1, 5]",
)


def plan_of(*overrides: str) -> tuple[Study, TaskPlan]:
    study = read_study("sdof_slider", overrides)
    return study, build_tasks(study, 2)


def assert_every_point_once(study: Study, plan: TaskPlan) -> None:
    points = Counter(point for line in plan.marches for task in line for point in task.points)
    sizes = [len(values) for values in study.dimensions.values()]
    assert points == Counter(itertools.product(*(range(size) for size in sizes)))
    assert plan.n_points == len(points)


def test_one_branch_a_line_of_frequencies() -> None:
    study, plan = plan_of(*GRID)
    assert len(plan.branches) == 2 * 2 * 2
    assert {branch.frequencies for branch in plan.branches} == {(150.0, 155.0, 160.0)}
    lines = {(task.excitation_amplitude, task.sweep, task.settings.harmonics) for task in plan.branches}
    assert lines == set(itertools.product((1.0, 2.0), ("up", "down"), (1, 5)))
    assert_every_point_once(study, plan)


def test_a_ramp_is_a_task_at_each_frequency() -> None:
    """Nothing is serial in it: as many branches as points, and the marches of each from its only state."""
    study, plan = plan_of("axes.frequency=[160, 150, 155]", "axes.sweep=['ramp', 'up']", *SHARED)
    ramps = [branch for branch in plan.branches if branch.sweep == "ramp"]
    assert [branch.frequencies for branch in ramps] == [(150.0,), (155.0,), (160.0,)]
    assert [branch.frequencies for branch in plan.branches if branch.sweep == "up"] == [(150.0, 155.0, 160.0)]
    assert [branch.number for branch in plan.branches] == list(range(4))
    assert all(0.0 < branch.cost < plan.branches[-1].cost for branch in ramps)
    for branch in ramps:
        assert branch.order == branch.order_left == (0,)
        assert plan.marches[branch.number] == plan.marches_from(branch.number, 0) != ()
    assert sum(item.n_points for item in plan.left_out) == plan.n_points - sum(len(line) for line in plan.marches)
    assert_every_point_once(study, plan)


@pytest.mark.parametrize(
    ("sweeps", "said"),
    [
        ("['ramp']", "6: 3 ramps of the excitation, then 3 wear histories"),
        ("['up', 'ramp']", "10: 1 branch along the frequency and 3 ramps of the excitation, then 6 wear histories"),
    ],
)
def test_the_plan_tells_ramps_from_branches(sweeps: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    overrides = ["axes.frequency=[1, 2, 3]", "axes.scheme=implicit", f"axes.sweep={sweeps}"]
    assert printed_plan(overrides, capsys)["tasks"] == said


def test_points_know_their_task() -> None:
    """The values at a point's index are those of its task and its branch, whatever the order on the axes."""
    study, plan = plan_of(*GRID, *SHARED, "axes.sweep=['up', 'ramp']")
    assert any(len(task.histories) > 1 for task in plan.marches[0])
    for branch, line in zip(plan.branches, plan.marches, strict=True):
        for task in line:
            assert task.branch == branch.number
            for point in task.points:
                values = {
                    name: axis[place] for place, (name, axis) in zip(point, study.dimensions.items(), strict=True)
                }
                assert values["frequency"] == branch.frequencies[task.position]
                assert values["excitation_amplitude"] == branch.excitation_amplitude
                assert values["sweep"] == branch.sweep
                assert values["harmonics"] == task.settings.harmonics == branch.settings.harmonics
                (scaled,) = (scaled for scaled in task.histories if point in scaled.points)
                assert values["wear_coefficient"] == scaled.wear_coefficient
                if not task.held:
                    assert values["scheme"] == task.scheme
                    assert values["step"] == scaled.step or task.scheme == "adaptive"


def test_nothing_wears_without_a_wear_coefficient() -> None:
    _, plan = plan_of(*GRID)
    held = [task for line in plan.marches for task in line if task.held]
    assert len(held) == 3 * 8
    assert all(len(task.points) == 4 and task.wear_coefficient == 0.0 for task in held)
    assert [(item.n_points, item.reason.split(" ")[0]) for item in plan.left_out] == [(3 * 3 * 8, "wear_coefficient")]


def test_unworn_states_are_computed_once_for_each_wear_coefficient() -> None:
    """Their motion is the same, but not their wear rate."""
    study, plan = plan_of(*GRID, "slow_time.cycles=0")
    assert all(task.held and task.cycles == (0.0,) for line in plan.marches for task in line)
    assert sum(len(line) for line in plan.marches) == 2 * 3 * 8
    assert [item.n_points for item in plan.left_out] == [3 * 2 * 3 * 8]
    assert_every_point_once(study, plan)
    for line in plan.marches:
        for task in line:
            assert {study.axes.wear_coefficient[point[1]] for point in task.points} == {task.wear_coefficient}


def test_largest_depth_makes_the_step_axis_idle_for_the_explicit_scheme() -> None:
    study, plan = plan_of(
        "axes.frequency=150",
        "axes.step=[100, 1000, 5000]",
        "axes.scheme=['implicit', 'explicit']",
        "slow_time.largest_depth=1e-6",
    )
    tasks = {(task.scheme, task.largest_depth): len(task.points) for task in plan.marches[0]}
    assert tasks == {("implicit", None): 1, ("explicit", 1e-6): 3}
    assert len(plan.marches[0]) == 4
    assert [item.n_points for item in plan.left_out] == [2]
    assert_every_point_once(study, plan)


def test_marches_cost_little_and_go_last_where_nothing_moves() -> None:
    _, plan = plan_of("axes.frequency=[1, 2]", "axes.step=[100, 1000]", "axes.scheme=implicit")
    planned = plan.marches_from(0, 0)
    moving = start_marches(planned, StartResult(0, "state", moves=True, n_unknowns=planned[0].n_unknowns))
    short, long = sorted(moving, key=lambda task: task.cost)
    resting = start_marches(planned, StartResult(0, "state", moves=False, n_unknowns=planned[0].n_unknowns))
    assert (long.start, long.step, short.step) == ("state", 100.0, 1000.0)
    assert all(0.0 < task.cost < short.cost for task in resting)
    assert [task.cost for task in planned] == [long.cost, short.cost]
    assert {task.cost_keys[0] for task in moving} != {task.cost_keys[0] for task in resting}


def test_a_march_costs_what_the_harmonics_of_its_start_state_say() -> None:
    _, plan = plan_of("axes.frequency=[1, 2]", "solver.harmonics=auto")
    planned = plan.marches_from(0, 1)
    n_planned = planned[0].n_unknowns
    more, same = (start_marches(planned, StartResult(1, "state", True, n)) for n in (3 * n_planned, 0))
    assert all(many.cost > task.cost for many, task in zip(more, planned, strict=True))
    assert [task.cost for task in same] == [task.cost for task in planned]


def test_marches_are_found_by_their_start_state() -> None:
    _, plan = plan_of("axes.frequency=[3, 1, 2]", "axes.wear_coefficient=[0, 1e-11]", "axes.sweep=['up', 'down']")
    numbers = [task.number for line in plan.marches for task in line]
    assert numbers == list(range(len(numbers)))
    for branch in plan.branches:
        found = [plan.marches_from(branch.number, position) for position in range(branch.n_results)]
        assert all(task.position == position for position, tasks in enumerate(found) for task in tasks)
        assert tuple(itertools.chain.from_iterable(found)) == plan.marches[branch.number]


def test_automatic_settings_are_those_of_the_task_and_estimated_for_the_plan() -> None:
    study, plan = plan_of("axes.frequency=150", "axes.harmonics=[3, 'auto']", "axes.rtol=[1e-2, 1e-3]")
    assert [branch.settings for branch in plan.branches] == [
        SolverSettings(harmonics, "auto", 1e-8, rtol, math.inf)
        for harmonics, rtol in itertools.product((3, "auto"), (1e-2, 1e-3))
    ]
    assert plan.n_unknowns == 2 * (2 * AUTOMATIC_HARMONICS + 1)
    assert plan.branches[0].cost < plan.branches[2].cost
    assert_every_point_once(study, plan)


def test_certificates_are_always_handed_back() -> None:
    _, plan = plan_of("outputs.variables=['worn_volume']")
    (variables,) = {task.variables for line in plan.marches for task in line}
    assert variables == ("worn_volume", *CERTIFICATE, "stable")


def test_plan_says_what_is_automatic(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed_plan(["axes.harmonics=[3, 'auto']"], capsys)
    assert lines["solver"] == "harmonics 3 or automatic, samples automatic, tolerance 1e-08, rtol 0.01"
    assert lines["unknowns"] == "22 at most in one task, with 5 for automatic harmonics"
    assert printed_plan(["solver.harmonics=3", "solver.samples=32"], capsys)["solver"] == (
        "harmonics 3, samples 32, tolerance 1e-08"
    )


def printed_plan(overrides: Sequence[str], capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    arguments = ["sdof_slider", "--plan"]
    for override in overrides:
        arguments += ["--set", override]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return {line[:10].strip(): line[11:] for line in captured.out.splitlines()}


def test_loops_are_handed_back_where_they_are_asked_for_and_the_plan_counts_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, plan = plan_of("outputs.loops=[0]")
    assert {task.variables[-2:] for task in plan.marches[0]} == {("loop_displacement", "loop_force")}
    assert {task.loops for task in plan.marches[0]} == {(0,)}
    sizes = []
    for overrides in ([], ["outputs.loops=[0]"]):
        _, _, said = printed_plan([*overrides, "slow_time.outputs=1001"], capsys)["memory"].partition("result ")
        sizes.append(float(said.partition(" ")[0]))
    # 10 points, 1001 counts, 128 phases, 3 components, displacement and force
    assert sizes[1] - sizes[0] == pytest.approx(10 * 1001 * 128 * 3 * 2 * 8 / 1e6, abs=0.11)


def test_plan_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed_plan(GRID, capsys)
    assert lines["points"].startswith("192 = 3 frequency x 2 wear_coefficient")
    assert lines["tasks"].startswith("128: 8 branches")
    assert lines["unknowns"].startswith("22 ")
    assert lines["left out"].startswith("72 points: wear_coefficient = 0")
    assert lines["time"].endswith("on two, to a factor of two, if every point wears;")
    assert "ms or less a step" in lines["assumed"]
    assert "GB a rank" in lines["memory"]


@pytest.mark.parametrize(
    ("study", "n_displacements", "used"),
    # CPU seconds of the tasks alone, measured on a busy core; of the first the deck is read besides, in 3 s
    [
        ("blade_root", 108, 25.7),
        ("cylinder_on_flat", 60, 2.5),
        ("sphere_on_flat", 104, 3.2),
        ("dovetail", 144, 124.0),
        ("work_precision_slider", 2, 578.0),
    ],
)
def test_estimates_hold_to_a_factor_of_two(study: str, n_displacements: int, used: float) -> None:
    planned = build_tasks(read_study(study), n_displacements).cost
    assert 0.5 * used < planned < 2.0 * used


def test_the_memory_of_a_rank_holds_building_its_scene() -> None:
    of_automatic = ((1584, True, 0.37e9), (5280, True, 1.10e9), (11088, True, 2.72e9))
    for n_unknowns, automatic, measured in (*of_automatic, (3360, False, 0.44e9)):
        assert 1.0 / 1.5 < memory_a_rank(n_unknowns, 0, automatic, 0.0) / measured < 1.5
    small, large = (memory_a_rank(1584, 1000, False, built_with) for built_with in (3e7, 2.6e9))
    assert small == memory_a_rank(1584, 1000, False, 0.0)
    assert large == pytest.approx(small + 2.6e9, rel=0.03)


def test_the_largest_memory_grows_with_what_is_held() -> None:
    before = largest_memory()
    assert before > 1e7
    held = b"1" * int(before + 2e8)
    assert largest_memory() >= before + 1e8
    assert held.endswith(b"1")
