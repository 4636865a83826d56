"""Records what the tasks of bundled studies take, for the replay in tests.benchmarks.scheduling.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.record_costs > tests/benchmarks/dovetail_costs.csv
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.record_costs samples > tests/benchmarks/scatter_costs.csv

`dovetail`: a sweep along 100 frequencies, and two histories from every fourth of them. A line of the table: frequency
(Hz), wear coefficient (1/Pa; 0 for the start state), CPU seconds, unknowns of the start state with the harmonics that
it took, and whether anything moves there. `scatter`: a line for each sample, with the CPU seconds of its start state
and of its history. A few minutes on one core each.
"""

import sys
import time

from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult, Task
from studyrunner.scene.drawn_contacts import contact_changes
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import read_study

STUDY = (
    "axes.frequency={start = 209.5, stop = 213.5, num = 100}",
    "axes.wear_coefficient=[3e-12, 3e-11]",
    "axes.scheme=implicit",
)
EVERY = 4


def record_line() -> None:
    """Prints the table of the study `dovetail` as comma-separated values."""
    study = read_study("dovetail", STUDY)
    model = build_study_scene(study)
    plan = build_tasks(study, describe_scene(model).n_displacements)
    models = {0: model}
    next(iter(plan.sweeps[0].compute(models, _forget)))  # compiles
    print("frequency,wear_coefficient,seconds,n_unknowns,moves")
    (sweep,) = plan.sweeps
    began = time.thread_time()
    for started in sweep.compute(models, _forget):
        spent = time.thread_time() - began
        assert isinstance(started, StartResult)
        place, kind = f"{sweep.frequencies[started.place]:.4f}", f"{started.n_unknowns},{int(started.moves)}"
        print(f"{place},0,{spent:.4f},{kind}")
        for planned in plan.waiting[0, started.place] if started.place % EVERY == 0 else ():
            history = planned.from_start(started)
            began = time.thread_time()
            list(history.compute(models, _forget))
            print(f"{place},{history.wear_coefficient:g},{time.thread_time() - began:.4f},{kind}")
        sys.stdout.flush()
        began = time.thread_time()


def record_samples() -> None:
    """Prints the table of the study `scatter` as comma-separated values."""
    study = read_study("scatter")
    model, scenes = build_study_scene(study), find_scenes(study)
    facts = describe_scene(model)
    plan = build_tasks(study, facts.n_displacements, contact_changes(study, scenes, [facts]), scenes)
    models = {0: model}
    next(iter(plan.sweeps[0].compute(models, _forget)))  # compiles

    def timed(task: Task) -> tuple[object, float]:
        began = time.thread_time()
        (result,) = task.compute(models, _forget)
        return result, time.thread_time() - began

    print("start_seconds,n_unknowns,moves,seconds")
    for sweep in plan.sweeps:
        started, spent = timed(sweep)
        assert isinstance(started, StartResult)
        (planned,) = plan.waiting[sweep.number, 0]
        _, seconds = timed(planned.from_start(started))
        print(f"{spent:.3f},{started.n_unknowns},{int(started.moves)},{seconds:.3f}", flush=True)


def _forget(_: object) -> None:
    """Takes the progress of a task."""


if __name__ == "__main__":
    record_samples() if sys.argv[1:] == ["samples"] else record_line()
