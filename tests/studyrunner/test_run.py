"""A whole run in this process: exit status, what is printed, and what the solver's histories become."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner import task_runs
from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult
from studyrunner.kinds.wear_result import build_result
from studyrunner.scene.scene import describe_scene
from studyrunner.study.study_file import read_study
from studyrunner.variables import ASKED, USUAL
from tests.studyrunner.fakes import changed, fake_evaluate, totals_of, without_values
from tests.studyrunner.histories import history

pytestmark = pytest.mark.usefixtures("folder")

SMALL = ["sdof_slider", "--set", "axes.frequency=[100, 110, 120]", "--set", "axes.scheme=implicit", "-o", "out.nc"]


def use_fake(monkeypatch, change):
    """Puts the stand-in in place of the solver; `change` has the last word on every history."""

    def compute(task, models, keep):
        for result in fake_evaluate(task, keep, describe_scene(models[0])):
            yield result if isinstance(result, StartResult) else change(task, result)

    monkeypatch.setattr(task_runs, "compute_task", compute)


def test_points_that_failed(monkeypatch, capsys):
    def fail_one(task, result):
        return without_values(result, int(Outcome.MARCH_FAILED)) if task.position == 1 else result

    use_fake(monkeypatch, fail_one)
    assert main(SMALL) == 3
    first, *_, failed, certainty = capsys.readouterr().out.splitlines()
    assert "2 computed, 1 failed" in first
    assert failed.startswith("failed ")
    assert "110 Hz" in failed
    assert "2 of 3 worn volumes" in certainty
    with xr.open_dataset("out.nc") as result:
        assert result.outcome.squeeze().values.tolist() == [0, int(Outcome.MARCH_FAILED), 0]
        assert result.worn_volume.squeeze().isnull().all("cycle").values.tolist() == [False, True, False]


@pytest.mark.parametrize("outcome", [Outcome.INACCURATE, Outcome.SENSITIVE])
def test_points_above_rtol_are_computed_points(outcome, monkeypatch, capsys):
    """Exit status 0; their values are kept, and they are named with what there is to say of them."""
    message = "from cycle 31 000 on the wear rate is known to 2.6 % only"

    def above(task, result):
        if task.position != 1:
            return result
        return changed(result, outcome=int(outcome), error_estimate=0.15, message=message)

    use_fake(monkeypatch, above)
    assert main(SMALL) == 0
    first, *_, uncertain, certainty = capsys.readouterr().out.splitlines()
    assert first.startswith("out.nc: 3 points, 3 computed, 0 failed, ")
    assert certainty.startswith("certainty ")
    assert "15 %" in certainty
    assert "110 Hz" in certainty
    assert uncertain.startswith("uncertain ")
    assert "110 Hz" in uncertain
    with xr.open_dataset("out.nc") as result:
        there = result.sel(frequency=110.0).squeeze()
        assert there.worn_volume.notnull().all()
        assert there.outcome == int(outcome)
        assert there.message.item() == message


@pytest.mark.slow
def test_unexpected_failure_keeps_the_old_file(folder, monkeypatch, capsys):
    def fail(*_):
        raise ZeroDivisionError("a bug")

    use_fake(monkeypatch, lambda _, result: result)
    assert main(SMALL) == 0
    earlier = (folder / "out.nc").read_bytes()
    (folder / "out.nc.progress").unlink()
    with monkeypatch.context() as broken:
        broken.setattr(task_runs.StudyRun, "take", fail)
        assert main(SMALL) == 1
    assert "ZeroDivisionError: a bug" in capsys.readouterr().err
    assert (folder / "out.nc").read_bytes() == earlier
    assert sorted(path.name for path in folder.iterdir()) == ["out.nc", "out.nc.progress"]
    assert main(SMALL) == 0


def history_task(*overrides):
    study = read_study("sdof_slider", ["axes.frequency=100", "axes.scheme=implicit", *overrides])
    return build_tasks(study, 2).results[0]


def ended_at(last, at, outcome=Outcome.CERTIFICATE_FAILED):
    """The history as it is where the march has ended there."""
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
    assert result.values["message"] == "computed up to cycle 50 of 20 000, the worn volume there to 3 %"


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
