"""[wear] of a study: from the file to the result."""

import numpy as np
import pytest

from solver.settings import WearTarget
from studyrunner import run_study
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import Identity
from studyrunner.study.study_file import format_study, read_study
from tests.studyrunner.fakes import FACTS

SHORT = ("axes.frequency=160", "axes.scheme=adaptive", "slow_time.cycles=20000", "slow_time.outputs=3")
TABLE = ("wear.law=table", "wear.pressure=[1e4, 1e5]", "wear.depth=[0, 1e-5]", "wear.factor=[[1, 2], [0.5, 1]]")


def study_with(*overrides):
    return read_study("sdof_slider", (*SHORT, *overrides))


def test_a_history_is_known_by_its_law_and_a_start_state_is_not():
    found = []
    for overrides in (
        (),
        ("wear.law=energy",),
        ("wear.surfaces={support = 2.0}",),
        ("slow_time.until={wear_depth = 1}",),
    ):
        study = study_with(*overrides)
        plan, of = build_tasks(study, FACTS.n_displacements), Identity((FACTS.digest,), "kind")
        found.append((plan.sweeps[0].names(of), plan.results[0].names(of)))
    assert len({starts for starts, _ in found}) == 1
    assert len({histories for _, histories in found}) == 4


@pytest.mark.slow
def test_the_law_of_a_study_is_the_one_that_wears(tmp_path):
    def final(*overrides):
        result = run_study(study_with(*overrides), tmp_path / "out.nc")
        return np.asarray(result.worn_volume.isel(cycle=-1).values.ravel())

    archard = final()
    assert final("wear.law=energy", "axes.wear_coefficient=2.2e-11") == pytest.approx(archard, rel=1e-12)
    assert final("wear.surfaces={support = 0.5}", "axes.wear_coefficient=2.2e-11") == pytest.approx(archard, rel=1e-12)
    assert 0.0 < final("wear.law=threshold", "wear.threshold=10") < 0.9 * archard
    assert not final("wear.law=threshold", "wear.threshold=1e4").any()
    # one march for all wear coefficients: worn volumes are those of products of coefficient and cycles
    shared = final(*TABLE, "axes.wear_coefficient=[1.1e-11, 5.5e-12]", "slow_time.cycles=20000")
    half = final(*TABLE, "axes.wear_coefficient=1.1e-11", "slow_time.cycles=10000")
    assert shared[1] == pytest.approx(half[0], rel=1e-3)
    assert abs(shared[0] / archard[0] - 1.0) > 0.01


@pytest.mark.slow
def test_points_end_at_their_target_each_at_its_own_count(tmp_path):
    shared = ("axes.wear_coefficient=[1e-11, 5e-12, 1e-12]", "slow_time.cycles=100000", "slow_time.outputs=101")
    study = study_with(*shared, "slow_time.until={wear_depth = 1e-5}")
    assert read_study(_written(study, tmp_path)).until == study.until == WearTarget("wear_depth", 1e-5)
    whole = run_study(study, tmp_path / "out.nc")
    result = whole.squeeze([name for name in whole.outcome.dims if name != "wear_coefficient"], drop=True)
    counts = result.cycles_to_target.values
    assert counts[1] == pytest.approx(2.0 * counts[0], rel=1e-9)
    assert np.isnan(counts[2])
    assert result.outcome.values.tolist() == [0, 0, 0]
    errors = result.cycles_to_target_error.values
    assert errors[1] == pytest.approx(2.0 * errors[0], rel=1e-9)
    assert 0.0 < errors[0] < 0.05 * counts[0]
    assert np.isnan(errors[2])
    for message, count, error in zip(result.message.values.tolist()[:2], counts[:2], errors[:2], strict=True):
        reached = f"{count:,.0f}".replace(",", " ")
        assert message == f"at its target at cycle {reached} +- {error:.2g}: later counts are not computed"
    life = whole.fretwear.summary().life
    assert (life.count.value, life.count.error, life.n_beyond) == (counts[0], errors[0], 1)
    assert result.message.values[2].startswith("wear_depth stays below 1e-05 m: it is ")
    assert result.worn_volume.isel(cycle=-1).isnull().values.tolist() == [True, True, False]
    depth = result.wear_depth.isel(contact=0)
    assert float(depth.isel(wear_coefficient=0).interp(cycle=counts[0])) == pytest.approx(1e-5, rel=1e-3)
    assert (result.last_cycle[:2] >= result.cycles_to_target[:2]).all()
    # nothing wears, nothing is reached
    still = run_study(study_with("axes.wear_coefficient=0", "slow_time.until={worn_volume = 1e-12}"), tmp_path / "o.nc")
    assert np.isnan(still.cycles_to_target.item())
    assert still.message.item() == "worn_volume stays below 1e-12 m3: it is 0 m3 at the last count"


def _written(study, folder):
    path = folder / "effective.toml"
    path.write_text(format_study(study))
    return path
