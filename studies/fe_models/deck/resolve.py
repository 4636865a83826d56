"""From the draft of a deck to the deck: every name is looked up, every number must exist."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftMaterial
from studies.fe_models.deck.mesh import (
    NODES_OF_KIND,
    ContactPair,
    CyclicSymmetry,
    Deck,
    ElementBlock,
    FloatArray,
    IntArray,
    Material,
    Surface,
)
from studies.fe_models.deck.numbering import build_blocks, build_nodes, find_offsets
from studies.fe_models.deck.sets import Key, Reference, Resolver, scope_of
from studies.fe_models.text.read_errors import Place, shown
from studies.finite_element.elements import ELEMENT_KINDS

FACES_OF_CORNERS = {4: 4, 10: 4, 6: 5, 15: 5, 8: 6, 20: 6}
"""Numbers of faces of an element by its number of nodes."""

_MOST_FACES = 20_000_000  # of all surfaces together
_SAME_AXIS = 1e-6  # distance of two axes over the distance of the points that give them


def resolve(draft: Draft) -> Deck:
    """The deck of a draft. Raises SceneError where names or numbers are missing or do not fit."""
    for generate in draft.generators:
        generate(draft)
    return Resolved(draft).deck()


class Resolved:
    """What names and numbers of a draft stand for: the readers of keywords ask it."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.offsets = find_offsets(draft)
        self.numbers, self.coordinates = build_nodes(draft, self.offsets)
        self.blocks = build_blocks(draft, self.offsets, self.numbers)
        order = np.concatenate([block.numbers for block in self.blocks] or [np.empty(0, dtype=np.int64)])
        kinds = np.repeat([block.kind for block in self.blocks], [block.numbers.size for block in self.blocks])
        rows = np.argsort(order)
        self.all_elements, self.kinds = order[rows], kinds[rows]
        self.solid = np.isin(self.kinds, list(NODES_OF_KIND))
        self.element_sets = Resolver(draft.element_sets, self.all_elements, self.offsets, "EALL")
        self.node_sets = Resolver(draft.node_sets, self.numbers, self.offsets, "NALL", self.nodes_of)
        self.faces_left = _MOST_FACES

    def deck(self) -> Deck:
        """The deck."""
        draft = self.draft
        # sets first: their errors are about the lines where they are defined
        element_sets, node_sets = (self._sets(each) for each in (self.element_sets, self.node_sets))
        surfaces: dict[str, Surface] = {}
        for key in draft.surfaces:
            surfaces.update(dict.fromkeys(self._names(key, draft.surfaces), self._surface(key)))
        fields = {
            name: [item for items in each.values() for item in items(self)] for name, each in draft.fields.items()
        }
        gone = self._gone(fields)
        blocks = [_without(block, gone) for block in self.blocks if block.kind in NODES_OF_KIND]
        kept = np.setdiff1d(self.all_elements[self.solid], gone)
        names = ("ties", "boundaries", "transforms", "equations", "rigid_motions", "sections", "forces", "pressures")
        loads = [load for load in fields.get("centrifugal", []) if np.isin(load.elements, kept).any() or not kept.size]
        return Deck(
            path=draft.name,
            node_numbers=self.numbers,
            coordinates=self.coordinates,
            blocks=tuple(block for block in blocks if block.numbers.size),
            node_sets=node_sets,
            element_sets={name: np.intersect1d(members, kept) for name, members in element_sets.items()},
            surfaces={name: _surface_without(surface, gone) for name, surface in surfaces.items()},
            contact_pairs=tuple(_contact_pairs(fields)),
            cyclic=_cyclic(fields),
            materials={name: self._material(each, fields) for name, each in draft.materials.items()},
            centrifugal=tuple(loads),
            gravity=self._gravity(fields, kept),
            removed=tuple(
                text for changes in ("removed", "apart") for taken, _, text in fields.get(changes, []) if taken
            ),
            n_instances=len(draft.placed),
            unassembled=tuple(text for text, _ in fields.get("unassembled", [])),
            skipped=(*draft.skipped, *self._idle(fields)),
            notes=(*self.node_sets.notes, *self.element_sets.notes, *draft.notes, *self._numbering()),
            included=tuple(draft.included),
            contact_nodes=None,
            **{name: tuple(fields.get(name, ())) for name in names},
        )

    def nodes(self, reference: Reference) -> tuple[str, IntArray]:
        """Name for messages, and the nodes of a set or number."""
        return self._name(reference, self.node_sets.sets.items), self.node_sets.find(reference)

    def elements(self, reference: Reference) -> tuple[str, IntArray]:
        """Name for messages, and the elements of a set or number."""
        return self._name(reference, self.element_sets.sets.items), self.element_sets.find(reference)

    def node(self, reference: Reference) -> int:
        """A node, or the only one of a set."""
        found = self.node_sets.find(reference)
        if found.size != 1:
            what = f"{shown(str(reference.target))} has {found.size} nodes"
            raise reference.place.wrong(what, "give one reference node that exists")
        return int(found[0])

    def ordered(self, reference: Reference) -> IntArray:
        """Nodes of a set or number in the order that counts in equations."""
        found = self.node_sets.find(reference)
        if (reference.scope, reference.target) in self.draft.node_sets.unsorted and found.size > 1:
            raise reference.place.wrong(f"the set {shown(str(reference.target))} is UNSORTED", "give nodes one by one")
        if not found.size:
            raise reference.place.wrong(
                f"{shown(str(reference.target))} of a constraint has no node", "give nodes that exist"
            )
        return found

    def surface(self, reference: Reference) -> str:
        """Name of a surface."""
        scope = scope_of(self.draft.surfaces, self.offsets, reference)
        if scope is None:
            found = f"there is no surface {shown(str(reference.target))}"
            raise reference.place.wrong(found, "define it with *SURFACE")
        return self._names((scope, str(reference.target)), self.draft.surfaces)[0]

    def faces(self, name: str) -> Surface:
        """Faces or nodes of a surface."""
        return self._surface(next(key for key in self.draft.surfaces if name in self._names(key, self.draft.surfaces)))

    def surface_nodes(self, name: str) -> IntArray:
        """Nodes of a surface."""
        surface = self.faces(name)
        found = [surface.nodes]
        for block in self.blocks:
            if block.kind in NODES_OF_KIND:
                for face, local in enumerate(ELEMENT_KINDS[block.kind].faces):
                    own = surface.elements[surface.faces == face + 1]
                    found.append(block.nodes[np.isin(block.numbers, own)][:, local].ravel())
        return np.unique(np.concatenate(found))

    def nodes_of(self, reference: Reference) -> IntArray:
        """Nodes of a set of elements."""
        elements = self.element_sets.find(reference)
        found = [np.empty(0, dtype=np.int64)]
        for block in self.blocks:
            rows = np.minimum(np.searchsorted(block.numbers, elements), block.numbers.size - 1)
            found.append(block.nodes[rows[block.numbers[rows] == elements]].ravel())
        return np.unique(np.concatenate(found))

    def other_kinds(self, elements: IntArray) -> list[str]:
        """Kinds of those elements (m,) that are not read."""
        return sorted(set(self.kinds[np.isin(self.all_elements, elements) & ~self.solid].tolist()))

    def placed(self, scope: str, points: FloatArray, *, vectors: bool = False) -> FloatArray:
        """Points or vectors (n, 3) of an instance where the instance stands."""
        shift, turn = self.draft.placed.get(scope, self.draft.world)
        return points @ turn.T + (0.0 if vectors else shift)

    def _names(self, key: Key, everything: Mapping[Key, object]) -> list[str]:
        """Names of a set or surface: where others have the same, the one of an instance has that before it."""
        scope, name = key
        if not scope:
            return [name]
        long = f"{scope}.{name}"
        alone = [other for other in ("", *self.draft.placed) if (other, name) in everything] == [scope]
        return [name, long] if alone else [long]

    def _name(self, reference: Reference, everything: Mapping[Key, object]) -> str:
        scope = scope_of(everything, self.offsets, reference)
        target = str(reference.target)
        return target if scope is None else self._names((scope, target), everything)[0]

    def _sets(self, resolver: Resolver) -> dict[str, IntArray]:
        start, sets = Place(self.draft.name, 1), resolver.sets.items
        return {name: resolver.members(key, start) for key in sets for name in self._names(key, sets)}

    def _surface(self, key: Key) -> Surface:
        empty = np.empty(0, dtype=np.int64)
        parts = self.draft.surfaces[key]
        if not parts or parts[0][1] == 0:
            nodes = np.concatenate([empty, *(self.node_sets.find(reference) for reference, _ in parts)])
            return Surface(empty, empty, np.unique(nodes))
        found: list[IntArray] = []
        for reference, face in parts:
            name, members = self.elements(reference)
            self.faces_left -= members.size
            if self.faces_left < 0:
                raise reference.place.wrong(f"more than {_MOST_FACES} faces", "remove surfaces that are not used")
            few = members[self._n_faces[np.searchsorted(self.all_elements, members)] < face]
            if few.size:
                kind = self.kinds[np.searchsorted(self.all_elements, few[0])]
                what = f"elements of {shown(name)} have no face S{face}, as element {few[0]} ({kind})"
                raise reference.place.wrong(what, "give another, of a solid element")
            found.append(np.stack((members, np.full(members.size, face)), axis=1))
        both = np.unique(np.concatenate(found), axis=0)
        return Surface(both[:, 0].copy(), both[:, 1].copy(), empty)

    @cached_property
    def _n_faces(self) -> IntArray:
        faces = {kind: FACES_OF_CORNERS[n] for kind, n in NODES_OF_KIND.items()}
        return np.array([faces.get(kind, 0) for kind in self.kinds], dtype=np.int64)

    def _idle(self, fields: Mapping[str, list[Any]]) -> Iterator[str]:
        """Elements that are not read, and carry nothing as no section has them."""
        carry = np.concatenate([np.empty(0, dtype=np.int64), *(own for _, own in fields.get("unassembled", []))])
        for each in self.draft.elements:
            if each.kind not in NODES_OF_KIND and not np.isin(each.numbers + self.offsets[each.scope], carry).all():
                yield f"{each.place}: *ELEMENT of type {each.kind} without a section"

    def _gone(self, fields: Mapping[str, list[Any]]) -> IntArray:
        """Elements that *MODEL CHANGE takes away."""
        gone = np.empty(0, dtype=np.int64)
        for removed, elements, _ in fields.get("removed", []):
            gone = np.union1d(gone, elements) if removed else np.setdiff1d(gone, elements)
        return gone

    def _gravity(self, fields: Mapping[str, list[Any]], kept: IntArray) -> FloatArray | None:
        total = None
        for elements, acceleration, place in fields.get("gravity", []):
            if not np.isin(kept, elements).all():
                raise place.wrong("*DLOAD, GRAV on a part of the elements", "give it to all of them")
            total = acceleration + (0.0 if total is None else total)
        return total

    def _material(self, draft: DraftMaterial, fields: Mapping[str, list[Any]]) -> Material:
        """Values at the temperature of all nodes; of several temperatures without one they are a problem."""
        given, thermal, empty = fields.get("temperatures", []), self.draft.thermal, np.empty(0, dtype=np.int64)
        if thermal.keys() >= {"TEMPERATURE", "EXPANSION"}:
            found = "*TEMPERATURE strains materials with *EXPANSION"
            raise thermal["TEMPERATURE"].wrong(found, "remove one of them")
        solid = np.concatenate([empty, *(each.nodes.ravel() for each in self.blocks if each.kind in NODES_OF_KIND)])
        everywhere = np.isin(solid, np.concatenate([empty, *(nodes for nodes, _ in given)])).all()
        values = {value for _, value in given} if everywhere and "TEMPERATURE" not in thermal else set()
        problem = draft.problem

        def at_temperature(keyword: str, rows: list[list[float]], column: int, n_values: int) -> float | None:
            nonlocal problem
            own = {(row[n_values] if len(row) > n_values else 0.0): row[column] for row in rows}
            if len(set(own.values())) > 1 and len(values) != 1:
                several = f"*{keyword} at several temperatures, of which none is given"
                problem = problem or f"{draft.places[keyword]}: {several}"
            at = sorted(own)
            return float(np.interp(min(values, default=0.0), at, [own[each] for each in at])) if own else None

        young, poisson = (at_temperature("ELASTIC", draft.elastic, column, 2) for column in (0, 1))
        return Material(young, poisson, at_temperature("DENSITY", draft.density, 0, 1), problem)

    def _numbering(self) -> list[str]:
        """Which numbers the nodes of instances have."""
        return [
            f"Node 1 of {name or 'the assembly'} is node {offset + 1}."
            for name, offset in self.offsets.items()
            if offset
        ]


