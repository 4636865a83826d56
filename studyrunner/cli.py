"""The command `run-study` on each rank. Signals are handled from the first moment, before slow imports."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.mpi.ranks import (
    POLL_SECONDS,
    LauncherError,
    RankInterrupted,
    Ranks,
    job_size,
    launcher_rank,
    start_ranks,
)
from studyrunner.system.machine import MachineFaultError
from studyrunner.system.process import (
    INTERRUPTED,
    begin_ending,
    is_ending,
    keep_talking,
    last_error,
    raise_ending,
    take_endings,
)
from studyrunner.user_error import StorageError, UserError, show_text

if TYPE_CHECKING:
    import argparse

    from studyrunner.study.study import Study

CONVERGED, UNEXPECTED, BAD_INPUT, SOME_FAILED = 0, 1, 2, 3
"""Exit statuses, beside INTERRUPTED."""

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_SECONDS_FOR_RANK_0 = 60.0
"""Time that rank 0 has for writing the result, s, before another interrupted rank ends the run."""

_SECONDS_FOR_A_LINE = 2.0
_SECONDS_WITHOUT_A_WORD = 3.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command on this rank and returns its exit status; an unexpected failure ends all ranks.

    Parameters
    ----------
    arguments
        None for those of the process, which ends here if the run did not come to its end.
    """
    try:
        take_endings()
        keep_talking()
        # One thread a rank: the ranks share the cores. It has to be said before numpy is loaded.
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        return _run(start_ranks(), arguments)
    except LauncherError as error:
        if launcher_rank() == 0:
            print(f"run-study: launcher: {error}", file=sys.stderr)
        else:
            # a launcher may pass nothing on once another process has failed
            time.sleep(_SECONDS_FOR_A_LINE)
        return BAD_INPUT
    except BaseException as error:
        if not is_ending(error):
            raise
        begin_ending()
        if launcher_rank() == 0:
            print("run-study: interrupted", file=sys.stderr)
        return INTERRUPTED


def _run(ranks: Ranks, arguments: Sequence[str] | None) -> int:
    """Exit status of the command on a rank; only rank 0 has one that says something."""
    try:
        if ranks.rank == 0:
            status = _lead(ranks, sys.argv[1:] if arguments is None else arguments)
            for rank in range(1, ranks.size):
                ranks.send(None, rank)
        else:
            status = _follow(ranks)
        if arguments is None:
            # it has come to its end: what comes while MPI and the interpreter end is of no use to anybody
            begin_ending()
        ranks.close()
    except BaseException as error:
        # One rank's end must be the end of all: the others would wait for ever.
        status = UNEXPECTED
        if is_ending(error):
            begin_ending()
            if ranks.rank > 0 and _leave_to_rank_0(ranks, RankInterrupted()):
                ranks.close()
                return CONVERGED
            said = str(error) if isinstance(error, KeyboardInterrupt) else ""
            print(f"run-study: {said or 'interrupted'}", file=sys.stderr)
            status = INTERRUPTED
        elif isinstance(error, StorageError):
            print(f"run-study: {error}", file=sys.stderr)
        elif isinstance(error, MachineFaultError):
            kept = "what was computed is kept, and the same command goes on from it"
            if ranks.rank > 0:
                _leave_to_rank_0(ranks, error)
            print(f"run-study: {error}: a fault of the machine; {kept}", file=sys.stderr)
        else:
            print(f"run-study: unexpected failure on rank {ranks.rank} of {ranks.size}", file=sys.stderr)
            traceback.print_exc()
        ranks.abort(status)
        if arguments is None:
            # The thread that computes is still at it, which an interpreter on its way out does not always survive.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    return status


def _leave_to_rank_0(ranks: Ranks, reason: object) -> bool:
    """Waits for rank 0 to write what there is and to end all ranks, after telling it the reason.

    Returns whether rank 0 had already finished.
    """
    ranks.send(reason, 0)
    latest = time.monotonic() + _SECONDS_FOR_RANK_0
    while time.monotonic() < latest:
        # a message moves only while its sender is in the MPI library
        received = ranks.receive()
        if received is not None and received[1] is None:
            return True
        time.sleep(POLL_SECONDS)
    return False


def _follow(ranks: Ranks) -> int:
    from studyrunner.mpi.schedule import follow_rank_0
    from studyrunner.task_runs import evaluator

    follow_rank_0(ranks, evaluator())
    return CONVERGED


