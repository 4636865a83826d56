"""One HTML page of a result, with everything inside: opens from a disk, without a network.

A template puts it together and escapes all texts; only scripts, the style sheet, the numbers, and the SVG files that
matplotlib has written, are taken as they are. Numbers of the interactive part are variables of the file as 32-bit
floats, within a limit of size.
"""

import base64
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from studyrunner.coordinates import COORDINATES
from studyrunner.kinds.wear.kind import CERTIFICATE, OWN_STEPS
from studyrunner.report.drawing import Drawing, Item, Missing
from studyrunner.report.figures.response import find_loops
from studyrunner.report.root import body_colours, find_views, read_root
from studyrunner.report.selection import course_axis
from studyrunner.result.opening import describe_outcome
from studyrunner.result.pairs import axes_of_scenes, of_shown_scene
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.statistics.samples import DRAWN
from studyrunner.summary.answer import summarise
from studyrunner.system.machine import replacing
from studyrunner.system.process import raise_ending
from studyrunner.system.progress import count
from studyrunner.units import Scale, scale_for, show_number, units_of
from studyrunner.user_error import show_text

DATA_LIMIT = 5e6
"""Most characters of numbers of the interactive part, those of the root in three dimensions aside."""

_SCRIPTS = ("panel.js", "root.js", "page.js")  # each uses what stands in those before it
_MOST_VALUES = 12


def write_page(result: Result, items: Iterable[Item], path: Path) -> str:
    """Write the page, and beside it the files of each drawing, into a folder that exists; what is there, in words.

    An older page is replaced when the new one is complete. Raises OSError where something cannot be written, and
    KeyboardInterrupt where the process is ended from outside.
    """
    counts, parts = Counter[str](), list[Any]()
    for item in items:
        raise_ending()
        counts[type(item).__name__] += 1
        parts.append(_save(item, path.parent) if isinstance(item, Drawing) else item)
    with replacing(path) as partial:
        partial.write_text(_build_page(result, parts), encoding="utf-8", newline="\n")
    shown = f"{count(counts['Drawing'], 'figure')}, {count(counts['Table'], 'table')}, {counts['Missing']} left out"
    return f"{shown}, {path.stat().st_size / 1e6:.1f} MB"


def _save(drawing: Drawing, folder: Path) -> dict[str, Any]:
    """A drawing as it stands on the page: its picture, and names of its files.

    Parts of SVG files with one id are equal: matplotlib makes the ids of what is referred to from their contents.
    """
    text = drawing.save(folder).read_text(encoding="utf-8")
    files = [name for kind in ("svg", "png", "csv") if (folder / (name := f"{drawing.name}.{kind}")).exists()]
    about = {"name": drawing.name, "title": drawing.title, "caption": drawing.caption}
    # pixels on a wide screen: half as large again as in print
    about["width"] = f"{1.5 * 96.0 * drawing.figure.get_figwidth():.0f}"
    return {**about, "picture": text[text.index("<svg") :], "files": files}


def _build_page(result: Result, parts: Sequence[Any]) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    loader = PackageLoader("studyrunner.report", "browser")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **blocks)
    notes, browser = list[str](), resources.files("studyrunner.report") / "browser"
    data, scripts = build_page_data(result, DATA_LIMIT, notes), list[str]()
    if data is not None:
        data["root"] = build_root_numbers(result, notes)
        scripts = [get_plotlyjs(), "\n".join(browser.joinpath(name).read_text("utf-8") for name in _SCRIPTS)]
    return environment.get_template("page.html").render(
        title=result.dataset.attrs.get("title") or show_text(result.path.stem),
        file=show_text(result.path.name),
        css=browser.joinpath("page.css").read_text("utf-8"),
        answer=summarise(result).rows,
        facts=_facts(result),
        study=result.dataset.attrs.get("study"),
        parts=[part for part in parts if not isinstance(part, Missing)],
        missing=[part for part in parts if isinstance(part, Missing)],
        notes=notes,
        # nothing in it ends the script element that it stands in
        data=json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c") if data else "",
        scripts=scripts,
    )


