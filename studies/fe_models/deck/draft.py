"""A deck while it is read: what its keywords say, with names that are looked up when all of it is read."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.fe_models.deck.mesh import FloatArray, IntArray
from studies.fe_models.deck.sets import Reference, SetDefinitions, read_reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_fields
from studies.fe_models.text.read_errors import Place, shown
from studies.scene_error import SceneError

if TYPE_CHECKING:
    from studies.fe_models.deck.resolve import Resolved


Items = Callable[["Resolved"], Iterable[Any]]
"""Gives entries of a field of the deck, once names can be looked up."""


@dataclass(frozen=True)
class Records:
    """Nodes or elements as they are written. numbers (n,), values (n, k): coordinates or nodes. kind: of elements."""

    scope: str
    numbers: IntArray
    values: FloatArray | IntArray
    place: Place
    kind: str = ""


@dataclass
class DraftMaterial:
    """A material: rows of *ELASTIC and *DENSITY, the temperature last, and where they stand."""

    elastic: list[list[float]] = field(default_factory=list)
    density: list[list[float]] = field(default_factory=list)
    places: dict[str, Place] = field(default_factory=dict)
    problem: str = ""


@dataclass
class DraftInteraction:
    """Friction of an interaction; whether it glues, and which law of it is not read."""

    friction: float | None = None
    glued: str = ""
    problem: str = ""


@dataclass
class DraftStep:
    """A step.

    before: the fields of the deck before it. kind: its procedure. writes: whether it writes matrices. fresh: whether
    it has no centrifugal load yet.
    """

    before: dict[str, dict[Hashable, Items]]
    kind: str = ""
    writes: bool = False
    fresh: bool = True

    @property
    def loads_count(self) -> bool:
        """Whether its loads are static ones."""
        return self.kind in ("", "STATIC", "VISCO")


@dataclass
class Draft:
    """All that was read so far.

    name: of the file. scope: name of the instance that is read, else "". parts: keywords by the name of the part.
    fields: entries of the fields of the deck in the order of the file, by a key for those that may be replaced.
    placed: shift (3,) and turn (3, 3) of every instance. generators: what makes nodes and elements of others.
    """

    name: str
    nodes: list[Records] = field(default_factory=list)
    elements: list[Records] = field(default_factory=list)
    generators: list[Callable[[Draft], None]] = field(default_factory=list)
    node_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("nodes"))
    element_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("elements"))
    surfaces: dict[tuple[str, str], list[tuple[Reference, int]]] = field(default_factory=dict)
    fields: dict[str, dict[Hashable, Items]] = field(default_factory=dict)
    interactions: dict[str, DraftInteraction] = field(default_factory=dict)
    interaction: DraftInteraction | None = None
    materials: dict[str, DraftMaterial] = field(default_factory=dict)
    material: DraftMaterial | None = None
    thermal: dict[str, Place] = field(default_factory=dict)
    coupling: Block | None = None
    world: tuple[FloatArray, FloatArray] = field(default_factory=lambda: (np.zeros(3), np.eye(3)))
    system: tuple[FloatArray, FloatArray] = (np.zeros(3), np.eye(3))
    step: DraftStep | None = None
    parts: dict[str, list[Block]] = field(default_factory=dict)
    part: str = ""
    placed: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    scope: str = ""
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    included: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.system = self.world

    def add(self, name: str, items: Items, key: Hashable = None) -> None:
        """Adds entries of a field of the deck; those of the same key, which is not None, are replaced."""
        entries = self.fields.setdefault(name, {})
        entries[len(entries) if key is None else key] = items

    def clear(self, name: str) -> None:
        """Removes all entries of a field, as OP=NEW does."""
        self.fields[name] = {}

    def end_step(self) -> None:
        """Of a step that writes matrices nothing stays, of one that is not static no load."""
        step, self.step = self.step, None
        if step is None:
            return
        for name in list(self.fields):
            if step.writes or (name in ("forces", "pressures", "gravity") and not step.loads_count):
                self.fields[name] = step.before.get(name, {})

    def skip(self, block: Block) -> None:
        """Notes a keyword that cannot change the model."""
        if len(self.skipped) < 1000:
            self.skipped.append(f"{block.place}: *{block.written}")

    def named(self, block: Block, parameter: str) -> Reference:
        """What the name in a parameter points to. Raises SceneError."""
        return self.refer(f'"{block.name(parameter)}"', block.place)

    def refer(self, text: str, place: Place) -> Reference:
        """What a name or number of a data line points to. Raises SceneError."""
        return read_reference(text, self.scope, self.placed, place)

    def lines(self, block: Block, least: int, what: str) -> Iterable[tuple[list[str], Place]]:
        """Fields and place of each data line, at least so many fields. what: they are, for the message."""
        if not block.lines:
            raise block.place.wrong(f"*{block.written} without data lines", f"give {what} below it")
        for line in range(len(block.lines)):
            place, fields = block.place_of(line), read_fields(block, line)
            if len(fields) < least:
                found = f"{len(fields)} entries below *{block.written}"
                raise place.wrong(found, f"give {what}")
            yield fields, place


def chosen(block: Block, parameter: str, known: Iterable[str], default: str) -> str:
    """Value of a parameter, in capitals without blanks. Raises SceneError where it is none of the known ones."""
    value = "".join(block.parameters.get(parameter, default).split()).upper()
    if value not in known:
        found = f"*{block.written} with {parameter}={shown(value)}, which is not read"
        raise block.place.wrong(found, f"write {parameter}={' or '.join(known)}, or remove the keyword")
    return value


def refused(block: Block, found: str, remedy: str) -> SceneError:
    """The error about a keyword that changes the model in a way that is not read."""
    return block.place.wrong(f"*{block.written}: {found}", remedy)
