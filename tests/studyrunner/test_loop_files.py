"""Fretting loops in the result file: where they stand, and that other pairs take no room."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from solver.results.state_report import LOOP_PHASES
from studyrunner import variables
from studyrunner.kinds.kind import build_tasks
from studyrunner.result.arrays import coordinates
from studyrunner.result.target import Target
from studyrunner.result.write import write_result
from studyrunner.scene.scene_set import pair_arrays
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS, changed, fake_history, open_completion, started, without_values

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
        for task in started(completion.plan):
            result = fake_history(task, facts)
            if task.position == 1:
                result = without_values(result, 6)
                # noise does not shrink: what is on the disk is what was written
            else:
                loops = {name: result.values[name].shape for name in variables.LOOPS if name in result.values}
                noise = {name: np.random.default_rng(1).normal(size=shape) for name, shape in loops.items()}
                result = changed(result, **noise)
            completion.add(task, result)
        completion.store.flush()
        path = tmp_path / f"{n_contact}.nc"
        with contextlib.closing(completion.store):
            write_result(
                study, facts, completion, Target(path), [*coordinates(study, facts, pair_arrays(study, [facts]))], {}
            )
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
