"""run-study with a stand-in for the solver, to be started by the tests under mpiexec.

FAKE_SECONDS: longest time of a history.
FAKE_FAILURE: rank whose first history gives more results than it should: a bug, which raises. The histories of the
others wait for that.
FAKE_STEPS: every history takes as many steps of FAKE_SECONDS each and says after each how far it is; every start state
takes two. What was done when, and what was gone on from, is noted in a file.
FAKE_PROGRESS: a task says so often how far it is, s; 0.03 where it is not given.
FAKE_CRASH: what each history at the second frequency does instead: "segfault", "abort", or "memory": it gets none.
FAKE_NOTHING: tasks take no time at all; in the end rank 0 says how much memory and time it has taken.
"""

import ctypes
import os
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from solver.packing import Packed
from studyrunner.cli import main
from studyrunner.kinds.task import Keep, PointResult, Result, Task
from studyrunner.kinds.wear.histories import History, Sweep
from studyrunner.mpi import schedule
from studyrunner.mpi.ranks import launcher_rank
from studyrunner.scene.scene import SceneFacts, describe_scene
from tests.studyrunner.fakes import changed, fake_evaluate, fake_sweep

BULK = np.random.default_rng(0).random(0 if "FAKE_NOTHING" in os.environ else 100_000)
"""Goes with every start state: larger than what MPI sends off at once, and not smaller when it is compressed."""

DONE = "done.txt"
"""A line for each step and result that was finished, and each that was gone on from: time (s), what, task, number."""

PATIENCE = 200.0
"""Seconds: less than the tests have."""

FACTS: dict[int, tuple[object, SceneFacts]] = {}
"""Of models, by their identity: found once."""


def compute_fake(task: Task, models: Mapping[int, object], keep: Keep) -> Iterator[Result]:
    """Stands for `Task.compute`."""
    model = models[task.scenes[0]]
    if id(model) not in FACTS:
        FACTS[id(model)] = model, describe_scene(model)
    seconds = float(os.environ.get("FAKE_SECONDS", "0.0" if "FAKE_NOTHING" in os.environ else "0.002"))
    n_steps = int(os.environ.get("FAKE_STEPS", "0"))
    if isinstance(task, Sweep):
        yield from compute_sweep(task, n_steps, seconds, keep)
    else:
        assert isinstance(task, History)
        yield from compute_history(task, FACTS[id(model)][1], n_steps, seconds, keep)


def compute_sweep(task: Sweep, n_steps: int, seconds: float, keep: Keep) -> Iterator[Result]:
    left = list(task.places)
    for number, started in enumerate(fake_sweep(replace(task, skipped=frozenset()))):
        if not left:
            return
        if number < gone_on_from(task):
            continue
        if n_steps:
            time.sleep(2.0 * seconds)
            note("step", task, number)
        if started.place in left:
            left.remove(started.place)
            if n_steps:
                note("result", task, started.place)
            yield replace(started, start=replace(started.start, arrays=(*started.start.arrays, BULK)))
        if n_steps:
            keep(Packed("sweep", (np.array([number + 1.0]),)))


def compute_history(
    task: History, facts: SceneFacts, n_steps: int, seconds: float, keep: Keep
) -> Iterator[PointResult]:
    failing, crash = int(os.environ.get("FAKE_FAILURE", "-1")), os.environ.get("FAKE_CRASH", "")
    if task.position == 1 and crash == "memory":
        raise MemoryError
    if task.position == 1 and crash:
        # as a bug in compiled code would
        ctypes.string_at(0) if crash == "segfault" else os.abort()
    if launcher_rank() == failing:
        # not the task, but what is around it
        yield from fake_evaluate(task, facts=facts)
    elif failing >= 0:
        time.sleep(PATIENCE)
    carried = walk(task, n_steps, seconds, keep) if n_steps else 0.0
    for result in fake_evaluate(task, facts=facts, seconds=0.0 if n_steps else seconds):
        assert isinstance(result, PointResult)
        if n_steps:
            note("result", task, result.place)
        yield changed(result, error_estimate=carried)


def gone_on_from(task: Task) -> int:
    """Step that an earlier run has come to."""
    if task.resume is None:
        return 0
    note(f"resumed-{task.resume.text}", task, int(task.resume.arrays[0][0]))
    return int(task.resume.arrays[0][0])


def walk(task: History, n_steps: int, seconds: float, keep: Keep) -> float:
    """A number that depends on every bit of what is carried from step to step."""
    first = gone_on_from(task)
    carried = 0.1 + 0.01 * (task.number % 50) if task.resume is None else float(task.resume.arrays[0][1])
    for step in range(first, n_steps):
        carried = 3.99 * carried * (1.0 - carried)
        time.sleep(seconds)
        note("step", task, step)
        keep(Packed("history", (np.array([step + 1.0, carried]),)))
    return carried


def note(what: str, task: Task, number: int) -> None:
    """When a step or a result of a task was finished, before anybody hears of it."""
    with Path(DONE).open("a", encoding="ascii") as file:
        file.write(f"{time.time()} {what} {task.key} {number}\n")


def watch_memory(samples: list[int]) -> None:
    """Memory of this process, KiB, but for that of files, which are in memory as long as there is room only."""
    while True:
        (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("RssAnon")]
        samples.append(int(line.split()[1]))
        time.sleep(0.02)


if __name__ == "__main__":
    Sweep.compute = History.compute = compute_fake
    schedule.SECONDS_TO_PROGRESS = float(os.environ.get("FAKE_PROGRESS", "0.03"))
    samples: list[int] = []
    watched = "FAKE_NOTHING" in os.environ and launcher_rank() == 0
    if watched:
        threading.Thread(target=watch_memory, args=(samples,), daemon=True).start()
    status = main()
    if watched:
        print(f"rank 0: {max(samples)} KiB, {time.process_time()} s", file=sys.stderr)
    sys.exit(status)
