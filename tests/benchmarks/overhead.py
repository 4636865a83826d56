"""What a point costs beyond its computing: a study of trivial points, the time and the memory of rank 0.

Ends with 1 where a point takes rank 0 of 4 more than 0.5 ms of its processor, or 0.01 MiB. On a slow machine the
limit is as many times higher as a fixed piece of work in Python takes longer there.

    python -m tests.benchmarks.overhead [--points 10000]

Tasks give made-up results at once. In one process, all of it runs in turn: the time is that of rank 0, of the ranks
that compute and of the disk together. Under mpiexec with 4 ranks it is shared with the other ranks, which take turns on
the cores of this machine.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.frame import Table, arguments
from tests.mpi.launching import FAKED, ROOT, launcher

FREQUENCIES = 10
MILLISECONDS, MEMORY = 0.5, 1e-2
"""Most that a point may take of rank 0: of its processor where `UNIT` is right, and in MiB."""
UNIT = 14.0
"""Milliseconds that the loop in `unit` takes where the limit was found."""


@dataclass(frozen=True)
class Spent:
    """Wall seconds of a whole run, and the time and largest memory of rank 0: seconds of its processor, MiB."""

    seconds: float
    of_rank_0: float
    memory: float


def run(n_ranks: int, n_points: int, folder: Path, name: str = "out.nc", outputs: int = 11) -> Spent:
    """A study of trivial points from its start to its end. outputs: cycle counts at which a point has results."""
    changes = (
        f"axes.frequency={{start = 100, stop = 200, num = {FREQUENCIES}}}",
        f"axes.wear_coefficient={{start = 1e-12, stop = 1e-11, num = {n_points // FREQUENCIES}}}",
        "axes.scheme=implicit",
        f"slow_time.outputs={outputs}",
        "outputs.variables=['worn_volume']",
        "solver.shortcuts=false",
    )
    command = [*launcher(n_ranks), sys.executable, FAKED, "sdof_slider", *(f"--set={change}" for change in changes)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "FAKE_NOTHING": "1"}
    began = time.perf_counter()
    done = subprocess.run(
        [*command, "-o", name], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    seconds = time.perf_counter() - began
    ((memory, of_rank_0),) = re.findall(r"rank 0: (\d+) KiB, (\S+) s", done.stderr)
    return Spent(seconds, float(of_rank_0), int(memory) / 1024)


def unit() -> float:
    """Milliseconds of this processor for a fixed piece of work in Python, the least of some tries."""
    tries = []
    for _ in range(7):
        began, texts = time.thread_time(), {}
        for number in range(100_000):
            texts[number & 1023] = str(number)
        tries.append(1e3 * (time.thread_time() - began))
    return min(tries)


def main() -> int:
    """Prints a row for one process and one for 4 ranks; 1 where the 4 ranks take more than the limits."""
    n_points = arguments(__doc__, points=10_000).points
    table = Table("per point", "ms", "ms of rank 0", "MiB in all")
    with tempfile.TemporaryDirectory() as name:
        for n_ranks in (0, 4):
            # beyond what a study of few points does
            few, many = (run(n_ranks, n, Path(name), f"{n_ranks} {n}.nc") for n in (FREQUENCIES, n_points))
            seconds, of_rank_0 = (
                1e3 * (getattr(many, key) - getattr(few, key)) / n_points for key in ("seconds", "of_rank_0")
            )
            table.row(f"{n_ranks} ranks" if n_ranks else "one process", seconds, of_rank_0, many.memory - few.memory)
    slowness = max(1.0, unit() / UNIT)
    return int(of_rank_0 > MILLISECONDS * slowness or many.memory - few.memory > MEMORY * n_points)


if __name__ == "__main__":
    sys.exit(main())
