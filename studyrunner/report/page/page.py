"""One HTML page of a result, with everything inside: opens from a disk, without a network.

Templates put it together and escape all texts; only pictures, scripts, the style sheet and the numbers are taken as
they are. The page runs only its own scripts, named by their hashes in its security policy.

By hand: ids in the SVG files of matplotlib are alike, and no library makes one page of several.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.page.data import PageData, build_page_data
from studyrunner.report.page.study import describe_study
from studyrunner.report.reading.result import Result
from studyrunner.user_error import show_text

DATA_LIMIT = 5.2e6
"""Most characters of numbers for the interactive part."""

PAGE_LIMIT = 11.4e6
"""Bytes that a page is to stay below; its drawings and numbers make room."""

_SCRIPTS = (
    "numbers.js",
    "plots.js",
    "blocks.js",
    "root.js",
    "trends.js",
    "scatter.js",
    "page.js",
)  # each uses what stands in those before it
_DRAWINGS_LIMIT = 3e6
_FEWEST_DATA = 0.5e6
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_REFERENCE = re.compile(r"url\(#")
_UNWANTED = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"}


@dataclass(frozen=True)
class Shown:
    """A drawing as it stands on the page: as an SVG element, or as the base64 of a PNG file where there is one."""

    drawing: Drawing
    svg: str
    png: str = ""

    @property
    def n_bytes(self) -> int:
        """Length in the page."""
        return len((self.png or self.svg).encode())


@dataclass(frozen=True)
class Summary:
    """What was written. n_bytes: of the page."""

    n_drawings: int
    n_tables: int
    n_missing: int
    n_bytes: int


def write_page(result: Result, items: Iterable[Drawing | Missing | Table], path: Path) -> Summary:
    """Write the page, and beside it `<name>.svg` and `<name>.png` of each drawing.

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
    folder = path.parent
    parts = _within_limit([_save(item, folder) if isinstance(item, Drawing) else item for item in items], folder)
    text = _build_page(result, parts)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(text, encoding="utf-8", newline="\n")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    kinds = Counter(type(part) for part in parts)
    return Summary(kinds[Shown], kinds[Table], kinds[Missing], path.stat().st_size)


def inline_svg(text: str, prefix: str, label: str) -> str:
    """An SVG file of matplotlib as an element of the page: its ids begin with `prefix`, its style sheet is left out."""
    root = ElementTree.fromstring(text)
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag in _UNWANTED]:
            parent.remove(child)
    for element in root.iter():
        for name, value in element.attrib.items():
            if name == "id":
                element.set(name, prefix + value)
            elif name in ("href", f"{{{_XLINK}}}href") and value.startswith("#"):
                element.set(name, f"#{prefix}{value[1:]}")
            else:
                element.set(name, _REFERENCE.sub(f"url(#{prefix}", value))
    root.set("role", "img")
    root.set("aria-label", label)
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return ElementTree.tostring(root, encoding="unicode")


def _save(drawing: Drawing, folder: Path) -> Shown:
    svg, _ = drawing.save(folder)
    return Shown(drawing, inline_svg(svg.read_text(encoding="utf-8"), f"{drawing.name}-", drawing.title))


def _within_limit(parts: Sequence[Shown | Missing | Table], folder: Path) -> list[Shown | Missing | Table]:
    """The parts with the largest drawings as pixels instead of lines, until they are small enough together."""
    parts = list(parts)
    for place in sorted(range(len(parts)), key=lambda place: -_size(parts[place])):
        if sum(map(_size, parts)) <= _DRAWINGS_LIMIT:
            break
        part = parts[place]
        if isinstance(part, Shown):
            image = base64.b64encode((folder / f"{part.drawing.name}.png").read_bytes()).decode("ascii")
            parts[place] = min(part, replace(part, png=image), key=_size)
    return parts


def _size(part: Shown | Missing | Table) -> int:
    return part.n_bytes if isinstance(part, Shown) else 0


def _build_page(result: Result, parts: Sequence[Shown | Missing | Table]) -> str:
    """The page as text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    loader = PackageLoader("studyrunner.report.page", ".")
    template = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **blocks).get_template(
        "page.html"
    )
    scripts = [_normal(get_plotlyjs()), _normal("\n".join(map(_own_file, _SCRIPTS)))]
    shown: dict[str, Any] = {
        "title": result.title,
        "file": show_text(result.path.name),
        "css": _own_file("page.css"),
        "study": describe_study(result),
        "parts": parts,
        "missing": [part for part in parts if isinstance(part, Missing)],
    }

    def render(data: PageData) -> str:
        """The page with these numbers; without scripts where there are none."""
        own = scripts if data.content is not None else []
        hashes = " ".join(f"'sha256-{_digest(script)}'" for script in own) or "'none'"
        policy = f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
        numbers = _json(data.content) if own else ""
        return template.render(shown, policy=policy, scripts=own, data=numbers, notes=data.notes)

    fixed = sum(len(text.encode()) for text in (render(PageData(None, ())), *scripts))
    return render(build_page_data(result, min(DATA_LIMIT, max(PAGE_LIMIT - fixed, _FEWEST_DATA))))


def _own_file(name: str) -> str:
    return resources.files("studyrunner.report.page").joinpath("browser", name).read_text(encoding="utf-8")


def _normal(script: str) -> str:
    """A script as a browser reads it from the page: the hash is that of its text with plain line ends."""
    return script.replace("\r\n", "\n").replace("\r", "\n")


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")


def _json(content: object) -> str:
    """JSON that cannot end the script element that it stands in."""
    return json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
