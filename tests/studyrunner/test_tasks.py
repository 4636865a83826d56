"""Which tasks a study has, which points share one, what the plan says of it, and what a run makes of their results."""

import math
import tracemalloc
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.packing import pack
from solver.results.history import StartState
from solver.settings import Resolution
from studyrunner.cli import main
from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS, memory_a_rank
from studyrunner.kinds.wear.effort import share_done
from studyrunner.kinds.wear.kind import ASKED, USUAL
from studyrunner.kinds.wear.point import build_result
from studyrunner.plan import doubts_of_study, effort_of
from studyrunner.study.study_file import bundled_studies, read_study
from tests.mpi.launching import options, results
from tests.studyrunner.faked_runs import history
from tests.studyrunner.fakes import FACTS, changed, plan_of, points_of, totals_of

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


def tasks_of(*overrides):
    study = read_study("sdof_slider", overrides)
    return study, plan_of(study)


def assert_every_point_once(study, plan):
    points = Counter(point for task in plan.results for point in points_of(task))
    assert points == Counter(range(study.n_points))
    assert plan.n_points == len(points)


def test_a_ramp_is_a_task_at_each_frequency():
    """Nothing is serial in it: as many ramps as points, and the histories of each from its only state."""
    study, plan = tasks_of("axes.frequency=[160, 150, 155]", "axes.sweep=['ramp', 'up']", *SHARED)
    ramps = [sweep for sweep in plan.sweeps if sweep.excitation.direction == "ramp"]
    assert [sweep.frequencies for sweep in ramps] == [(150.0,), (155.0,), (160.0,)]
    assert [sweep.number for sweep in plan.sweeps] == list(range(4))
    assert all(0.0 < sweep.cost < plan.sweeps[-1].cost for sweep in ramps)
    for sweep in ramps:
        assert sweep.order == sweep.places == (0,)
        assert {task.sweep for task in plan.waiting[sweep.number, 0]} == {sweep.number}
    assert sum(plan.left_out.values()) == plan.n_points - sum(len(task.integrated) for task in plan.results)
    assert_every_point_once(study, plan)


def test_points_know_their_task():
    """The values at a point's index are those of its task and its branch, whatever the order on the axes."""
    study, plan = tasks_of(*GRID, *SHARED, "axes.sweep=['up', 'ramp']")
    assert_every_point_once(study, plan)
    assert any(len(each.wear_coefficients) > 1 for task in plan.results for each in task.integrated)
    assert any(len(task.integrated) > 1 for task in plan.results)
    for task in plan.results:
        sweep = plan.sweeps[task.sweep]
        for point in points_of(task):
            at = np.unravel_index(point, [len(axis) for axis in study.dimensions.values()])
            values = {name: axis[place] for place, (name, axis) in zip(at, study.dimensions.items(), strict=True)}
            assert values["frequency"] == sweep.frequencies[task.position] == task.frequency
            assert values["excitation_amplitude"] == sweep.excitation.amplitude
            assert values["sweep"] == sweep.excitation.direction
            assert values["harmonics"] == task.settings.harmonics == sweep.settings.harmonics
            ((integrated, number),) = [task.results[place] for place in task.order if point in task.points(place)]
            assert values["wear_coefficient"] == integrated.wear_coefficients[number]
            if not integrated.unworn:
                assert values["scheme"] == integrated.scheme
                assert values["step"] == integrated.step or integrated.scheme == "adaptive"


@pytest.mark.parametrize("frequencies", [[150.0, 160.0], np.linspace(150.0, 160.0, 40)])
@pytest.mark.parametrize("overrides", [{}, {"axes.step": [10, 100], "axes.scheme": ["implicit", "adaptive"]}])
def test_a_plan_counts_the_tasks_that_a_design_has(frequencies, overrides):
    """Also those of start states that are alike, which it does not make one by one."""
    random = np.random.default_rng(0)
    columns = {"frequency": frequencies, "excitation_amplitude": [9.0, 10.0], "wear_coefficient": [0.0, 1e-12, 1e-11]}
    rows = dict.fromkeys(zip(*(random.choice(each, 99).tolist() for each in columns.values()), strict=True))
    study = read_study("sdof_slider", overrides, ([*rows], [*columns]))
    plan = plan_of(study)
    counted, made = effort_of(study, plan.works), effort_of(study, (task.work for task in plan.sweeps + plan.results))
    assert counted[:3] == made[:3]
    assert counted.seconds == pytest.approx(made.seconds)
    assert_every_point_once(study, plan)


