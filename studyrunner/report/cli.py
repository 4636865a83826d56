"""The command `study-report`."""

import argparse
import os
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studyrunner.system.process import keep_talking, take_endings
from studyrunner.user_error import Parser, StorageError, UserError

if TYPE_CHECKING:
    from studyrunner.result.view import Result

WRITTEN, UNEXPECTED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130  # exit statuses

_DESCRIPTION = """\
Draws a result file of run-study: figures as SVG and PNG, and one HTML page that holds all of them and an interactive
part, and that opens without a network."""

_EPILOG = """\
examples:
  study-report dovetail.nc                    -> dovetail-report/index.html and the figures beside it
  study-report results/worn.nc -o figures     the same into the folder figures
  study-report dovetail.nc --vtu              also dovetail-report/root.pvd, the worn root for ParaView
  study-report dovetail.nc --point frequency=211.75,scheme=implicit    figures of single points show this one
  study-report dovetail.nc --loops 25         also fretting loops of pair 25, computed from the wear depths of the file
  study-report scar.nc --measured profile.csv the wear scar beside a measured one

exit status:
  0  the report was written
  1  unexpected failure
  2  bad input, nothing was written: one line says what is wrong"""


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """The options; paths are None where left out. Raises UserError where they are wrong, SystemExit after --help."""
    parser = Parser("study-report", _DESCRIPTION, _EPILOG)
    add, flag = parser.add_argument, dict[str, Any](action="store_true")
    add("result", metavar="OUT.nc", type=Path, help="result file of run-study")
    add("-o", dest="folder", metavar="FOLDER", type=Path, help="where to write (default: OUT-report, here)")
    which = "the point that root, maps, loops and --vtu show (default: the most worn one)"
    add("--point", metavar="AXIS=VALUE,...", type=axis_values, default={}, help=which)
    add("--loops", metavar="PAIR,...", type=pair_numbers, default=(), help="compute fretting loops of these pairs")
    scar = "measured scar of a cylinder or sphere on a flat; first line x_mm,depth_um (also m, um)"
    add("--measured", metavar="PROFILE.csv", type=Path, help=scar)
    add("--no-compute", help="draw what the file holds, without the response of a worn joint", **flag)
    add("--column", help="figures 90 mm wide, for a column of a journal or a phone (default: 190 mm)", **flag)
    add("--vtu", help="also the root over the cycles, for ParaView (extra meshio)", **flag)
    return parser.parse_args(list(arguments))


def axis_values(text: str) -> dict[str, str]:
    """Values of axes, as text, from AXIS=VALUE,... ValueError: it is none."""
    pairs = (part.split("=") for part in text.split(","))
    return {name.strip(): value.strip() for name, value in pairs}


def pair_numbers(text: str) -> tuple[int, ...]:
    """Numbers of contact pairs, from PAIR,... ValueError: it is none."""
    return tuple(int(part) for part in text.split(","))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line, None for that of this process, and returns its exit status."""
    keep_talking()
    take_endings()
    try:
        return _report(parse_options(sys.argv[1:] if arguments is None else arguments))
    except (UserError, StorageError) as error:
        print(f"study-report: {error}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, UserError) else UNEXPECTED
    except SystemExit:
        return WRITTEN
    except KeyboardInterrupt:
        print("study-report: interrupted", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        print("study-report: unexpected failure", file=sys.stderr)
        traceback.print_exc()
        return UNEXPECTED


def _report(options: argparse.Namespace) -> int:
    # Loaded late: help and mistakes on the command line do not wait for the libraries that draw.
    began = time.monotonic()
    from studyrunner.measured import read_profile
    from studyrunner.report.contents import draw_report
    from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH
    from studyrunner.report.page import write_page
    from studyrunner.report.root import SERIES, find_writer
    from studyrunner.result.opening import reading_errors
    from studyrunner.result.view import open_for_report
    from studyrunner.system.progress import count, format_seconds

    measured = read_profile(options.measured) if options.measured else None
    result = replace(open_for_report(options.result, options.point), measured=measured)
    with result.dataset, reading_errors(str(options.result)):
        write_series = find_writer(result) if options.vtu else None
        folder = options.folder or Path(f"{options.result.stem}-report")
        with _writing_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            trial = folder / f".index.html.{os.getpid()}.partial"
            trial.touch()
            trial.unlink()
        result, page = _compute(result, folder, options), folder / "index.html"
        with _writing_errors(folder):
            width = COLUMN_WIDTH if options.column else WIDTH
            shown = write_page(result, draw_report(result, width), page)
            n_files = write_series(folder) if write_series else 0
    print(f"{page}: {shown}, {format_seconds(time.monotonic() - began)}; open it in a browser")
    if options.vtu:
        print(f"{folder / SERIES}: time series of {count(n_files, 'VTU file')}; open it in ParaView")
    return WRITTEN


def _compute(result: "Result", folder: Path, options: argparse.Namespace) -> "Result":
    """The result with what its file does not hold of the worn joint: what was asked for, and its response curve."""
    from studyrunner.worn_joint import compute_worn_joint, has_worn_response

    given: dict[str, Any] = {"path": options.result, "folder": folder, "point": options.point}
    recomputed, why = compute_worn_joint(**given, loops=options.loops) if options.loops else {}, ""
    if not options.no_compute and has_worn_response(result):
        print("study-report: computing the response of the worn joint (--no-compute leaves it out)", file=sys.stderr)
        try:
            recomputed |= compute_worn_joint(**given, response=True)
        except UserError as error:
            # a report of what there is, where the scene is gone or the file has no depths
            why = str(error)
    return replace(result, recomputed=recomputed, no_worn_response=why)


@contextmanager
def _writing_errors(folder: Path) -> Iterator[None]:
    """What the system says of a folder becomes UserError."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.errno < 0:  # of the library that reads the result
            raise
        remedy = f"give a folder that can be written: {error.strerror}"
        raise UserError("command line", "-o", str(folder), remedy) from None


if __name__ == "__main__":
    sys.exit(main())
