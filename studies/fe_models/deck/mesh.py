"""The mesh of a deck: as it is read, and then with every number in its place and every set to be looked up."""

from collections.abc import Container, Mapping
from dataclasses import dataclass, field

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND, ElementBlock, Surface
from studies.fe_models.deck.keywords import Block, Reference
from studies.fe_models.deck.sets import NONE, Key, Resolver, Sets, find_key
from studies.fe_models.files import LARGEST_NUMBER, FloatArray, IntArray, Place, shown
from studies.finite_element.elements import ELEMENT_KINDS
from studies.scene_error import SceneError

_MOST_FACES = 20_000_000  # of all surfaces together


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
    row, of *NODE. surfaces: sets or numbers with faces, 0 of nodes. others: keywords that are not of the mesh.
    """

    name: str
    nodes: list[Records] = field(default_factory=list)
    elements: list[Records] = field(default_factory=list)
    node_sets: Sets = field(default_factory=lambda: Sets("nodes"))
    element_sets: Sets = field(default_factory=lambda: Sets("elements"))
    surfaces: dict[Key, list[tuple[Reference, int]]] = field(default_factory=dict)
    system: tuple[FloatArray, FloatArray] | None = None
    parts: dict[str, list[Block]] = field(default_factory=dict)
    part: str = ""
    placed: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    scope: str = ""
    others: list[Block] = field(default_factory=list)
    included: list[str] = field(default_factory=list)

    def at(self, scope: str, points: FloatArray, *, vectors: bool = False) -> FloatArray:
        """Points or vectors (n, 3) of an instance where the instance stands."""
        shift, turn = self.placed.get(scope, (np.zeros(3), np.eye(3)))
        return points @ turn.T + (0.0 if vectors else shift)


class Mesh:
    """Nodes, elements, sets and surfaces of a draft under the numbers that they have in the deck.

    offsets: what is added to the numbers of every scope. numbers (n,), coordinates (n, 3): of the nodes. blocks: by
    kind. solid_blocks: those that are read. nodes, elements: of a set or number. Raises SceneError where numbers or
    names are missing or do not fit.
    """

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.offsets = _find_offsets(draft)
        self.numbers, self.coordinates = _build_nodes(draft, self.offsets)
        self.blocks = _build_blocks(draft, self.offsets, self.numbers)
        self.solid_blocks = [block for block in self.blocks if block.kind in NODES_OF_KIND]
        elements = np.concatenate([NONE, *(block.numbers for block in self.blocks)])
        kinds = np.repeat([block.kind for block in self.blocks], [block.numbers.size for block in self.blocks])
        order = np.argsort(elements)
        self._kinds = kinds[order]
        self.elements = Resolver(draft.element_sets, elements[order], self.offsets)
        self.nodes = Resolver(draft.node_sets, self.numbers, self.offsets, self.nodes_of)
        # sets first: their errors are about the lines where they are defined
        self.element_sets, self.node_sets = self._sets(self.elements), self._sets(self.nodes)
        self._faces_left = _MOST_FACES
        self.surfaces: dict[str, Surface] = {}
        for key in draft.surfaces:
            self.surfaces.update(dict.fromkeys(self._names(key, draft.surfaces), self._surface(key)))

    @property
    def notes(self) -> tuple[str, ...]:
        """What sets name that does not exist, and which numbers the nodes of later instances have."""
        later = [(name, offset) for name, offset in self.offsets.items() if offset]
        numbering = (f"Node 1 of {name or 'the assembly'} is node {offset + 1}." for name, offset in later)
        return (*self.nodes.notes, *self.elements.notes, *numbering)

    def name_of_elements(self, reference: Reference) -> str:
        """Name that a set of elements has in the deck; the number of a single one."""
        key = self.elements.key(reference)
        return reference.target if key is None else self._names(key, self.draft.element_sets.items)[0]

    def node(self, reference: Reference) -> int:
        """A node, or the only one of a set."""
        found = self.nodes(reference)
        if found.size != 1:
            raise reference.place.wrong(f"{shown(reference.target)} has {found.size} nodes", "give one that exists")
        return int(found[0])

    def ordered(self, reference: Reference) -> IntArray:
        """Nodes of a set or number in the order that counts in equations."""
        found = self.nodes(reference)
        if not found.size or (found.size > 1 and self.nodes.key(reference) in self.draft.node_sets.unsorted):
            what = f"the set {shown(reference.target)} is UNSORTED, or has no node"
            raise reference.place.wrong(what, "give nodes that exist, one by one")
        return found

    def surface(self, reference: Reference) -> str:
        """Name of a surface."""
        if (key := find_key(self.draft.surfaces, self.offsets, reference)) is None:
            raise reference.place.wrong(f"there is no surface {shown(reference.target)}", "define it with *SURFACE")
        return self._names(key, self.draft.surfaces)[0]

    def surface_nodes(self, name: str) -> IntArray:
        """Nodes of a surface."""
        surface = self.surfaces[name]
        found = [surface.nodes]
        for block in self.solid_blocks:
            for face, local in enumerate(ELEMENT_KINDS[block.kind].faces, 1):
                own = surface.elements[surface.faces == face]
                found.append(block.nodes[np.isin(block.numbers, own)][:, local].ravel())
        return np.unique(np.concatenate(found))

    def nodes_of(self, reference: Reference) -> IntArray:
        """Nodes of a set of elements."""
        elements = self.elements(reference)
        found = [block.nodes[np.isin(block.numbers, elements)].ravel() for block in self.blocks]
        return np.unique(np.concatenate([NONE, *found]))

    def _names(self, key: Key, everything: Container[Key]) -> list[str]:
        """Names of a set or surface: where others have the same, the one of an instance has that before it."""
        scope, name = key
        alone = all((other, name) not in everything for other in ("", *self.draft.placed) if other != scope)
        long = f"{scope}.{name}" if scope else name
        return [name, long] if alone and scope else [long]

    def _sets(self, resolver: Resolver) -> dict[str, IntArray]:
        start, sets = Place(self.draft.name, 1), resolver.sets.items
        return {name: resolver.members(key, start) for key in sets for name in self._names(key, sets)}

    def _surface(self, key: Key) -> Surface:
        parts = self.draft.surfaces[key]
        if not parts or parts[0][1] == 0:
            nodes = np.concatenate([NONE, *(self.nodes(reference) for reference, _ in parts)])
            return Surface(NONE, NONE, np.unique(nodes))
        found: list[IntArray] = []
        for reference, face in parts:
            members = self.elements(reference)
            self._faces_left -= members.size
            if self._faces_left < 0:
                raise reference.place.wrong(f"more than {_MOST_FACES} faces", "remove surfaces that are not used")
            for kind in set(self._kinds[np.searchsorted(self.elements.existing, members)].tolist()):
                if kind not in ELEMENT_KINDS or len(ELEMENT_KINDS[kind].corner_faces) < face:
                    what = f"elements of {shown(reference.target)} have no face S{face}"
                    raise reference.place.wrong(what, f"give one of a solid element, not of {kind}")
            found.append(np.stack((members, np.full(members.size, face)), axis=1))
        both = np.unique(np.concatenate(found), axis=0)
        return Surface(both[:, 0].copy(), both[:, 1].copy(), NONE)


def _find_offsets(draft: Draft) -> dict[str, int]:
    """What is added to the numbers of every scope: 0 for the first one, then a power of ten and its multiples."""
    largest: dict[str, int] = {}
    for each in (*draft.nodes, *draft.elements):
        largest[each.scope] = max(largest.get(each.scope, 0), int(each.numbers.max(initial=0)))
    step = 10 ** len(str(max(largest.values(), default=0)))
    if step * len(largest) > LARGEST_NUMBER and len(largest) > 1:
        raise SceneError("model", f"{draft.name}: {len(largest)} instances with numbers up to {step}", "number from 1")
    return {scope: place * step for place, scope in enumerate(largest)} or {"": 0}


def _build_nodes(draft: Draft, offsets: Mapping[str, int]) -> tuple[IntArray, FloatArray]:
    """Numbers (n,), ascending, and coordinates (n, 3)."""
    if not any(each.numbers.size for each in draft.nodes):
        what = "nodes: no *PART has an *INSTANCE" if draft.parts and not draft.placed else "nodes"
        raise SceneError("model", f"{draft.name} has no {what}", "give the deck with its mesh")
    numbers = np.concatenate([each.numbers + offsets[each.scope] for each in draft.nodes])
    coordinates = np.concatenate([draft.at(each.scope, each.values.astype(np.float64)) for each in draft.nodes])
    order = np.argsort(numbers, kind="stable")
    numbers, coordinates = numbers[order], coordinates[order]
    again = np.flatnonzero(numbers[1:] == numbers[:-1])
    if (moved := again[np.any(coordinates[again] != coordinates[again + 1], axis=1)]).size:
        number = numbers[moved[0]]
        place = _place_of(draft.nodes, offsets, number)
        raise place.wrong(f"node {number} is defined again at another position", "give each node once")
    keep = np.ones(numbers.size, dtype=bool)
    keep[again] = False
    return numbers[keep].astype(np.int64), coordinates[keep]


def _place_of(records: list[Records], offsets: Mapping[str, int], number: int) -> Place:
    """Place of the last record of a number."""
    return next(each.place for each in reversed(records) if number - offsets[each.scope] in each.numbers)


def _build_blocks(draft: Draft, offsets: Mapping[str, int], nodes: IntArray) -> tuple[ElementBlock, ...]:
    """Elements, one block a kind, by ascending number."""
    kinds: dict[str, list[tuple[IntArray, IntArray]]] = {}
    for each in draft.elements:
        used = each.values.astype(np.int64) + offsets[each.scope]
        missing = ~np.isin(used, nodes)
        if missing.any():
            row, column = np.argwhere(missing)[0]
            found = f"element {each.numbers[row]} has the node {each.values[row, column]}, which does not exist"
            raise each.place.wrong(found, "give the whole mesh")
        kinds.setdefault(each.kind, []).append((each.numbers + offsets[each.scope], used))
    blocks: list[ElementBlock] = []
    for kind, parts in kinds.items():
        numbers, used = (np.concatenate(each) for each in zip(*parts, strict=True))
        order = np.argsort(numbers, kind="stable")
        blocks.append(ElementBlock(kind, numbers[order], used[order]))
    numbers = np.sort(np.concatenate([NONE, *(block.numbers for block in blocks)]))
    if (again := numbers[1:][numbers[1:] == numbers[:-1]]).size:
        place = _place_of(draft.elements, offsets, again[0])
        raise place.wrong(f"element {again[0]} is defined again", "give each element once")
    return tuple(block for block in blocks if block.numbers.size)
