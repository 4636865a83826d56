"""run-study with a stand-in for the solver, to be started by the tests under mpiexec.

FAKE_SECONDS: longest time of a march; each rank then notes those that it took in a file.
FAKE_FAILURE: rank whose first march raises.
FAKE_PATIENCE: each branch stops after its first start state until a march from it is done; after this time it raises.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from studyrunner import run
from studyrunner.cli import main
from studyrunner.ranks import launcher_rank
from studyrunner.results import MarchResult, StartResult
from studyrunner.scene import describe_scene
from studyrunner.tasks import BranchTask, MarchTask
from tests.studyrunner.fakes import fake_branch, fake_evaluate

BULK = np.zeros(100_000)
"""Goes with every start state: larger than what MPI sends off at once."""


def build_fake(model: object, friction_coefficient: float) -> Callable[..., Iterator[StartResult | MarchResult]]:
    facts = describe_scene(model)
    seconds = float(os.environ.get("FAKE_SECONDS", "0.002"))
    failing = int(os.environ.get("FAKE_FAILURE", "-1"))

    def evaluate(task: BranchTask | MarchTask) -> Iterator[StartResult | MarchResult]:
        if isinstance(task, BranchTask):
            for started in fake_branch(task):
                yield replace(started, start=(started.start, BULK))
                if "FAKE_PATIENCE" in os.environ:
                    wait_for(Path(f"branch{task.number}.txt"), float(os.environ["FAKE_PATIENCE"]))
        else:
            yield from march(task)

    def march(task: MarchTask) -> Iterator[MarchResult]:
        if launcher_rank() == failing:
            raise ZeroDivisionError("a task that fails")
        assert isinstance(task.start, tuple)
        for result in fake_evaluate(replace(task, start=task.start[0]), facts, seconds):
            assert isinstance(result, MarchResult)
            if "FAKE_SECONDS" in os.environ:
                for name in (f"rank{launcher_rank()}.txt", f"branch{task.branch}.txt"):
                    with Path(name).open("a", encoding="utf-8") as file:
                        file.write(f"{result.run_time}\n")
            yield result

    return evaluate


def wait_for(file: Path, patience: float) -> None:
    """Returns when there is such a file; raises TimeoutError after a while."""
    latest = time.monotonic() + patience
    while not file.exists():
        if time.monotonic() > latest:
            raise TimeoutError(f"there is no {file}")
        time.sleep(0.01)


if __name__ == "__main__":
    run.build_evaluator = build_fake
    sys.exit(main())
