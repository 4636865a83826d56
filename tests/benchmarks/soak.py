"""Random kills of ranks and launchers, and whether every study still ends with the same result.

    python -m tests.benchmarks.soak [COUNT [SEED]]

Each trial is a study of the stand-in for the solver that is killed at some time, one in four of them twice, and then
goes on to its end, on another number of ranks. The trial of a seed can be repeated. The tests do a few of these.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import xarray as xr

from tests.mpi.launching import results, run_to_end
from tests.mpi.test_kills import AT_ONCE, FAKED_STUDY, kill_and_go_on


def soak(count: int, seed: int, folder: Path) -> tuple[int, int, list[str]]:
    """Trials with an identical result, kills, and a line for each of the others."""
    study = FAKED_STUDY
    assert run_to_end(0, [*study.arguments, "-o", "whole.nc"], folder, study.environment).status == 0
    expected = results(folder / "whole.nc")
    same, n_kills, wrong = 0, 0, []
    for first in range(seed, seed + count, AT_ONCE):
        seeds = range(first, min(first + AT_ONCE, seed + count))
        with ThreadPoolExecutor(AT_ONCE) as pool:
            found = list(pool.map(lambda one: kill_and_go_on(study, folder / str(one), one), seeds))
        # netCDF does not like threads: the files are opened here
        for one, how in zip(seeds, found, strict=True):
            if how.startswith("killed") and _is_same(folder / str(one) / "out.nc", expected):
                same += 1
                n_kills += int(how.split()[1])
            else:
                wrong.append(f"seed {one}: {how}")
            shutil.rmtree(folder / str(one))
    return same, n_kills, wrong


def _is_same(path: Path, expected: xr.Dataset) -> bool:
    return results(path).identical(expected)


def main() -> int:
    """Prints what came of it; 1 where a result is another one."""
    count, seed = (int(sys.argv[place]) if len(sys.argv) > place else default for place, default in ((1, 1000), (2, 0)))
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        same, n_kills, wrong = soak(count, seed, Path(name))
    print(f"{same} of {count} identical after {n_kills} kills, {time.monotonic() - began:.0f} s", *wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
