"""Sets of nodes or elements: numbers, ranges and other sets, made to numbers once all of them are known."""

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field

import numpy as np

from studies.fe_models.deck.keywords import Reference
from studies.fe_models.files import IntArray, Place, is_integer, read_integer, shown

NONE = np.empty(0, dtype=np.int64)
"""No numbers."""

_DEEPEST = 100  # sets within sets

Key = tuple[str, str]
"""Scope and name of a set or surface. The scope is the name of an instance, "" outside of instances."""


@dataclass(frozen=True)
class Numbers:
    """Numbers as they are written in a scope; with step not 0 the first, last and step of a range."""

    scope: str
    numbers: IntArray
    step: int = 0


@dataclass
class Sets:
    """Sets as they are written. what: "nodes" or "elements". items: of every set what it consists of.

    unsorted: sets of several numbers whose order matters.
    """

    what: str
    items: dict[Key, list[Numbers | Reference]] = field(default_factory=dict)
    unsorted: set[Key] = field(default_factory=set)

    def add(self, key: Key, *items: Numbers | Reference) -> None:
        """Adds members to a set, which may be new."""
        self.items.setdefault(key, []).extend(items)


def _key_of(reference: Reference, instances: Container[str]) -> Key:
    """Scope and name, or number, that a reference means: those of an instance where it names one."""
    target = reference.target
    # names may have dots
    for at in [place for place, letter in enumerate(target[:100]) if letter == "."]:
        if target[:at] in instances:
            return target[:at], target[at + 1 :]
    return reference.scope, target


def find_key(items: Container[Key], instances: Mapping[str, object], reference: Reference) -> Key | None:
    """Key of the named set or surface: in its own scope, else of the only instance that has it; None of none.

    Raises SceneError where several instances have one of this name.
    """
    key = _key_of(reference, instances)
    if key in items:
        return key
    found = [scope for scope in instances if (scope, key[1]) in items]
    if len(found) > 1:
        remedy = f"write {found[0]}.{shown(key[1])} or {found[1]}.{shown(key[1])}"
        raise reference.place.wrong(f"{len(found)} instances have {shown(key[1])}", remedy)
    return (found[0], key[1]) if found else None


@dataclass
class Resolver:
    """Sets as numbers that exist.

    existing: (n,) all numbers that exist, ascending. offsets: of every scope, what is added to its numbers; those of
    one scope are smaller than the difference to the next. nodes_of: the nodes of a set of elements. notes: what is
    named and does not exist.
    """

    sets: Sets
    existing: IntArray
    offsets: Mapping[str, int]
    nodes_of: Callable[[Reference], IntArray] = lambda _: NONE
    notes: list[str] = field(default_factory=list)
    _done: dict[Key, IntArray] = field(default_factory=dict)
    _open: list[Key] = field(default_factory=list)

    def __call__(self, reference: Reference) -> IntArray:
        """Numbers (m,) that a reference stands for, ascending. Raises SceneError where there is no such set."""
        scope, target = _key_of(reference, self.offsets)
        if is_integer(target):
            number = np.array([read_integer(target, reference.place)])
            return self._existing(Numbers(scope, number), str(reference.place))
        key = self.key(reference)
        if key is not None:
            return self.members(key, reference.place)
        if target == f"{self.sets.what[0].upper()}ALL":  # NALL, EALL: the names that CalculiX gives to all of them
            return self.existing
        what = f"there is no set of {self.sets.what} {shown(target)}"
        raise reference.place.wrong(what, "define it, or remove it here")

    def key(self, reference: Reference) -> Key | None:
        """Of the named set; None of a number, or a set that is not defined."""
        return find_key(self.sets.items, self.offsets, reference)

    def members(self, key: Key, place: Place) -> IntArray:
        """Numbers (m,) of a set, ascending. Raises SceneError where it contains itself."""
        if key in self._done:
            return self._done[key]
        if key in self._open or len(self._open) >= _DEEPEST:
            found = "contains itself" if key in self._open else f"is more than {_DEEPEST} sets deep"
            raise place.wrong(f"the set {shown(key[1])} {found}", "name the members of the inner sets")
        self._open.append(key)
        parts = [NONE]
        for item in self.sets.items[key]:
            if isinstance(item, Numbers):
                parts.append(self._existing(item, f"set {shown(key[1])}"))
            else:
                parts.append(self.nodes_of(item) if item.of_elements else self(item))
        self._open.pop()
        self._done[key] = np.unique(np.concatenate(parts)).astype(np.int64)
        return self._done[key]

    def _existing(self, members: Numbers, where: str) -> IntArray:
        """Those numbers that exist; a note says which of those that are named do not."""
        if not self.existing.size or members.scope not in self.offsets:
            return NONE
        offset = self.offsets[members.scope]
        last_of_scope = min((other for other in self.offsets.values() if other > offset), default=self.existing[-1])
        numbers = members.numbers + offset
        if members.step:
            # as many as there are numbers that exist, whatever the range says
            first, last = np.searchsorted(self.existing, (numbers.min(), min(numbers.max(), last_of_scope) + 1))
            within = self.existing[first:last]
            return np.asarray(within[(within - numbers[0]) % abs(members.step) == 0])
        there = np.isin(numbers, self.existing) & (numbers <= last_of_scope)
        if not there.all():
            missing, what = members.numbers[~there], self.sets.what
            self.notes.append(f"{where}: {missing.size} of its {what} do not exist, the first is {missing[0]}.")
        return np.asarray(numbers[there])
