"""Cuts a deck of CalculiX or Abaqus, and the files that it includes, into keywords with their data lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from studies.fe_models.text.read_errors import LARGEST_DECK, Place, check_file, shown

_BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, which some editors write, in Latin-1
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
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

    Raises SceneError where a file is missing, is no deck, too large, or includes itself.
    """
    block: Block | None = None
    names = [] if included is None else included
    for text, place in _lines(path, path.name, path.parent.resolve(), names, ()):
        if text.startswith("*"):
            if block is not None:
                yield block
            block = _cut_keyword(text, place)
        elif block is None:
            raise place.wrong(f"{shown(text)!r} before the first keyword", "give a deck of CalculiX or Abaqus")
        else:
            block.lines.append(text)
            block.places.append((place.file, place.line))
    if block is None:
        raise Place(path.name, 1).wrong("no keyword in the file", "give a deck of CalculiX or Abaqus")
    yield block


def _lines(
    path: Path, name: str, folder: Path, included: list[str], within: tuple[Path, ...]
) -> Iterator[tuple[str, Place]]:
    """Keywords, each as one line, and data lines; those of included files in their places.

    An included file does not end a keyword: data lines may follow in it, and behind it. within: files that are open.
    """
    check_file(path, LARGEST_DECK)
    begun: tuple[str, Place] | None = None  # a keyword that goes on in the next line
    with path.open(encoding="latin-1") as file:
        for number, raw in enumerate(file, 1):
            text = raw.removeprefix(_BYTE_ORDER_MARK).strip() if number == 1 else raw.strip()
            if not text or text == "*" or text.startswith("**"):
                continue
            place = Place(name, number)
            if begun is not None and text.startswith("*"):
                yield from _keyword(*begun, folder, included, (*within, path.resolve()))
            elif begun is not None:
                text, place = begun[0] + text, begun[1]
            begun = None
            if not text.startswith("*"):
                yield text, place
            elif text.endswith(","):
                begun = text, place
            else:
                yield from _keyword(text, place, folder, included, (*within, path.resolve()))
    if begun is not None:
        yield from _keyword(*begun, folder, included, (*within, path.resolve()))


def _keyword(
    text: str, place: Place, folder: Path, included: list[str], within: tuple[Path, ...]
) -> Iterator[tuple[str, Place]]:
    """A keyword, and the lines of the file that it includes."""
    block = _cut_keyword(text, place)
    if block.keyword != "INCLUDE":
        yield text, place
        if block.keyword not in _WITH_INPUT or "INPUT" not in block.parameters:
            return
    name = block.parameters.get("INPUT", "").strip().strip('"')
    try:
        path = (folder / name).resolve()
        missing = not path.is_file()
    except (OSError, ValueError):
        missing, path = True, folder
    if not path.is_relative_to(folder):
        raise block.place.wrong(f"{shown(name)} is outside the deck's folder", "copy it beside the deck")
    if missing:
        raise block.place.wrong(f"there is no file {shown(name)}", "copy it beside the deck")
    if path in within:
        raise block.place.wrong(f"{shown(name)} includes itself", "remove this line")
    relative = str(path.relative_to(folder))
    if relative not in included:
        included.append(relative)
    yield from _lines(path, relative, folder, included, within)


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