@pytest.mark.slow
def test_a_plan_of_many_points_takes_little_memory():
    """Of a million points about 200 MB, where all tasks would take 900 MB."""
    values = "{{start = {0}, stop = {1}, num = {2}}}".format
    axes = {"frequency": (150, 160, 50), "wear_coefficient": (1e-12, 1e-11, 40), "excitation_amplitude": (1, 9, 20)}
    many = [f"axes.{name}={values(*ends)}" for name, ends in axes.items()]
    study = read_study("sdof_slider", [*many, "axes.scheme=implicit", "axes.step=500"])
    tracemalloc.start()
    try:
        words = "1000 start states by 20 sweeps, and 40000 wear histories"
        assert effort_of(study, plan_of(study).works).words == words
        assert tracemalloc.get_traced_memory()[1] < 250 * study.n_points
    finally:
        tracemalloc.stop()


def printed_plan(overrides, capsys, study="sdof_slider"):
    assert main([study, "--plan", *options(*overrides)]) == 0
    captured = capsys.readouterr()
    # progress, where the machine is slow
    assert all("building scene" in line for line in captured.err.splitlines())
    return {line[:10].strip(): line[11:] for line in captured.out.splitlines()}


@pytest.mark.parametrize(("n_sectors", "per_sector", "measured"), [(1, 144, 0.37e9), (12, 48, 0.91e9), (47, 24, 1.2e9)])
def test_memory_is_estimated_as_measured(n_sectors, per_sector, measured):
    n_unknowns = n_sectors * per_sector * (2 * AUTOMATIC_HARMONICS + 1)
    assert memory_a_rank(n_unknowns, 0, True, 0.0, n_sectors) == pytest.approx(measured, rel=0.2)


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
    # more steps than there are numbers
    assert "years" in printed_plan(["axes.step=1e-320", "axes.scheme=explicit"], capsys)["time"]


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
    plan = plan_of(read_study(study), n_displacements)
    planned = sum(task.cost for task in (*plan.sweeps, *plan.results))
    assert 0.5 * used < planned < 2.0 * used


# --- from results of tasks to the exit status ---

RUN = ["sdof_slider", *options("axes.frequency=[100, 110, 120]", "axes.scheme=implicit"), "-o", "out.nc"]


def answer(capsys):
    """Rows of the end of a run by their first words."""
    rows = capsys.readouterr().out.replace("\n ", " ").splitlines()
    return {row.split()[0]: " ".join(row.split()) for row in rows}


def at_the_second_frequency(change):
    """Of the stand-in for the solver: another result there."""
    return lambda task, result: change(result) if task.position == 1 else result


@pytest.mark.parametrize("outcome", [Outcome.INACCURATE, Outcome.SENSITIVE])
def test_points_above_rtol_are_computed_points(outcome, folder, solver, capsys):
    """Exit status 0; their values are kept, and they are named with what there is to say of them."""
    message = "from cycle 31 000 on the wear rate is known to 2.6 % only"
    values = {"outcome": int(outcome), "error_estimate": 0.15, "message": message}
    solver.change = at_the_second_frequency(lambda result: changed(result, **values))
    assert main(RUN) == 0
    rows = answer(capsys)
    assert "3 points, 3 computed, 0 failed" in rows["out.nc:"]
    assert "15 %" in rows["certainty"]
    assert all("110 Hz" in rows[name] for name in ("certainty", "uncertain"))
    there = results().sel(frequency=110.0).squeeze()
    assert there.worn_volume.notnull().all()
    assert (there.outcome, there.message) == (int(outcome), message)


def history_task(*overrides):
    study = read_study("sdof_slider", ["axes.frequency=100", "axes.scheme=implicit", *overrides])
    return plan_of(study, 2).results[0]


def ended_at(last, at, outcome=Outcome.CERTIFICATE_FAILED):
    """The history as it is where it has ended there."""
    behind = at.cycles > last
    changed = {}
    for name, values in vars(at).items():
        if isinstance(values, np.ndarray) and name != "cycles":
            cut = values.copy()
            cut[behind] = np.nan if values.dtype.kind in "fc" else 0
            changed[name] = cut
    return replace(at, outcome=outcome, last_cycle=last, error_estimate=0.03, **changed)


def test_what_was_computed_of_a_point_that_failed_is_kept():
    failed = ended_at(50.0, history([0.0, 40.0, 80.0, 1e5]))
    task = history_task("slow_time.outputs=[0, 40, 80, 20000]")
    result = build_result(task, task.integrated[0], failed)
    assert totals_of(result, "outcome", "last_cycle", "error_estimate") == [7, 50.0, 0.03]
    for name in set(USUAL) - {"wear_rate_error"}:
        values = result.values[name]
        there = np.isfinite(values) if ASKED[name].dtype == "float64" else values != 0
        assert there[:2].all(), name
        assert not there[2:].any(), name
    assert result.values["worn_volume"][:2].tolist() == [0.0, 1.0]
    assert result.values["largest_wear_depth"] == 1.0
    assert totals_of(result, "branch", "fold_frequency", "newton_iterations") == [2, 101.5, 7]
    message = result.values["message"]
    assert message.startswith("lost; ")
    assert all(words in message for words in ("cycle 50 of 20 000", "3 %"))


