"""The files of a run: whole or not there, and all that a result says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studyrunner import parts as parts_module
from studyrunner.parts import SECONDS_A_FILE, Parts, histories_of, pack, record_type
from studyrunner.results import MarchResult
from studyrunner.study_file import read_study
from studyrunner.tasks import MarchTask, build_tasks
from studyrunner.variables import KEPT
from tests.studyrunner.fakes import FACTS, fake_histories

STUDY = read_study(
    "sdof_slider",
    (
        "axes.frequency=[160, 150]",
        "slow_time.outputs=3",
        "axes.sweep=['up', 'down']",
        "axes.scheme=adaptive",
        "axes.wear_coefficient=[1e-12, 1e-11]",
    ),
)


def results() -> list[tuple[MarchTask, MarchResult]]:
    return list(fake_histories(build_tasks(STUDY, FACTS.n_displacements)))


def new_parts(folder: Path) -> Parts:
    return Parts(folder, record_type(STUDY, FACTS))


def test_a_record_says_all_that_its_result_does() -> None:
    pairs = results()
    records = pack(record_type(STUDY, FACTS), pairs)
    assert histories_of(records) == [(march, share) for march in (0, 1, 3, 2) for share in range(2)]
    for record, (task, result) in zip(records, pairs, strict=True):
        for name in KEPT:
            np.testing.assert_equal(record[name], getattr(result, name))
        for name in task.variables:
            np.testing.assert_equal(record[name], result.values[name])


def test_what_is_read_is_what_was_added(tmp_path: Path) -> None:
    parts = new_parts(tmp_path / "out.parts")
    pairs = results()
    for place, pair in enumerate(pairs):
        parts.add(*pair)
        if place % 3 == 1:
            parts.flush()
    parts.flush()
    parts.flush()
    read = np.concatenate([parts.read(number) for number in range(len(parts.files))])
    assert read.tobytes() == pack(parts.kind, pairs).tobytes()
    assert sorted(parts.folder.iterdir()) == parts.files


def test_a_first_result_is_written_at_once_and_later_ones_wait_a_moment_for_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr(parts_module.time, "monotonic", lambda: now)
    parts = new_parts(tmp_path / "out.parts")
    one, two, three, *_ = results()
    for pair, seconds, n_files in ((one, 0.0, 1), (two, 0.5, 1), (three, 0.6, 2)):
        parts.add(*pair)
        now += seconds * SECONDS_A_FILE
        parts.tick()
        assert len(parts.files) == n_files
    assert [len(parts.read(number)) for number in range(2)] == [1, 2]


def test_little_is_kept_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = new_parts(tmp_path / "out.parts")
    monkeypatch.setattr(parts_module, "_BYTES_A_FILE", 2.5 * parts.kind.itemsize)
    for place, pair in enumerate(results()):
        parts.add(*pair)
        assert len(parts.files) == (place + 1) // 3


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = new_parts(tmp_path / "out.parts")
    parts.add(*results()[0])

    def fail(*_: object) -> None:
        assert list(parts.folder.glob("*.npy")) == []
        raise OSError("disk full")

    monkeypatch.setattr(parts_module.os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        parts.flush()
    assert parts.files == []


def test_what_an_earlier_run_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "out.parts"
    earlier = new_parts(folder)
    earlier.add(*results()[0])
    earlier.flush()
    (folder / "00000001.partial").touch()
    (folder / "notes.txt").touch()
    parts = new_parts(folder)
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
    parts.remove()
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
    (folder / "notes.txt").unlink()
    parts.remove()
    assert not folder.exists()
