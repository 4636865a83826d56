"""Cuts a deck of CalculiX or Abaqus, and the files that it includes, into keywords with their data lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from studies.fe_models.text.read_errors import LARGEST_DECK, Place, check_file, shown

_LONGEST_LINE = 10_000
_MOST_INCLUDES = 1000
_DEEPEST_INCLUDE = 10
_BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, which some editors write, in Latin-1
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
_MOST_BLOCKS = 1_000_000
_MOST_LINES = 6_000_000  # each takes a hundred bytes of memory and more
# the name of a parameter, and its value: quoted, or up to the next comma
_PARAMETER = re.compile(r'[\s,]*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,"]*))?\s*(?:,|$)')


@dataclass
class Block:
    """A keyword and the data lines below it.

    keyword: in capitals, without its star and without blanks: "SOLIDSECTION". written: as it stands in the file.
    parameters: values by names in capitals without blanks; "" for a name without value. place: of the keyword.
    lines: data lines, comments and empty lines left out. places: of the data lines.
    """

    keyword: str
    written: str
    parameters: dict[str, str]
    place: Place
    lines: list[str] = field(default_factory=list)
    places: list[tuple[str, int]] = field(default_factory=list)

    def place_of(self, line: int) -> Place:
        """Place of a data line, counted from 0."""
        return Place(*self.places[line], self.written)

    def name(self, parameter: str) -> str:
        """The value of a parameter that is a name, in capitals. Raises SceneError where it is missing."""
        value = read_name(self.parameters.get(parameter, ""))
        if not value:
            raise self.place.wrong(f"*{self.written} without {parameter}", f"write {parameter}=... behind the keyword")
        return value


def read_name(text: str) -> str:
    """A name in capitals: without blanks, or as it stands between quotation marks."""
    text = text.strip()
    if len(text) >= 2 and text[0] == text[-1] == '"':
        return text[1:-1].upper()
    return "".join(text.split()).upper()


def read_blocks(path: Path, included: list[str] | None = None) -> Iterator[Block]:
    """The keywords of a deck, one after the other, those of files that it includes in their places.

    An included file stands in the deck's folder or below; its name is taken from there, and appended to `included`.

    Raises
    ------
    SceneError
        Where a file is missing, is no text, too large, or includes itself.
    """
    return _Cutter(path, [] if included is None else included).blocks()


class _Cutter:
    def __init__(self, path: Path, included: list[str]) -> None:
        self.path = path
        self.included = included
        self.folder = path.parent.resolve()
        self.bytes_left = LARGEST_DECK
        self.n_includes = 0
        self.open: list[Path] = []

    def blocks(self) -> Iterator[Block]:
        block: Block | None = None
        n_blocks = n_lines = 0
        for text, place in self._lines(self.path, self.path.name):
            if text.startswith("*"):
                if block is not None:
                    yield block
                block = _cut_keyword(text, place)
                n_blocks += 1
                if n_blocks > _MOST_BLOCKS:
                    raise place.wrong(f"more than {_MOST_BLOCKS} keywords", "reduce the deck")
            elif block is None:
                raise place.wrong(f"{shown(text)!r} before the first keyword", "give a deck of CalculiX or Abaqus")
            else:
                n_lines += 1
                if n_lines > _MOST_LINES:
                    raise place.wrong(f"more than {_MOST_LINES} lines", "reduce the deck")
                block.lines.append(text)
                block.places.append((place.file, place.line))
        if block is None:
            raise Place(self.path.name, 1).wrong("no keyword in the file", "give a deck of CalculiX or Abaqus")
        yield block

    def _lines(self, path: Path, name: str) -> Iterator[tuple[str, Place]]:
        """Keywords, each as one line, and data lines; those of included files in their places.

        An included file does not end a keyword: data lines may follow in it, and behind it.
        """
        self.bytes_left -= check_file(path, LARGEST_DECK)
        if self.bytes_left < 0:
            raise Place(name, 1).wrong(f"more than {LARGEST_DECK / 2**20:.0f} MiB with its includes", "reduce the deck")
        self.open.append(path.resolve())
        number = 0
        begun: tuple[str, Place] | None = None  # a keyword that goes on in the next line
        with path.open(encoding="latin-1") as file:
            while raw := file.readline(_LONGEST_LINE + 1):
                number += 1
                if len(raw) > _LONGEST_LINE or "\0" in raw:
                    raise Place(name, number).wrong("no text, or a very long line", "give a deck of CalculiX or Abaqus")
                text = raw.removeprefix(_BYTE_ORDER_MARK).strip() if number == 1 else raw.strip()
                if not text or text == "*" or text.startswith("**"):
                    continue
                place = Place(name, number)
                if begun is not None:
                    if text.startswith("*"):
                        yield from self._keyword(*begun)
                    else:
                        text, place = begun[0] + text, begun[1]
                    begun = None
                if not text.startswith("*"):
                    yield text, place
                elif text.endswith(",") and len(text) < _LONGEST_LINE:
                    begun = text, place
                else:
                    yield from self._keyword(text, place)
        if begun is not None:
            yield from self._keyword(*begun)
        self.open.pop()

    def _keyword(self, text: str, place: Place) -> Iterator[tuple[str, Place]]:
        cut = _cut_keyword(text, place)
        if cut.keyword != "INCLUDE":
            yield text, place
        if cut.keyword == "INCLUDE" or (cut.keyword in _WITH_INPUT and "INPUT" in cut.parameters):
            yield from self._included(cut)

    def _included(self, block: Block) -> Iterator[tuple[str, Place]]:
        name = block.parameters.get("INPUT", "").strip().strip('"')
        if not name:
            raise block.place.wrong(f"*{block.written} without a file", "write INPUT=file")
        try:
            path = (self.folder / name).resolve()
            missing = not path.is_file()
        except (OSError, ValueError):
            raise block.place.wrong(f"{shown(name)!r} is no name of a file", "write INPUT=file") from None
        if not path.is_relative_to(self.folder):
            raise block.place.wrong(f"{shown(name)} is outside the deck's folder", "copy it beside the deck")
        if missing:
            raise block.place.wrong(f"there is no file {shown(name)}", "copy it beside the deck")
        if path in self.open:
            raise block.place.wrong(f"{shown(name)} includes itself", "remove this line")
        self.n_includes += 1
        if self.n_includes > _MOST_INCLUDES or len(self.open) > _DEEPEST_INCLUDE:
            found = f"more than {_MOST_INCLUDES} files, or {_DEEPEST_INCLUDE} within each other"
            raise block.place.wrong(found, "put the deck into fewer files")
        relative = str(path.relative_to(self.folder))
        if relative not in self.included:
            self.included.append(relative)
        yield from self._lines(path, relative)


def _cut_keyword(text: str, place: Place) -> Block:
    written, _, rest = text[1:].partition(",")
    keyword = "".join(written.split()).upper()
    if not keyword:
        raise place.wrong("a star without a keyword", "write **, where it begins a comment")
    parameters: dict[str, str] = {}
    at = 0
    rest = rest.rstrip().rstrip(",")
    while at < len(rest):
        match = _PARAMETER.match(rest, at)
        if match is None or match.end() == at:
            raise place.wrong(f"{shown(rest[at:])!r} is no parameter of *{shown(written)}", "write NAME=value")
        parameters["".join(match[1].split()).upper()] = (match[2] or "").strip()
        at = match.end()
    name = shown(" ".join(written.split()).upper())
    return Block(keyword, name, parameters, Place(place.file, place.line, name))
