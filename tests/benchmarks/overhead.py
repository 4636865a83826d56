"""What a point costs beyond its computing: a study of trivial points, the time and the memory of rank 0.

    python -m tests.benchmarks.overhead [--points 10000] [--written 1000000]

Tasks give made-up results at once. In one process, all of it runs in turn: the time is that of rank 0, of the ranks
that compute and of the disk together. Under mpiexec with 4 ranks it is shared with the other ranks, which take turns on
the cores of this machine. Wanted: at most 0.5 ms of the processor of rank 0 of 4, and 0.01 MiB, a point.

With --written the results of so many points are there, and a run alone writes them: wanted are 1000 MiB for a million.
"""

import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from solver.packing import Packed
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.store import RESULTS, Store
from studyrunner.plan import build_tasks
from studyrunner.scene.scene_set import merge_facts, plan_scenes
from studyrunner.study.study_file import read_study
from tests.benchmarks.frame import Table, arguments
from tests.mpi.launching import FAKED, options, run_to_end

FREQUENCIES = 10


@dataclass(frozen=True)
class Spent:
    """Wall seconds of a whole run, and the time and largest memory of rank 0: seconds of its processor, MiB."""

    seconds: float
    of_rank_0: float
    memory: float


def changes(n_points: int, outputs: int) -> tuple[str, ...]:
    """What makes a study of trivial points of the slider. outputs: cycle counts at which a point has results."""
    return (
        f"axes.frequency={{start = 100, stop = 200, num = {FREQUENCIES}}}",
        f"axes.wear_coefficient={{start = 1e-12, stop = 1e-11, num = {n_points // FREQUENCIES}}}",
        "axes.scheme=implicit",
        f"slow_time.outputs={outputs}",
        "outputs.variables=['worn_volume']",
        "solver.shortcuts=false",
    )


def run(n_ranks: int, n_points: int, folder: Path, name: str = "out.nc", outputs: int = 11) -> Spent:
    """A study of trivial points from its start to its end."""
    study = [FAKED, "sdof_slider", *options(*changes(n_points, outputs)), "-o", name]
    began = time.perf_counter()
    ended = run_to_end(n_ranks, study, folder, {"FAKE_NOTHING": "1"})
    assert ended.status == 0, ended.said
    ((memory, of_rank_0),) = re.findall(r"rank 0: (\d+) KiB, (\S+) s", ended.said)
    return Spent(time.perf_counter() - began, float(of_rank_0), int(memory) / 1024)


def fill(n_points: int, path: Path, outputs: int = 11) -> None:
    """The file of a run that has computed all points of a study, which have equal results."""
    study = read_study("sdof_slider", changes(n_points, outputs))
    scenes, facts, _ = plan_scenes(study, print)
    store = Store(path)
    plan = build_tasks(study, scenes, facts)
    completion = CompletionIndex(study, plan, merge_facts(facts), [each.digest for each in facts], store)
    record = Packed("", (completion.read_results(["none"])[0].view("u1"),))
    for task in completion.plan.make():
        for name in task.names:
            store.put(RESULTS, name, record)
    store.close()


def main() -> None:
    given = arguments(__doc__, points=10_000, written=0)
    if given.written:
        table = Table("written points", "seconds", "s of rank 0", "MiB")
        with tempfile.TemporaryDirectory() as name:
            fill(given.written, Path(name, "out.nc.progress"))
            spent = run(0, given.written, Path(name))
        table.row(str(given.written), spent.seconds, spent.of_rank_0, spent.memory)
        return
    n_points = given.points
    table = Table("per point", "ms", "ms of rank 0", "MiB in all")
    with tempfile.TemporaryDirectory() as name:
        for n_ranks in (0, 4):
            # beyond what a study of few points does
            few, many = (run(n_ranks, n, Path(name), f"{n_ranks} {n}.nc") for n in (FREQUENCIES, n_points))
            spent = (1e3 * (getattr(many, key) - getattr(few, key)) / n_points for key in ("seconds", "of_rank_0"))
            table.row(f"{n_ranks} ranks" if n_ranks else "one process", *spent, many.memory - few.memory)


if __name__ == "__main__":
    main()
