"""One run of a study: builds its scenes, does the tasks that are left, and writes the result file."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from solver.outcome import COMPLETE, Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex, record_type
from studyrunner.checkpoint.store import Store, StoreInUseError
from studyrunner.kinds.kind import build_tasks, describe_tasks
from studyrunner.kinds.task import Identity, digest
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import serve_tasks
from studyrunner.plan import doubts_of_study
from studyrunner.result.arrays import small_arrays
from studyrunner.result.provenance import compare_with_archived, describe_date, describe_run
from studyrunner.result.target import Target, identity_of
from studyrunner.scene.answers import remarks_of_study
from studyrunner.scene.pairs import contact_changes
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import merge_facts
from studyrunner.scene_building import Scenes, build_scenes
from studyrunner.study.study import Study
from studyrunner.system.files import remove_leftovers
from studyrunner.system.process import begin_ending, is_ending
from studyrunner.system.progress import ProgressDisplay, count
from studyrunner.task_runs import StudyRun, evaluator
from studyrunner.user_error import UserError, Verbatim, show_text


@dataclass(frozen=True)
class RunOptions:
    """What a run does with earlier results, and the date in the file, as `check_date` gives it; None for none.

    fresh: whether the run begins anew. retry_failed: whether failed points are computed again. again: what goes on
    after an end from outside, in words.
    """

    fresh: bool = False
    retry_failed: bool = False
    date: str | None = None
    again: str = "the same command"


def compute_study(
    ranks: Ranks,
    study: Study,
    target: Target,
    options: RunOptions,
    display: ProgressDisplay,
    say: Callable[[str], None],
    notes: Sequence[str] = (),
) -> Counter[int]:
    """Rank 0: computes a study together with the other ranks, writes its result, and counts the points of each outcome.

    target: as `check_result` gives it; a finished result is replaced by one without missing points only. display: what
    the user sees while the tasks are done, notes first. say: takes a line on what is done before: a wrong scene is bad
    input, which ends with one line. Raises UserError where a scene is wrong, or another run uses the file of the
    progress; StorageError where something cannot be written; KeyboardInterrupt where the run is ended from outside,
    with what is left in words, after finished points have been written.
    """
    with _open_progress(target) as store:
        scenes = build_scenes(ranks, study, store, say)
        facts = merge_facts(scenes.facts)
        attributes = {**describe_run(study, facts), **({} if scenes.kept is None else scenes.kept.origin)}
        attributes |= describe_date(options.date)
        completion = _open_completion(study, scenes, store, facts, options)
        with display:
            for line in (
                *notes,
                *(f"{show_text(study.source)}: {text}" for text in compare_with_archived(study, facts.digest)),
                *store.notes,
                *scenes.notes,
                *doubts_of_study(study, facts),
                *(f"{label}: {text}" for label, text in remarks_of_study(study)),
            ):
                display.say(line)
            if n_found := completion.n_points_finished:
                display.say(f"{n_found} of {count(completion.plan.n_points, 'point')} are there from an earlier run")

            def write() -> Counter[int]:
                # netCDF4 takes a moment to load: after the other ranks have got their last task
                from studyrunner.result.write import write_result

                store.flush()
                arrays = small_arrays(study, scenes.scenes, scenes.facts, scenes.variables)
                return write_result(study, facts, completion, target, arrays, attributes, scenes.kept)

            return _compute(ranks, StudyRun(completion, scenes.models, display), target, options.again, write)


def _compute(
    ranks: Ranks,
    run: StudyRun,
    target: Target,
    again: str,
    write: Callable[[], Counter[int]],
) -> Counter[int]:
    """Has the tasks done that are left and writes the result, also where the run is ended from outside."""
    try:
        if run.tasks:
            run.display.say(f"computing {describe_tasks(run.tasks)}")
        serve_tasks(ranks, run, evaluator(), run.costs)
        run.display.say("writing the result")
        # a signal that comes now finds a result that is about to be whole
        begin_ending()
        outcomes = write()
    except BaseException as error:
        if not is_ending(error):
            raise
        begin_ending()
        outcomes = write()
        if n_left := outcomes[Outcome.NOT_COMPUTED]:
            name, n_points = target.path.name, outcomes.total()
            done = f"{n_points - n_left} of {count(n_points, 'point')}"
            kept = f"{done} are kept, {name} is the finished result that it was" if target.finished else ""
            raise KeyboardInterrupt(f"interrupted: {kept or f'{name} holds {done}'}, {again} goes on") from None
    return outcomes


@contextlib.contextmanager
def _open_progress(target: Target) -> Iterator[Store]:
    """The file of the progress beside a result, open for a run: before the scene is built, which may be in the file."""
    path = target.progress
    try:
        store = Store(path)
    except StoreInUseError as error:
        remedy = "wait for its end, or give another result file with -o; where no run is at work the disk has no locks"
        raise UserError(str(path), "in use", Verbatim(f"by {error}"), remedy) from None
    with contextlib.closing(store):
        remove_leftovers(path)
        remove_leftovers(target.path)
        try:
            yield store
        finally:
            with contextlib.suppress(OSError):
                # what the ranks have mapped
                remove_leftovers(path)


def _open_completion(
    study: Study, scenes: Scenes, store: Store, facts: SceneFacts, options: RunOptions
) -> CompletionIndex:
    """The tasks of a study, and what of them is finished and wanted. facts: of all scenes."""
    contacts = contact_changes(study, scenes.scenes, scenes.facts)
    plan = build_tasks(study, [each.n_displacements for each in scenes.facts], contacts, scenes.scenes)
    kind = record_type(study, facts)
    identity = Identity(tuple(each.digest for each in scenes.facts), digest(repr(kind.descr)))
    completion = CompletionIndex(plan, identity, store, kind)
    store.note_study(identity_of(study.study.name, study.scene.model))
    if options.fresh:
        completion.forget_all()
    if options.retry_failed:
        completion.forget_failed(COMPLETE)
    completion.give_up_crashed()
    store.flush()
    return completion
