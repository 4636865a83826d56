"""Random kills of ranks and launchers: whether every study still ends with the same result, and what the kills cost.

    python -m tests.benchmarks.soak [--count 1000] [--seed 0]

Each trial is a study of the stand-in for the solver that is killed at some time, and then goes on to its end, on
another number of ranks; one in eight goes on for so long that what it loses may be old, and one in eight is computed by
the solver itself. The stand-in notes when it has finished something: what it notes again after a kill was lost with it.
The trial of a seed can be repeated. `tests/mpi/test_kills.py` does a few of these.
"""

import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from studyrunner.mpi.schedule import SECONDS_TO_PROGRESS
from tests.benchmarks.frame import arguments
from tests.mpi.launching import options, results, run_to_end
from tests.mpi.test_kills import AT_ONCE, FAKED_STUDY, PROMISED, SHORT_STUDY, Disturbed, ages_of_losses, kill_and_go_on

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
STUDIES = (*6 * (FAKED_STUDY,), REAL_STUDY, LONG_STUDY)


def main() -> None:
    """Prints the trials whose result is another one, and what was lost."""
    given, expected, ages, n_same = arguments(__doc__, count=1000, seed=0), {}, [], 0
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
            for (study, path, seed), end in zip(trials, found, strict=True):
                if end.status == 0 and results(path / "out.nc").identical(expected[study.arguments]):
                    n_same += 1
                else:
                    print(f"seed {seed}: status {end.status}: {end.said}", flush=True)
                ages += ages_of_losses(path)
                shutil.rmtree(path)
    print(f"{n_same} identical after a kill each; {len(ages)} steps and results were done again, finished")
    print(f"{max(ages, default=0.0):.1f} s before the kill at most, {PROMISED:g} s are promised")


if __name__ == "__main__":
    main()
