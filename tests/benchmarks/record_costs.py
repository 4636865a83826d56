"""Records what the tasks of the bundled dovetail study take, for the replay in tests.benchmarks.scheduling.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.record_costs > tests/benchmarks/dovetail_costs.csv

A branch along 100 frequencies, and two marches from every fourth of them. A few minutes on one core. A line of the
table: frequency (Hz), wear coefficient (1/Pa; 0 for the start state), CPU seconds, unknowns of the start state with the
harmonics that it took, and whether anything moves there.
"""

from __future__ import annotations

import sys
import time

from studyrunner.evaluate import build_evaluator
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import StartResult
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import start_marches

STUDY = (
    "axes.frequency={start = 209.5, stop = 213.5, num = 100}",
    "axes.wear_coefficient=[3e-12, 3e-11]",
    "axes.scheme=implicit",
)
EVERY = 4


def main() -> None:
    """Prints the table as comma-separated values."""
    study = read_study("dovetail", STUDY)
    model = build_study_scene(study)
    plan = build_tasks(study, describe_scene(model).n_displacements)
    evaluate = build_evaluator(model)
    next(iter(evaluate(plan.branches[0])))  # compiles
    print("frequency,wear_coefficient,seconds,n_unknowns,moves")
    (branch,) = plan.branches
    began = time.thread_time()
    for started in evaluate(branch):
        spent = time.thread_time() - began
        assert isinstance(started, StartResult)
        place, kind = f"{branch.frequencies[started.position]:.4f}", f"{started.n_unknowns},{int(started.moves)}"
        print(f"{place},0,{spent:.4f},{kind}")
        planned = plan.marches_from(0, started.position) if started.position % EVERY == 0 else ()
        for march in start_marches(planned, started):
            began = time.thread_time()
            list(evaluate(march))
            print(f"{place},{march.wear_coefficient:g},{time.thread_time() - began:.4f},{kind}")
        sys.stdout.flush()
        began = time.thread_time()


if __name__ == "__main__":
    main()
