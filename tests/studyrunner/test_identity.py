"""What a finished task is known by: everything that its result depends on, and nothing else."""

import importlib.metadata
import itertools
import shutil
from pathlib import Path

import pytest

import solver
from studyrunner.checkpoint.records import record_type
from studyrunner.plan import identity
from studyrunner.plan.identity import Identities, hash_of_kind
from studyrunner.plan.planning import build_tasks
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS

BASE = {
    "axes.frequency": "[150, 155, 160]",
    "axes.scheme": "['implicit']",
    "axes.step": "[100]",
    "axes.wear_coefficient": "[1e-11]",
    "axes.excitation_amplitude": "[10]",
    "axes.sweep": "['up']",
    "slow_time.cycles": "1000",
    "slow_time.outputs": "3",
    "solver.harmonics": "3",
    "solver.samples": "64",
}


def hashes(scene=FACTS.digest, **changes):
    """Hashes of the start state and of the history of each point, by frequency, amplitude, coefficient and step."""
    overrides = BASE | {name.replace("__", "."): value for name, value in changes.items()}
    study = read_study("sdof_slider", [f"{name}={value}" for name, value in overrides.items()])
    plan = build_tasks(study, FACTS.n_displacements)
    found = Identities(scene, hash_of_kind(record_type(study, FACTS).descr))
    points = {}
    for branch, line in zip(plan.branches, plan.marches, strict=True):
        starts = found.of_starts(branch)
        for march in line:
            for scaled, history in zip(march.histories, found.of_histories(branch, march), strict=True):
                where = (branch.frequencies[march.position], branch.excitation_amplitude)
                points[(*where, scaled.wear_coefficient, scaled.step)] = (starts[march.position], history)
    return points


POINT = (155.0, 10.0, 1e-11, 100.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"scene__friction_coefficient": "0.4"},
        {"axes__sweep": "['down']"},
        {"solver__harmonics": "5"},
        {"solver__harmonics": "auto"},
        {"solver__samples": "128"},
        {"solver__tolerance": "1e-9"},
        {"solver__rtol": "1e-3"},
        {"axes__sweep": "['ramp']"},
        {"scene": "1" * 64},
    ],
    ids=str,
)
def test_what_changes_a_start_state_changes_all_that_follows(changes):
    before, after = hashes()[POINT], hashes(**changes)[POINT]
    assert before[0] != after[0]
    assert before[1] != after[1]


@pytest.mark.parametrize(
    "changes",
    [
        {"axes__scheme": "['explicit']"},
        {"axes__scheme": "['adaptive']"},
        {"axes__scheme": "['explicit']", "slow_time__largest_depth": "1e-6"},
        {"slow_time__cycles": "2000"},
        {"slow_time__outputs": "4"},
        {"slow_time__outputs": "[0, 400, 1000]"},
        {"outputs__variables": "['worn_volume']"},
        {"outputs__loops": "[0]"},
    ],
    ids=str,
)
def test_what_changes_a_history_only_leaves_its_start_state(changes):
    before, after = hashes()[POINT], hashes(**changes)[POINT]
    assert before[0] == after[0]
    assert before[1] != after[1]


@pytest.mark.parametrize(
    "changes",
    [
        {"solver__time_limit": "3"},
        {"study__title": "another"},
        {"axes__frequency": "[160, 150, 155]"},
        {"axes__frequency": "[155]"},
        {"axes__frequency": "[151, 155, 160]"},
        {"axes__frequency": "[150, 152, 155, 158, 160]"},
        {"axes__frequency": "[100, 155, 900]"},
        {"axes__excitation_amplitude": "[9, 10]"},
        {"axes__wear_coefficient": "[3e-11, 1e-11]"},
        {"axes__step": "[10, 100]"},
        {"axes__sweep": "['down', 'up']"},
        {"axes__scheme": "['implicit', 'explicit']"},
        {"axes__harmonics": "[5, 3]"},
    ],
    ids=str,
)
def test_what_does_not_change_a_result_does_not_change_its_hash(changes):
    found = set(hashes_of_all(**changes))
    assert hashes()[POINT] in found


def hashes_of_all(**changes):
    """Of all points, also where several have the same frequency, amplitude, coefficient and step."""
    overrides = BASE | {name.replace("__", "."): value for name, value in changes.items()}
    study = read_study("sdof_slider", [f"{name}={value}" for name, value in overrides.items()])
    plan = build_tasks(study, FACTS.n_displacements)
    own = Identities(FACTS.digest, hash_of_kind(record_type(study, FACTS).descr))
    return [
        (own.of_starts(branch)[march.position], history)
        for branch, line in zip(plan.branches, plan.marches, strict=True)
        for march in line
        for history in own.of_histories(branch, march)
    ]


def test_all_points_have_hashes_of_their_own():
    changes = {
        "axes__excitation_amplitude": "[9, 10]",
        "axes__wear_coefficient": "[0, 1e-12, 1e-11]",
        "axes__step": "[10, 100]",
        "axes__scheme": "['implicit', 'explicit', 'adaptive']",
        "axes__sweep": "['up', 'down', 'ramp']",
        "axes__harmonics": "[3, 5]",
    }
    found = hashes_of_all(**changes)
    assert len({history for _, history in found}) == len(found) > 100
    starts = {start for start, _ in found}
    assert len(starts) == 3 * 2 * 3 * 2


def plan_and_identities():
    study = read_study("sdof_slider", [f"{name}={value}" for name, value in BASE.items()])
    return build_tasks(study, FACTS.n_displacements), Identities(FACTS.digest, "kind")


def test_progress_is_known_by_all_that_its_task_gives():
    plan, own = plan_and_identities()
    branch = plan.branches[0]
    histories = [own.of_histories(branch, march) for march in plan.marches[0]]
    names = [own.of_branch(branch), *map(own.of_march, histories), *own.of_starts(branch), *itertools.chain(*histories)]
    assert len(set(names)) == len(names)
    assert all(len(name) == 32 and set(name) <= set("0123456789abcdef") for name in names)


def test_another_solver_is_another_one(monkeypatch):
    before = hashes()
    identity.solver_digest.cache_clear()
    assert hashes() == before
    monkeypatch.setattr(importlib.metadata, "version", lambda _: "0.0.0")
    identity.solver_digest.cache_clear()
    try:
        assert hashes()[POINT][0] != before[POINT][0]
    finally:
        identity.solver_digest.cache_clear()


@pytest.mark.slow
def test_an_edit_anywhere_in_the_solver_makes_all_results_others(tmp_path, monkeypatch):
    """Every source file of a copy is changed in turn, and one is moved."""
    copy = tmp_path / "solver"
    shutil.copytree(Path(solver.__path__[0]), copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(solver, "__path__", [str(copy)])
    monkeypatch.setattr(solver.__spec__, "submodule_search_locations", [str(copy)])

    def digest():
        identity.solver_digest.cache_clear()
        return identity.solver_digest()

    before, seen = digest(), set()
    paths = sorted(copy.rglob("*.py"))
    assert any(path.parent != copy for path in paths)
    for path in paths:
        text = path.read_bytes()
        path.write_bytes(text + b"# changed\n")
        seen.add(digest())
        path.write_bytes(text)
    assert digest() == before
    room = next(path for path in paths if path.parent != copy and path.name != "__init__.py")
    room.rename(copy / room.name)
    seen.add(digest())
    identity.solver_digest.cache_clear()
    assert len(seen - {before}) == len(paths) + 1
