"""Fretting loops in the result file: where they stand, and that other pairs take no room."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from solver.results.loops import LOOP_PHASES
from studyrunner import variables
from studyrunner.cli import main
from studyrunner.netcdf import gather
from studyrunner.plan.planning import build_tasks
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS, changed, fake_march, fake_starts, open_completion, without_values

OVERRIDES = ("axes.frequency=[160, 150]", "axes.scheme=implicit", "slow_time.outputs=3")


def wide(n_contact):
    return replace(
        FACTS, position=np.zeros((n_contact, 3)), area=np.full(n_contact, 1e-4), surface=("flank",) * n_contact
    )


@pytest.fixture
def write(tmp_path):
    def write_file(n_contact, asked):
        facts = wide(n_contact)
        study = read_study("sdof_slider", (*OVERRIDES, f"outputs.loops={asked}", "outputs.variables=['worn_volume']"))
        plan = build_tasks(study, facts.n_displacements)
        completion = open_completion(study, plan, tmp_path / "parts", facts, fresh=True)
        for task in fake_starts(plan, 0):
            result = fake_march(task, facts)
            if task.position == 1:
                result = without_values(result, 6)
                # noise does not shrink: what is on the disk is what was written
            else:
                loops = {name: result.values[name].shape for name in variables.LOOPS if name in result.values}
                noise = {name: np.random.default_rng(1).normal(size=shape) for name, shape in loops.items()}
                result = changed(result, **noise)
            completion.add_history(task, result)
        completion.store.flush()
        path = tmp_path / f"{n_contact}.nc"
        with contextlib.closing(completion.store):
            gather.gather(study, facts, completion, path)
        return path

    return write_file


def test_pairs_without_loops_take_no_room(write):
    files = {
        (n_contact, loops): write(n_contact, loops).stat().st_size
        for n_contact in (3, 300)
        for loops in ("[]", "[1]", "[0, 1, 2]")
    }
    bytes_a_pair = 2 * 3 * LOOP_PHASES * 3 * 8  # of the point that did not fail
    for n_contact in (3, 300):
        assert files[n_contact, "[0, 1, 2]"] - files[n_contact, "[1]"] > 1.8 * bytes_a_pair
        assert files[n_contact, "[1]"] - files[n_contact, "[]"] > 0.9 * bytes_a_pair
    # what loops add does not grow with the pairs: a chunk takes more than this in the index of the file alone
    added = [files[n_contact, "[1]"] - files[n_contact, "[]"] for n_contact in (3, 300)]
    assert abs(added[1] - added[0]) < 16 * 2 * (300 - 3)


@pytest.mark.slow
def test_points_that_share_a_march_have_its_loops_at_their_own_counts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = [
        "sdof_slider",
        *("--set", "axes.frequency=160", "--set", "axes.scheme=['implicit', 'adaptive']"),
        *("--set", "axes.wear_coefficient=[0, 1e-11, 2e-11]", "--set", "axes.step=[500, 1000]"),
        *("--set", "slow_time.cycles=2000", "--set", "slow_time.outputs=[500, 2000]"),
        *("--set", "solver.harmonics=3", "--set", "solver.samples=128", "--set", "outputs.loops=[0]"),
    ]
    assert main([*study, "-o", "shared.nc"]) == 0
    assert main([*study, "-o", "alone.nc", "--set", "solver.shortcuts=false"]) == 0
    with xr.open_dataset("shared.nc") as shared, xr.open_dataset("alone.nc") as alone:
        for name in ("loop_displacement", "loop_force"):
            assert alone[name].notnull().all()
            scale = float(np.abs(alone[name]).max())
            np.testing.assert_allclose(shared[name].values, alone[name].values, rtol=0.0, atol=1e-6 * scale)
        # half the normal force in the worst case: they are not all the same
        force = shared.loop_force.isel(component=0, phase=0, cycle=-1).squeeze()
        assert float(force.max() - force.min()) > 0.01
        np.testing.assert_allclose(
            shared.loop_force.isel(component=0).mean("phase"), shared.mean_pressure * shared.contact_area, rtol=1e-9
        )
