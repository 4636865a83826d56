"""The default study on one rank and on two: time, the ratio, and the peak memory of a rank.

    python -m tests.benchmarks.ranks [STUDY] [--set KEY=VALUE ...]

Arguments go to `run-study`. The runs take turns, after one that fills the caches: the ratio is one of this machine now.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MPIEXEC = Path(sys.executable).with_name("mpiexec")
RUN_STUDY = Path(sys.executable).with_name("run-study")
REPEATS = 2


def run(n_ranks: int, arguments: list[str], folder: Path) -> float:
    """Wall time of one run, s."""
    command = [str(MPIEXEC), "-n", str(n_ranks), str(RUN_STUDY), *arguments, "--fresh", "-o", str(folder / "out.nc")]
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - started


def compare(arguments: list[str], folder: Path) -> None:
    """Runs a study and prints its row of the table."""
    first = run(2, arguments, folder)
    print(f"first run on two ranks: {first:.0f} s (with compilation, if caches were cold)")
    times: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(REPEATS):
        for n_ranks, spent in times.items():
            spent.append(run(n_ranks, arguments, folder))
    best = {n_ranks: min(spent) for n_ranks, spent in times.items()}
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"one rank {best[1]:.1f} s, two ranks {best[2]:.1f} s: {best[2] / best[1]:.2f} of the time (0.52)")
    print(f"largest memory of a rank: {peak:.0f} MiB")


def main() -> None:
    """Prints the table."""
    with tempfile.TemporaryDirectory() as name:
        compare(sys.argv[1:], Path(name))


if __name__ == "__main__":
    main()
