"""One HTML page of a result, with everything inside: opens from a disk, without a network.

A template puts it together and escapes all texts; only pictures, scripts, the style sheet and the numbers are taken as
they are.

By hand: ids in the SVG files of matplotlib are alike, and no library makes one page of several.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.page.data import build_page_data
from studyrunner.report.page.root import build_root_numbers
from studyrunner.report.page.study import describe_study
from studyrunner.result.view import Result
from studyrunner.user_error import show_text

DATA_LIMIT = 5e6
"""Most characters of numbers of the interactive part, those of the root in three dimensions aside."""

_SCRIPTS = ("panel.js", "root.js", "page.js")  # each uses what stands in those before it
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_UNWANTED = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"}
_REFERENCE = re.compile(r"url\(#")
_GREY = re.compile(r"#([0-9a-f]{2})\1\1\b")
_DARKEST, _BRIGHTEST = 0x18, 0xE8


@dataclass(frozen=True)
class Shown:
    """A drawing as it stands on the page: SVG elements for wide and for narrow windows, and names of its files."""

    name: str
    title: str
    caption: str
    wide: str
    narrow: str
    files: tuple[str, ...]


@dataclass(frozen=True)
class Summary:
    """What was written. n_bytes: of the page."""

    n_drawings: int
    n_tables: int
    n_missing: int
    n_bytes: int


def write_page(result: Result, items: Iterable[Drawing | Missing | Table], path: Path) -> Summary:
    """Write the page, and beside it the files of each drawing.

    Parameters
    ----------
    result
        The file that is shown.
    items
        What the page shows beside the interactive part, in its order.
    path
        Of the page, in a folder that exists. An older page is replaced when the new one is complete.

    Raises
    ------
    OSError
        Where something cannot be written.
    """
    parts = [_save(item, path.parent) if isinstance(item, Drawing) else item for item in items]
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(_build_page(result, parts), encoding="utf-8", newline="\n")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    kinds = Counter(type(part) for part in parts)
    return Summary(kinds[Shown], kinds[Table], kinds[Missing], path.stat().st_size)


def inline_svg(text: str, prefix: str, label: str) -> str:
    """An SVG file of matplotlib as an element of the page.

    Its ids begin with `prefix`, its style sheet is left out, and its greys, black and white among them, change places
    on a dark page.
    """
    root = ElementTree.fromstring(text)
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag in _UNWANTED]:
            parent.remove(child)
    for element in root.iter():
        for name, value in element.attrib.items():
            if name == "id":
                element.set(name, prefix + value)
            elif name in ("href", f"{{{_XLINK}}}href"):
                element.set(name, f"#{prefix}{value[1:]}" if value.startswith("#") else value)
            else:
                element.set(name, _REFERENCE.sub(f"url(#{prefix}", value))
        if "style" in element.attrib:
            element.set("style", _GREY.sub(_turn_grey, element.attrib["style"]))
    root.set("role", "img")
    root.set("aria-label", label)
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return ElementTree.tostring(root, encoding="unicode")


def _turn_grey(found: re.Match[str]) -> str:
    level = _BRIGHTEST - (_BRIGHTEST - _DARKEST) * int(found[1], 16) // 255
    return f"light-dark({found[0]}, #{level:02x}{level:02x}{level:02x})"


def _save(drawing: Drawing, folder: Path) -> Shown:
    paths = drawing.save(folder)
    wide, narrow = (inline_svg(path.read_text(encoding="utf-8"), f"{path.stem}-", drawing.title) for path in paths)
    files = [f"{drawing.name}.{kind}" for kind in ("svg", "png", "csv")] + [paths[1].name]
    there = tuple(name for name in files if (folder / name).exists())
    return Shown(drawing.name, drawing.title, drawing.caption, wide, narrow, there)


def _build_page(result: Result, parts: Sequence[Shown | Missing | Table]) -> str:
    """The page as text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    loader = PackageLoader("studyrunner.report.page", ".")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **blocks)
    notes: list[str] = []
    data = build_page_data(result, DATA_LIMIT, notes)
    if data is not None:
        data["root"] = build_root_numbers(result, notes)
    scripts = [] if data is None else [get_plotlyjs(), "\n".join(map(_own_file, _SCRIPTS))]
    return environment.get_template("page.html").render(
        title=result.title,
        file=show_text(result.path.name),
        css=_own_file("page.css"),
        study=describe_study(result),
        parts=[part for part in parts if not isinstance(part, Missing)],
        missing=[part for part in parts if isinstance(part, Missing)],
        notes=notes,
        # nothing in it ends the script element that it stands in
        data=json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c") if data else "",
        scripts=scripts,
    )


def _own_file(name: str) -> str:
    return resources.files("studyrunner.report.page").joinpath("browser", name).read_text(encoding="utf-8")
