"""One HTML page of a result, with everything inside: opens from a disk, without a network.

A template puts it together and escapes all texts; only scripts, the style sheet, the numbers, and the SVG files that
matplotlib has written, are taken as they are.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from studyrunner.coordinates import COORDINATES
from studyrunner.report.drawing import Drawing, Item, Missing
from studyrunner.report.page.data import build_page_data, build_root_numbers
from studyrunner.result.view import Result
from studyrunner.summary.answer import summarise
from studyrunner.system.progress import count
from studyrunner.units import show_number, units_of
from studyrunner.user_error import show_text

DATA_LIMIT = 5e6
"""Most characters of numbers of the interactive part, those of the root in three dimensions aside."""

_SCRIPTS = ("panel.js", "root.js", "page.js")  # each uses what stands in those before it
_MOST_VALUES = 12


def write_page(result: Result, items: Iterable[Item], path: Path) -> str:
    """Write the page, and beside it the files of each drawing, into a folder that exists; what is there, in words.

    An older page is replaced when the new one is complete. Raises OSError where something cannot be written.
    """
    counts, parts = Counter[str](), list[Any]()
    for item in items:
        counts[type(item).__name__] += 1
        parts.append(_save(item, path.parent) if isinstance(item, Drawing) else item)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(_build_page(result, parts), encoding="utf-8", newline="\n")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    shown = f"{count(counts['Drawing'], 'figure')}, {count(counts['Table'], 'table')}, {counts['Missing']} left out"
    return f"{shown}, {path.stat().st_size / 1e6:.1f} MB"


def _save(drawing: Drawing, folder: Path) -> dict[str, Any]:
    """A drawing as it stands on the page: pictures for wide and narrow windows, and names of its files.

    Parts of SVG files with one id are equal: matplotlib makes the ids of what is referred to from their contents.
    """
    paths = drawing.save(folder)
    wide, narrow = (text[text.index("<svg") :] for text in (path.read_text(encoding="utf-8") for path in paths))
    files = [f"{drawing.name}.{kind}" for kind in ("svg", "png", "csv")] + [paths[1].name]
    there = [name for name in files if (folder / name).exists()]
    about = {"name": drawing.name, "title": drawing.title, "caption": drawing.caption}
    return {**about, "wide": wide, "narrow": narrow, "files": there}


def _build_page(result: Result, parts: Sequence[Any]) -> str:
    """The page as text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    loader = PackageLoader("studyrunner.report.page", ".")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **blocks)
    notes, own = list[str](), resources.files("studyrunner.report.page") / "browser"
    data = build_page_data(result, DATA_LIMIT, notes)
    if data is not None:
        data["root"] = build_root_numbers(result, notes)
    return environment.get_template("page.html").render(
        title=result.title,
        file=show_text(result.path.name),
        css=own.joinpath("page.css").read_text("utf-8"),
        answer=summarise(result).rows,
        facts=_facts(result),
        study=result.dataset.attrs.get("study"),
        parts=[part for part in parts if not isinstance(part, Missing)],
        missing=[part for part in parts if isinstance(part, Missing)],
        notes=notes,
        # nothing in it ends the script element that it stands in
        data=json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c") if data else "",
        scripts=[get_plotlyjs(), "\n".join(own.joinpath(name).read_text("utf-8") for name in _SCRIPTS)] if data else [],
    )


def _facts(result: Result) -> list[tuple[str, str]]:
    """Names and values: points, axes, contact pairs, versions."""
    ends = {
        "computed to the end": result.computed,
        "ended early with values up to there": result.has_values & ~result.computed,
        "without a result": ~result.has_values,
    }
    ended = ", ".join(f"{np.count_nonzero(where)} {words}" for words, where in ends.items() if where.any())
    facts = [("points", f"{result.computed.size}: {ended}")]
    for name in result.axes:
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
