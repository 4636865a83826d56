"""One run of a study: builds its scenes, does the tasks that are left, and writes the result file."""

from collections import Counter
from collections.abc import Iterator

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.store import Store
from studyrunner.mpi.ranks import Ranks, job_size
from studyrunner.mpi.schedule import serve_tasks
from studyrunner.plan import build_tasks, doubts_of_study, effort_of
from studyrunner.result.arrays import small_arrays
from studyrunner.result.provenance import compare_with_archived, describe_run
from studyrunner.result.target import Target, identity_of
from studyrunner.scene.answers import description_of
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import merge_facts
from studyrunner.scene_building import Scenes, build_scenes
from studyrunner.study.study import Study
from studyrunner.system.machine import remove_leftovers
from studyrunner.system.process import begin_ending, is_ending
from studyrunner.system.progress import ProgressDisplay, count
from studyrunner.task_runs import StudyRun, evaluator
from studyrunner.user_error import show_text


def compute_study(
    ranks: Ranks,
    study: Study,
    target: Target,
    store: Store,
    display: ProgressDisplay,
    *,
    fresh: bool = False,
    retry_failed: bool = False,
    date: str | None = None,
) -> Counter[int]:
    """Rank 0: computes a study together with the other ranks, writes its result, and counts the points of each outcome.

    target: as `check_result` gives it; a finished result is replaced by one without missing points only. store: the
    open file of its progress: while it is open no other run writes the result. fresh: whether the run begins anew.
    retry_failed: whether failed points are computed again. date: of the result, see `check_date`.

    Raises UserError where a scene is wrong; StorageError where something cannot be written; KeyboardInterrupt where the
    run is ended from outside, with what is left in words, after finished points have been written.
    """
    remove_leftovers(target.path)
    scenes = build_scenes(ranks, study, store, display.step)
    facts = merge_facts(scenes.facts)
    attributes = describe_run(study, facts) | description_of(study)
    attributes |= {} if date is None else {"date_created": date}
    plan = build_tasks(study, scenes.scenes, scenes.facts)
    completion = CompletionIndex(study, plan, facts, [each.digest for each in scenes.facts], store)
    store.note_study(identity_of(study.study.name, study.scene.model))
    if fresh:
        completion.forget_all()
    completion.forget_damaged()
    if retry_failed:
        completion.forget_failed()
    completion.give_up_crashed()
    store.flush()

    def write() -> Counter[int]:
        # netCDF4 takes a moment to load: after the other ranks have got their last task
        from studyrunner.result.write import write_result

        # a signal that comes now finds a result that is about to be whole
        begin_ending()
        store.flush()
        arrays = small_arrays(study, scenes.scenes, scenes.facts, scenes.variables)
        return write_result(study, facts, completion, target, arrays, attributes, scenes.stored)

    with display:
        for line in _notes(ranks, study, scenes, store, facts):
            display.say(line)
        if target.old is not None:
            display.say(f"{target.path.name} has the result of other values, and is kept as {target.old.name}")
        run = StudyRun(completion, scenes.models, display, ranks.size)
        if run.n_points:
            display.say(f"from an earlier run: {run.n_points} of {count(plan.n_points, 'point')}")
        try:
            if run.tasks:
                display.say(f"computing {effort_of(study, (task.work for task in run.tasks)).words}")
            serve_tasks(ranks, run, evaluator())
            display.say("writing the result")
            return write()
        except BaseException as error:
            if not is_ending(error):
                raise
        outcomes = write()
        if n_left := outcomes[Outcome.NOT_COMPUTED]:
            name, done = target.path.name, f"{plan.n_points - n_left} of {count(plan.n_points, 'point')}"
            unchanged = f"{done} are kept, {name} is the finished result that it was" if target.finished else ""
            raise KeyboardInterrupt(f"interrupted: {unchanged or f'{name} holds {done}'}, the same command goes on")
        return outcomes


def _notes(ranks: Ranks, study: Study, scenes: Scenes, store: Store, facts: SceneFacts) -> Iterator[str]:
    """What the user should know before the tasks are done."""
    if ranks.size == 1 and (announced := job_size()) > 1:
        yield f"one process, although the job has room for {announced}: srun or mpiexec starts them"
    yield from (f"{show_text(study.source)}: {text}" for text in compare_with_archived(study, facts.digest))
    yield from (*store.notes, *scenes.notes, *doubts_of_study(study, facts))
    yield from (f"{label}: {text}" for label, text in study.scene.source.remarks())
