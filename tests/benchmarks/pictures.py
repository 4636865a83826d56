"""Draws the pictures of the bundled studies in `studies/pictures` and writes down the numbers that some show.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures dovetail.nc
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures scatter.nc mission.nc ...
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures time-scales
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.pictures running-in

Results of other bundled studies give one small picture each, the figure of `GALLERY`; `time-scales` a wear history of
the slider, as the theory explains it; `running-in` the first mode of the joint of that study while it wears, and of one
whose contact stays as it begins, whose numbers it prints (4 CPU minutes). Of `dovetail.nc`, the result of the bundled
study, the PNG files of `SHOWN` are written, as the report draws them, and `numbers.json`: the study, what the artists
of each figure of `NAMES` hold, and a checksum of each picture.
`tests/studyrunner/test_bundled_studies.py` compares all of that with the bundled study, with the files, and with points
that are computed anew.
"""

import hashlib
import json
import re
import sys
import tempfile
import tomllib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.container import ErrorbarContainer
from PIL import Image

import studies
from studyrunner import run_study
from studyrunner.report import drawing as plot
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import Drawing
from studyrunner.result.view import open_for_report

FOLDER = Path(studies.__file__).parent / "pictures"
NUMBERS = "numbers.json"
SHOWN = ("final_worn_volume", "worn_profile", "worn_root", "worn_volume_map")  # on the pages
NAMES = (*SHOWN, "frequency_response")
WIDTH, COLOURS = 1200, 128  # of a picture: pixels, and of its palette
SMALL = 720  # pixels of a picture of `GALLERY`
GALLERY = {
    "blade_root": "worn_root",
    "bolted_beam": "damping_ratio",
    "cylinder_on_flat": "worn_profile",
    "damper": "worn_root",
    "extremes": "outcome_map",
    "mission": "block_shares",
    "modes": "damping_ratio",
    "scatter": "worn_volume_bands",
    "sdof_slider": "final_worn_volume",
    "shrouded": "worn_root",
    "sphere_on_flat": "wear_depth",
    "two_masses": "frequency_response",
    "vibro_impact": "frequency_response",
}
"""Figure of the report by study."""
COUNTS, LAST = (0, 16, 40), 200_000  # of the picture of the time scales: places of the outputs, cycles
AMPLITUDE = 5e-4  # of the picture of running in, m sqrt(kg)
MOST_POINTS, DIGITS = 30, 6  # of a line that is written down, and of its numbers


def shrink(png: bytes, width: int | None = None) -> bytes:
    """A drawing with a palette, a third of the size; as it was where that is no smaller. width: pixels at most.

    The bytes depend on the pixels and the version of Pillow alone.
    """
    picture = Image.open(BytesIO(png))
    if picture.mode == "P":
        return png
    picture = picture.convert("RGB")
    if width is not None and width < picture.width:
        picture = picture.resize((width, round(width * picture.height / picture.width)), Image.Resampling.LANCZOS)
    written = BytesIO()
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(written, "PNG", optimize=True)
    return written.getvalue() if width is not None or written.tell() < len(png) else png


def write_picture(drawing: Drawing) -> str:
    """Writes the figure as a PNG file of `WIDTH` pixels; its SHA-256."""
    with tempfile.TemporaryDirectory() as large:
        png = shrink(drawing.save(Path(large)).with_suffix(".png").read_bytes(), WIDTH)
    (FOLDER / f"{drawing.name}.png").write_bytes(png)
    return hashlib.sha256(png).hexdigest()


def read_panel(panel: Axes) -> dict[str, Any]:
    """The "lines" of a panel, by label, and its "bars": place, low and high end."""
    lines = {}
    for line in panel.get_lines():
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        if not str(line.get_label()).startswith("_") and x.size <= MOST_POINTS:
            lines[str(line.get_label())] = [plain(x), plain(y)]
    bars = [
        plain([segment[0, 0], *segment[:, 1]])
        for container in panel.containers
        if isinstance(container, ErrorbarContainer)
        for part in container.lines[2]
        if isinstance(part, LineCollection)
        for segment in part.get_segments()
    ]
    return {"lines": lines, "bars": bars}