def test_loops_are_read_at_the_counts_of_a_point():
    task = history_task("slow_time.outputs=[10, 20]", "outputs.loops=[0]")
    assert task.loops == (0,)
    loops = np.arange(3 * 2 * 3.0).reshape(3, 1, 2, 3)
    result = build_result(task, task.integrated[0], history([0.0, 10.0, 20.0], loops=loops))
    assert np.array_equal(result.values["loop_displacement"], loops[1:])
    assert np.array_equal(result.values["loop_force"], -loops[1:])
    failed = build_result(task, task.integrated[0], ended_at(10.0, history([0.0, 10.0, 20.0], loops=loops)))
    assert np.array_equal(failed.values["loop_force"][0], -loops[1])
    assert np.isnan(failed.values["loop_force"][1]).all()
    unworn = history_task("slow_time.outputs=[10, 20]", "outputs.loops=[0]", "axes.wear_coefficient=0")
    at_rest = build_result(unworn, unworn.integrated[0], history([0.0], loops=loops[:1]))
    assert np.array_equal(at_rest.values["loop_force"], -loops[[0, 0]])


# --- questions about what is hardly meant ---


@pytest.mark.parametrize("name", [name for name in bundled_studies() if name != "extremes"])
def test_bundled_studies_are_plausible(name):
    facts = replace(FACTS, stuck_frequency=225.0 if "dove" in name else math.nan)
    assert doubts_of_study(read_study(name), facts) == ()


@pytest.mark.parametrize(
    ("study", "override", "start", "asked"),
    [
        # of 52100 steel, 4.23e-5 mm3/J
        ("sdof_slider", "axes.wear_coefficient=4.23e-5", "wear_coefficient 4.23e-05 ", "mm3/J (then it is 4.23e-14 "),
        ("dovetail", "axes.friction_coefficient=[0.5, 2.5]", "friction_coefficient 2.5 ", "percent (then it is 0.025)"),
        ("dovetail", "scene.density=4.43", "scene.density = 4.43 ", "4430"),
        ("dovetail", "scene.loss_factor=1", "loss_factor 1 ", "percent (then it is 0.01)"),
        ("dovetail", "axes.frequency=[1330, 1335]", "frequencies ", "rad/s"),
        ("dovetail", "scene.rotation_speed=314", "rotation_speed 314 rpm ", "in rad/s (then it is 2998.5 rpm)"),
        ("dovetail", "axes.frequency=[0.2, 0.21]", "frequency 0.21 Hz", "in kHz (then it is 210 Hz)"),
        ("dovetail", "axes.frequency=150e3", "frequency 1.5e+05 Hz", "in mHz (then it is 150 Hz)"),
        ("dovetail", "axes.excitation_amplitude=[1, 1e9]", "excitation_amplitude 1e+09 N", "(then it is 1e+06 N)"),
        ("dovetail", "slow_time.until={wear_depth=5.0}", "slow_time.until.wear_depth 5 m", "in um (then it is 5e-06"),
        ("dovetail", "slow_time.until={worn_volume=1.0}", "slow_time.until.worn_volume 1 m3", "in mm3"),
        (
            "running_in",
            "wear.evolution.energy=[0, 0.01, 0.02, 0.05]",
            "wear.evolution.energy 0.05 J/m2 is less than a joint dissipates in some cycles",
            "J/mm2 (then it is 50000 J/m2)",
        ),
        ("dovetail", "slow_time.cycles=1e20", "slow_time.cycles 1e+20 is more than machines live", "meant"),
        ("mission", "mission.0.excitation_amplitude=1e9", "excitation_amplitude 1e+09 N", "in mN"),
        ("dovetail", "scene.worn={depth=1e-6, energy=1e5}", "scene.worn has dissipated energies", "repeated"),
    ],
)
def test_other_units_are_asked_about_once(study, override, start, asked):
    (line,) = doubts_of_study(read_study(study, [override]), replace(FACTS, stuck_frequency=212.0))
    assert line.startswith(start)
    assert asked in line
    assert line.count("?") == 1


@pytest.mark.slow
def test_lines_come_once_on_stderr(tmp_path, capfd):
    wrong = ("axes.frequency=150", "axes.wear_coefficient=2.9e-8", "slow_time.cycles=100", "slow_time.outputs=2")
    assert main(["sdof_slider", *options(*wrong), "-o", str(tmp_path / "out.nc")]) in (0, 3)
    assert capfd.readouterr().err.count("wear_coefficient 2.9e-08 1/Pa") == 1


# --- what points that share an integrated history are given of it ---


