"""What a finished task is known by: everything that its result depends on, and nothing else."""

import importlib.metadata
import itertools
import shutil
from pathlib import Path

import pytest

import solver
from studyrunner.plan import identity
from studyrunner.plan.identity import Identities
from studyrunner.plan.planning import build_tasks
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS


def names_of(scene=FACTS.digest):
    """All names of the tasks of a study and of their results; which keys change them tells `test_completion_index`."""
    study = read_study("sdof_slider", ["axes.frequency=[150, 155]", "axes.scheme=implicit", "axes.step=[100, 150]"])
    plan, own = build_tasks(study, FACTS.n_displacements), Identities(scene, "kind")
    (branch,), (line,) = plan.branches, plan.marches
    histories = [own.of_histories(branch, march) for march in line]
    return [own.of_branch(branch), *map(own.of_march, histories), *own.of_starts(branch), *itertools.chain(*histories)]


def test_all_that_a_task_gives_has_a_name_of_its_own():
    names = names_of()
    assert len(set(names)) == len(names)
    assert all(len(name) == 32 and set(name) <= set("0123456789abcdef") for name in names)


def test_another_solver_or_scene_is_another_one(monkeypatch):
    before = set(names_of())
    assert before.isdisjoint(names_of("1" * 64))
    identity.solver_digest.cache_clear()
    assert set(names_of()) == before
    monkeypatch.setattr(importlib.metadata, "version", lambda _: "0.0.0")
    identity.solver_digest.cache_clear()
    try:
        assert before.isdisjoint(names_of())
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
