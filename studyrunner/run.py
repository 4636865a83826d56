"""One run of a study: does the tasks that are left, and writes the result file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from solver.outcome import COMPLETE, Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.records import record_type
from studyrunner.checkpoint.store import Store, StoreInUseError
from studyrunner.coordinates import COORDINATES, STUCK_FREQUENCY
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import Identity, TaskPlan, digest
from studyrunner.mpi.ranks import Ranks
from studyrunner.plan.plausibility import doubts_of_study
from studyrunner.result.arrays import SmallArray, coordinates, scene_arrays
from studyrunner.result.creation_date import describe_date
from studyrunner.result.existing_result import Label, Target
from studyrunner.result.paths import older_folder, progress_file, remove_leftovers
from studyrunner.result.provenance import PACKAGES, describe_run
from studyrunner.result.sample_coordinates import sample_coordinates, worn_coordinate
from studyrunner.result.software import describe_software
from studyrunner.scene.check_command import remarks_of_study
from studyrunner.scene.drawn_contacts import contact_changes
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import frequencies_of_ratios, merge_facts, pair_arrays, stuck_frequencies_of
from studyrunner.scene_building import Scenes
from studyrunner.study.study import Study
from studyrunner.system.endings import begin_ending, is_ending
from studyrunner.system.progress import ProgressDisplay, count
from studyrunner.task_runs import StudyRun, run_tasks
from studyrunner.user_error import UserError, Verbatim


class Interrupted(KeyboardInterrupt):
    """A run was ended from outside; the result file holds the points computed so far. summary: state of the run."""

    def __init__(self, summary: RunSummary) -> None:
        super().__init__(summary)
        self.summary = summary


@dataclass(frozen=True)
class RunSummary:
    """Summary of a run.

    n_points: number of points of the study.
    n_complete: number of points computed to the end.
    n_left: number of points that are not computed yet.
    n_found: number of points that an earlier run has left.
    written: whether the file was written; else a finished result was kept.
    """

    n_points: int
    n_complete: int
    n_left: int
    n_found: int
    written: bool


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


@dataclass(frozen=True)
class _ResultWriter:
    """Writes the result file from the finished points.

    study, plan, facts: the study, its tasks, and facts of its scenes.
    scenes: the scenes.
    target: the file.
    software: attributes on the program.
    date: as in `RunOptions`.
    """

    study: Study
    plan: TaskPlan
    facts: SceneFacts
    scenes: Scenes
    target: Target
    software: Mapping[str, str]
    date: str | None

    def write(self, completion: CompletionIndex, n_found: int) -> RunSummary:
        """Writes the file. n_found: number of points that an earlier run has left."""
        # netCDF4 takes a moment to load: on rank 0 only, and after the other ranks have got their last task.
        from studyrunner.result.write import write_result

        completion.store.flush()
        kept = self.scenes.kept
        origin = {**describe_run(self.study, self.facts), **({} if kept is None else kept.origin)}
        origin |= {**self.software, **describe_date(self.date)}
        finished = self.target.finished
        outcomes = write_result(
            self.study, self.facts, completion, self.target.path, self._arrays(), origin, kept, keep_finished=finished
        )
        left = outcomes[Outcome.NOT_COMPUTED]
        n_complete = sum(outcomes[number] for number in COMPLETE)
        return RunSummary(self.plan.n_points, n_complete, left, n_found, written=not (finished and left))

    def _arrays(self) -> list[SmallArray]:
        """Coordinates of the file, and its variables that no task computes."""
        study, scenes, facts = self.study, self.scenes, self.scenes.facts
        stuck = SmallArray("stuck_frequency", *stuck_frequencies_of(study, facts, scenes.scenes), STUCK_FREQUENCY)
        hertz = frequencies_of_ratios(study, facts, scenes.scenes)
        return [
            *([] if hertz is None else [SmallArray("frequency", *hertz, COORDINATES["frequency"])]),
            *coordinates(study, self.facts, pair_arrays(study, facts, scenes.scenes)),
            stuck,
            *worn_coordinate(study, facts),
            *sample_coordinates(study, facts, scenes.scenes),
            *scene_arrays(study, scenes.variables),
        ]


@contextlib.contextmanager
def open_progress(target: Target) -> Iterator[Store]:
    """The file of the progress beside a result, open for a run: before the scene is built, which may be in the file.

    Raises
    ------
    UserError
        Where another run uses the file, or its disk has no locks.
    StorageError
        Where the file cannot be written.
    """
    path = progress_file(target.path)
    try:
        store = Store(path)
    except StoreInUseError as error:
        remedy = "wait for its end, or give another result file with -o; where no run is at work the disk has no locks"
        raise UserError(str(path), "in use", Verbatim(f"by {error}"), remedy) from None
    with contextlib.closing(store):
        remove_leftovers(path)
        try:
            yield store
        finally:
            with contextlib.suppress(OSError):
                # what the ranks have mapped
                remove_leftovers(path)


def serve_study(
    ranks: Ranks,
    study: Study,
    scenes: Scenes,
    store: Store,
    target: Target,
    progress: ProgressDisplay,
    options: RunOptions,
) -> RunSummary:
    """Rank 0: computes a study together with the other ranks and writes the file `target.path`.

    A finished result at this path is replaced by a result without missing points only.

    Parameters
    ----------
    ranks, study
        The ranks, and the study that they compute.
    scenes
        The scenes of the study, as `build_scenes` gives them.
    store
        The open file of the progress.
    target
        The result file, as `check_result` gives it.
    progress
        What the user sees during the run.
    options
        What is done with earlier results.

    Raises
    ------
    UserError
        Where another run uses the file of the progress.
    StorageError
        Where something cannot be written.
    Interrupted
        Where the run is ended from outside; finished points have been written.
    """
    completion, writer = _prepare(study, scenes, store, target, progress, options)
    n_found = _begin(completion, writer.plan.n_points, options, progress)
    try:
        run_tasks(ranks, study, StudyRun(completion, scenes, progress), progress)
        progress.say("writing the result")
        summary = writer.write(completion, n_found)
    except BaseException as error:
        if not is_ending(error):
            raise
        begin_ending()
        raise Interrupted(writer.write(completion, n_found)) from None
    if summary.n_left == 0:
        completion.prune()
    return summary


def _prepare(
    study: Study, scenes: Scenes, store: Store, target: Target, progress: ProgressDisplay, options: RunOptions
) -> tuple[CompletionIndex, _ResultWriter]:
    """The index of finished points, and the writer of the result."""
    facts = merge_facts(scenes.facts)
    contacts = contact_changes(study, scenes.scenes, scenes.facts)
    plan = build_tasks(study, [each.n_displacements for each in scenes.facts], contacts, scenes.scenes)
    # The software is described when the run begins: a checkout may have changed at the end of the run.
    software = describe_software(PACKAGES[0])
    kind = record_type(study, facts)
    for note in (
        *store.notes,
        *_older(target.path),
        *scenes.notes,
        *doubts_of_study(study, facts),
        *(f"{label}: {text}" for label, text in remarks_of_study(study)),
    ):
        progress.note(note)
    remove_leftovers(target.path)
    identity = Identity(tuple(each.digest for each in scenes.facts), digest(repr(kind.descr)))
    completion = CompletionIndex(plan, identity, store, kind)
    label = Label.of(study)
    store.note_study(label.name, label.model)
    return completion, _ResultWriter(study, plan, facts, scenes, target, software, options.date)


def _older(target: Path) -> list[str]:
    """A sentence where a folder of an earlier version stands beside a result."""
    folder = older_folder(target)
    if not folder.is_dir():
        return []
    return [f"{folder.name} is of version 0.4.0 or before: it is neither used nor changed, and may be removed"]


def _begin(completion: CompletionIndex, n_points: int, options: RunOptions, progress: ProgressDisplay) -> int:
    """Applies the options to the results of earlier runs; returns the number of finished points."""
    if options.fresh:
        completion.forget_all()
    if options.retry_failed:
        completion.forget_failed(COMPLETE)
    completion.give_up_crashed()
    completion.store.flush()
    n_found = completion.n_points_finished
    if n_found:
        progress.say(f"{n_found} of {count(n_points, 'point')} are there from an earlier run")
    return n_found
