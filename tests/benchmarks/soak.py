"""Random kills of ranks and launchers: whether every study still ends with the same result, and what the kills cost.

    python -m tests.benchmarks.soak [COUNT [SEED]]

Each trial is a study of the stand-in for the solver that is killed at some time, and then goes on to its end, on
another number of ranks; one in eight goes on for so long that what it loses may be old, and one in eight is computed by
the solver itself. The stand-in notes when it has finished something: what it notes again after a kill was lost with it.
The trial of a seed can be repeated. `tests/mpi/test_kills.py` does a few of these.
"""

import shutil
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from studyrunner.mpi.schedule import SECONDS_TO_PROGRESS
from tests.mpi.launching import options, results, run_to_end
from tests.mpi.test_kills import AT_ONCE, FAKED_STUDY, PROMISED, SHORT_STUDY, Disturbed, ages_of_losses, kill_and_go_on

_EVERY = 8
LONG_STUDY = Disturbed(
    SHORT_STUDY.arguments,
    {"FAKE_STEPS": "25", "FAKE_SECONDS": "0.2", "FAKE_PROGRESS": str(SECONDS_TO_PROGRESS)},
    n_steps=2 + 25 * 6,
)
"""Goes on for 10 to 30 s, and says as often as any other how far its tasks are."""
REAL_STUDY = Disturbed(
    (
        *("-m", "studyrunner.cli", "sdof_slider"),
        *options("axes.frequency=[100, 160]", "axes.wear_coefficient=[5e-12, 1e-11]", "axes.step=100"),
        *options("axes.scheme=['implicit', 'adaptive']", "solver.harmonics=5", "solver.samples=64"),
    ),
    {},
    n_steps=0,
)


def _study_of(seed: int) -> Disturbed:
    return {_EVERY - 1: LONG_STUDY, _EVERY - 2: REAL_STUDY}.get(seed % _EVERY, FAKED_STUDY)


def soak(count: int, seed: int, folder: Path) -> int:
    """So many trials, with seeds from this one on; 1 where a result is another one, or too much was lost."""
    expected = {}
    for number, study in enumerate((FAKED_STUDY, LONG_STUDY, REAL_STUDY)):
        arguments = [*study.arguments, "-o", f"whole{number}.nc"]
        assert run_to_end(0, arguments, folder, {**study.environment, "FAKE_SECONDS": "0"}).status == 0
        expected[study.arguments] = results(folder / arguments[-1])
    same, ages = 0, []
    for first in range(seed, seed + count, AT_ONCE):
        seeds = range(first, min(first + AT_ONCE, seed + count))
        with ThreadPoolExecutor(AT_ONCE) as pool:
            found = list(pool.map(lambda one: kill_and_go_on(_study_of(one), folder / str(one), one), seeds))
        # netCDF does not like threads: the files are opened here
        for one, ended in zip(seeds, found, strict=True):
            path = folder / str(one)
            if ended.status == 0 and results(path / "out.nc").identical(expected[_study_of(one).arguments]):
                same += 1
            else:
                print(f"seed {one}: status {ended.status}: {ended.said}")
            ages += ages_of_losses(path)
            shutil.rmtree(path)
    oldest = max(ages, default=0.0)
    print(f"{same} of {count} identical after a kill each; {len(ages)} steps and results were done again, finished")
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
