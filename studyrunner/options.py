"""The options of `run-study`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

from studyrunner.user_error import UserError

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
  run-study dovetail --set slow_time.cycles=1e4 --set 'axes.frequency=[192.0, 192.5]'

exit status:
  0  all points were computed to the end, each with its error; the last lines say how many are known to rtol
  1  unexpected failure
  2  bad input, nothing was computed: a line for each mistake says what is wrong
  3  finished and saved, but some points failed, not computed to the end; their `outcome` says why
  130  ended by Ctrl-C, SIGTERM, SIGHUP or SIGUSR1; the file holds the points that were computed until then

A run that was ended, in whatever way, goes on where it was when the same command is given again. What it needs for that
is in the file OUT.nc.progress; with it a study that is changed computes only what is new. It may be removed."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UserError("command line", "options", None, f"{message}; run-study --help lists them")


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Options from the command line, by their names.

    study: text. output, write_scene: paths or None. overrides: texts. date: checked, or None. The others are flags.

    Raises UserError; SystemExit after --help, --new and the like.
    """
    look: Any = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False}
    parser = _Parser("run-study", description=_DESCRIPTION, epilog=_EPILOG, **look)
    add, flag, path = parser.add_argument, dict[str, Any](action="store_true"), dict[str, Any](type=Path)
    which = "TOML file, result file or bundled study (default: dovetail)"
    add("study", nargs="?", default="dovetail", metavar="STUDY", help=which)
    add("-o", dest="output", metavar="OUT.nc", help="result file (default: <study name>.nc, here)", **path)
    version = f"fretwear {metadata.version('fretwear')}"
    add("--version", action="version", version=version, help="print the version")
    add("--new", metavar="NAME", help="write NAME.toml, a study to start from, and stop")
    add("--from", dest="deck", metavar="DECK", help="with --new: a study of this deck", **path)
    add("--plan", help="print what would be computed; compute nothing", **flag)
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
    if found.scene_help is not None or found.new is not None:
        print(_scene_help(found.scene_help) if found.new is None else _new_study(found.new, found.deck), flush=True)
        parser.exit()
    if found.date is not None:
        from studyrunner.result.provenance import check_date  # where it is used: it takes a second to load

        found.date = check_date(found.date, "command line", "--date")
    return found


def _scene_help(scene: str) -> str:
    from studies.scene_help import scene_help
    from studies.scenes import BUNDLED

    if scene not in BUNDLED:
        raise UserError("command line", "--scene-help", scene, f"give one of {', '.join(BUNDLED)}")
    return scene_help(scene)


def _new_study(name: str, deck: Path | None) -> str:
    from studyrunner.study.keys import write_new_study

    path = write_new_study(name, deck)
    return f"{path}: run-study {path} computes it"
