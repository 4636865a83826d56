"""Records what the tasks of bundled studies take, for the replay in tests.benchmarks.scheduling.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.record_costs dovetail > tests/benchmarks/dovetail_costs.csv
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.record_costs scatter > tests/benchmarks/scatter_costs.csv

`dovetail`: a sweep along 100 frequencies, and two histories from every fourth of them. A line of the table: frequency
(Hz), wear coefficient (1/Pa; 0 for the start state), CPU seconds, unknowns of the start state with the harmonics that
it took, and whether anything moves there. `scatter`: a line for each sample, with the CPU seconds of its start state
and of its history. A few minutes on one core each.
"""

import time

from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult
from studyrunner.scene.pairs import contact_changes
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import read_study
from tests.benchmarks.frame import arguments

STUDY = (
    "axes.frequency={start = 209.5, stop = 213.5, num = 100}",
    "axes.wear_coefficient=[3e-12, 3e-11]",
    "axes.scheme=implicit",
)
EVERY = 4


def record(name: str) -> None:
    """Prints the table of a study as comma-separated values."""
    study = read_study(name, STUDY if name == "dovetail" else ())
    model, scenes = build_study_scene(study), find_scenes(study)
    facts = describe_scene(model)
    plan = build_tasks(study, facts.n_displacements, contact_changes(study, scenes, [facts]), scenes)
    models = {0: model}
    next(iter(plan.sweeps[0].compute(models, _forget)))  # compiles
    samples = "start_seconds,n_unknowns,moves,seconds"
    print(samples if name == "scatter" else "frequency,wear_coefficient,seconds,n_unknowns,moves")
    for sweep in plan.sweeps:
        began = time.thread_time()
        for started in sweep.compute(models, _forget):
            first = time.thread_time() - began
            assert isinstance(started, StartResult)
            kind, frequency = f"{started.n_unknowns},{int(started.moves)}", sweep.frequencies[started.place]
            if name == "dovetail":
                print(f"{frequency:.4f},0,{first:.4f},{kind}", flush=True)
            for planned in plan.waiting[sweep.number, started.place] if started.place % EVERY == 0 else ():
                history = planned.from_start(started)
                began = time.thread_time()
                list(history.compute(models, _forget))
                spent = time.thread_time() - began
                each = f"{frequency:.4f},{history.wear_coefficient:g},{spent:.4f},{kind}"
                print(f"{first:.3f},{kind},{spent:.3f}" if name == "scatter" else each, flush=True)
            began = time.thread_time()


def _forget(_: object) -> None:
    """Takes the progress of a task."""


if __name__ == "__main__":
    for chosen in arguments(__doc__, ("dovetail", "scatter")).chosen:
        record(chosen)