def _lead(ranks: Ranks, arguments: Sequence[str]) -> int:
    try:
        from studyrunner.options import parse_options

        options = parse_options(arguments)
        raise_ending()
        from studyrunner.study.study_file import read_study

        study = read_study(options.study, options.overrides)
        raise_ending()
        if options.plan:
            return _show_plan(study)
        if options.check:
            return _check(study)
        if options.write_scene is not None:
            return _write_scene(study, options.write_scene)
        return _compute(ranks, study, options)
    except UserError as error:
        # Ctrl-C ends the processes that read files as well, which tells nothing of the files
        raise_ending()
        print(*(f"run-study: {line}" for line in str(error).splitlines()), sep="\n", file=sys.stderr)
    except SystemExit:
        return CONVERGED
    return BAD_INPUT


def _slow_steps() -> Callable[[str], None]:
    """Takes lines on how a scene is built, and prints those of a scene that takes long."""
    began = time.monotonic()

    def say(doing: str) -> None:
        raise_ending()
        seconds = time.monotonic() - began
        if seconds > _SECONDS_WITHOUT_A_WORD:
            print(f"[{seconds:5.0f} s] {doing}", file=sys.stderr, flush=True)

    return say


def _show_plan(study: Study) -> int:
    from studyrunner.kinds.estimate import largest_memory
    from studyrunner.kinds.kind import build_tasks
    from studyrunner.plan import doubts_of_study, format_plan
    from studyrunner.scene.answers import remarks_of_study
    from studyrunner.scene.pairs import contact_changes
    from studyrunner.scene.scene_set import plan_scenes

    before = largest_memory()
    planned = plan_scenes(study, _slow_steps())
    built_with = largest_memory() - before
    contacts = contact_changes(study, planned.scenes, planned.facts)
    plan = build_tasks(study, [each.n_displacements for each in planned.facts], contacts, planned.scenes)
    seconds = time.process_time() + planned.seconds_left
    lines = [format_plan(study, planned.largest, plan, built_with, seconds, planned.describe())]
    said = *remarks_of_study(study), *(("note", doubt) for doubt in doubts_of_study(study, planned.largest))
    print(*lines, *(f"{label:<10} {show_text(text)}" for label, text in said), sep="\n", flush=True)
    error = last_error(sys.stdout)
    if error is not None and not isinstance(error, BrokenPipeError):  # a reader that has gone has seen enough
        raise UserError("command line", "--plan", None, f"cannot be written to stdout: {error.strerror}")
    return CONVERGED


def _check(study: Study) -> int:
    from studyrunner.result.target import check_output
    from studyrunner.scene.answers import check_study_model

    picture = Path(f"{study.study.name}.check.png")
    target = check_output("--check", picture, study.files)
    print(check_study_model(study, target, _slow_steps()), flush=True)
    print(f"{picture}: the contact pairs and their frames", flush=True)
    return CONVERGED


def _write_scene(study: Study, path: Path) -> int:
    from studyrunner.result.target import check_scene_file
    from studyrunner.scene.scene import write_study_scene

    write_study_scene(study, check_scene_file("--write-scene", path, study), _slow_steps())
    print(f"{path}: the scene of study {study.study.name}", flush=True)
    return CONVERGED


def _compute(ranks: Ranks, study: Study, options: argparse.Namespace) -> int:
    from solver.outcome import COMPLETE
    from studyrunner.result.target import check_result
    from studyrunner.run import RunOptions, compute_study
    from studyrunner.system.progress import ProgressDisplay, count, format_seconds

    path = Path(f"{study.study.name}.nc") if options.output is None else options.output
    target = check_result("-o", path, study, overwrite=options.overwrite)
    display, announced = ProgressDisplay(), job_size() if ranks.size == 1 else 0
    idle = f"one process, although the job has room for {announced}: srun or mpiexec starts them"
    given = RunOptions(options.fresh, options.retry_failed, options.date)
    outcomes = compute_study(ranks, study, target, given, display, _slow_steps(), [idle] if announced > 1 else [])
    n_points, n_complete = outcomes.total(), sum(outcomes[number] for number in COMPLETE)
    counts = f"{count(n_points, 'point')}, {n_complete} computed, {n_points - n_complete} failed"
    print(f"{path}: {counts}, {format_seconds(display.seconds)}", *_answer(target.path), sep="\n", flush=True)
    return SOME_FAILED if n_complete < n_points else CONVERGED


def _answer(path: Path) -> tuple[str, ...]:
    """What came out, in lines, read from the result."""
    # where they are used: they take a second to load
    from studyrunner.result.opening import open_result
    from studyrunner.summary.answer import summary

    try:
        with open_result(path) as dataset:
            return summary(dataset).lines
    except UserError as error:
        # the result is there all the same, but larger than what is read
        return (f"no summary: {error}",)


if __name__ == "__main__":
    sys.exit(main())
