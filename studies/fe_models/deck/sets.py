"""Sets of nodes or elements: numbers, ranges and other sets, made to numbers once all of them are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from studies.fe_models.deck.mesh import IntArray
from studies.fe_models.text.keyword_lines import Block, read_name
from studies.fe_models.text.numbers import is_integer, read_fields, read_integer
from studies.fe_models.text.read_errors import Place, shown

PART = "part"
"""The scope of names inside of *PART and *INSTANCE; the other one is ""."""

_MOST_MEMBERS = 50_000_000  # of all sets together
_DEEPEST = 100
_MOST_NOTES = 100


@dataclass(frozen=True)
class Reference:
    """What a data line points to.

    scope: PART, or "". target: a name in capitals, or a number. place: of the data line.
    """

    scope: str
    target: str | int
    place: Place


@dataclass(frozen=True)
class _Range:
    first: int
    last: int
    step: int


@dataclass
class SetDefinitions:
    """Sets as they are written.

    what: "nodes" or "elements". items: of every set, by scope and name, what it consists of. of_elements: whether the
    set has the nodes of elements added, as references to sets of elements.
    """

    what: str
    items: dict[tuple[str, str], list[IntArray | _Range | Reference]] = field(default_factory=dict)
    of_elements: dict[tuple[str, str], list[Reference]] = field(default_factory=dict)

    def add(self, scope: str, name: str, numbers: IntArray) -> None:
        """Adds numbers to a set, which may be new."""
        self.items.setdefault((scope, name), []).append(numbers)

    def add_block(self, scope: str, name: str, block: Block, instance: str, local: bool) -> None:
        """Adds what stands below *NSET or *ELSET. local: whether numbers are those of the part."""
        items = self.items.setdefault((scope, name), [])
        if "GENERATE" in block.parameters:
            for line in range(len(block.lines)):
                place = block.place_of(line)
                fields = read_fields(block, line)
                if not 2 <= len(fields) <= 3:
                    raise place.wrong(f"{len(fields)} numbers below GENERATE", "give first, last and step")
                if local:
                    items.append(_Range(*[read_integer(part, place) for part in fields], *[1] * (3 - len(fields))))
            return
        numbers: list[int] = []
        for line in range(len(block.lines)):
            place = block.place_of(line)
            for part in read_fields(block, line):
                if is_integer(part):
                    if local:
                        numbers.append(read_integer(part, place))
                elif part:
                    reference = read_reference(part, scope, instance, place)
                    if isinstance(reference.target, int):
                        numbers.append(reference.target)
                    else:
                        items.append(reference)
        items.append(np.array(numbers, dtype=np.int64))


def read_reference(text: str, scope: str, instance: str, place: Place) -> Reference:
    """A name or number of a data line; "INSTANCE.7" and "INSTANCE.NAME" are those of the part. Raises SceneError."""
    name = read_name(text)
    if instance and name.startswith(f"{instance}."):
        scope, name = PART, name[len(instance) + 1 :]
    if not name:
        raise place.wrong("a name is missing", "give the name of a set or surface")
    return Reference(scope, read_integer(name, place) if is_integer(name) else name, place)


class Resolver:
    """Sets as numbers that exist.

    Parameters
    ----------
    sets
        As they are written.
    existing
        (n,) all numbers that exist, ascending.
    everything
        The name that the code gives to all of them.
    nodes_of
        Of a reference to a set of elements, its nodes; None for sets of elements.
    """

    def __init__(
        self,
        sets: SetDefinitions,
        existing: IntArray,
        everything: str,
        nodes_of: Callable[[Reference], IntArray] | None = None,
    ) -> None:
        self.sets = sets
        self.existing = existing
        self.everything = everything
        self.nodes_of = nodes_of
        self.notes: list[str] = []
        self._done: dict[tuple[str, str], IntArray] = {}
        self._open: list[tuple[str, str]] = []
        self._left = _MOST_MEMBERS

    def find(self, reference: Reference) -> IntArray | None:
        """Numbers (m,) that a reference stands for, ascending; None where there is no such set."""
        if isinstance(reference.target, int):
            return self._kept(np.array([reference.target]), f"{reference.place}")
        for key in ((reference.scope, reference.target), (PART, reference.target)):
            if key in self.sets.items:
                return self.members(key, reference.place)
        return self.existing if reference.target == self.everything else None

    def members(self, key: tuple[str, str], place: Place) -> IntArray:
        """Numbers (m,) of a set, ascending. Raises SceneError where it contains itself, or all become too many."""
        if key in self._done:
            return self._done[key]
        if key in self._open:
            raise place.wrong(f"the set {shown(key[1])} contains itself", "take it out of its own members")
        if len(self._open) >= _DEEPEST:
            raise place.wrong(f"more than {_DEEPEST} sets within each other", "name the members of the inner sets")
        self._open.append(key)
        parts: list[IntArray] = []
        for item in self.sets.items[key]:
            if isinstance(item, _Range):
                # as many steps as there are numbers that exist, whatever the range says
                first, last = np.searchsorted(self.existing, (item.first, item.last + 1))
                within = self.existing[first:last]
                self._count(within.size, place)
                parts.append(within[(within - item.first) % item.step == 0])
            elif isinstance(item, Reference):
                found = self.find(item)
                if found is None:
                    raise item.place.wrong(
                        f"there is no set of {self.sets.what} {shown(str(item.target))}", "define it, or remove it here"
                    )
                parts.append(found)
            else:
                parts.append(self._kept(item, f"set {shown(key[1])}"))
            self._count(parts[-1].size, place)
        if self.nodes_of is not None:
            for reference in self.sets.of_elements.get(key, ()):
                parts.append(self.nodes_of(reference))
                self._count(parts[-1].size, place)
        self._open.pop()
        numbers = np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)
        self._done[key] = numbers.astype(np.int64)
        return self._done[key]

    def _count(self, n: int, place: Place) -> None:
        self._left -= n
        if self._left < 0:
            raise place.wrong(f"the sets have more than {_MOST_MEMBERS} members", "remove sets that are not used")

    def _kept(self, numbers: IntArray, where: str) -> IntArray:
        """Those numbers that exist; a note says which do not."""
        if not self.existing.size:
            return self.existing
        at = np.minimum(np.searchsorted(self.existing, numbers), self.existing.size - 1)
        there = self.existing[at] == numbers
        if not there.all():
            missing = numbers[~there]
            if len(self.notes) < _MOST_NOTES:
                self.notes.append(
                    f"{where}: {missing.size} of its {self.sets.what} do not exist, the first is {missing[0]}."
                )
        kept: IntArray = numbers[there]
        return kept
