"""Text files of finite-element codes: opened within limits, cut into keywords, data lines and numbers.

What is wrong in them is one sentence with file and line.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LARGEST_NUMBER = 2**31 - 1
"""Of a node or an element: the codes count in 32 bits."""

_LARGEST_DECK = 2**28  # bytes of a deck together with all that it includes: a mesh of about two million nodes
_BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, which some editors write, in Latin-1
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
# the name of a parameter, and its value: quoted, or up to the next comma
_PARAMETER = re.compile(r'[\s,]*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,"]*))?\s*(?:,|$)')
_INTEGER = re.compile(r"[+-]?\d{1,18}")
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d{1,4})|[eEdD](\d{1,4}))?")


@dataclass(frozen=True)
class Place:
    """A line of a file, counted from 1; as a text "sector.inp, line 12". keyword: of this line, or the one above it."""

    file: str
    line: int
    keyword: str = ""

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"

    def wrong(self, found: str, remedy: str) -> SceneError:
        """The error about this place: what stands there, and what would be right (a clause without a full stop)."""
        if self.keyword and f"*{self.keyword}" not in found:
            found = f"{found}, at *{self.keyword}"
        return SceneError("model", f"{self}: {found}", remedy)


def shown(text: str) -> str:
    """A text out of a file as it may stand in a message: at most 40 characters, all of them printable."""
    clean = "".join(letter if letter.isprintable() else "?" for letter in text.strip())
    return clean if len(clean) <= 40 else f"{clean[:37]}..."


def check_file(path: Path, largest: int, key: str = "model") -> int:
    """Bytes of a file that is there, is a file, and is at most `largest` bytes. Raises SceneError, about `key`."""
    try:
        there = path.is_file()
        size = path.stat().st_size if there else 0
        if there:
            with path.open("rb"):
                pass
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or "no name of a file"
        raise SceneError(key, f"{shown(path.name)}: {said}", "give a file that can be read") from None
    if not there:
        raise SceneError(key, f"{shown(path.name)}: there is no such file", "give a path from the study file")
    if size > largest:
        found = f"{shown(path.name)}: {size / 2**20:.0f} MiB are more than {largest / 2**20:.0f} MiB"
        raise SceneError(key, found, "reduce the model")
    if size == 0:
        raise SceneError(key, f"{shown(path.name)}: the file is empty", "write it again")
    return size


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
    check_file(path, _LARGEST_DECK)
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


def is_integer(text: str) -> bool:
    """Whether a text is a whole number."""
    return _INTEGER.fullmatch(text) is not None


def read_float(text: str, place: Place) -> float:
    """A finite number, Fortran's 1.5D+03 and 1.5+3 included; 0 for an empty text. Raises SceneError."""
    text = text.strip()
    if not text:
        return 0.0
    match = _REAL.fullmatch(text)
    value = math.nan
    if match is not None:
        try:
            value = float(f"{match[1]}e{match[2] or match[3] or 0}")
        except (OverflowError, ValueError):
            value = math.inf
    if not math.isfinite(value):
        raise place.wrong(f"{shown(text)!r} in place of a number", "give a finite number")
    return value


def read_integer(text: str, place: Place, what: str = "a whole number") -> int:
    """A whole number from 1 to LARGEST_NUMBER. Raises SceneError, about `what`."""
    text = text.strip()
    if not is_integer(text) or not 0 < int(text) <= LARGEST_NUMBER:
        raise place.wrong(f"{shown(text)!r} in place of {what}", f"give a whole number of at most {LARGEST_NUMBER}")
    return int(text)


def read_fields(block: Block, line: int) -> list[str]:
    """Fields of a data line, without the empty ones at its end."""
    fields = [part.strip() for part in block.lines[line].split(",")]
    while fields and not fields[-1]:
        fields.pop()
    return fields


def read_floats(block: Block, line: int, least: int) -> list[float]:
    """Numbers of a data line, at least so many. Raises SceneError."""
    if line >= len(block.lines):
        raise block.place.wrong(f"*{block.written} without its data line", "give the numbers below it")
    place = block.place_of(line)
    values = [read_float(part, place) for part in read_fields(block, line)]
    if len(values) < least:
        raise place.wrong(f"{len(values)} numbers below *{block.written}", f"give {least}")
    return values


def read_points(block: Block) -> tuple[IntArray, FloatArray]:
    """Numbers (n,) and coordinates (n, 3) of data lines "number, x, y, z"; coordinates that are missing are 0."""
    numbers = np.zeros(len(block.lines), dtype=np.int64)
    coordinates = np.full((len(block.lines), 3), np.nan)
    for line, text in enumerate(block.lines):
        try:
            number, x, y, z = text.split(",")
            numbers[line], coordinates[line] = int(number), (float(x), float(y), float(z))
        except (ValueError, OverflowError):
            pass
    plain = np.isfinite(coordinates).all(axis=1) & (numbers > 0) & (numbers <= LARGEST_NUMBER)
    for line in np.flatnonzero(~plain).tolist():
        place = block.place_of(line)
        fields = read_fields(block, line)[:4]  # Abaqus: direction of a normal behind the position
        numbers[line] = read_integer(fields[0] if fields else "", place, "a node number")
        values = [read_float(part, place) for part in fields[1:]]
        coordinates[line] = values + [0.0] * (3 - len(values))
    return numbers, coordinates


def read_records(block: Block, length: int, what: str) -> IntArray:
    """Records (n, length) of whole numbers, each from the beginning of a line over one or more lines.

    Raises SceneError where a line is none of numbers, or a record is too short or too long. what: of the record, for
    the message.
    """
    values = array("q")
    started = 0  # numbers of records before the present one
    for line, text in enumerate(block.lines):
        parts = text.rstrip(", \t").split(",")
        try:
            values.extend(list(map(int, parts)))
        except (ValueError, OverflowError):
            for part in parts:
                read_integer(part, block.place_of(line), "a whole number")
        have = len(values) - started
        if have > length:
            raise block.place_of(line).wrong(f"{have} numbers for {what}", f"give {length}")
        if have == length:
            started = len(values)
    if started != len(values):
        have = len(values) - started
        raise block.place_of(len(block.lines) - 1).wrong(f"{have} numbers for {what}", f"give {length}")
    records = np.array(values, dtype=np.int64).reshape(-1, length)
    if records.size and not ((records > 0) & (records <= LARGEST_NUMBER)).all():
        for line, text in enumerate(block.lines):
            for part in text.rstrip(", \t").split(","):
                read_integer(part, block.place_of(line), "a node or element number")
    return records
