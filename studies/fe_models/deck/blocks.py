"""Keywords and data lines of a deck: what a line says, or one sentence that refuses it."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studies.fe_models.files import (
    LARGEST_NUMBER,
    FloatArray,
    IntArray,
    Place,
    check_file,
    read_float,
    read_integer,
    shown,
)

_LARGEST_DECK = 2**28  # bytes of a deck together with all that it includes: a mesh of about two million nodes
_BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, which some editors write, in Latin-1
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
# the name of a parameter, and its value: quoted, or up to the next comma
_PARAMETER = re.compile(r'[\s,]*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,"]*))?\s*(?:,|$)')


def read_name(text: str) -> str:
    """A name in capitals: without blanks, or as it stands between quotation marks."""
    text = text.strip()
    if len(text) >= 2 and text[0] == text[-1] == '"':
        return text[1:-1].upper()
    return "".join(text.split()).upper()


@dataclass(frozen=True)
class Reference:
    """What a line points to: the name of a set or surface in capitals, or a number, in a scope.

    scope: name of an instance, "" outside of instances. target: "INSTANCE.7" and "INSTANCE.NAME" are of an instance.
    """

    scope: str
    target: str
    place: Place


@dataclass(frozen=True)
class Row:
    """A data line: its fields, without the empty ones at its end."""

    fields: list[str]
    place: Place
    scope: str

    def text(self, n: int) -> str:
        """A field, counted from 0; "" where it is missing."""
        return self.fields[n] if n < len(self.fields) else ""

    def real(self, n: int) -> float:
        """A field as a finite number, 0 where it is missing. Raises SceneError."""
        return read_float(self.text(n), self.place)

    def reals(self, first: int, least: int, what: str) -> list[float]:
        """The numbers from a field on, at least so many. Raises SceneError, which asks for `what`."""
        values = [read_float(part, self.place) for part in self.fields[first:]]
        if len(values) < least:
            raise self.place.wrong(f"{len(values)} numbers", f"give {what}")
        return values

    def whole(self, n: int, what: str) -> int:
        """A field as a whole number from 1 to LARGEST_NUMBER. Raises SceneError, about `what`."""
        return read_integer(self.text(n), self.place, what)

    def reference(self, n: int) -> Reference:
        """What a field points to. Raises SceneError where it is missing."""
        name = read_name(self.text(n))
        if not name:
            raise self.place.wrong("a name is missing", "give the name of a set or surface")
        return Reference(self.scope, name, self.place)


@dataclass(frozen=True)
class Block:
    """A keyword and the data lines below it.

    keyword: in capitals, without its star and without blanks: "SOLIDSECTION". parameters: values by names in capitals
    without blanks; "" for a name without value. place: of the keyword, as it is written. lines: data lines, without
    comments and empty lines. places: of the data lines. scope: name of the instance to which it belongs, else "".
    """

    keyword: str
    parameters: dict[str, str]
    place: Place
    lines: list[str] = field(default_factory=list)
    places: list[tuple[str, int]] = field(default_factory=list)
    scope: str = ""

    def row(self, line: int) -> Row:
        """A data line, counted from 0."""
        fields = [part.strip() for part in self.lines[line].split(",")]
        while fields and not fields[-1]:
            fields.pop()
        return Row(fields, Place(*self.places[line], self.place.keyword), self.scope)

    def rows(self, least: int = 0, what: str = "") -> Iterator[Row]:
        """The data lines, each with at least so many fields; at least one, unless none is asked for. what: they are.

        Raises SceneError.
        """
        if least and not self.lines:
            raise self.place.wrong("no data lines", f"give {what} below it")
        for line in range(len(self.lines)):
            row = self.row(line)
            if len(row.fields) < least:
                raise row.place.wrong(f"{len(row.fields)} entries", f"give {what}")
            yield row

    def reals(self, line: int, least: int) -> list[float]:
        """The numbers of a data line that must be there, at least so many. Raises SceneError."""
        if line >= len(self.lines):
            raise self.place.wrong("the data line is missing", "give the numbers below it")
        return self.row(line).reals(0, least, f"{least}")

    def name(self, parameter: str) -> str:
        """The value of a parameter that is a name, in capitals. Raises SceneError where it is missing."""
        value = read_name(self.parameters.get(parameter, ""))
        if not value:
            raise self.place.wrong(f"no {parameter}", f"write {parameter}=... behind the keyword")
        return value

    def reference(self, parameter: str) -> Reference:
        """What the name in a parameter points to. Raises SceneError where it is missing."""
        return Reference(self.scope, self.name(parameter), self.place)

    def value(self, parameter: str) -> str:
        """Value of a parameter, in capitals without blanks; "" where it is not given."""
        return "".join(self.parameters.get(parameter, "").split()).upper()

    def chosen(self, parameter: str, known: Iterable[str], default: str) -> str:
        """The same of a parameter that must be one of the known ones. Raises SceneError."""
        value = self.value(parameter) or default
        if value not in known:
            remedy = f"write {parameter}={' or '.join(known)}, or remove the keyword"
            raise self.place.wrong(f"{parameter}={shown(value)} is not read", remedy)
        return value


def read_blocks(path: Path, included: list[str]) -> Iterator[Block]:
    """The keywords of a deck, one after the other, those of files that it includes in their places.

    Included files stand in the deck's folder or below; their names are appended to `included`. Raises SceneError.
    """
    block: Block | None = None
    for each in _lines(path, path.name, path.parent.resolve(), included, ()):
        if isinstance(each, Block):
            if block is not None:
                yield block
            block = each
        elif block is None:
            raise Place(*each[1]).wrong(
                f"{shown(each[0])!r} before the first keyword", "give a deck of CalculiX or Abaqus"
            )
        else:
            block.lines.append(each[0])
            block.places.append(each[1])
    if block is None:
        raise Place(path.name, 1).wrong("no keyword in the file", "give a deck of CalculiX or Abaqus")
    yield block


def _lines(
    path: Path, name: str, folder: Path, included: list[str], within: tuple[Path, ...]
) -> Iterator[Block | tuple[str, tuple[str, int]]]:
    """Keywords without data lines, and data lines with their places. within: files that are open.

    An included file does not end a keyword: data lines may follow in it, and behind it.
    """
    check_file(path, _LARGEST_DECK, "model")
    within = (*within, path.resolve())
    with path.open(encoding="latin-1") as file:
        for text, number in _joined(file):
            if not text.startswith("*"):
                yield text, (name, number)
                continue
            block = _cut_keyword(text, Place(name, number))
            if block.keyword != "INCLUDE":
                yield block
                if block.keyword not in _WITH_INPUT or "INPUT" not in block.parameters:
                    continue
            inner = _find_included(block, folder)
            if inner in within:
                raise block.place.wrong(f"{shown(inner.name)} includes itself", "remove this line")
            relative = str(inner.relative_to(folder))
            if relative not in included:
                included.append(relative)
            yield from _lines(inner, relative, folder, included, within)


def _joined(lines: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Keywords, each as one line, and data lines, with their numbers; without comments and empty lines."""
    begun: tuple[str, int] | None = None  # a keyword that goes on in the next line
    for number, raw in enumerate(lines, 1):
        text = raw.removeprefix(_BYTE_ORDER_MARK).strip() if number == 1 else raw.strip()
        if not text or text == "*" or text.startswith("**"):
            continue
        line = text, number
        if begun is not None and text.startswith("*"):
            yield begun
        elif begun is not None:
            line = begun[0] + text, begun[1]
        begun = line if line[0].startswith("*") and text.endswith(",") else None
        if begun is None:
            yield line
    if begun is not None:
        yield begun


