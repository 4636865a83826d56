"""Which tasks a study has, which points share one, and what the plan says of it."""

import itertools
from collections import Counter

import pytest

from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import points_of

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
    points = Counter(point for task in plan.results for point in points_of(task))
    sizes = [len(values) for values in study.dimensions.values()]
    assert points == Counter(itertools.product(*(range(size) for size in sizes)))
    assert plan.n_points == len(points)


def test_one_sweep_along_a_line_of_frequencies():
    study, plan = plan_of(*GRID)
    assert len(plan.sweeps) == 2 * 2 * 2
    assert {branch.frequencies for branch in plan.sweeps} == {(150.0, 155.0, 160.0)}
    lines = {(task.excitation_amplitude, task.direction, task.settings.harmonics) for task in plan.sweeps}
    assert lines == set(itertools.product((1.0, 2.0), ("up", "down"), (1, 5)))
    assert_every_point_once(study, plan)


def test_a_ramp_is_a_task_at_each_frequency():
    """Nothing is serial in it: as many ramps as points, and the histories of each from its only state."""
    study, plan = plan_of("axes.frequency=[160, 150, 155]", "axes.sweep=['ramp', 'up']", *SHARED)
    ramps = [sweep for sweep in plan.sweeps if sweep.direction == "ramp"]
    assert [sweep.frequencies for sweep in ramps] == [(150.0,), (155.0,), (160.0,)]
    assert [sweep.frequencies for sweep in plan.sweeps if sweep.direction == "up"] == [(150.0, 155.0, 160.0)]
    assert [sweep.number for sweep in plan.sweeps] == list(range(4))
    assert all(0.0 < sweep.cost < plan.sweeps[-1].cost for sweep in ramps)
    for sweep in ramps:
        assert sweep.order == sweep.places == (0,)
        assert {task.sweep for task in plan.waiting[sweep.number, 0]} == {sweep.number}
    assert sum(plan.left_out.values()) == plan.n_points - sum(len(task.integrated) for task in plan.results)
    assert_every_point_once(study, plan)


def test_points_know_their_task():
    """The values at a point's index are those of its task and its branch, whatever the order on the axes."""
    study, plan = plan_of(*GRID, *SHARED, "axes.sweep=['up', 'ramp']")
    assert any(len(each.histories) > 1 for task in plan.results for each in task.integrated)
    assert any(len(task.integrated) > 1 for task in plan.results)
    for task in plan.results:
        sweep = plan.sweeps[task.sweep]
        for point in points_of(task):
            values = {name: axis[place] for place, (name, axis) in zip(point, study.dimensions.items(), strict=True)}
            assert values["frequency"] == sweep.frequencies[task.position] == task.frequency
            assert values["excitation_amplitude"] == sweep.excitation_amplitude
            assert values["sweep"] == sweep.direction
            assert values["harmonics"] == task.settings.harmonics == sweep.settings.harmonics
            own = [(each, scaled) for each in task.integrated for scaled in each.histories if point in scaled.points]
            ((integrated, scaled),) = own
            assert values["wear_coefficient"] == scaled.wear_coefficient
            if not integrated.unworn:
                assert values["scheme"] == integrated.scheme
                assert values["step"] == scaled.step or integrated.scheme == "adaptive"


def test_histories_cost_little_and_go_last_where_nothing_moves():
    alone = "solver.shortcuts=false"
    _, plan = plan_of("axes.frequency=[1, 2]", "axes.step=[100, 1000]", "axes.scheme=implicit", alone)
    planned = plan.waiting[0, 0]
    n_unknowns = planned[0].n_unknowns
    moving = [task.from_start(StartResult(0, "state", moves=True, n_unknowns=n_unknowns)) for task in planned]
    short, long = sorted(moving, key=lambda task: task.cost)
    resting = [task.from_start(StartResult(0, "state", moves=False, n_unknowns=n_unknowns)) for task in planned]
    assert long.start == "state"
    assert [task.integrated[0].step for task in (long, short)] == [100.0, 1000.0]
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
    assert lines["tasks"] == "56: 24 start states by 8 sweeps, and 120 wear histories"
    assert lines["unknowns"].startswith("22 ")
    assert lines["left out"].startswith("72 points: wear_coefficient = 0")
    assert "on two" in lines["time"]
    assert "GB a rank" in lines["memory"]
    missions = printed_plan(["axes.wear_coefficient=[1e-14, 2e-14]"], capsys, "mission")
    assert missions["tasks"] == "2: 2 mission histories, each computed by one rank"
    assert printed_plan([], capsys, "modes")["tasks"].endswith("points")


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
