"""Sets of nodes or elements: numbers, ranges and other sets, made to numbers once all of them are known."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field

import numpy as np

from studies.fe_models.text import (
    LARGEST_NUMBER,
    Block,
    IntArray,
    Place,
    is_integer,
    read_fields,
    read_integer,
    read_name,
    shown,
)

_DEEPEST = 100

Key = tuple[str, str]
"""Scope and name of a set or surface. The scope is the name of an instance, "" outside of instances."""


@dataclass(frozen=True)
class Reference:
    """What a data line points to: a name in capitals, or a number, in a scope. place: of the data line."""

    scope: str
    target: str | int
    place: Place


@dataclass(frozen=True)
class _Members:
    """Numbers as they are written in a scope; with step not 0 the first, last and step of a range."""

    scope: str
    numbers: IntArray
    step: int = 0


@dataclass
class SetDefinitions:
    """Sets as they are written. what: "nodes" or "elements". items: of every set what it consists of.

    of_elements: sets of elements whose nodes a set has as well. unsorted: sets of several numbers whose order matters.
    """

    what: str
    items: dict[Key, list[_Members | Reference]] = field(default_factory=dict)
    of_elements: dict[Key, list[Reference]] = field(default_factory=dict)
    unsorted: set[Key] = field(default_factory=set)

    def add(self, scope: str, name: str, numbers: IntArray) -> None:
        """Adds numbers to a set, which may be new."""
        self.items.setdefault((scope, name), []).append(_Members(scope, numbers))

    def add_all(self, scope: str, name: str, other: str) -> None:
        """Adds all numbers of another scope to a set."""
        self.items.setdefault((scope, name), []).append(_Members(other, np.array([1, LARGEST_NUMBER]), 1))

    def add_block(self, key: Key, block: Block, instances: Container[str]) -> None:
        """Adds what stands below *NSET or *ELSET, where INSTANCE may say whose numbers they are. Raises SceneError."""
        items = self.items.setdefault(key, [])
        scope = read_name(block.parameters["INSTANCE"]) if "INSTANCE" in block.parameters else key[0]
        if scope and scope not in instances:
            raise block.place.wrong(f"there is no instance {shown(scope)}", "give INSTANCE=... of one above")
        if "UNSORTED" in block.parameters:
            self.unsorted.add(key)
        numbers: list[int] = []
        for line in range(len(block.lines)):
            place, fields = block.place_of(line), read_fields(block, line)
            if "GENERATE" in block.parameters:
                items.append(_range(scope, fields, place))
                continue
            for part in fields:
                if is_integer(part):
                    numbers.append(read_integer(part, place))
                elif part:
                    reference = read_reference(part, scope, instances, place)
                    number = isinstance(reference.target, int)
                    items.append(_Members(reference.scope, np.array([reference.target])) if number else reference)
        if numbers:
            items.append(_Members(scope, np.array(numbers, dtype=np.int64)))


def _range(scope: str, fields: list[str], place: Place) -> _Members:
    """First, last and step, which may be negative; the members are the same in both senses."""
    if not 2 <= len(fields) <= 3:
        raise place.wrong(f"{len(fields)} numbers below GENERATE", "give first, last and step")
    first, last = (read_integer(part, place) for part in fields[:2])
    step = read_integer(fields[2].lstrip("-"), place) if len(fields) == 3 and fields[2] else 1
    backwards = fields[2].startswith("-") if len(fields) == 3 and fields[2] else last < first
    if first != last and backwards != (last < first):
        found = f"from {first} to {last} in steps of {'-' if backwards else ''}{step} below GENERATE"
        raise place.wrong(found, "give a step that leads from the first to the last number")
    return _Members(scope, np.array([first, last]), -step if backwards else step)


def read_reference(text: str, scope: str, instances: Container[str], place: Place) -> Reference:
    """A name or number of a data line; "INSTANCE.7" and "INSTANCE.NAME" are those of an instance. Raises SceneError."""
    name = read_name(text)
    # names may have dots
    for at in [place for place, letter in enumerate(name[:100]) if letter == "."]:
        if name[:at] in instances:
            scope, name = name[:at], name[at + 1 :]
            break
    if not name:
        raise place.wrong("a name is missing", "give the name of a set or surface")
    return Reference(scope, read_integer(name, place) if is_integer(name) else name, place)


def scope_of(items: Container[Key], instances: Mapping[str, object], reference: Reference) -> str | None:
    """Scope of the named set or surface: its own, else the only instance that has it; None where there is none.

    Raises SceneError where several instances have one of this name.
    """
    name = str(reference.target)
    if (reference.scope, name) in items:
        return reference.scope
    found = [scope for scope in instances if (scope, name) in items]
    if len(found) > 1:
        remedy = f"write {found[0]}.{shown(name)} or {found[1]}.{shown(name)}"
        raise reference.place.wrong(f"{len(found)} instances have {shown(name)}", remedy)
    return found[0] if found else None


class Resolver:
    """Sets as numbers that exist.

    existing: (n,) all numbers that exist, ascending. offsets: of every scope, what is added to its numbers; those of
    one scope are smaller than the difference to the next. everything: the name that the code gives to all of them.
    nodes_of: of a reference to a set of elements, its nodes; None for sets of elements.
    """

    def __init__(
        self,
        sets: SetDefinitions,
        existing: IntArray,
        offsets: Mapping[str, int],
        everything: str,
        nodes_of: Callable[[Reference], IntArray] | None = None,
    ) -> None:
        self.sets, self.existing, self.offsets = sets, existing, offsets
        self.everything, self.nodes_of = everything, nodes_of
        self.notes: list[str] = []
        self._done: dict[Key, IntArray] = {}
        self._open: list[Key] = []

    def find(self, reference: Reference) -> IntArray:
        """Numbers (m,) that a reference stands for, ascending. Raises SceneError where there is no such set."""
        if isinstance(reference.target, int):
            return self._kept(_Members(reference.scope, np.array([reference.target])), f"{reference.place}")
        scope = scope_of(self.sets.items, self.offsets, reference)
        if scope is not None:
            return self.members((scope, reference.target), reference.place)
        if reference.target == self.everything:
            return self.existing
        found = f"there is no set of {self.sets.what} {shown(reference.target)}"
        raise reference.place.wrong(found, "define it, or remove it here")

    def members(self, key: Key, place: Place) -> IntArray:
        """Numbers (m,) of a set, ascending. Raises SceneError where it contains itself."""
        if key in self._done:
            return self._done[key]
        if key in self._open:
            raise place.wrong(f"the set {shown(key[1])} contains itself", "take it out of its own members")
        if len(self._open) >= _DEEPEST:
            raise place.wrong(f"more than {_DEEPEST} sets within each other", "name the members of the inner sets")
        self._open.append(key)
        parts = [np.empty(0, dtype=np.int64)]
        for item in self.sets.items[key]:
            parts.append(self.find(item) if isinstance(item, Reference) else self._kept(item, f"set {shown(key[1])}"))
        if self.nodes_of is not None:
            parts += [self.nodes_of(reference) for reference in self.sets.of_elements.get(key, ())]
        self._open.pop()
        self._done[key] = np.unique(np.concatenate(parts)).astype(np.int64)
        return self._done[key]

    def _kept(self, members: _Members, where: str) -> IntArray:
        """Those numbers that exist; a note says which of those that are named do not."""
        if not self.existing.size or members.scope not in self.offsets:
            return np.empty(0, dtype=np.int64)
        offset = self.offsets[members.scope]
        larger = [other for other in self.offsets.values() if other > offset]
        last_of_scope = min(larger) if larger else self.existing[-1]
        numbers = members.numbers + offset
        if members.step:
            # as many as there are numbers that exist, whatever the range says
            first, last = np.searchsorted(self.existing, (numbers.min(), min(numbers.max(), last_of_scope) + 1))
            within = self.existing[first:last]
            return np.asarray(within[(within - numbers[0]) % abs(members.step) == 0])
        at = np.minimum(np.searchsorted(self.existing, numbers), self.existing.size - 1)
        there = (self.existing[at] == numbers) & (numbers <= last_of_scope)
        if not there.all():
            missing = members.numbers[~there]
            what = self.sets.what
            self.notes.append(f"{where}: {missing.size} of its {what} do not exist, the first is {missing[0]}.")
        return np.asarray(numbers[there])
