"""The mesh of a deck while it is read, the table of all keywords, and what their readers ask of a line.

A deck is read twice: first the keywords of the mesh, whose sets and surfaces may be named before they are defined;
then, with the mesh at hand, all others in the order of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.fe_models.deck.sets import Reference, SetDefinitions, read_reference
from studies.fe_models.text import Block, FloatArray, IntArray, Place, read_fields, shown
from studies.scene_error import SceneError


@dataclass(frozen=True)
class Records:
    """Nodes or elements as they are written. numbers (n,), values (n, k): coordinates or nodes. kind: of elements."""

    scope: str
    numbers: IntArray
    values: FloatArray | IntArray
    place: Place
    kind: str = ""


@dataclass
class Draft:
    """The mesh as far as it is read.

    name: of the file. scope: name of the instance that is read, else "". parts: keywords by the name of the part. part:
    name of the one that is read. placed: shift (3,) and turn (3, 3) of every instance. system: origin and axes, one a
    row, of *NODE. surfaces: sets or numbers with faces, 0 of nodes. generators: what makes nodes and elements of
    others. others: keywords that are not of the mesh, with their scopes.
    """

    name: str
    nodes: list[Records] = field(default_factory=list)
    elements: list[Records] = field(default_factory=list)
    generators: list[Callable[[Draft], None]] = field(default_factory=list)
    node_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("nodes"))
    element_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("elements"))
    surfaces: dict[tuple[str, str], list[tuple[Reference, int]]] = field(default_factory=dict)
    system: tuple[FloatArray, FloatArray] | None = None
    parts: dict[str, list[Block]] = field(default_factory=dict)
    part: str = ""
    placed: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    scope: str = ""
    others: list[tuple[str, Block]] = field(default_factory=list)
    included: list[str] = field(default_factory=list)

    def named(self, block: Block, parameter: str) -> Reference:
        """What the name in a parameter points to. Raises SceneError."""
        return self.refer(f'"{block.name(parameter)}"', block.place)

    def refer(self, text: str, place: Place) -> Reference:
        """What a name or number of a data line points to. Raises SceneError."""
        return read_reference(text, self.scope, self.placed, place)


@dataclass(frozen=True)
class Keyword:
    """A keyword that is read.

    reader: takes the draft, or the model of all others, and the keyword. parameters: names in capitals without blanks
    that the reader acts on; "*" stands for any. harmless: those that cannot change the model.
    """

    reader: Callable[[Any, Block], None]
    parameters: frozenset[str]
    harmless: frozenset[str]
    of_mesh: bool


KEYWORDS: dict[str, Keyword] = {}
"""Keywords that are read, in capitals without blanks; the files of their readers fill it."""


def keyword(
    names: str, parameters: str = "", harmless: str = "", *, of_mesh: bool = False
) -> Callable[[Callable[[Any, Block], None]], Callable[[Any, Block], None]]:
    """Enters the reader of keywords into the table; several names have blanks between them."""

    def entered(reader: Callable[[Any, Block], None]) -> Callable[[Any, Block], None]:
        for name in names.split():
            KEYWORDS[name] = Keyword(reader, frozenset(parameters.split()), frozenset(harmless.split()), of_mesh)
        return reader

    return entered


def check_parameters(known: Keyword, block: Block) -> None:
    """Raises SceneError where a parameter of a keyword may change the model, and is not read."""
    for name in block.parameters:
        if not {name, "*"} & known.parameters and name not in known.harmless:
            found = f"*{block.written} with {shown(name)}, which is not read and may change the model"
            raise block.place.wrong(found, f"leave {shown(name)} out if the model is right without it")


def data_lines(block: Block, least: int, what: str) -> Iterator[tuple[list[str], Place]]:
    """Fields and place of each data line, at least so many fields. what: they are, for the message."""
    if not block.lines:
        raise block.place.wrong(f"*{block.written} without data lines", f"give {what} below it")
    for line in range(len(block.lines)):
        place, fields = block.place_of(line), read_fields(block, line)
        if len(fields) < least:
            raise place.wrong(f"{len(fields)} entries below *{block.written}", f"give {what}")
        yield fields, place


def value_of(block: Block, parameter: str) -> str:
    """Value of a parameter, in capitals without blanks; "" where it is not given."""
    return "".join(block.parameters.get(parameter, "").split()).upper()


def chosen(block: Block, parameter: str, known: Iterable[str], default: str) -> str:
    """The same of a parameter that must be one of the known ones. Raises SceneError."""
    value = value_of(block, parameter) or default
    if value not in known:
        found = f"*{block.written} with {parameter}={shown(value)}, which is not read"
        raise block.place.wrong(found, f"write {parameter}={' or '.join(known)}, or remove the keyword")
    return value


def refused(block: Block, found: str, remedy: str) -> SceneError:
    """The error about a keyword that changes the model in a way that is not read."""
    return block.place.wrong(f"*{block.written}: {found}", remedy)


def unit(vector: FloatArray, place: Place, found: str, remedy: str) -> FloatArray:
    """A vector (3,) of unit length. Raises SceneError where it has none."""
    length = float(np.linalg.norm(vector))
    if not 0 < length < np.inf:
        raise place.wrong(found, remedy)
    return np.asarray(vector / length)
