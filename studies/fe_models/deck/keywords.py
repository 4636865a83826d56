"""Keywords of a deck: what a keyword and its data lines say, and the table of what reads each of them.

A keyword, and each of its parameters, is read, or stands in a list of those that cannot change the model, or is
refused: it may change the model.
"""

from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from studies.fe_models.files import LARGEST_NUMBER, FloatArray, IntArray, Place, read_float, read_integer, shown

_Thing = TypeVar("_Thing")


def read_name(text: str) -> str:
    """A name in capitals: without blanks, or as it stands between quotation marks."""
    text = text.strip()
    return text[1:-1].upper() if len(text) >= 2 and text[0] == text[-1] == '"' else "".join(text.split()).upper()


@dataclass(frozen=True)
class Reference:
    """What a line points to: the name of a set or surface in capitals, or a number, perhaps with "INSTANCE." before it.

    scope: name of the instance in which it stands, "" outside of instances. of_elements: in a set of nodes, the nodes
    of a set of elements.
    """

    scope: str
    target: str
    place: Place
    of_elements: bool = False


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
        if not (name := read_name(self.text(n))):
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
        """The data lines, each with at least so many fields; at least one, unless none is asked for.

        what: the fields. Raises SceneError.
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

    def numbered_points(self) -> tuple[IntArray, FloatArray]:
        """Numbers (n,) and coordinates (n, 3) of data lines "number, x, y, z"; coordinates that are missing are 0."""
        numbers = np.zeros(len(self.lines), dtype=np.int64)
        coordinates = np.full((len(self.lines), 3), np.nan)
        for line, text in enumerate(self.lines):
            try:
                number, x, y, z = text.split(",")
                numbers[line], coordinates[line] = int(number), (float(x), float(y), float(z))
            except (ValueError, OverflowError):
                pass
        plain = np.isfinite(coordinates).all(axis=1) & (numbers > 0) & (numbers <= LARGEST_NUMBER)
        for line in np.flatnonzero(~plain).tolist():
            row = self.row(line)  # Abaqus: direction of a normal behind the position
            numbers[line], coordinates[line] = row.whole(0, "a node number"), [row.real(n) for n in (1, 2, 3)]
        return numbers, coordinates

    def records(self, length: int, what: str) -> IntArray:
        """Records (n, length) of whole numbers, each from the beginning of a line over one or more lines.

        what: of the record, for the message. Raises SceneError.
        """
        values = array("q")
        started = 0  # numbers of records before the present one
        for line, text in enumerate(self.lines):
            try:
                values.extend(list(map(int, text.rstrip(", \t").split(","))))
            except (ValueError, OverflowError):
                self._check_whole(line)
            have = len(values) - started
            if have > length or (line == len(self.lines) - 1 and have < length):
                raise self.row(line).place.wrong(f"{have} numbers for {what}", f"give {length}")
            if have == length:
                started = len(values)
        records = np.array(values, dtype=np.int64).reshape(-1, length)
        if records.size and not 0 < records.min() <= records.max() <= LARGEST_NUMBER:
            for line in range(len(self.lines)):
                self._check_whole(line)
        return records

    def _check_whole(self, line: int) -> None:
        for part in self.row(line).fields:
            read_integer(part, self.row(line).place, "a node or element number")

    def points(self, line: int = 0) -> FloatArray:
        """Two points or vectors (2, 3) in a data line. Raises SceneError."""
        return np.array(self.reals(line, 6)[:6]).reshape(2, 3)

    def below(self, thing: _Thing | None, keyword: str) -> _Thing:
        """What a keyword above this one has begun. Raises SceneError where it has not."""
        if thing is None:
            raise self.place.wrong(f"no *{keyword} to which it belongs", f"write *{keyword} above it")
        return thing

    def name(self, parameter: str) -> str:
        """The value of a parameter that is a name, in capitals. Raises SceneError where it is missing."""
        if not (value := read_name(self.parameters.get(parameter, ""))):
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
            raise self.place.wrong(f"{parameter}={shown(value)} is not read", f"write {' or '.join(known)}")
        return value


def unit(vector: FloatArray, place: Place, remedy: str) -> FloatArray:
    """A vector (3,) of unit length. Raises SceneError, which asks for what gives one, where it has none."""
    length = float(np.linalg.norm(vector))
    if not 0 < length < np.inf:
        raise place.wrong("a direction without a length", f"give {remedy}")
    return np.asarray(vector / length)


_OUTPUT = """
OUTPUT NODEOUTPUT ELEMENTOUTPUT CONTACTOUTPUT ENERGYOUTPUT MODALOUTPUT INTEGRATEDOUTPUT RADIATIONOUTPUT NODEPRINT
ELPRINT CONTACTPRINT ENERGYPRINT FACEPRINT SECTIONPRINT MODALPRINT PRINT PREPRINT NODEFILE ELFILE CONTACTFILE ENERGYFILE
MODALFILE FILEFORMAT FILEOUTPUT MONITOR FILTER TIMEPOINTS MATRIXOUTPUT RESTART INCREMENTATIONOUTPUT DIAGNOSTICS
INTEGRATEDOUTPUTSECTION ELEMENTMATRIXOUTPUT SUBSTRUCTUREOUTPUT
"""
_HOW_STEPS_ARE_COMPUTED = """
CONTROLS SOLVERCONTROLS CONTACTCONTROLS SECTIONCONTROLS AMPLITUDE SELECTCYCLICSYMMETRYMODES SELECTEIGENMODES
MODALDAMPING BASEMOTION
"""
_HEAT_AND_DIRECTIONS = """
CONDUCTIVITY SPECIFICHEAT LATENTHEAT PHYSICALCONSTANTS FILM RADIATE CFLUX DFLUX SFILM DSFLUX GAPCONDUCTANCE ORIENTATION
"""  # strains by heat are refused, and materials are isotropic

HARMLESS = frozenset((_OUTPUT + _HOW_STEPS_ARE_COMPUTED + _HEAT_AND_DIRECTIONS).split())
"""Keywords that cannot change the model, in capitals without blanks. They are skipped and named."""

_INSTEAD = {
    **dict.fromkeys(("CONTACT", "CONTACTINCLUSIONS"), "give *CONTACT PAIR for the surfaces that touch"),
    "DAMPING": "remove it: the damping is loss_factor of the study",
    "EMBEDDEDELEMENT": "give *TIE, or meshes that share their nodes",
    "DISTRIBUTINGCOUPLING": "write *COUPLING with *DISTRIBUTING, of a surface of element faces",
    **dict.fromkeys(
        ("NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY"), "write nodes and elements one by one, as a mesher does"
    ),
    "PARAMETER": "write numbers in place of <names>",
    "PLASTIC": "remove it: materials are elastic",
    "PRE-TENSIONSECTION": "remove it, and give the force of the bolt with `preload` in the study",
}
"""Remedies for some of the others."""

Reader = Callable[[Any, Block], None]
"""Acts on a keyword: takes the draft of the mesh, or the model of all others, and the keyword."""


@dataclass(frozen=True)
class Keyword:
    """A keyword that is read.

    parameters: names in capitals without blanks that the reader acts on; "*" stands for any. harmless: those that
    cannot change the model. of_mesh: whether it is read with the mesh, before all others.
    """

    reader: Reader
    parameters: frozenset[str]
    harmless: frozenset[str]
    of_mesh: bool


KEYWORDS: dict[str, Keyword] = {}
"""Keywords that are read, in capitals without blanks; the files of their readers fill it."""


def keyword(
    names: str, parameters: str = "", harmless: str = "", *, of_mesh: bool = False
) -> Callable[[Reader], Reader]:
    """Enters the reader of keywords into the table; several names have blanks between them."""

    def entered(reader: Reader) -> Reader:
        for name in names.split():
            KEYWORDS[name] = Keyword(reader, frozenset(parameters.split()), frozenset(harmless.split()), of_mesh)
        return reader

    return entered


def find_keyword(block: Block, *, any_parameters: bool = False) -> Keyword:
    """What reads a keyword. Raises SceneError where it, or one of its parameters, may change the model."""
    if (known := KEYWORDS.get(block.keyword)) is None:
        remedy = _INSTEAD.get(block.keyword, "remove it if the model is right without it")
        raise block.place.wrong("this keyword is not read, and may change the model", remedy)
    for name in block.parameters:
        if not (any_parameters or {name, "*"} & known.parameters or name in known.harmless):
            remedy = "leave it out if the model is right without it"
            raise block.place.wrong(f"{shown(name)} is not read, and may change the model", remedy)
    return known
