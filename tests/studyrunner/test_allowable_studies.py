"""The excitation at which wear just meets its target, from the study file to the end of a run."""

from pathlib import Path

import numpy as np
import pytest

from solver import SolverSettings, WearTarget, allowable_amplitude
from studies import build_scene
from studyrunner.kinds.task import Part
from studyrunner.report.figures.points import draw_trends
from studyrunner.result.view import open_for_report
from studyrunner.study.study_file import read_study
from studyrunner.summary.answer import summary
from studyrunner.worn_joint import compute_worn_joint
from tests.studyrunner.fakes import plan_of
from tests.studyrunner.small_studies import compute, same_values

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]

SOUGHT = ("axes.excitation_amplitude=allowable", "slow_time.until={wear_depth=5e-5}", "slow_time.cycles=8e5")
ASKED = (*SOUGHT, "axes.scheme=adaptive", "axes.frequency=[150, 160]", "slow_time.outputs=5")


def told(found):
    return " ".join(str(summary(found)).split())


def test_each_point_has_its_amplitude(tmp_path):
    found = compute("sdof_slider", "out.nc", *ASKED)
    amplitude, error = found.allowable_amplitude.squeeze(), found.allowable_amplitude_error.squeeze()
    assert "excitation_amplitude" not in found.dims
    for frequency, at in zip((150.0, 160.0), amplitude.values, strict=True):
        alone = allowable_amplitude(
            build_scene("sdof_slider"), frequency, 0.5, 1.1e-11, 8e5, WearTarget("wear_depth", 5e-5)
        )
        assert abs(alone.amplitude - at) < alone.error + float(error.sel(frequency=frequency))
    # the history of a point is that at its amplitude, with values at all counts
    depth = found.wear_depth.isel(cycle=-1).values.ravel()
    assert ((depth > 0.95 * 5e-5) & (depth < 1.01 * 5e-5)).all()
    given = compute("sdof_slider", "given.nc", "axes.scheme=adaptive", "axes.frequency=150", "slow_time.cycles=8e5",
                    f"axes.excitation_amplitude={float(amplitude[0])!r}", "slow_time.outputs=5")  # fmt: skip
    np.testing.assert_array_equal(
        given.worn_volume.values.ravel(), found.worn_volume.sel(frequency=150.0).values.ravel()
    )
    values = summary(found).values
    assert values["allowable"]["amplitude"] == float(amplitude.min())
    assert not {"life", "wear"} & {*values}
    shown = open_for_report(Path("out.nc"))
    assert shown.shown["frequency"] == int(np.argmin(amplitude.values))
    assert draw_trends(shown) is not None
    # a result runs again, and its worn joint is excited as it was
    same_values(compute("out.nc", "again.nc"), found)
    curve = compute_worn_joint(Path("out.nc"), tmp_path, response=True)["response"]
    assert np.isfinite(curve.response_amplitude).all()


def test_samples_have_amplitudes_of_their_own():
    drawn = ("scatter.samples=3", "scatter.friction_coefficient={normal = {std = 0.05}}", "axes.frequency=160")
    found = compute("sdof_slider", "out.nc", *ASKED[:-2], *drawn, "slow_time.outputs=2")
    assert len(np.unique(found.allowable_amplitude)) == 3
    assert "3 samples are too few to say which input decides" in told(found)
    # as if there were many: the friction that each has drawn decides
    many = found.isel(sample=np.tile([0, 1, 2], 30))
    assert "5, 50, 95 % of 90 samples" in told(many)
    assert "rank correlations: friction coefficient 1.00" in told(many)


def test_each_search_is_a_task():
    study = read_study("sdof_slider", (*ASKED, "axes.wear_coefficient=[1e-11, 2e-11]", "axes.step=[1, 2]"))
    plan = plan_of(study)
    assert (len(plan.results), plan.sweeps) == (4 + 4, ())
    assert SolverSettings().rtol == study.solver.rtol[0]


def test_a_search_says_how_far_it_is_also_within_a_history():
    task, told = (
        plan_of(
            read_study("sdof_slider", (*ASKED, "axes.frequency=150", "solver.harmonics=3", "solver.samples=32"))
        ).results[0],
        list[object](),
    )
    next(task.compute({0: build_scene("sdof_slider")}, told.append))
    shares = [each.share for each in told if isinstance(each, Part)]
    # an amplitude that gives no history is tried again without being counted
    assert np.diff(shares).min() > -0.125
    assert 0.0 <= shares[0] < 0.1
    assert 0.8 < shares[-1] <= 1.0
    assert len({*shares}) > 20