def _facts(result: Result) -> list[tuple[str, str]]:
    """Names and values: points, axes, contact pairs, versions."""
    facts = [("points", f"{result.computed.size}, {np.count_nonzero(result.computed)} computed to the end")]
    schemes = result.dataset["scheme"].values.tolist() if "scheme" in result.axes else []
    # the middle of the range of a followed resonance, and steps that no scheme takes, say nothing
    unused = {"frequency"} if result.followed else set[str]()
    unused |= {"step"} if schemes and {*schemes} <= {*OWN_STEPS} else set()
    facts += [("frequency", f"the {result.followed}, followed")] if result.followed else []
    for name in (name for name in result.axes if name not in unused):
        axis = result.dataset[name]
        numbers, units = axis.dtype.kind in "fiu", units_of(axis)
        values = [show_number(float(value)) if numbers else str(value) for value in axis.values]
        text = f"{values[0]} to {values[-1]}, {len(values)} values" if len(values) > _MOST_VALUES else ", ".join(values)
        # of keys of [scene] and [wear] the file says what they are
        meaning = "" if name in COORDINATES else str(axis.attrs.get("long_name", ""))
        facts.append((name.replace("_", " "), f"{text} {units}".rstrip() + (f": {meaning}" if meaning else "")))
    facts.append(("contact pairs", str(result.dataset.sizes["contact"])))
    named = {"source": "source", "versions": "versions", "scene_sha256": "hash of the scene"}
    attributes = result.dataset.attrs
    return facts + [(label, str(attributes[name])) for name, label in named.items() if name in attributes]


# --- numbers of the interactive part ---

_CHARACTERS_A_FLOAT = 16.0 / 3.0
_MOST_POINTS = 20_000
"""Points of a study with an interactive part: each takes time to draw."""

_MOST_FACES, _MOST_PAIRS = 15_000, 10_000
"""Faces, and contact pairs, that the page draws in three dimensions."""

_MOST_MESSAGES, _MOST_PHASES = 500, 64
_LOOPS = "pair_of_loop"
"""Dimension of those pairs that have loops."""

_ERRORS = dict.fromkeys(("response_amplitude", "response_amplitude_begin", "response_peak"), "response_error")
"""Variables whose error has another name than `<name>_error`."""

_PERCENT = ("worn_volume_error", "error_estimate", "block_worn_volume_error", *CERTIFICATE)
_FIRST = ("worn_volume", "natural_frequency", "response_amplitude")
_COLOURED = ("worn_cycle", "scheme", "sweep", "cycle", "mode")
_LINES = 10

_Arrays = dict[str, xr.DataArray]


