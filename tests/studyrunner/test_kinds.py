"""Kinds of study: each reads what it names and no other key, one marks a study, and its results say which they are."""

import pickle
from itertools import permutations

import pytest

from solver.outcome import Outcome
from studyrunner import UserError, read_study
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.kinds.table import KINDS
from studyrunner.result.opening import KIND
from studyrunner.study.sections import SECTIONS
from studyrunner.study.study_file import format_study
from tests.studyrunner.results import as_result, result_of_study
from tests.studyrunner.small_studies import MISSIONS, MODES, SLIDER

STUDIES = {"wear": SLIDER, "modes": MODES, "missions": MISSIONS}
PARTS = {"tasks": ("build_tasks", "WAYS", "plan_rows"), "figures": ("FIGURES",)}
PARTS |= {"findings": ("what_came_out", "errors_of")}


def study_of(name, folder, overrides=()):
    (folder / "s.toml").write_text(STUDIES[name], encoding="utf-8")
    return read_study(folder / "s.toml", overrides)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_kind_names_what_it_has(kind, tmp_path):
    study = study_of(kind.name, tmp_path)
    assert study.kind is kind
    assert pickle.loads(pickle.dumps(study)).kind is kind
    for part, names in PARTS.items():
        assert all(hasattr(kind.part(part), name) for name in names), part
    assert list(kind.broken_rules(study)) == []
    assert {*kind.axes, *kind.last_axes, *kind.other_axes} <= SECTIONS["axes"].model_fields.keys() & COORDINATES.keys()
    assert {*kind.usual, *kind.of_samples} <= kind.asked.keys()
    assert {"outcome", "newton_iterations", "run_time", "message"} <= kind.always.keys()
    assert set(kind.scene) <= SCENE.keys()
    names = [entry.name for entry in kind.part("figures").FIGURES]
    assert len(names) == len({*names})


def test_each_axis_is_read_by_a_kind_and_refused_by_the_others(tmp_path):
    for table, key in ((name, key) for name in ("axes", "slow_time") for key in SECTIONS[name].model_fields):
        readers = [kind for kind in KINDS.values() if kind.is_read(table, key)]
        assert readers, key
        for kind in KINDS.values():
            if kind in readers or readers[0].marker == f"{table}.{key}":
                continue
            value = {"scheme": "adaptive", "sweep": "up", "until": {"wear_depth": 1.0}}.get(key, 0.5)
            with pytest.raises(UserError, match=f"{table}.{key}"):
                study_of(kind.name, tmp_path, {f"{table}.{key}": 2 if key in ("mode", "missions") else value})


def test_two_markers_are_refused_in_one_sentence(tmp_path):
    for one, other in permutations([kind for kind in KINDS.values() if kind.marker], 2):
        given = {other.marker.strip("[]"): [] if other.table else 1e-3}
        with pytest.raises(UserError) as refused:
            study_of(one.name, tmp_path, given)
        assert len(refused.value.mistakes) == 1
        assert all(words in str(refused.value) for words in ("s.toml", one.marker, other.marker))


@pytest.mark.parametrize("name", KINDS)
def test_a_result_says_its_kind_and_one_of_an_earlier_version_shows_it(name, tmp_path):
    study = study_of(name, tmp_path)
    dataset = result_of_study(study)
    assert dataset.attrs[KIND] == name
    assert as_result(dataset, tmp_path / "new.nc").kind is KINDS[name]
    without = dataset.copy()
    del without.attrs[KIND]
    old = as_result(without, tmp_path / "old.nc")
    assert old.kind is KINDS[name]
    assert old.ended(Outcome.CONVERGED).all()
    with pytest.raises(UserError, match="attribute kind"):
        as_result(dataset.assign_attrs(kind="impact"), tmp_path / "later.nc")
    assert read_study(tmp_path / "s.toml") == study
    assert "kind" not in format_study(study)
