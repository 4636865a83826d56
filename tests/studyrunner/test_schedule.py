"""The schedule on one rank, and the ranks without MPI."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import pytest

from studyrunner.costs import LearnedCosts
from studyrunner.ranks import Alone, LauncherError, launcher_rank, launcher_size, start_ranks
from studyrunner.schedule import serve_tasks


@dataclass(frozen=True)
class Job:
    name: str
    cost: float
    n_results: int = 1
    opens_others: bool = False

    @property
    def kin(self) -> tuple[tuple[str, ...], ...]:
        return (("job", self.name),)


def take_nothing(job: Job, result: object) -> list[Job]:
    return []


def serve(
    tasks: Iterable[Job],
    run: Callable[[Job], Iterable[object]],
    take: Callable[[Job, object], list[Job]] = take_nothing,
) -> LearnedCosts:
    costs = LearnedCosts()
    serve_tasks(Alone(), tasks, lambda job, _: run(job), take, costs)
    return costs


def test_long_tasks_go_first_and_results_make_new_ones() -> None:
    done: list[tuple[str, object]] = []

    def run(job: Job) -> Iterator[str]:
        yield job.name.upper()

    def take(job: Job, result: object) -> list[Job]:
        done.append((job.name, result))
        return [Job("a1", 1e5), Job("a2", 1e6)] if job.name == "a" else []

    serve([Job("b", 10.0), Job("a", 1.0, opens_others=True)], run, take)
    assert done == [("a", "A"), ("a2", "A2"), ("a1", "A1"), ("b", "B")]


def test_results_arrive_while_their_task_goes_on() -> None:
    taken = threading.Event()

    def run(job: Job) -> Iterator[int]:
        yield 1
        assert taken.wait(10.0)
        yield 2

    def take(job: Job, result: object) -> list[Job]:
        taken.set()
        results.append(result)
        return []

    results: list[object] = []
    serve([Job("a", 1.0, n_results=2)], run, take)
    assert results == [1, 2]


@pytest.mark.parametrize(("given", "said"), [(0, 1), (1, 2), (2, 1)])
def test_another_number_of_results_than_said_is_a_bug(given: int, said: int) -> None:
    with pytest.raises(ValueError, match=f"not {said} results"):
        serve([Job("a", 1.0, n_results=said)], lambda _: range(given))


def test_no_tasks() -> None:
    serve([], lambda job: [job])


def test_what_tasks_take_is_learnt() -> None:
    def run(job: Job) -> Iterator[object]:
        for seconds in (0.05, 0.15):
            time.sleep(seconds)
            yield None

    assert 0.2 <= serve([Job("a", 1.0, n_results=2)], run).measured("job") < 0.6


def test_an_exception_in_a_task_is_raised() -> None:
    def fail(job: Job) -> Iterator[object]:
        yield "a result"
        raise ZeroDivisionError(job.name)

    with pytest.raises(ZeroDivisionError, match="a"):
        serve([Job("a", 1.0, n_results=2)], fail)


@pytest.mark.parametrize(
    ("environment", "size", "rank"),
    [
        ({}, 0, 0),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, 4, 3),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, 2, 1),
        ({"SLURM_NTASKS": "8", "SLURM_PROCID": "0"}, 0, 0),
        ({"SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "5"}, 8, 5),
        ({"PMI_SIZE": "two"}, 0, 0),
    ],
)
def test_what_the_launcher_says(environment: dict[str, str], size: int, rank: int) -> None:
    assert (launcher_size(environment), launcher_rank(environment)) == (size, rank)


def test_without_a_launcher_a_process_is_alone() -> None:
    assert isinstance(start_ranks(), Alone)


def test_several_processes_without_mpi_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PMI_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    with pytest.raises(LauncherError, match="2 processes were started that cannot talk"):
        start_ranks()


def test_one_process_of_a_launcher_needs_no_mpi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PMI_SIZE", "1")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    assert isinstance(start_ranks(), Alone)
