"""One HTML page of a result, with everything inside: opens from a disk, without a network.

Texts of the file are escaped. The page runs only its own scripts, named by their hashes in its security policy.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.page.data import build_page_data
from studyrunner.report.page.sections import (
    figure_section,
    interactive_section,
    missing_section,
    study_section,
    table_section,
)
from studyrunner.report.reading.result import Result
from studyrunner.user_error import show_text

DATA_LIMIT = 4e6
"""Most characters of numbers for the interactive part."""

PAGE_LIMIT = 9.8e6
"""Bytes that a page is to stay below; its drawings and numbers make room."""

_SCRIPTS = ("page_numbers.js", "page_plots.js", "page.js")  # each uses what stands in those before it
_DRAWINGS_LIMIT = 3e6
_FEWEST_DATA = 0.5e6
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_REFERENCE = re.compile(r"url\(#")
_UNWANTED = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"}


@dataclass(frozen=True)
class Shown:
    """A drawing as it stands on the page. markup: SVG or an image, n_bytes long."""

    drawing: Drawing
    markup: str

    @property
    def n_bytes(self) -> int:
        """Length in the page."""
        return len(self.markup.encode())


@dataclass(frozen=True)
class Summary:
    """What was written. n_bytes: of the page."""

    n_drawings: int
    n_tables: int
    n_missing: int
    n_bytes: int


def write_page(result: Result, items: Iterable[Drawing | Missing | Table], path: Path) -> Summary:
    """Write the page `path`, and beside it `<name>.svg` and `<name>.png` of each drawing; the folder exists.

    The page replaces an older one when it is complete. OSError where something cannot be written.
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
            label = escape(part.drawing.title)
            pixels = Shown(part.drawing, f'<img alt="{label}" src="data:image/png;base64,{image}">')
            parts[place] = min(part, pixels, key=_size)
    return parts


def _size(part: Shown | Missing | Table) -> int:
    return part.n_bytes if isinstance(part, Shown) else 0


def _build_page(result: Result, parts: Sequence[Shown | Missing | Table]) -> str:
    from plotly.offline import get_plotlyjs

    body = [study_section(result), ""]
    for part in parts:
        if isinstance(part, Shown):
            body.append(figure_section(part.drawing, part.markup))
        elif isinstance(part, Table):
            body.append(table_section(part))
    body.append(missing_section([part for part in parts if isinstance(part, Missing)]))
    style = _own_file("page.css")
    scripts = [_normal(get_plotlyjs()), _normal("\n".join(map(_own_file, _SCRIPTS)))]
    fixed = sum(len(text.encode()) for text in (*body, style, *scripts))
    data = build_page_data(result, min(DATA_LIMIT, max(PAGE_LIMIT - fixed, _FEWEST_DATA)))
    body[1] = interactive_section(data)
    if data.content is None:
        scripts = []
    else:
        body.append(f'<script type="application/json" id="page-data">{_json(data.content)}</script>')
    hashes = " ".join(f"'sha256-{_digest(script)}'" for script in scripts) or "'none'"
    policy = f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
    title = escape(result.title)
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="only light">',
            f"<title>{title}</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            f"<header><h1>{title}</h1><p>Report of <code>{escape(show_text(result.path.name))}</code></p></header>",
            "<main>",
            *body,
            "</main>",
            *(f"<script>{script}</script>" for script in scripts),
            "</body>",
            "</html>",
            "",
        ]
    )


def _own_file(name: str) -> str:
    return resources.files("studyrunner.report.page").joinpath(name).read_text(encoding="utf-8")


def _normal(script: str) -> str:
    """A script as a browser reads it from the page: the hash is that of its text with plain line ends."""
    return script.replace("\r\n", "\n").replace("\r", "\n")


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")


def _json(content: object) -> str:
    """JSON that cannot end the script element that it stands in."""
    return json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
