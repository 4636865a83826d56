"""The command `run-study` on each rank. Signals are handled once the ranks have found each other."""

import argparse
import contextlib
import os
import platform
import shlex
import sys
import time
import traceback
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studyrunner.mpi.ranks import POLL_SECONDS, LauncherError, Ranks, launcher_rank, start_ranks
from studyrunner.system import process
from studyrunner.system.machine import MachineFaultError
from studyrunner.user_error import Parser, StorageError, UserError

if TYPE_CHECKING:
    from studyrunner.study.study import Study

CONVERGED, UNEXPECTED, BAD_INPUT, SOME_FAILED = 0, 1, 2, 3  # exit statuses, beside INTERRUPTED
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_SECONDS_FOR_RANK_0 = 60.0  # for writing the result, before another interrupted rank ends the run
_SECONDS_FOR_A_LINE = 2.0

_DESCRIPTION = """\
Computes a study of fretting wear in a vibrating joint and writes its results to one NetCDF file.

Alone, under "mpiexec -n N run-study ..." or under "srun run-study ...": the result is the same."""

_EPILOG = """\
examples:
  run-study --new my_study                               writes my_study.toml, a study to start from
  run-study                                              the bundled study "dovetail" -> dovetail.nc
  run-study --plan                                       what that would compute, and how long it takes
  mpiexec -n 2 run-study my_study.toml -o worn.nc        a study of one's own on two cores
  run-study my_study.toml --check                        mass, pairs, frequencies of a finite-element model
  run-study worn.nc -o again.nc                          the study of a result file again
  run-study dovetail --set slow_time.cycles=1e4 --set 'axes.frequency=[211.5, 212.0]'

exit status:
  0  all points were computed to the end, each with its error; the last lines say how many are known to rtol
  1  unexpected failure
  2  bad input, nothing was computed: a line for each mistake says what is wrong
  3  finished and saved, but some points failed, not computed to the end; their `outcome` says why
  130  ended by Ctrl-C, SIGTERM, SIGHUP or SIGUSR1; the file holds the points that were computed until then

A run that was ended, in whatever way, goes on where it was when the same command is given again. What it needs for that
is in the file OUT.nc.progress; with it a study that is changed computes only what is new. It may be removed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command on this rank and returns its exit status, which says something on rank 0 only.

    arguments: None for those of the process, which ends here if the run did not come to its end.
    """
    ranks = Ranks()
    try:
        process.leave_endings()
        process.keep_talking()
        # One thread a rank: the ranks share the cores. It has to be said before numpy is loaded.
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        ranks = start_ranks()
        process.take_endings()
        status = CONVERGED
        if ranks.rank == 0:
            status = _lead(ranks, sys.argv[1:] if arguments is None else arguments)
            for rank in range(1, ranks.size):
                ranks.send(None, rank)
        else:
            from studyrunner.mpi.schedule import follow_rank_0
            from studyrunner.task_runs import evaluator

            follow_rank_0(ranks, evaluator())
        if arguments is None:
            # it has come to its end: what comes while MPI and the interpreter end is of no use to anybody
            process.begin_ending()
        ranks.close()
        return status
    except LauncherError as error:
        if launcher_rank() > 0:
            # rank 0 mostly says the same, and a launcher may pass nothing on once another process has failed
            time.sleep(_SECONDS_FOR_A_LINE)
        if launcher_rank() == 0 or not error.known:
            print(f"run-study: launcher: {error}", file=sys.stderr)
        if not error.known:
            ranks.abort(BAD_INPUT)
        return BAD_INPUT
    except BaseException as error:
        # One rank's end must be the end of all: the others would wait for ever.
        status = _tell(ranks, error)
        if status != CONVERGED:
            ranks.abort(status)
        if arguments is None:
            # The thread that computes is still at it, which an interpreter on its way out does not always survive.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
        return status


