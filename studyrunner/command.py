"""The command `run-study` on each rank."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.mpi.ranks import (
    POLL_SECONDS,
    LauncherError,
    RankInterrupted,
    Ranks,
    check_software,
    job_size,
    launcher_rank,
    start_ranks,
)
from studyrunner.options import Options, parse_options
from studyrunner.system.endings import INTERRUPTED, begin_ending, is_ending, raise_ending, say_at_last
from studyrunner.system.machine_faults import LEAST_ADDRESS_SPACE, address_space
from studyrunner.system.streams import keep_talking, last_error
from studyrunner.user_error import StorageError, UserError, Verbatim, show_text

if TYPE_CHECKING:
    from studyrunner.study.study import Study

CONVERGED, UNEXPECTED, BAD_INPUT, SOME_FAILED = 0, 1, 2, 3
"""Exit statuses, beside INTERRUPTED."""

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_SECONDS_FOR_RANK_0 = 60.0
"""Time that rank 0 has for writing the result, s, before another interrupted rank ends the run."""

_SECONDS_FOR_A_LINE = 2.0
_SECONDS_WITHOUT_A_WORD = 3.0


class _SlowSteps:
    """Lines on stderr about a scene that takes long to build; no line for a fast one."""

    def __init__(self) -> None:
        self._began = time.monotonic()

    def say(self, doing: str) -> None:
        raise_ending()
        seconds = time.monotonic() - self._began
        if seconds > _SECONDS_WITHOUT_A_WORD:
            print(f"[{seconds:5.0f} s] {doing}", file=sys.stderr, flush=True)


def run_command(arguments: Sequence[str] | None) -> int:
    """As `studyrunner.cli.main`. Raises KeyboardInterrupt where the run was ended before the ranks have started."""
    keep_talking()
    # One thread a rank: the ranks share the cores. It has to be said before numpy is loaded.
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        ranks = start_ranks()
    except LauncherError as error:
        if launcher_rank() == 0:
            print(f"run-study: launcher: {error}", file=sys.stderr)
        else:
            # a launcher may pass nothing on once another process has failed
            time.sleep(_SECONDS_FOR_A_LINE)
        return BAD_INPUT
    if ranks.rank == 0:
        say_at_last("run-study: ended at once: the same command goes on where it was")
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
        if is_ending(error):
            begin_ending()
            if ranks.rank > 0 and _leave_to_rank_0(ranks):
                ranks.close()
                return CONVERGED
            said = str(error) if isinstance(error, KeyboardInterrupt) else ""
            print(f"run-study: {said or 'interrupted'}", file=sys.stderr)
            status = INTERRUPTED
        elif isinstance(error, StorageError):
            print(f"run-study: {error}", file=sys.stderr)
            status = UNEXPECTED
        else:
            print(f"run-study: unexpected failure on rank {ranks.rank} of {ranks.size}", file=sys.stderr)
            traceback.print_exc()
            status = UNEXPECTED
        ranks.abort(status)
        if arguments is None:
            # The thread that computes is still at it, which an interpreter on its way out does not always survive.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    return status


def _leave_to_rank_0(ranks: Ranks) -> bool:
    """Waits for rank 0 to write the result and to end all ranks, after telling rank 0 of the end.

    Returns whether rank 0 had already finished.
    """
    ranks.send(RankInterrupted(), 0)
    latest = time.monotonic() + _SECONDS_FOR_RANK_0
    while time.monotonic() < latest:
        # a message moves only while its sender is in the MPI library
        received = ranks.receive()
        if received is not None and received[1] is None:
            return True
        time.sleep(POLL_SECONDS)
    return False


def _lead(ranks: Ranks, arguments: Sequence[str]) -> int:
    """Rank 0: its exit status."""
    try:
        check_software(ranks)
        options = parse_options(arguments)
        _check_memory()
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
    except LauncherError as error:
        print(f"run-study: launcher: {error}", file=sys.stderr)
    except SystemExit:
        return CONVERGED
    return BAD_INPUT


def _check_memory() -> None:
    """Raises UserError where a limit of the address space leaves no room for the libraries."""
    if (limit := address_space()) < LEAST_ADDRESS_SPACE:
        remedy = f"give each process at least {1e-6 * LEAST_ADDRESS_SPACE:.0f} MB of address space, or no limit"
        raise UserError("limits of the process", "ulimit -v", Verbatim(f"{1e-6 * limit:.0f} MB"), remedy)


def _follow(ranks: Ranks) -> int:
    """Any other rank. Only rank 0 has an exit status."""
    from studyrunner.mpi.schedule import follow_rank_0
    from studyrunner.task_runs import evaluator

    follow_rank_0(ranks, evaluator())
    return CONVERGED


def _show_plan(study: Study) -> int:
    from studyrunner.kinds.estimate import largest_memory
    from studyrunner.kinds.kind import build_tasks
    from studyrunner.plan import doubts_of_study, format_plan
    from studyrunner.scene.answers import remarks_of_study
    from studyrunner.scene.pairs import contact_changes
    from studyrunner.scene.scene_set import plan_scenes

    before = largest_memory()
    planned = plan_scenes(study, _SlowSteps().say)
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
    from studyrunner.result.paths import check_output
    from studyrunner.scene.answers import check_study_model

    picture = Path(f"{study.study.name}.check.png")
    target = check_output("--check", picture, study.files)
    print(check_study_model(study, target, _SlowSteps().say), flush=True)
    print(f"{picture}: the contact pairs and their frames", flush=True)
    return CONVERGED


def _write_scene(study: Study, path: Path) -> int:
    from studyrunner.result.existing_result import check_scene_file
    from studyrunner.result.paths import check_output
    from studyrunner.scene.scene import write_study_scene

    target = check_output("--write-scene", path, study.files)
    check_scene_file("--write-scene", target)
    write_study_scene(study, target, _SlowSteps().say)
    print(f"{path}: the scene of study {study.study.name}", flush=True)
    return CONVERGED


def _compute(ranks: Ranks, study: Study, options: Options) -> int:
    from studyrunner.result.existing_result import check_result
    from studyrunner.result.paths import check_output
    from studyrunner.run import Interrupted, RunOptions, compute_study
    from studyrunner.system.progress import ProgressDisplay, count, format_seconds

    path = Path(f"{study.study.name}.nc") if options.output is None else options.output
    target = check_result("-o", check_output("-o", path, study.files), study, overwrite=options.overwrite)
    display, announced = ProgressDisplay(), job_size() if ranks.size == 1 else 0
    idle = f"one process, although the job has room for {announced}: srun or mpiexec starts them"
    given = RunOptions(options.fresh, options.retry_failed, options.date)
    try:
        summary = compute_study(ranks, study, target, given, display, _SlowSteps().say, [idle] if announced > 1 else [])
    except Interrupted as ended:
        raise KeyboardInterrupt(ended.summary.describe_end(path, "the same command")) from None
    failed = summary.n_points - summary.n_complete
    counts = f"{count(summary.n_points, 'point')}, {summary.n_complete} computed, {failed} failed"
    print(f"{path}: {counts}, {format_seconds(display.seconds)}", *_answer(target.path), sep="\n", flush=True)
    return SOME_FAILED if failed else CONVERGED


def _answer(path: Path) -> tuple[str, ...]:
    """What came out, in lines, read from the result."""
    # where they are used: they take a second to load
    from studyrunner.result.opening import open_result
    from studyrunner.summary.answer import summary
    from studyrunner.summary.lines import summary_lines

    try:
        with open_result(path) as dataset:
            found = summary(dataset)
    except UserError as error:
        # the result is there all the same, but larger than what is read
        return (f"no summary: {error}",)
    return tuple(summary_lines(found))
