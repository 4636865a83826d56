"""What of a study is left to do after an earlier run: by the tasks that are asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studyrunner.checkpoint.completion_index import MOST_OF_OTHERS, Ledger
from studyrunner.course import Course
from studyrunner.evaluate import COMPLETE
from studyrunner.plan.results import Kept
from studyrunner.plan.tasks import BranchTask, MarchTask, build_tasks
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS, fake_branch, fake_march, open_ledger, without_values

BASE = (
    "axes.frequency=[100, 110, 120]",
    "axes.sweep=['up', 'down']",
    "axes.scheme=['implicit']",
    "axes.wear_coefficient=[5e-12, 1e-11]",
    "slow_time.outputs=3",
)


@contextlib.contextmanager
def ledger_of(folder: Path, *overrides: str) -> Iterator[Ledger]:
    study = read_study("sdof_slider", (*BASE, *overrides))
    ledger = open_ledger(study, build_tasks(study, FACTS.n_displacements), folder)
    with contextlib.closing(ledger.store):
        yield ledger


def compute(ledger: Ledger, n_tasks: int = 1000, failing: frozenset[int] = frozenset()) -> tuple[int, int]:
    """Does what is left as a run does, up to a number of tasks; how many start states and marches it computed.

    failing: numbers of marches that fail.
    """
    course = Course(ledger)
    waiting: list[BranchTask | MarchTask] = list(course.begin())
    n_starts = n_marches = 0
    while waiting and n_starts + n_marches < n_tasks:
        task = waiting.pop(0)
        if isinstance(task, BranchTask):
            for start in fake_branch(task):
                waiting.extend(course.take(task, start))
                n_starts += 1
        else:
            n_marches += 1
            for place in range(task.n_results):
                result = fake_march(task, place=place)
                if task.number in failing:
                    result = replace(without_values(result, 4), message="why")
                waiting.extend(course.take(task, result))
    ledger.store.flush()
    return n_starts, n_marches


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "out.nc.parts"


@pytest.fixture
def finished(folder: Path) -> Path:
    """The folder of a study that is finished: 2 branches of 3 start states, 2 marches from each."""
    with ledger_of(folder) as ledger:
        assert compute(ledger) == (6, 12)
    return folder


def test_what_is_finished_is_not_computed_again(finished: Path) -> None:
    with ledger_of(finished) as ledger:
        assert ledger.n_points_finished == 12
        assert compute(ledger) == (0, 0)


@pytest.mark.parametrize("n_tasks", [1, 3, 4, 6, 7, 11, 15, 17])
def test_a_run_that_stopped_anywhere_goes_on_there(n_tasks: int, folder: Path) -> None:
    with ledger_of(folder) as ledger:
        first = compute(ledger, n_tasks)
    with ledger_of(folder) as ledger:
        assert ledger.n_points_finished == first[1]
        second = compute(ledger)
    assert first[1] + second[1] == 12
    # a branch gives all its states in one task here
    assert first[0] + second[0] == 6


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("axes.wear_coefficient=[5e-12, 1e-11, 2e-11]", (0, 6)),
        ("axes.wear_coefficient=[1e-11]", (0, 0)),
        ("axes.step=[2000]", (0, 12)),
        ("slow_time.outputs=4", (0, 12)),
        ("outputs.variables=['worn_volume']", (0, 12)),
        ("axes.sweep=['up']", (0, 0)),
        ("axes.excitation_amplitude=[11]", (6, 12)),
        # a state knows nothing of the other frequencies
        ("axes.frequency=[90, 100, 110, 120]", (2, 4)),
        ("axes.frequency=[100, 110, 115, 120]", (2, 4)),
        ("axes.frequency=[100, 110, 120, 130]", (2, 4)),
        ("axes.frequency=[110, 120]", (0, 0)),
        ("axes.sweep=['up', 'ramp']", (3, 6)),
        ("solver.time_limit=100", (0, 0)),
        ("solver.tolerance=1e-9", (6, 12)),
    ],
)
def test_a_changed_study_computes_only_what_changed(change: str, expected: tuple[int, int], finished: Path) -> None:
    with ledger_of(finished, change) as ledger:
        assert compute(ledger) == expected
    with ledger_of(finished, change) as ledger:
        assert compute(ledger) == (0, 0)
    # and what it was before is still there, until a run of the changed one is finished
    with ledger_of(finished) as ledger:
        assert compute(ledger) == (0, 0)


def test_points_that_failed_are_tried_again_where_asked_for_only(folder: Path) -> None:
    with ledger_of(folder) as ledger:
        compute(ledger, failing=frozenset({2, 7}))
    with ledger_of(folder) as ledger:
        assert compute(ledger) == (0, 0)
        ledger.forget_failed(COMPLETE)
        assert ledger.n_points_finished == 10
        assert compute(ledger) == (0, 2)
    with ledger_of(folder) as ledger:
        ledger.forget_failed(COMPLETE)
        assert compute(ledger) == (0, 0)


def test_points_that_are_not_to_tolerance_have_not_failed(folder: Path) -> None:
    with ledger_of(folder) as ledger:
        compute(ledger, failing=frozenset({2, 7}))
        ledger.forget_failed([*COMPLETE, 4])
        assert ledger.n_points_finished == 12


def test_a_start_state_that_failed_is_tried_again_and_no_other_one(folder: Path) -> None:
    """What comes behind it on its branch does not depend on it."""
    with ledger_of(folder) as ledger:
        down = ledger.plan.branches[1]
        for branch in ledger.plan.branches:
            for start in fake_branch(branch):
                failed = branch is down and start.position == 1
                ledger.add_start(branch, replace(start, n_unknowns=0) if failed else start)
        ledger.keep(down, Kept("progress", (np.zeros(1),)))
        compute(ledger)
        assert ledger.n_points_finished == 12
        ledger.forget_failed(COMPLETE)
        assert ledger.n_points_finished == 10
        (left,) = ledger.branches_left()
        assert (left.number, left.known, left.resume) == (1, frozenset({0, 2}), None)
        assert compute(ledger) == (1, 2)


def test_a_march_that_ended_its_process_has_failed(folder: Path) -> None:
    with ledger_of(folder) as ledger:
        compute(ledger, 5)
        (march, *_) = [m for line in ledger.plan.marches for m in line if not ledger.is_finished(m)]
        n_before = ledger.n_points_finished
        assert ledger.take_as_failed(ledger.key(march), None, 12, "Segmentation fault") == 1
        assert ledger.take_as_failed(ledger.key(march), None, 12, "Segmentation fault") == 0
        assert ledger.take_as_failed("0" * 32, None, 12, "of another study") == 0
        assert ledger.n_points_finished == n_before + 1
        (place,) = ledger.places(march)
        assert place is not None
        record = ledger.store.read(place[0])[place[1]]
        assert (record["outcome"], record["message"]) == (12, "Segmentation fault")
        assert np.isnan(record["worn_volume"]).all()
    with ledger_of(folder) as ledger:
        n_marches = compute(ledger)[1]
        assert n_marches == 12 - n_before - 1
        ledger.forget_failed(COMPLETE)
        assert compute(ledger) == (0, 1)


def test_of_a_march_that_crashed_later_histories_alone_are_lost(folder: Path) -> None:
    with ledger_of(folder, "axes.scheme=adaptive", "axes.sweep=up") as ledger:
        (march, *_) = Course(ledger).take(ledger.plan.branches[0], next(iter(fake_branch(ledger.plan.branches[0]))))
        assert march.n_results == 2
        ledger.add_history(march, fake_march(march))
        ledger.store.flush()
        kept = ledger.places(march)[0]
        assert kept is not None
        assert ledger.take_as_failed(march.key, None, 12, "") == 1
        assert ledger.places(march)[0] == kept
        assert ledger.is_finished(march)


@pytest.mark.parametrize(("number", "position", "lost"), [(0, 1, {1, 2}), (1, 1, {0, 1}), (0, 0, {0, 1, 2})])
def test_a_branch_that_ended_its_process_ends_there(number: int, position: int, lost: set[int], folder: Path) -> None:
    with ledger_of(folder) as ledger:
        branch = ledger.plan.branches[number]
        ended = ledger.take_as_failed(ledger.key(branch), position, 12, "why")
        assert ended == 2 * len(lost)
        lost_marches = {(m.branch, m.position) for line in ledger.plan.marches for m in line if ledger.is_finished(m)}
        assert lost_marches == {(number, place) for place in lost}
        assert ledger.take_as_failed(ledger.key(branch), 99, 12, "no such place") == 0
        n_starts, n_marches = compute(ledger)
        assert (n_starts, n_marches) == (6 - len(lost), 12 - 2 * len(lost))


def test_only_states_that_something_is_to_be_marched_from_are_asked_for(finished: Path) -> None:
    with ledger_of(finished) as ledger:
        branch = ledger.plan.branches[0]
        for place in range(3):
            ledger.store.forget_start(ledger._starts[0][place])
        (march,) = [m for m in ledger.plan.marches_from(0, 1) if m.wear_coefficient == 1e-11]
        ledger.store.forget_history(ledger._histories[march.number][0])
        (left,) = ledger.branches_left()
        assert left == replace(branch, known=frozenset({0, 2}))
        assert left.n_results == 1
        assert compute(ledger) == (1, 1)


def test_tasks_know_their_keys_and_their_progress(folder: Path) -> None:
    with ledger_of(folder) as ledger:
        branch, march = ledger.plan.branches[0], ledger.plan.marches[0][3]
        ledger.keep(branch, Kept("branch", ()))
        ledger.keep(march, Kept("march", ()))
        with pytest.raises(TypeError, match="no progress"):
            ledger.keep(march, "anything")
    with ledger_of(folder) as ledger:
        first, second = ledger.branches_left()
        assert (first.key, first.resume) == (ledger.key(branch), Kept("branch", ()))
        assert (second.key, second.resume) == (ledger.key(ledger.plan.branches[1]), None)
        found = ledger.marches_from(0, march.position)
        assert [task.key for task in found] == [ledger.key(task) for task in found]
        assert [task.resume for task in found] == [
            None if t.number != march.number else Kept("march", ()) for t in found
        ]


@pytest.mark.parametrize(("most", "expected"), [(MOST_OF_OTHERS, (0, 0)), (0.0, (6, 12)), (1.0, (6, 12))])
def test_what_another_study_has_left_stays_up_to_a_size(most: float, expected: tuple[int, int], finished: Path) -> None:
    other = "axes.excitation_amplitude=11"
    with ledger_of(finished, other) as ledger:
        assert compute(ledger) == (6, 12)
        ledger.prune(most)
        assert ledger.n_points_finished == 12
    with ledger_of(finished, other) as ledger:
        assert compute(ledger) == (0, 0)
    with ledger_of(finished) as ledger:
        assert compute(ledger) == expected


def test_what_stands_in_one_file_with_another_study_goes_alone(finished: Path) -> None:
    """A study and a larger one share files once these are put together."""
    with ledger_of(finished, "axes.wear_coefficient=[1e-11]") as ledger:
        assert ledger.n_points_finished == 6
        ledger.prune(0.0)
    with ledger_of(finished) as ledger:
        assert ledger.n_points_finished == 6


def test_a_study_that_starts_over_leaves_those_of_others(finished: Path) -> None:
    other = "axes.wear_coefficient=[5e-12, 1e-11, 2e-11]"
    with ledger_of(finished, other) as ledger:
        assert compute(ledger) == (0, 6)
    with ledger_of(finished) as ledger:
        ledger.forget_all()
    with ledger_of(finished) as ledger:
        assert ledger.n_points_finished == 0
        assert not any(branch.known for branch in ledger.branches_left())
    with ledger_of(finished, other) as ledger:
        assert ledger.n_points_finished == 6