def _tell(ranks: Ranks, error: BaseException) -> int:
    """Says why a rank has come to its end early, and returns the exit status."""
    if process.is_ending(error):
        process.begin_ending()
        if ranks.rank > 0 and _leave_to_rank_0(ranks, KeyboardInterrupt()):
            ranks.close()
            return CONVERGED
        if max(ranks.rank, launcher_rank()) == 0 or ranks.size > 1:
            said = str(error) if isinstance(error, KeyboardInterrupt) else ""
            print(f"run-study: {said or 'interrupted'}", file=sys.stderr)
        return process.INTERRUPTED
    from solver.outcome import describe_error, is_machine_fault

    if isinstance(error, StorageError):
        print(f"run-study: {error}", file=sys.stderr)
    elif isinstance(error, MachineFaultError) or is_machine_fault(error):
        if not isinstance(error, MachineFaultError):
            error = MachineFaultError(f"{describe_error(error)}, on {platform.node()}")
        if ranks.rank > 0:
            _leave_to_rank_0(ranks, error)
        kept = "what was computed is kept, and the same command goes on from it"
        print(f"run-study: {error}: a fault of the machine; {kept}", file=sys.stderr)
    else:
        print(f"run-study: unexpected failure on rank {ranks.rank} of {ranks.size}", file=sys.stderr)
        traceback.print_exception(error)
    return UNEXPECTED


def _leave_to_rank_0(ranks: Ranks, reason: BaseException) -> bool:
    """Tells rank 0 why it has to end all ranks, and waits for that. Returns whether rank 0 had already finished."""
    ranks.send(reason, 0)
    latest = time.monotonic() + _SECONDS_FOR_RANK_0
    while time.monotonic() < latest:
        # a message moves only while its sender is in the MPI library
        received = ranks.receive()
        if received is not None and received[1] is None:
            return True
        time.sleep(POLL_SECONDS)
    return False


def _lead(ranks: Ranks, arguments: Sequence[str]) -> int:
    try:
        options = _parse_options(arguments)
        process.raise_ending()
        from studyrunner.study.study_file import read_study

        study = read_study(options.study, options.overrides, options.points)
        process.raise_ending()
        if options.plan or options.check or options.write_scene is not None:
            return _describe(study, options)
        return _compute(ranks, study, options)
    except UserError as error:
        # Ctrl-C ends the processes that read files as well, which tells nothing of the files
        process.raise_ending()
        print(*(f"run-study: {line}" for line in str(error).splitlines()), sep="\n", file=sys.stderr)
    except SystemExit:
        return CONVERGED
    return BAD_INPUT


def _describe(study: "Study", options: argparse.Namespace) -> int:
    """What the options --plan, --check and --write-scene print and write."""
    from studyrunner.plan import plan_lines
    from studyrunner.result.target import check_output
    from studyrunner.scene.answers import check_study_model, write_study_scene
    from studyrunner.system.progress import ProgressDisplay

    step = ProgressDisplay().step
    if options.plan:
        if options.csv:
            from studyrunner.plan_table import print_table

            print_table(study, step, sys.stdout)
        else:
            print(*plan_lines(study, step), sep="\n", flush=True)
        error = process.last_error(sys.stdout)
        if error is not None and not isinstance(error, BrokenPipeError):  # a reader that has gone has seen enough
            raise UserError("command line", "--plan", None, f"cannot be written to stdout: {error.strerror}")
    elif options.check:
        picture = Path(f"{study.study.name}.check.png")
        print(check_study_model(study, check_output("--check", picture, study.files), step), flush=True)
        print(f"{picture}: the contact pairs and their frames", flush=True)
    else:
        path = options.write_scene
        write_study_scene(study, check_output("--write-scene", path, study.files, new=True), step)
        print(f"{path}: the scene of study {study.study.name}", flush=True)
    return CONVERGED


