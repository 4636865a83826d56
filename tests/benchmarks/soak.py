"""Random kills of ranks and launchers: whether every study still ends with the same result, and what the kills cost.

    python -m tests.benchmarks.soak [--count 1000] [--seed 0]

Each trial is a study of the stand-in for the solver that is killed at some time, one in four of them twice, and then
goes on to its end, on another number of ranks; one in eight goes on for so long that what it loses may be old, and one
in eight is computed by the solver itself. The stand-in notes when it has finished something: what it notes again after
a kill was lost with it. The trial of a seed can be repeated. `tests/mpi/test_kills.py` does a few of these.
"""

import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.benchmarks.frame import arguments
from tests.mpi.launching import results, run_to_end
from tests.mpi.losses import PROMISED, ages_of_losses
from tests.mpi.test_kills import AT_ONCE, FAKED_STUDY, LONG_STUDY, REAL_STUDY, kill_and_go_on

STUDIES = (*6 * (FAKED_STUDY,), REAL_STUDY, LONG_STUDY)


def main() -> None:
    """Prints the trials whose result is another one, and what was lost."""
    given, expected, ages, ended = arguments(__doc__, count=1000, seed=0), {}, [], []
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(AT_ONCE) as pool:
        folder = Path(name)
        for number, study in enumerate(STUDIES):
            if study.arguments not in expected:
                whole = [*study.arguments, "-o", f"whole{number}.nc"]
                assert run_to_end(0, whole, folder, {**study.environment, "FAKE_SECONDS": "0"}).status == 0
                expected[study.arguments] = results(folder / whole[-1])
        for first in range(given.seed, given.seed + given.count, AT_ONCE):
            seeds = range(first, first + AT_ONCE)
            trials = [(STUDIES[seed % len(STUDIES)], folder / str(seed), seed) for seed in seeds]
            found = list(pool.map(lambda trial: kill_and_go_on(*trial), trials))
            # netCDF does not like threads: the files are opened here
            for (study, path, seed), how in zip(trials, found, strict=True):
                if how.startswith("killed") and results(path / "out.nc").identical(expected[study.arguments]):
                    ended.append(int(how.split()[1]))
                else:
                    print(f"seed {seed}: {how}", flush=True)
                ages += ages_of_losses(path)
                shutil.rmtree(path)
    print(f"{len(ended)} identical after {sum(ended)} kills; {len(ages)} steps and results were done again, finished")
    print(f"{max(ages, default=0.0):.1f} s before the kill at most, {PROMISED:g} s are promised")


if __name__ == "__main__":
    main()