def plain(values: Any) -> list[float | None]:
    """Numbers with `DIGITS` digits, None for what is not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def drawings_of(path: str, names: tuple[str, ...]) -> dict[str, Drawing]:
    """Figures of the report on a result file. Raises KeyError where the file lacks what one needs."""
    drawn = {item.name: item for item in draw_report(open_for_report(Path(path))) if isinstance(item, Drawing)}
    return {name: drawn[name] for name in names}


def write_small(path: str) -> None:
    """Writes the picture of a bundled study, from its result."""
    study = Path(path).stem
    result = open_for_report(Path(path))
    # solids, and long labels, need room
    items = draw_report(result, plot.WIDTH if GALLERY[study] in ("worn_root", "outcome_map") else plot.COLUMN_WIDTH)
    (drawing,) = (item for item in items if isinstance(item, Drawing) and item.name == GALLERY[study])
    with tempfile.TemporaryDirectory() as large:
        png = shrink(drawing.save(Path(large)).with_suffix(".png").read_bytes(), SMALL)
    (FOLDER / f"study_{study}.png").write_bytes(png)


def draw_time_scales() -> None:
    """Writes the picture of the two time scales: friction through a period, and wear over the cycles."""
    given = {"axes.frequency": 160.0, "axes.excitation_amplitude": 10.0, "axes.scheme": "adaptive"}
    given |= {"slow_time.cycles": LAST, "slow_time.outputs": COUNTS[-1] + 1, "outputs.loops": [0]}
    with tempfile.TemporaryDirectory() as folder, plot.style():
        result = run_study(
            "sdof_slider", Path(folder) / "slider.nc", overrides={**given, "axes.wear_coefficient": 1.1e-11}
        )
        result = result.squeeze([*result["outcome"].dims])
        figure, panels = plot.new_panels(1, 2, 2.6)
        (fast, slow), depth = panels[0], 1e6 * result["wear_depth"].values[:, 0]
        slow.plot(1e-3 * result["cycle"], depth, color="0.6")
        for number, place in enumerate(COUNTS):
            loop, look = (
                result.isel(cycle=[place]).fretwear.loop(0).isel(cycle=0),
                plot.line_style(number) | {"marker": ""},
            )
            label = f"cycle {int(result['cycle'][place]):,}".replace(",", " ")
            fast.plot(1e3 * loop["phase"] / (2.0 * np.pi * 160.0), loop["force"][:, 1], **look, label=label)
            slow.plot(1e-3 * result["cycle"][place], depth[place], marker="o", color=look["color"])
        fast.set(xlabel="fast time, one period (ms)", ylabel="friction force (N)")
        slow.set(xlabel="slow time (kcycles)", ylabel="wear depth (µm)", ylim=(0.0, None), xlim=(0.0, None))
        plot.add_legend(figure)
        png = shrink(Drawing("time_scales", "", "", figure).save(Path(folder)).with_suffix(".png").read_bytes(), WIDTH)
    (FOLDER / "time_scales.png").write_bytes(png)


def draw_running_in() -> None:
    """Writes the picture of frequency and damping of a rough joint over the cycles, and prints them."""
    source = (FOLDER.parent / "running_in.toml").read_text(encoding="utf-8")
    evolution = tomllib.loads(source)["wear"]["evolution"]
    mode = {"axes.modal_amplitude": AMPLITUDE, "scene.friction_coefficient": None, "scene.worn.depth": None}
    names = {"natural_frequency": "natural frequency (Hz)", "damping_ratio": "damping ratio (%)"}
    with tempfile.TemporaryDirectory() as folder, plot.style():
        figure, panels = plot.new_panels(1, 2, 2.8)
        for number, words in enumerate(("contact that runs in", "contact that stays as it begins")):
            tables = {f"wear.evolution.{name}": table for name, table in evolution.items()}
            if number:
                tables |= {name: [table[0]] * len(table) for name, table in tables.items() if "energy" not in name}
            path = Path(folder) / f"worn_{number}.nc"
            worn = {"scene.worn.cycle": run_study("running_in", path, overrides=tables)["cycle"].values.tolist()}
            worn |= {"scene.worn.result": str(path)}
            modes = run_study("modes", Path(folder) / f"modes_{number}.nc", overrides={**mode, **tables, **worn})
            modes, look = modes.squeeze(), plot.line_style(number) | {"label": words}
            print(words, modes[[*names, *(f"{name}_error" for name in names)]].to_dataframe().to_string(), sep="\n")
            for panel, (name, label) in zip(panels[0], names.items(), strict=True):
                scale = 1.0 if name == "natural_frequency" else 100.0
                values, error = scale * modes[name].values, scale * modes[f"{name}_error"].values
                plot.add_line(panel, 1e-3 * modes["cycle"].values, values, error, **look)
                panel.set(xlabel="slow time (kcycles)", ylabel=label, xlim=(0.0, None))
        plot.add_legend(figure)
        drawing = Drawing("running_in_modes", "", "", figure)
        png = shrink(drawing.save(Path(folder)).with_suffix(".png").read_bytes(), WIDTH)
    (FOLDER / "running_in_modes.png").write_bytes(png)


def main() -> None:
    names = sys.argv[1:]
    if names == ["time-scales"]:
        draw_time_scales()
    elif names == ["running-in"]:
        draw_running_in()
    elif [Path(name).stem for name in names] == ["dovetail"]:
        write_dovetail(*names)
    else:
        for name in names:
            write_small(name)


def write_dovetail(dovetail: str) -> None:
    """Writes the pictures of the dovetail, and their numbers."""
    drawings = drawings_of(dovetail, NAMES)
    figures = {
        name: {
            "caption": drawing.caption,
            # what matplotlib calls the axes of a colour bar
            "panels": [read_panel(each) for each in drawing.figure.axes if each.get_label() != "<colorbar>"],
        }
        for name, drawing in drawings.items()
    }
    numbers = {
        "study": open_for_report(Path(dovetail)).dataset.attrs["study"],
        "figures": figures,
        "pictures": {f"{name}.png": write_picture(drawings[name]) for name in SHOWN},
    }
    text = json.dumps(numbers, indent=1, ensure_ascii=False)
    # each list of numbers on one line
    text = re.sub(r"\[\s+([^\[\]{}\"]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"
    (FOLDER / NUMBERS).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
