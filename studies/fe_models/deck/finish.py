"""From the draft of a deck to the deck: every name is looked up, every number must exist."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftBoundary, DraftPair, DraftStep, DraftSurface
from studies.fe_models.deck.mesh import (
    NODES_OF_KIND,
    Boundary,
    CentrifugalLoad,
    ContactPair,
    CyclicSymmetry,
    Deck,
    ElementBlock,
    FloatArray,
    IntArray,
    Material,
    SolidSection,
    Step,
    Surface,
    Tie,
)
from studies.fe_models.deck.sets import PART, Reference, Resolver, SetDefinitions
from studies.fe_models.text.read_errors import Place, shown
from studies.scene_error import SceneError

FACES_OF_CORNERS = {4: 4, 10: 4, 6: 5, 15: 5, 8: 6, 20: 6}
"""Numbers of faces of an element by its number of nodes."""

_MOST_FACES = 20_000_000  # of all surfaces together


def finish(draft: Draft, name: str) -> Deck:
    """The deck of a draft. name: of the file. Raises SceneError where names or numbers are missing or do not fit."""
    return _Finish(draft, name).deck()


class _Finish:
    def __init__(self, draft: Draft, name: str) -> None:
        self.draft = draft
        self.name = name
        self.numbers, self.coordinates = _nodes(draft, name)
        self.blocks = _blocks(draft, self.numbers)
        self.elements, kinds = _element_kinds(self.blocks)
        self.faces_of = np.array([FACES_OF_CORNERS[NODES_OF_KIND[kind]] for kind in sorted(NODES_OF_KIND)])[kinds]
        self.element_sets = Resolver(draft.element_sets, self.elements, "EALL")
        self.node_sets = Resolver(draft.node_sets, self.numbers, "NALL", self._nodes_of)
        self.faces_left = _MOST_FACES

    def deck(self) -> Deck:
        draft = self.draft
        # sets first: their errors are about the lines where they are defined
        element_sets = self._sets(draft.element_sets, self.element_sets)
        node_sets = self._sets(draft.node_sets, self.node_sets)
        surfaces = {self._public(key, draft.surfaces): self._surface(item) for key, item in draft.surfaces.items()}
        ties = tuple(self._tie(pair) for pair in draft.ties)
        return Deck(
            path=self.name,
            node_numbers=self.numbers,
            coordinates=self.coordinates,
            blocks=self.blocks,
            node_sets=node_sets,
            element_sets=element_sets,
            surfaces=surfaces,
            ties=ties,
            contact_pairs=tuple(
                ContactPair(*self._two_surfaces(pair), pair.name, draft.frictions.get(pair.name))
                for pair in draft.contact_pairs
            ),
            cyclic=self._cyclic(ties),
            boundaries=tuple(self._boundary(item) for item in draft.boundaries),
            materials={key: Material(m.young, m.poisson, m.density) for key, m in draft.materials.items()},
            sections=tuple(self._section(reference, material) for reference, material in draft.sections),
            steps=tuple(self._step(step) for step in draft.steps),
            skipped=tuple(draft.skipped.values()),
            notes=(*self.node_sets.notes, *self.element_sets.notes),
            included=tuple(draft.included),
        )

    def _public(self, key: tuple[str, str], all_of_them: Mapping[tuple[str, str], object]) -> str:
        """Name of a set or surface: one of the part has its instance before it where the assembly has the same."""
        scope, name = key
        return f"{self.draft.instance}.{name}" if scope == PART and ("", name) in all_of_them else name

    def _sets(self, sets: SetDefinitions, resolver: Resolver) -> dict[str, IntArray]:
        start = Place(self.name, 1)
        return {self._public(key, sets.items): resolver.members(key, start) for key in sets.items}

    def _find(self, reference: Reference, resolver: Resolver) -> tuple[str, IntArray]:
        """Public name and numbers of what a line points to."""
        numbers = resolver.find(reference)
        target = str(reference.target)
        if numbers is None:
            raise reference.place.wrong(f"there is no set of {resolver.sets.what} {shown(target)}", "define it")
        scope = reference.scope if (reference.scope, target) in resolver.sets.items else PART
        return self._public((scope, target), resolver.sets.items), numbers

    def _nodes_of(self, reference: Reference) -> IntArray:
        elements = self._find(reference, self.element_sets)[1]
        found = [np.empty(0, dtype=np.int64)]
        for block in self.blocks:
            rows = np.minimum(np.searchsorted(block.numbers, elements), block.numbers.size - 1)
            found.append(block.nodes[rows[block.numbers[rows] == elements]].ravel())
        return np.unique(np.concatenate(found))

    def _surface(self, draft: DraftSurface) -> Surface:
        empty = np.empty(0, dtype=np.int64)
        if draft.nodes and draft.faces:
            raise draft.place.wrong("a surface of nodes and of faces", "give two surfaces")
        found = [self._find(reference, self.node_sets)[1] for reference in draft.nodes]
        elements: list[IntArray] = []
        faces: list[IntArray] = []
        for item in draft.faces:
            name, members = self._find(item.elements, self.element_sets)
            self.faces_left -= members.size
            if self.faces_left < 0:
                raise item.elements.place.wrong(f"more than {_MOST_FACES} faces", "remove surfaces that are not used")
            if np.any(self.faces_of[np.searchsorted(self.elements, members)] < item.face):
                raise item.elements.place.wrong(f"elements of {shown(name)} have no face S{item.face}", "give another")
            elements.append(members)
            faces.append(np.full(members.size, item.face))
        if not elements:
            return Surface(empty, empty, np.unique(np.concatenate(found)) if found else empty)
        both = np.unique(np.stack((np.concatenate(elements), np.concatenate(faces)), axis=1), axis=0)
        return Surface(both[:, 0].copy(), both[:, 1].copy(), empty)

    def _two_surfaces(self, pair: DraftPair) -> tuple[str, str]:
        names: list[str] = []
        for reference in (pair.dependent, pair.independent):
            target = str(reference.target)
            scopes = [scope for scope in (reference.scope, PART) if (scope, target) in self.draft.surfaces]
            if not scopes:
                raise reference.place.wrong(f"there is no surface {shown(target)}", "define it with *SURFACE")
            names.append(self._public((scopes[0], target), self.draft.surfaces))
        return names[0], names[1]

    def _tie(self, pair: DraftPair) -> Tie:
        return Tie(pair.name, *self._two_surfaces(pair), pair.tolerance, pair.cyclic)

    def _cyclic(self, ties: tuple[Tie, ...]) -> CyclicSymmetry | None:
        if self.draft.cyclic is None:
            return None
        n_sectors, name, axis, place = self.draft.cyclic
        cyclic = [tie.name for tie in ties if tie.cyclic]
        if name and name not in cyclic:
            raise place.wrong(f"there is no tie {shown(name)} of cut faces", "give *TIE, CYCLIC SYMMETRY this name")
        return CyclicSymmetry(n_sectors, name or (cyclic[0] if len(cyclic) == 1 else ""), axis)

    def _boundary(self, item: DraftBoundary) -> Boundary:
        name, nodes = self._find(item.nodes, self.node_sets)
        return Boundary(name, nodes, item.first_dof, item.last_dof, item.value)

    def _section(self, reference: Reference, material: str) -> SolidSection:
        name = self._find(reference, self.element_sets)[0]
        if material not in self.draft.materials:
            raise reference.place.wrong(f"there is no material {shown(material)}", "define it with *MATERIAL")
        return SolidSection(name, material)

    def _step(self, step: DraftStep) -> Step:
        loads: list[CentrifugalLoad] = []
        for load in step.centrifugal:
            name, elements = self._find(load.elements, self.element_sets)
            loads.append(CentrifugalLoad(name, elements, load.omega_squared, load.point, load.axis))
        return Step(
            kind=step.kind,
            perturbation="PERTURBATION" in step.parameters,
            nlgeom=step.parameters.get("NLGEOM", "NO").upper() != "NO",
            line=str(step.place),
            boundaries=tuple(self._boundary(item) for item in step.boundaries),
            boundaries_replaced=step.replaced,
            centrifugal=tuple(loads),
            equations_removed=step.equations_removed,
            contact_removed=tuple(step.contact_removed),
            parameters=step.kind_parameters,
        )


def _nodes(draft: Draft, name: str) -> tuple[IntArray, FloatArray]:
    """Numbers (n,), ascending, and coordinates (n, 3)."""
    if not any(numbers.size for numbers, _, _ in draft.nodes):
        raise SceneError("model", f"{name} has no nodes", "give the deck with its mesh")
    numbers = np.concatenate([item[0] for item in draft.nodes])
    coordinates = np.concatenate([item[1] for item in draft.nodes])
    order = np.argsort(numbers, kind="stable")
    numbers, coordinates = numbers[order], coordinates[order]
    again = np.flatnonzero(numbers[1:] == numbers[:-1])
    moved = again[np.any(coordinates[again] != coordinates[again + 1], axis=1)]
    if moved.size:
        number = numbers[moved[0]]
        place = next(place for found, _, place in reversed(draft.nodes) if number in found)
        raise place.wrong(f"node {number} is defined again at another position", "give each node once")
    keep = np.ones(numbers.size, dtype=bool)
    keep[again] = False
    coordinates = coordinates[keep]
    if draft.shift is not None:
        shift, turn = draft.shift
        coordinates = coordinates @ turn.T + shift
    return numbers[keep], coordinates


def _blocks(draft: Draft, nodes: IntArray) -> tuple[ElementBlock, ...]:
    """Elements, one block a kind, by ascending number."""
    for _, records, place in draft.elements:
        used = records[:, 1:]
        at = np.minimum(np.searchsorted(nodes, used), nodes.size - 1)
        missing = nodes[at] != used
        if missing.any():
            row, column = np.argwhere(missing)[0]
            found = f"element {records[row, 0]} has the node {used[row, column]}, which does not exist"
            raise place.wrong(found, "give the whole mesh")
    kinds = dict.fromkeys(kind for kind, _, _ in draft.elements)
    blocks: list[ElementBlock] = []
    for kind in kinds:
        records = np.concatenate([item for other, item, _ in draft.elements if other == kind])
        records = records[np.argsort(records[:, 0], kind="stable")]
        blocks.append(ElementBlock(kind, records[:, 0].copy(), records[:, 1:].copy()))
    numbers = np.sort(np.concatenate([block.numbers for block in blocks] or [np.empty(0, dtype=np.int64)]))
    again = numbers[1:][numbers[1:] == numbers[:-1]]
    if again.size:
        place = next(place for _, records, place in reversed(draft.elements) if again[0] in records[:, 0])
        raise place.wrong(f"element {again[0]} is defined again", "give each element once")
    return tuple(block for block in blocks if block.numbers.size)


def _element_kinds(blocks: tuple[ElementBlock, ...]) -> tuple[IntArray, IntArray]:
    """Numbers (m,) of all elements, ascending, and the place (m,) of their kinds in the sorted NODES_OF_KIND."""
    if not blocks:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    kinds = sorted(NODES_OF_KIND)
    numbers = np.concatenate([block.numbers for block in blocks])
    places = np.concatenate([np.full(block.numbers.size, kinds.index(block.kind)) for block in blocks])
    order = np.argsort(numbers)
    return numbers[order], places[order]