def _find_included(block: Block, folder: Path) -> Path:
    """The file that a keyword names. Raises SceneError where it is missing, or outside of the folder."""
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
    return path


def _cut_keyword(text: str, place: Place) -> Block:
    written, _, rest = text[1:].partition(",")
    keyword = "".join(written.split()).upper()
    if not keyword:
        raise place.wrong("a star without a keyword", "write **, where it begins a comment")
    place = Place(place.file, place.line, shown(" ".join(written.split()).upper()))
    parameters: dict[str, str] = {}
    at, rest = 0, rest.rstrip().rstrip(",")
    while at < len(rest):
        match = _PARAMETER.match(rest, at)
        if match is None or match.end() == at:
            raise place.wrong(f"{shown(rest[at:])!r} is no parameter", "write NAME=value")
        parameters["".join(match[1].split()).upper()] = (match[2] or "").strip()
        at = match.end()
    return Block(keyword, parameters, place)


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
        row = block.row(line)  # Abaqus: direction of a normal behind the position
        numbers[line], coordinates[line] = row.whole(0, "a node number"), [row.real(n) for n in (1, 2, 3)]
    return numbers, coordinates


def read_records(block: Block, length: int, what: str) -> IntArray:
    """Records (n, length) of whole numbers, each from the beginning of a line over one or more lines.

    what: of the record, for the message. Raises SceneError.
    """
    values = array("q")
    started = 0  # numbers of records before the present one
    for line, text in enumerate(block.lines):
        try:
            values.extend(list(map(int, text.rstrip(", \t").split(","))))
        except (ValueError, OverflowError):
            _check_whole(block, line)
        have = len(values) - started
        if have > length or (line == len(block.lines) - 1 and have < length):
            raise block.row(line).place.wrong(f"{have} numbers for {what}", f"give {length}")
        if have == length:
            started = len(values)
    records = np.array(values, dtype=np.int64).reshape(-1, length)
    if records.size and not 0 < records.min() <= records.max() <= LARGEST_NUMBER:
        for line in range(len(block.lines)):
            _check_whole(block, line)
    return records


def _check_whole(block: Block, line: int) -> None:
    for part in block.row(line).fields:
        read_integer(part, block.row(line).place, "a node or element number")


def unit(vector: FloatArray, place: Place, remedy: str) -> FloatArray:
    """A vector (3,) of unit length. Raises SceneError, which asks for what gives one, where it has none."""
    length = float(np.linalg.norm(vector))
    if not 0 < length < np.inf:
        raise place.wrong("a direction without a length", f"give {remedy}")
    return np.asarray(vector / length)
