"""Nodes and surfaces of a mesh by the names of its file; which surfaces touch or are glued, and with what friction."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from solver.model import IntArray
from studies.fe_models.deck.contents import ContactPair, Deck
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.model_files import Units
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.solid_mesh import SolidMesh
from studies.finite_element.surfaces import Surface, surface_of_faces, surface_of_nodes, surface_of_points
from studies.scene_error import SceneError

_MOST_NAMED = 6


@dataclass(frozen=True)
class Selections:
    """What the names of a deck stand for in its mesh. Names may be written in small letters.

    references: rows of nodes without elements that others follow.
    """

    deck: Deck
    mesh: SolidMesh
    references: Mapping[int, int] = field(default_factory=dict)

    def rows(self, numbers: IntArray) -> IntArray:
        """Rows of the nodes that are in the mesh; of other nodes alone, those that others follow."""
        inside = np.intersect1d(numbers, self.mesh.numbers)
        if not len(inside):
            return np.array([self.references[each] for each in numbers if each in self.references], dtype=np.int64)
        return np.searchsorted(self.mesh.numbers, inside).astype(np.int64)

    def nodes(self, name: str, key: str) -> IntArray:
        """Rows of the nodes of a set of nodes, a surface or a set of elements.

        key: of the study that has the name, for messages. Raises SceneError where there is none, or has no node.
        """
        found = self._nodes(name.strip().upper())
        if found is None:
            known = (*self.deck.node_sets, *self.deck.surfaces, *self.deck.element_sets)
            raise self.unknown(name, key, "set of nodes or surface", known)
        if len(found) == 0:
            taken = f" ({self.deck.removed[0].rstrip('.')})" if self.deck.removed else ""
            found_none = f"{name} in {self.deck.path} has no node of an element{taken}"
            raise SceneError(key, found_none, "give nodes of the mesh")
        return found

    def surface(self, name: str, key: str) -> Surface:
        """Surface of a name, or of all outer faces whose nodes are in the set of this name.

        Raises SceneError where there is none.
        """
        known = name.strip().upper()
        surface = self.deck.surfaces.get(known)
        if surface is not None and not surface.of_nodes:
            return surface_of_faces(self.mesh, known, surface.elements, surface.faces)
        nodes = self._nodes(known)
        if nodes is not None and self.deck.contact_nodes is not None:
            return surface_of_points(known, nodes)
        if nodes is None:
            raise self.unknown(name, key, "surface or set of nodes", (*self.deck.surfaces, *self.deck.node_sets))
        return surface_of_nodes(self.mesh, known, nodes)

    def unknown(self, name: str, key: str, what: str, known: Iterable[str]) -> SceneError:
        """The error about a name that the deck does not have; it lists those that look like it."""
        names = sorted(set(known))
        what = "physical group" if self.deck.path.lower().endswith(".msh") else what
        near = difflib.get_close_matches(name.strip().upper(), names, n=3, cutoff=0.5)
        shown = near or names[:_MOST_NAMED]
        more = ", ..." if not near and len(names) > _MOST_NAMED else ""
        remedy = f"give {' or '.join(shown)}{more}" if shown else f"name it in {self.deck.path}: there is none"
        return SceneError(key, f'there is no {what} "{name}" in {self.deck.path}', remedy)

    def _nodes(self, name: str) -> IntArray | None:
        deck = self.deck
        if name in deck.node_sets:
            return self.rows(deck.node_sets[name])
        if name in deck.surfaces:
            surface = deck.surfaces[name]
            if surface.of_nodes:
                return self.rows(surface.nodes)
            return surface_of_faces(self.mesh, name, surface.elements, surface.faces).nodes
        if name not in deck.element_sets:
            return None
        members = deck.element_sets[name]
        used = [block.nodes[np.isin(block.numbers, members)].ravel() for block in deck.blocks]
        return self.rows(np.concatenate(used)) if used else np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class _Definition:
    """Two surfaces of the deck. tolerance: units of the file. pair: None where the deck has no such contact pair."""

    names: tuple[str, str]
    tolerance: float | None = None
    pair: ContactPair | None = None

    def joins(self, names: tuple[str, str]) -> bool:
        return set(self.names) == set(names)


@dataclass(frozen=True)
class Surfaces:
    """Surfaces in contact, at least one pair, and surfaces that are glued for good."""

    contacts: tuple[ContactSurfaces, ...]
    ties: tuple[ContactSurfaces, ...]


def find_surfaces(selections: Selections, parameters: Parameters, units: Units, axis: CyclicAxis | None) -> Surfaces:
    """Pairs of surfaces that the study names, else those of CONTACT PAIR, else those of TIE.

    Other ties stay glued, and contact pairs that the deck glues and the study does not name. Raises SceneError where
    there is no contact, a name is not known, or a pair has no friction coefficient.
    """
    deck = selections.deck
    ties = [_Definition((tie.dependent, tie.independent), tie.tolerance) for tie in deck.ties if not tie.cyclic]
    pairs = [_Definition((pair.dependent, pair.independent), None, pair) for pair in deck.contact_pairs]
    touching = [each for each in pairs if each.pair is not None and not each.pair.glued]
    glued_pairs = [each for each in pairs if each not in touching]
    if parameters.contact is not None:
        chosen = [_known(_capital(names), [*pairs, *ties]) for names in parameters.contact]
    else:
        chosen = touching or ties
    if not chosen and glued_pairs:
        found = f"{deck.contact_pairs[0].glued}: all contact pairs are glued, so that nothing wears"
        raise SceneError("contact", found, "name those that move: `contact` in the study")
    if not chosen:
        taken = f" ({deck.removed[0].rstrip('.')})" if deck.removed else ""
        found = f"{deck.path} has neither CONTACT PAIR nor TIE{taken}"
        raise SceneError("contact", found, 'give pairs of surfaces, as [["BLADES", "DISKS"]]')
    # a name that the deck does not have is said before a friction coefficient that is missing for it
    named = [_surfaces(selections, each, parameters, units, "contact") for each in chosen]
    friction = _friction(chosen, parameters, deck)
    sectors = _sectors(selections, named, chosen, parameters.next_sector, axis)
    contacts = [
        replace(each, friction_coefficient=value, sector=sector)
        for each, value, sector in zip(named, friction, sectors, strict=True)
    ]
    glued = [tie for tie in (*ties, *glued_pairs) if not any(tie.joins(each.names) for each in chosen)]
    return Surfaces(tuple(contacts), tuple(_surfaces(selections, tie, parameters, units, "model") for tie in glued))


def _capital(names: tuple[str, str]) -> tuple[str, str]:
    return names[0].strip().upper(), names[1].strip().upper()


def _known(names: tuple[str, str], definitions: list[_Definition]) -> _Definition:
    """What the deck says of two surfaces, nothing but their names where it says nothing."""
    return next((each for each in definitions if each.joins(names)), _Definition(names))


def _surfaces(
    selections: Selections,
    definition: _Definition,
    parameters: Parameters,
    units: Units,
    key: str,
) -> ContactSurfaces:
    first, second = (selections.surface(name, key) for name in definition.names)
    tolerance = parameters.tolerance
    if tolerance is None and definition.tolerance is not None:
        tolerance = definition.tolerance * units.length
    pair = definition.pair
    if pair is not None and pair.adjusted and pair.clearance is None and parameters.gaps:
        remedy = "leave ADJUST out where the distances of the mesh count, else leave gaps out"
        raise SceneError("gaps", f"{pair.adjusted} onto the other surface, so that there are no gaps", remedy)
    if pair is None or not pair.fitted:
        return ContactSurfaces(first, second, tolerance, None, with_gaps=parameters.gaps)
    if not parameters.gaps:
        raise SceneError("gaps", f"{pair.fitted}, and the study lets the surfaces touch", "give gaps = true")
    clearance = None if pair.clearance is None else pair.clearance * units.length
    return ContactSurfaces(first, second, tolerance, None, with_gaps=True, clearance=clearance)


def _sectors(
    selections: Selections,
    surfaces: list[ContactSurfaces],
    chosen: list[_Definition],
    given: bool | tuple[str, ...],
    axis: CyclicAxis | None,
) -> Iterator[int]:
    """Sector of the second surface of each contact: the neighbour, of both, to which the first one is nearer."""
    names = () if isinstance(given, bool) else tuple(name.strip().upper() for name in given)
    for name in names:
        if not any(name in _labels(each) for each in chosen):
            known = ", ".join(_labels(each)[-1] for each in chosen)
            raise SceneError("next_sector", f'no contact has the name "{name}"', f"give one of {known}")
    for each, definition in zip(surfaces, chosen, strict=True):
        if axis is None or not (given is True or any(name in _labels(definition) for name in names)):
            yield 0
            continue
        first, second = (selections.mesh.coordinates[side.nodes].mean(axis=0) for side in (each.first, each.second))
        ahead, back = (float(np.linalg.norm(axis.turned(second[None], k)[0] - first)) for k in (1, -1))
        yield 1 if ahead <= back else -1


def _friction(chosen: list[_Definition], parameters: Parameters, deck: Deck) -> Iterator[float | None]:
    """Friction coefficient of each contact; None of all where the study has one number."""
    given = parameters.friction_coefficient
    if isinstance(given, float | int):
        yield from [None] * len(chosen)
        return
    named = {} if given is None else {name.strip().upper(): value for name, value in given.items()}
    for name, value in named.items():
        if not any(name in _labels(each) for each in chosen):
            known = ", ".join(_labels(each)[-1] for each in chosen)
            raise SceneError(f"friction_coefficient.{name}", "no contact has this name", f"give one of {known}")
        if value < 0.0:
            raise SceneError(f"friction_coefficient.{name}", f"{value}", "give 0 or more")
    for each in chosen:
        own = [named[label] for label in _labels(each) if label in named]
        pair = each.pair
        value_or_none = own[-1] if own else None if pair is None else pair.friction_coefficient
        if value_or_none is None and pair is not None and pair.problem:
            remedy = "give one coefficient, there or by friction_coefficient in the study"
            raise SceneError("friction_coefficient", pair.problem, remedy)
        if value_or_none is None:
            found = f"missing for {_labels(each)[-1]}"
            raise SceneError("friction_coefficient", found, f"give it, or *FRICTION for a CONTACT PAIR in {deck.path}")
        yield value_or_none


def _labels(definition: _Definition) -> tuple[str, str, str]:
    first, second = definition.names
    return first, second, f"{first}-{second}"