def _compute(ranks: Ranks, study: "Study", options: argparse.Namespace) -> int:
    from solver.outcome import COMPLETE
    from studyrunner.checkpoint.store import Store
    from studyrunner.result.target import check_result
    from studyrunner.run import compute_study
    from studyrunner.system.progress import ProgressDisplay, count, format_seconds

    path = Path(f"{study.study.name}.nc") if options.output is None else options.output
    target = check_result("-o", path, study, overwrite=options.overwrite)
    display = ProgressDisplay()
    asked = {name: getattr(options, name) for name in ("fresh", "retry_failed", "date")}
    with contextlib.closing(Store(target.progress)) as store:
        outcomes = compute_study(ranks, study, target, store, display, **asked)
        # no other run replaces the result meanwhile
        answer = _answer(target.path)
    n_points, n_complete = outcomes.total(), sum(outcomes[number] for number in COMPLETE)
    counts = f"{count(n_points, 'point')}, {n_complete} computed, {n_points - n_complete} failed"
    print(f"{path}: {counts}, {format_seconds(display.seconds)}", *answer, sep="\n", flush=True)
    return SOME_FAILED if n_complete < n_points else CONVERGED


def _answer(path: Path) -> Sequence[str]:
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


def _parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Options from the command line, by their names. Raises UserError; SystemExit after --help, --new and the like."""
    parser = Parser("run-study", _DESCRIPTION, _EPILOG)
    add, flag, path = parser.add_argument, dict[str, Any](action="store_true"), dict[str, Any](type=Path)
    which = "TOML file, result file or bundled study (default: dovetail)"
    add("study", nargs="?", default="dovetail", metavar="STUDY", help=which)
    add("-o", dest="output", metavar="OUT.nc", help="result file (default: <study name>.nc, here)", **path)
    version = f"fretwear {metadata.version('fretwear')}"
    add("--version", action="version", version=version, help="print the version")
    add("--new", metavar="NAME", help="write NAME.toml, a study to start from, and stop")
    add("--from", dest="deck", metavar="DECK", help="with --new: a study of this deck or mesh", **path)
    rows = "points to compute: a header with names of axes, and a row a point"
    add("--points", metavar="DESIGN.csv", help=rows)
    add("--plan", help="print what would be computed; compute nothing", **flag)
    add("--csv", help="with --plan: each point with its task, scene and estimated time, as a table", **flag)
    add("--check", help="print what a finite-element model is, draw its contact pairs; then stop", **flag)
    changed = "override a key of the study by its dotted name; VALUE is TOML or a bare word; may be repeated"
    add("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE", help=changed)
    add("--write-scene", metavar="PATH.h5", help="write the scene as a scene file and stop", **path)
    add("--scene-help", metavar="SCENE", help="print what a bundled scene is, and its parameters")
    add("--fresh", help="start over: forget what an earlier run of it has left", **flag)
    add("--overwrite", help="replace the result of another study", **flag)
    add("--retry-failed", help="compute points that failed in an earlier run once more", **flag)
    date = "date_created of the result: a date, or now; without it equal runs have equal files"
    add("--date", nargs="?", const="now", metavar="ISO", help=date)
    found = parser.parse_args(list(arguments))
    if found.deck is not None and found.new is None:
        remedy = "give --new NAME beside it: the name of the new study"
        raise UserError("command line", "--from", str(found.deck), remedy)
    if found.csv and not found.plan:
        raise UserError("command line", "--csv", None, "give --plan beside it: it prints the points of a plan")
    # below: imported where it is used, as it takes a second to load
    if found.new is not None:
        from studyrunner.study.keys import write_new_study

        written = write_new_study(found.new, found.deck)
        print(f"{written}: run-study {shlex.quote(str(written))} computes it", flush=True)
        parser.exit()
    if found.scene_help is not None:
        from studies.scenes import BUNDLED, scene_help

        if found.scene_help not in BUNDLED:
            raise UserError("command line", "--scene-help", found.scene_help, f"give one of {', '.join(BUNDLED)}")
        print(scene_help(found.scene_help), flush=True)
        parser.exit()
    if found.date is not None:
        from studyrunner.result.provenance import check_date

        found.date = check_date(found.date, "command line", "--date")
    return found


if __name__ == "__main__":
    sys.exit(main())
