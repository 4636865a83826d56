"""Draws the pictures of the bundled study in `studies/pictures` and writes down the numbers that they show.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures dovetail.nc
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures dovetail.nc --precision work_precision_slider.nc

`dovetail.nc` is the result of the bundled study with its natural frequencies, `run-study dovetail --set
'outputs.variables=["default", "natural_frequency"]'`; that of `run-study work_precision_slider`, whose
picture shows CPU times and is in no test, is drawn where it is named. Written are the PNG files of `NAMES`, as the
report draws them, and `numbers.json`: the study, what the artists of each figure hold, and a checksum of each picture.
`tests/studyrunner/report/test_pictures.py` compares all of that with the bundled study, with the files, and with points
that are computed anew: a picture that is older than the solver, the study or the report is noticed.
"""

import argparse
import hashlib
import json
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.container import ErrorbarContainer

import studies
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import Drawing
from studyrunner.result.view import Result, open_for_report
from tests.benchmarks.small_png import shrink

FOLDER = Path(studies.__file__).parent / "pictures"
NUMBERS = "numbers.json"
NAMES = (
    *("final_worn_volume", "frequency_response", "fretting_loops", "mean_pressure", "natural_frequencies"),
    *("worn_profile", "worn_root", "worn_volume_map"),
)
WIDTH = 1200  # pixels
MOST_POINTS = 30
DIGITS = 6
_COLOUR_BAR = "<colorbar>"
"""What matplotlib calls the axes of one."""


def make_pictures(result: Result, folder: Path) -> dict[str, Any]:
    """Writes the pictures into a folder that exists, and returns what `numbers.json` is to hold.

    Keys: "study", the text of the file; "figures", of each name what `read_figure` gives; "pictures", the SHA-256 of
    each PNG file by its name. Raises KeyError where the file lacks what a figure needs.
    """
    drawings = find_drawings(result, NAMES)
    written = [write_picture(drawing, folder) for drawing in drawings]
    return {
        "study": result.dataset.attrs["study"],
        "figures": {each.name: read_figure(each) for each in drawings},
        "pictures": {png.name: hashlib.sha256(png.read_bytes()).hexdigest() for png in written},
    }


def find_drawings(result: Result, names: Sequence[str]) -> list[Drawing]:
    """Figures of the report by their names. Raises KeyError where the file lacks what one needs."""
    drawn = {item.name: item for item in draw_report(result) if isinstance(item, Drawing) and item.name in names}
    return [drawn[name] for name in names]


def write_picture(drawing: Drawing, folder: Path) -> Path:
    """The figure as a PNG file of `WIDTH` pixels in few colours; its path."""
    path = folder / f"{drawing.name}.png"
    with tempfile.TemporaryDirectory() as large:
        path.write_bytes(shrink(drawing.save(Path(large))[0].with_suffix(".png").read_bytes(), WIDTH))
    return path


def read_figure(drawing: Drawing) -> dict[str, Any]:
    """What is seen: "caption", and "panels" with their "lines", by label, and "bars": place, low and high end."""
    panels = [panel for panel in drawing.figure.axes if panel.get_label() != _COLOUR_BAR]
    return {"caption": drawing.caption, "panels": [_read_panel(panel) for panel in panels]}


def _read_panel(panel: Axes) -> dict[str, Any]:
    lines = {}
    for line in panel.get_lines():
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        if not str(line.get_label()).startswith("_") and x.size <= MOST_POINTS:
            lines[str(line.get_label())] = [_plain(x), _plain(y)]
    bars = [
        _plain([segment[0, 0], *segment[:, 1]])
        for container in panel.containers
        if isinstance(container, ErrorbarContainer)
        for part in container.lines[2]
        if isinstance(part, LineCollection)
        for segment in part.get_segments()
    ]
    return {"lines": lines, "bars": bars}


def _plain(values: Any) -> list[float | None]:
    """Numbers with `DIGITS` digits, None for what is not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def as_text(numbers: dict[str, Any]) -> str:
    """JSON with each list of numbers on one line."""
    text = json.dumps(numbers, indent=1, ensure_ascii=False)
    return re.sub(r"\[\s+([^\[\]{}\"]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes pictures and numbers of the result that is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result", type=Path, help="result file of dovetail, natural_frequency included")
    parser.add_argument("-o", dest="folder", type=Path, default=FOLDER, help="default: studies/pictures")
    parser.add_argument("--precision", type=Path, help="result file of work_precision_slider, for precision.png")
    options = parser.parse_args(arguments)
    result = open_for_report(options.result)
    (options.folder / NUMBERS).write_text(as_text(make_pictures(result, options.folder)), encoding="utf-8")
    if options.precision is not None:
        (drawing,) = find_drawings(open_for_report(options.precision), ["precision"])
        write_picture(drawing, options.folder)


if __name__ == "__main__":
    main()
