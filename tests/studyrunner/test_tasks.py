"""Which tasks a study has, which points share one, and what the plan says of it."""

import itertools
from collections import Counter

import pytest

from studyrunner.cli import main
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import StartResult
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import start_marches

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


def plan_of(*overrides):
    study = read_study("sdof_slider", overrides)
    return study, build_tasks(study, 2)


def assert_every_point_once(study, plan):
    points = Counter(point for line in plan.marches for task in line for point in task.points)
    sizes = [len(values) for values in study.dimensions.values()]
    assert points == Counter(itertools.product(*(range(size) for size in sizes)))
    assert plan.n_points == len(points)


def test_one_branch_a_line_of_frequencies():
    study, plan = plan_of(*GRID)
    assert len(plan.branches) == 2 * 2 * 2
    assert {branch.frequencies for branch in plan.branches} == {(150.0, 155.0, 160.0)}
    lines = {(task.excitation_amplitude, task.sweep, task.settings.harmonics) for task in plan.branches}
    assert lines == set(itertools.product((1.0, 2.0), ("up", "down"), (1, 5)))
    assert_every_point_once(study, plan)


def test_a_ramp_is_a_task_at_each_frequency():
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


def test_points_know_their_task():
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


def test_marches_cost_little_and_go_last_where_nothing_moves():
    _, plan = plan_of("axes.frequency=[1, 2]", "axes.step=[100, 1000]", "axes.scheme=implicit")
    planned = plan.marches_from(0, 0)
    moving = start_marches(planned, StartResult(0, "state", moves=True, n_unknowns=planned[0].n_unknowns))
    short, long = sorted(moving, key=lambda task: task.cost)
    resting = start_marches(planned, StartResult(0, "state", moves=False, n_unknowns=planned[0].n_unknowns))
    assert (long.start, long.step, short.step) == ("state", 100.0, 1000.0)
    assert all(0.0 < task.cost < short.cost for task in resting)
    assert [task.cost for task in planned] == [long.cost, short.cost]
    assert {task.cost_keys[0] for task in moving} != {task.cost_keys[0] for task in resting}


def printed_plan(overrides, capsys, study="sdof_slider"):
    arguments = [study, "--plan"]
    for override in overrides:
        arguments += ["--set", override]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return {line[:10].strip(): line[11:] for line in captured.out.splitlines()}


def test_plan_is_printed(capsys):
    lines = printed_plan(GRID, capsys)
    assert lines["points"].startswith("192 = 3 frequency x 2 wear_coefficient")
    assert lines["tasks"].startswith("128: 8 branches")
    assert lines["unknowns"].startswith("22 ")
    assert lines["left out"].startswith("72 points: wear_coefficient = 0")
    assert lines["time"].endswith("on two, to a factor of two, if every point wears;")
    assert lines["ranks"].startswith("up to about 4 ranks are efficient, with 32 tasks each; at least")
    assert "ms or less a step" in lines["assumed"]
    assert "GB a rank" in lines["memory"]


def test_the_plan_of_missions_says_what_is_serial(capsys):
    lines = printed_plan([], capsys, "mission")
    assert lines["tasks"] == "1: 1 mission history"
    assert lines["serial"].startswith("one rank computes all of a history, one part after the other: its missions")
    assert lines["ranks"].startswith("1 rank has work at most, one for each history; at least")
    lines = printed_plan(["axes.wear_coefficient=[1e-14, 2e-14]"], capsys, "mission")
    assert lines["tasks"] == "2: 2 mission histories, side by side on the ranks"
    assert lines["ranks"].startswith("2 ranks have work at most")


@pytest.mark.parametrize(
    ("study", "n_displacements", "used"),
    # CPU seconds of the tasks alone, measured on a busy core; of the first the deck is read besides, in 3 s
    [
        ("blade_root", 108, 13.5),  # on a quiet core
        ("cylinder_on_flat", 60, 2.5),
        ("sphere_on_flat", 104, 3.2),
        ("dovetail", 144, 124.0),
        ("work_precision_slider", 2, 578.0),
    ],
)
def test_estimates_hold_to_a_factor_of_two(study, n_displacements, used):
    planned = build_tasks(read_study(study), n_displacements).cost
    assert 0.5 * used < planned < 2.0 * used