def encode_floats(values: ArrayLike) -> str:
    """Numbers as base64 of little-endian 32 bit floats, the last index fastest; NaN stays NaN."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def build_page_data(result: Result, limit: float, notes: list[str]) -> dict[str, Any] | None:
    """What the script of the page reads, in about `limit` characters; None where there is nothing to show.

    `dims`: the dimensions, the axes first. `coords`: numbers along one that may stand for it. `variables`: see
    `_encode`. `at`: index along each dimension, and `start`: what is shown at first. `messages`: of points by number,
    the last axis fastest. `notes` gets sentences on what is left out.
    """
    if not result.has_values.any():
        return None
    if (n_points := result.has_values.size) > _MOST_POINTS:
        notes.append(f"The study has {n_points} points, more than the {_MOST_POINTS} that can be picked here.")
        return None
    if result.has("cycle_count"):
        notes.append("Each point has cycle counts of its own, see cycle_count: cycle is the number of the output.")
    shown = dict(result.shown)
    floats = limit / _CHARACTERS_A_FLOAT if result.has_slow_time else math.inf
    arrays, counts = _fit(_arrays(result), floats, notes)
    used = dict.fromkeys([*result.axes, *(str(dim) for array in arrays.values() for dim in array.dims)])
    if result.has_slow_time:
        shown["cycle"] = int(np.abs(counts - result.last_reached(shown)).argmin())
    outcomes = np.unique(result.dataset["outcome"].values).tolist()
    messages = result.dataset["message"].values.ravel().tolist() if result.has("message") else []
    return {
        "dims": [_dimension(result, name, arrays) for name in used],
        "axes": list(result.axes),
        "coords": list(_coordinates(result, set(used))),
        "variables": [_encode(array, arrays) for array in arrays.values()],
        "at": {name: shown.get(name, 0) for name in used},
        "start": _start(result, arrays),
        "sentences": {str(number): describe_outcome(number)[1] for number in outcomes},
        "messages": {str(place): text for place, text in enumerate(messages) if text and place < _MOST_MESSAGES},
    }


def _arrays(result: Result) -> _Arrays:
    """Numbers of the file that belong to points of the study, unread; loops of those pairs alone that have some."""
    arrays, blocks = _Arrays(), {} if result.blocks is None else result.blocks.data_vars
    for name, array in {**result.dataset.data_vars, **blocks}.items():
        if "phase" in array.dims:
            phases = slice(None, None, -(-array.sizes["phase"] // _MOST_PHASES))
            pairs = find_loops(result, result.shown)
            array = array.sel(contact=pairs).isel(phase=phases).rename(contact=_LOOPS)
        if array.dtype.kind in "iuf" and set(result.axes) & set(array.dims) and array.size:
            arrays[str(name)] = array
    return arrays


def _fit(arrays: _Arrays, floats: float, notes: list[str]) -> tuple[_Arrays, NDArray[np.intp]]:
    """Variables that fit, at as many counts as fit, and places of these: the first, the last, and some between."""
    cycles = {name: array.sizes.get("cycle", 1) for name, array in arrays.items()}
    small = {name: array.size // cycles[name] * min(2, cycles[name]) for name, array in arrays.items()}
    n_cycles = max(cycles.values(), default=1)
    for name in sorted(arrays, key=lambda name: -small[name]):
        if sum(small[each] for each in arrays) > floats:
            del arrays[name]
            notes.append(f"{name} does not fit into this page.")
    # a variable along the cycles takes as much at each of them
    each = sum(array.size / n_cycles for array in arrays.values() if "cycle" in array.dims)
    others = sum(array.size for array in arrays.values() if "cycle" not in array.dims)
    most = n_cycles if each * n_cycles + others <= floats else max(min(2, n_cycles), int((floats - others) / each))
    counts = np.unique(np.linspace(0, n_cycles - 1, most).round().astype(np.intp))
    if most < n_cycles:
        notes.append(f"On this page are {len(counts)} of {n_cycles} counts.")
        arrays = {name: array.isel(cycle=counts, missing_dims="ignore") for name, array in arrays.items()}
    return arrays, counts


def _encode(array: xr.DataArray, arrays: _Arrays) -> dict[str, Any]:
    """A variable: `data` in SI times `factor` in `unit`, `error` the variable of its error, `words` of its values."""
    name, attributes = str(array.name), array.attrs
    values = array.values.astype(float)
    scale = scale_for(str(attributes.get("units", "")), values)
    if name in _PERCENT and name.endswith(("_error", "_estimate")):
        scale = Scale(100.0, "%")
    error = _ERRORS.get(name, f"{name}_error")
    outcomes = np.unique(array.values).tolist() if name == "outcome" else []
    return {
        "name": name,
        "label": str(attributes.get("long_name", name)),
        "unit": scale.unit,
        "factor": scale.factor,
        "dims": [str(dim) for dim in array.dims],
        "data": encode_floats(values),
        "error": error if error in arrays else None,
        "relative": error in arrays and str(arrays[error].attrs.get("units")) != str(attributes.get("units")),
        "words": {str(number): describe_outcome(number)[0].replace("_", " ") for number in outcomes},
    }


def _dimension(result: Result, name: str, arrays: _Arrays) -> dict[str, Any]:
    """A dimension with its values: numbers, or words."""
    axis = next(array for array in arrays.values() if name in array.dims)[name]
    label = result.counted if name == "cycle" and result.has_slow_time else name.replace("_", " ")
    words, values = axis.dtype.kind not in "fiu", axis.values.tolist()
    numbers = [str(each) if words else each if math.isfinite(each) else None for each in values]
    return {
        "name": name,
        "label": label,
        "unit": "" if name == "cycle" else units_of(axis),
        "values": numbers,
        "words": words,
    }


def _coordinates(result: Result, dims: set[str]) -> Iterator[dict[str, Any]]:
    """Numbers along one dimension: what samples draw, positions of the pairs."""
    for name, axis in result.dataset.coords.items():
        along = [str(dim) for dim in axis.dims]
        if len(along) == 1 and along[0] in dims and name != along[0] and axis.dtype.kind in "iuf":
            scale = scale_for(str(axis.attrs.get("units", "")), axis.values)
            label = str(name).removeprefix(DRAWN).replace("_", " ")
            data = encode_floats(scale(axis.values))
            yield {"name": str(name), "dim": along[0], "label": label, "unit": scale.unit, "data": data}


def _start(result: Result, arrays: _Arrays) -> dict[str, str]:
    """What is shown first: a variable over the axis that figures are drawn over, or over slow time."""
    wears = result.has("worn_volume") and bool(np.nanmax(result.worn) > NO_VOLUME)
    usual = [name for name in _FIRST if name in arrays and (wears or name != "worn_volume")]
    name = next(iter((*usual, *arrays)))
    sizes = arrays[name].sizes
    several = [str(dim) for dim in sizes if sizes[dim] > 1]
    over = [dim for dim in (course_axis(result), "cycle") if dim in several]
    across = str(next(iter((*over, *several, *sizes))))
    colours = [dim for dim in _COLOURED if dim in several and dim != across and sizes[dim] <= _LINES]
    return {"variable": name, "x": across, "colour": colours[0] if colours else ""}


def build_root_numbers(result: Result, notes: list[str]) -> dict[str, Any] | None:
    """Faces and views as the script on the page reads them; None where there are none to draw, or too many.

    As `encode_floats` has them: `nodes`, m, `faces`, of each `body`, `flank` and bits `seen` of the views; of `contact`
    nodes, pairs and normals. `well_seen`: m, a depth that is well seen. `scene`: index of the drawn scene along axes.
    """
    n_pairs = result.dataset.sizes["contact"]
    if n_pairs > _MOST_PAIRS:
        notes.append(f"The contact is not on this page in three dimensions: it has {n_pairs} pairs.")
        return None
    scene = of_shown_scene(result)
    whole = read_root(scene)
    if whole is None:
        return None
    surface = whole.near_contact(_MOST_FACES)
    n_shown, n_faces = len(surface.faces), len(whole.faces)
    if n_shown < n_faces:
        notes.append(f"In three dimensions are {n_shown} of {n_faces} faces, those near the contact.")
    views, shown = find_views(surface), result.shown
    seen = sum(view.faces.astype(int) << number for number, view in enumerate(views))
    of_faces = {"nodes": surface.nodes, "faces": surface.faces, "body": surface.body, "flank": surface.flank}
    pairs = np.flatnonzero(np.isin(result.dataset["contact"], scene.dataset["contact"]))[surface.pairs]
    of_contact = {"nodes": surface.contact_nodes, "pairs": pairs, "normals": surface.normals}
    return {
        **{name: encode_floats(values) for name, values in (of_faces | {"seen": np.asarray(seen)}).items()},
        "bodies": list(surface.bodies),
        "colours": list(body_colours(surface.bodies)),
        "contact": {name: encode_floats(values) for name, values in of_contact.items()},
        "well_seen": surface.well_seen,
        "scene": {name: shown[name] for name in axes_of_scenes(result)},
        "views": [
            {
                "title": each.title,
                "body": each.body,
                "eye": each.to_eye.round(6).tolist(),
                "up": each.up.round(6).tolist(),
            }
            for each in views
        ],
    }
