"""run-study with a stand-in for the solver, to be started by the tests under mpiexec.

FAKE_SECONDS: longest time of a task; each rank then notes those that it took in a file.
FAKE_FAILURE: rank whose first march raises.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from studyrunner import run
from studyrunner.cli import main
from studyrunner.ranks import launcher_rank
from studyrunner.results import BranchResult, MarchResult
from studyrunner.scene import describe_scene
from studyrunner.tasks import BranchTask, MarchTask
from tests.studyrunner.fakes import fake_evaluate


def build_fake(model: object, friction_coefficient: float) -> Callable[..., BranchResult | MarchResult]:
    facts = describe_scene(model)
    seconds = float(os.environ.get("FAKE_SECONDS", "0.002"))
    failing = int(os.environ.get("FAKE_FAILURE", "-1"))

    def evaluate(task: BranchTask | MarchTask) -> BranchResult | MarchResult:
        result = fake_evaluate(task, facts, seconds)
        if isinstance(result, BranchResult):
            return result
        if launcher_rank() == failing:
            raise ZeroDivisionError("a task that fails")
        if "FAKE_SECONDS" in os.environ:
            with Path(f"rank{launcher_rank()}.txt").open("a", encoding="utf-8") as file:
                file.write(f"{result.run_time}\n")
        return result

    return evaluate


if __name__ == "__main__":
    run.build_evaluator = build_fake
    sys.exit(main())
