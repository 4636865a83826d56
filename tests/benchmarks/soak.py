"""Random kills of ranks and launchers: whether every study still ends with the same result, and what the kills cost.

    python -m tests.benchmarks.soak [COUNT [SEED]]

Each trial is a study of the stand-in for the solver that is killed at some time, one in four of them twice, and then
goes on to its end, on another number of ranks; one in eight goes on for so long that what it loses may be old, and one
in eight is computed by the solver itself. The stand-in notes when it has finished something: what it notes again after
a kill was lost with it. The trial of a seed can be repeated. `tests/mpi/test_kills.py` does a few of these.
"""

import shutil
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.mpi.launching import results, run_to_end
from tests.mpi.losses import PROMISED, ages_of_losses
from tests.mpi.test_kills import AT_ONCE, FAKED_STUDY, LONG_STUDY, REAL_STUDY, Disturbed, kill_and_go_on

_EVERY = 8


def _study_of(seed: int) -> Disturbed:
    return {_EVERY - 1: LONG_STUDY, _EVERY - 2: REAL_STUDY}.get(seed % _EVERY, FAKED_STUDY)


def soak(count: int, seed: int, folder: Path) -> int:
    """So many trials, with seeds from this one on; 1 where a result is another one, or too much was lost."""
    expected = {}
    for number, study in enumerate((FAKED_STUDY, LONG_STUDY, REAL_STUDY)):
        arguments = [*study.arguments, "-o", f"whole{number}.nc"]
        assert run_to_end(0, arguments, folder, {**study.environment, "FAKE_SECONDS": "0"}).status == 0
        expected[study.arguments] = results(folder / arguments[-1])
    same, n_kills, ages = 0, 0, []
    for first in range(seed, seed + count, AT_ONCE):
        seeds = range(first, min(first + AT_ONCE, seed + count))
        with ThreadPoolExecutor(AT_ONCE) as pool:
            found = list(pool.map(lambda one: kill_and_go_on(_study_of(one), folder / str(one), one), seeds))
        # netCDF does not like threads: the files are opened here
        for one, how in zip(seeds, found, strict=True):
            path = folder / str(one)
            if how.startswith("killed") and results(path / "out.nc").identical(expected[_study_of(one).arguments]):
                same += 1
                n_kills += int(how.split()[1])
            else:
                print(f"seed {one}: {how}")
            ages += ages_of_losses(path)
            shutil.rmtree(path)
    oldest = max(ages, default=0.0)
    print(f"{same} of {count} identical after {n_kills} kills; {len(ages)} steps and results were done again, finished")
    print(f"{oldest:.1f} s before the kill at most, {PROMISED:g} s are promised")
    return int(same < count or oldest > PROMISED)


def main() -> int:
    """Prints what came of it."""
    count, seed = (int(sys.argv[place]) if len(sys.argv) > place else default for place, default in ((1, 1000), (2, 0)))
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        status = soak(count, seed, Path(name))
    print(f"{time.monotonic() - began:.0f} s")
    return status


if __name__ == "__main__":
    sys.exit(main())
