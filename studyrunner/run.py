"""One run of a study: builds its scenes, does the tasks that are left, and writes the result file."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from solver.outcome import COMPLETE, Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.records import record_type
from studyrunner.checkpoint.store import Store, StoreInUseError
from studyrunner.coordinates import COORDINATES, STUCK_FREQUENCY
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import Identity, digest
from studyrunner.mpi.ranks import Ranks
from studyrunner.plan import doubts_of_study
from studyrunner.result.arrays import SmallArray, coordinates, scene_arrays
from studyrunner.result.creation_date import describe_date
from studyrunner.result.existing_result import Label, Target
from studyrunner.result.paths import older_folder, progress_file, remove_leftovers
from studyrunner.result.provenance import compare_with_archived, describe_run
from studyrunner.result.sample_coordinates import sample_coordinates, worn_coordinate
from studyrunner.result.software import describe_software
from studyrunner.scene.answers import remarks_of_study
from studyrunner.scene.pairs import contact_changes
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import frequencies_of_ratios, merge_facts, pair_arrays, stuck_frequencies_of
from studyrunner.scene_building import Scenes, build_scenes
from studyrunner.study.study import Study
from studyrunner.system.endings import begin_ending, is_ending
from studyrunner.system.progress import ProgressDisplay, count
from studyrunner.task_runs import StudyRun, run_tasks
from studyrunner.user_error import UserError, Verbatim, show_text


class Interrupted(KeyboardInterrupt):
    """A run was ended from outside; the result file holds the points computed so far. summary: state of the run."""

    def __init__(self, summary: RunSummary) -> None:
        super().__init__(summary)
        self.summary = summary


@dataclass(frozen=True)
class RunSummary:
    """Summary of a run.

    n_points: of the study. n_complete: computed to the end. n_left: not computed yet. written: whether the file was
    written; else a finished result was kept.
    """

    n_points: int
    n_complete: int
    n_left: int
    written: bool

    def describe_end(self, path: object, again: str) -> str:
        """What an end from outside leaves. path: of the result. again: what goes on from there, in words."""
        done = f"{self.n_points - self.n_left} of {self.n_points} points"
        left = f"{path} holds {done}" if self.written else f"{done} are kept, {path} is the finished result that it was"
        return f"interrupted: {left}, {again} goes on"


@dataclass(frozen=True)
class RunOptions:
    """What a run does with earlier results, and the date in the file.

    fresh: whether the run begins anew. Else the run continues what an earlier one has left.
    retry_failed: whether failed points are computed again.
    date: date of creation, as `check_date` gives it; None for no date in the file.
    """

    fresh: bool = False
    retry_failed: bool = False
    date: str | None = None


def compute_study(
    ranks: Ranks,
    study: Study,
    target: Target,
    options: RunOptions,
    display: ProgressDisplay,
    say: Callable[[str], None],
    notes: Sequence[str] = (),
) -> RunSummary:
    """Rank 0: computes a study together with the other ranks and writes the file `target.path`.

    A finished result at this path is replaced by a result without missing points only.

    Parameters
    ----------
    ranks, study
        The ranks, and the study that they compute.
    target
        The result file, as `check_result` gives it.
    options
        What is done with earlier results.
    display
        What the user sees while the tasks are done.
    say
        Takes a line on what is done before: a wrong scene is bad input, which ends with one line.
    notes
        Lines for the user.

    Raises
    ------
    UserError
        Where a scene is wrong, or another run uses the file of the progress.
    StorageError
        Where something cannot be written.
    Interrupted
        Where the run is ended from outside; finished points have been written.
    """
    with _open_progress(target) as store:
        scenes = build_scenes(ranks, study, store, say)
        facts = merge_facts(scenes.facts)
        completion = _completion_of(study, scenes, store, facts)
        with display:
            for note in (
                *notes,
                *(f"{show_text(study.source)}: {line}" for line in compare_with_archived(study, facts.digest)),
                *store.notes,
                *_older(target),
                *scenes.notes,
                *doubts_of_study(study, facts),
                *(f"{label}: {text}" for label, text in remarks_of_study(study)),
            ):
                display.note(note)
            return _serve(ranks, study, scenes, completion, target, options, display)


def _serve(
    ranks: Ranks,
    study: Study,
    scenes: Scenes,
    completion: CompletionIndex,
    target: Target,
    options: RunOptions,
    display: ProgressDisplay,
) -> RunSummary:
    # the software is described when the run begins: a checkout may have changed at the end of the run
    origin = {**describe_software(), **describe_date(options.date)}

    def write() -> RunSummary:
        return _write(study, scenes, completion, target, origin)

    label = Label.of(study)
    completion.store.note_study(label.name, label.model)
    if options.fresh:
        completion.forget_all()
    if options.retry_failed:
        completion.forget_failed(COMPLETE)
    completion.give_up_crashed()
    completion.store.flush()
    if n_found := completion.n_points_finished:
        display.say(f"{n_found} of {count(completion.plan.n_points, 'point')} are there from an earlier run")
    try:
        run_tasks(ranks, study, StudyRun(completion, scenes, display), display)
        display.say("writing the result")
        summary = write()
    except BaseException as error:
        if not is_ending(error):
            raise
        begin_ending()
        raise Interrupted(write()) from None
    if summary.n_left == 0:
        completion.prune()
    return summary


@contextlib.contextmanager
def _open_progress(target: Target) -> Iterator[Store]:
    """The file of the progress beside a result, open for a run: before the scene is built, which may be in the file."""
    path = progress_file(target.path)
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


def _completion_of(study: Study, scenes: Scenes, store: Store, facts: SceneFacts) -> CompletionIndex:
    """The tasks of a study, and what of them is finished. facts: of all scenes."""
    contacts = contact_changes(study, scenes.scenes, scenes.facts)
    plan = build_tasks(study, [each.n_displacements for each in scenes.facts], contacts, scenes.scenes)
    kind = record_type(study, facts)
    identity = Identity(tuple(each.digest for each in scenes.facts), digest(repr(kind.descr)))
    return CompletionIndex(plan, identity, store, kind)


def _write(
    study: Study, scenes: Scenes, completion: CompletionIndex, target: Target, origin: dict[str, str]
) -> RunSummary:
    """Writes the result file from the finished points. origin: attributes on program and date."""
    # netCDF4 takes a moment to load: on rank 0 only, and after the other ranks have got their last task.
    from studyrunner.result.write import write_result

    completion.store.flush()
    facts, kept, finished = merge_facts(scenes.facts), scenes.kept, target.finished
    attributes = {**describe_run(study, facts), **({} if kept is None else kept.origin), **origin}
    arrays = _arrays(study, scenes, facts)
    outcomes = write_result(study, facts, completion, target.path, arrays, attributes, kept, keep_finished=finished)
    left = outcomes[Outcome.NOT_COMPUTED]
    n_complete = sum(outcomes[number] for number in COMPLETE)
    return RunSummary(completion.plan.n_points, n_complete, left, written=not (finished and left))


def _arrays(study: Study, scenes: Scenes, facts: SceneFacts) -> list[SmallArray]:
    """Coordinates of the file, and its variables that no task computes. facts: of all scenes."""
    stuck = stuck_frequencies_of(study, scenes.facts, scenes.scenes)
    hertz = frequencies_of_ratios(study, scenes.facts, scenes.scenes)
    return [
        *([] if hertz is None else [SmallArray("frequency", *hertz, COORDINATES["frequency"])]),
        *coordinates(study, facts, pair_arrays(study, scenes.facts, scenes.scenes)),
        SmallArray("stuck_frequency", *stuck, STUCK_FREQUENCY),
        *worn_coordinate(study, scenes.facts),
        *sample_coordinates(study, scenes.facts, scenes.scenes),
        *scene_arrays(study, scenes.variables),
    ]


def _older(target: Target) -> list[str]:
    """A sentence where a folder of an earlier version stands beside a result."""
    folder = older_folder(target.path)
    if not folder.is_dir():
        return []
    return [f"{folder.name} is of version 0.4.0 or before: it is neither used nor changed, and may be removed"]