ADAPTIVE = ("axes.wear_coefficient=[2e-12, 1e-11, 4e-12]", "axes.scheme=adaptive", "axes.step=[1, 2]")
COUNTS = [0.0, 2.0, 4.0, 5.0, 10.0]


def shared_task():
    """A task of three histories at cycles 0 and 10, which are read at 0, 10; 0, 4; 0, 2 cycles of the first."""
    study = read_study("sdof_slider", ["axes.frequency=150", *ADAPTIVE, "slow_time.cycles=10", "slow_time.outputs=2"])
    (task,) = plan_of(study, 2).results
    start = StartState(Outcome.CONVERGED, None, 1.0, Resolution((1,), 64), 0.0, 0.0, 0, 0.0)
    return replace(task, start=pack(start))


def results_of(integrated):
    """Those of the three histories, of the integrated one."""
    task = shared_task()
    return [build_result(task, task.integrated[0], integrated, place) for place in range(3)]


@pytest.mark.parametrize(
    ("last", "outcomes", "lasts"),
    [
        (10.0, [4, 0, 0], [10.0, 10.0, 10.0]),
        (9.0, [4, 0, 0], [9.0, 10.0, 10.0]),
        (4.0, [4, 0, 0], [4.0, 10.0, 10.0]),
        (3.0, [4, 4, 0], [3.0, 7.5, 10.0]),
        (1.5, [4, 4, 4], [1.5, 3.75, 7.5]),
    ],
)
def test_histories_of_one_that_ended_early_are_results_all_the_same(last, outcomes, lasts):
    """Cycles 0 and 10 of the histories are 0, 10; 0, 4; 0, 2 cycles of the integrated one."""
    found = results_of(replace(history(COUNTS, Outcome.MARCH_FAILED), last_cycle=last, message="at cycle 9"))
    assert [result.values["outcome"] for result in found] == outcomes
    np.testing.assert_allclose([result.values["last_cycle"] for result in found], lasts)
    for result, end in zip(found, (10.0, 4.0, 2.0), strict=True):
        there = np.isfinite(result.values["worn_volume"]).tolist()
        assert there == [True, last >= end]
        assert result.values["error_estimate"] == pytest.approx(0.03 * result.values["worn_volume"][there][-1])
    # the message of the integrated one counts its own cycles
    assert ["at cycle 9" in result.values["message"] for result in found] == [True, False, False]
    assert all(result.values["message"] == "" for result in found if result.values["outcome"] == 0)


@pytest.mark.parametrize(
    ("first", "ended", "expected"),
    [
        (10.0, Outcome.INACCURATE, [6, 0, 0]),
        (5.0, Outcome.INACCURATE, [6, 0, 0]),
        (4.0, Outcome.INACCURATE, [6, 6, 0]),
        (0.0, Outcome.INACCURATE, [6, 6, 6]),
        (3.0, Outcome.MARCH_FAILED, [4, 6, 0]),
        (np.inf, Outcome.MARCH_FAILED, [4, 0, 0]),
    ],
)
def test_a_scaled_history_is_inaccurate_by_its_own_counts(first, ended, expected):
    inaccurate = {"inaccurate_from": first, "inaccurate_in": "wear rate", "inaccurate_error": 0.04}
    found = results_of(replace(history(COUNTS, ended), message="of it", **inaccurate))
    assert [result.values["outcome"] for result in found] == expected
    # 4 cycles of the integrated history are 10 of the second, 2 of them 10 of the third
    for result, slower in zip(found[1:], (0.4, 0.2), strict=True):
        assert (f"from cycle {first / slower:.0f} on" in result.values["message"]) is bool(result.values["outcome"])


def test_what_is_done_of_a_history_moves_with_its_cycles():
    """With given steps first these, then the adaptive history and its reference solution."""
    for scheme, n in (("adaptive", 2), ("implicit", 3)):
        done = [share_done(scheme, 1000.0, 1e5, number, share) for number in range(n) for share in (1e-3, 0.5, 1.0)]
        assert done == sorted(done)
        assert 0.0 < done[0] < 0.05
        assert done[-1] == pytest.approx(1.0)
        assert share_done(scheme, 1000.0, 1e5, n, 0.5) == share_done(scheme, 1000.0, 1e5, 0, 0.0) == 0.0
    assert share_done("adaptive", 1.0, 1e5, 0, 0.25) == pytest.approx(0.32)


def test_a_contact_that_changes_is_planned_to_take_longer():
    plain = tasks_of("axes.frequency=160")[1].results[0].cost
    for energies, least in (("[0, 1e5]", 1.4), ("[0, 1e4, 1e5, 1e6]", 3.0)):
        factors = [1.0] * (energies.count(",") + 1)
        evolution = f"wear.evolution={{energy={energies}, wear_factor={factors}}}"
        _, plan = tasks_of("axes.frequency=160", evolution)
        assert least * plain < plan.results[0].cost < 2.0 * least * plain