def _without(block: ElementBlock, gone: IntArray) -> ElementBlock:
    keep = ~np.isin(block.numbers, gone)
    return ElementBlock(block.kind, block.numbers[keep], block.nodes[keep])


def _surface_without(surface: Surface, gone: IntArray) -> Surface:
    keep = ~np.isin(surface.elements, gone)
    return Surface(surface.elements[keep], surface.faces[keep], surface.nodes)


def _contact_pairs(fields: Mapping[str, list[Any]]) -> Iterator[ContactPair]:
    """Contact pairs with their clearances, without those that *MODEL CHANGE takes away."""
    apart: set[frozenset[str]] = set()
    for removed, names, _ in fields.get("apart", []):
        apart = apart | {frozenset(names)} if removed else apart - {frozenset(names)}
    pairs = fields.get("contact_pairs", [])
    known = [frozenset((pair.dependent, pair.independent)) for pair in pairs]
    fits: dict[frozenset[str], tuple[str, float | None]] = {}
    for one, other, text, value, place in fields.get("fits", []):
        if {one, other} not in known:
            raise place.wrong(f"there is no contact pair of {one} and {other}", "give the surfaces of a *CONTACT PAIR")
        fits[frozenset((one, other))] = text, value
    for names, pair in zip(known, pairs, strict=True):
        if names not in apart:
            fitted, clearance = fits.get(names, ("", None))
            yield replace(pair, fitted=fitted, clearance=clearance)


def _cyclic(fields: Mapping[str, list[Any]]) -> CyclicSymmetry | None:
    """Cyclic symmetry of one number of sectors and one axis, whose cut faces may be several ties."""
    ties = [tie.name for tie in fields.get("ties", []) if tie.cyclic]
    named: list[str] = []
    first: tuple[int, FloatArray] | None = None
    for number, name, axis, place in fields.get("cyclic", []):
        if name and name not in ties:
            raise place.wrong(f"there is no tie {shown(name)} of cut faces", "give *TIE, CYCLIC SYMMETRY this name")
        named += [name] if name else []
        first = first or (number, axis)
        own = (first[1][1] - first[1][0]) / np.linalg.norm(first[1][1] - first[1][0])
        apart = np.cross(axis - first[1][0], own) / np.linalg.norm(axis[1] - axis[0])
        if number != first[0] or np.abs(apart).max() > _SAME_AXIS or (axis[1] - axis[0]) @ own < 0:
            found = f"*CYCLIC SYMMETRY MODEL with {number} sectors, another one with {first[0]}, or about other axes"
            raise place.wrong(found, "give all of them one N and one axis: several stages are not supported")
    return None if first is None else CyclicSymmetry(first[0], tuple(named or ties), first[1])
