"""What the names of a mesh stand for; which surfaces touch, are glued, cut or clamped, and with what friction."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from solver.model import IntArray
from studies.fe_models.deck.contents import Deck, SurfacePair
from studies.fe_models.files import Units
from studies.fe_models.from_files.parameters import Parameters
from studies.finite_element.cut_faces import CutFaces, CyclicAxis, find_cut_faces, match_cut_faces
from studies.finite_element.pairing import Contacts, ContactSurfaces
from studies.finite_element.solid_mesh import SolidMesh
from studies.finite_element.surfaces import Surface, surface_of_faces, surface_of_nodes, surface_of_points
from studies.scene_error import SceneError

_MOST_NAMED = 6
_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Selections:
    """What the names of a deck stand for in its mesh. Names may be written in small letters.

    parameters: what the study says. units: of the deck. references: rows of nodes without elements that others follow.
    """

    deck: Deck
    mesh: SolidMesh
    parameters: Parameters
    units: Units
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
        deck, known = self.deck, capital(name)
        surface = self._of_faces(known)
        if known in deck.node_sets:
            found = self.rows(deck.node_sets[known])
        elif surface is not None:
            found = surface.nodes
        elif known in deck.surfaces:
            found = self.rows(deck.surfaces[known].nodes)
        elif known in deck.element_sets:
            members = deck.element_sets[known]
            used = [block.nodes[np.isin(block.numbers, members)].ravel() for block in deck.blocks]
            found = self.rows(np.concatenate([_NONE, *used]))
        else:
            names = sorted({*deck.node_sets, *deck.surfaces, *deck.element_sets})
            what = "physical group" if deck.path.lower().endswith(".msh") else "set or surface"
            near = difflib.get_close_matches(known, names, n=3, cutoff=0.5) or names[:_MOST_NAMED]
            remedy = f"give {' or '.join(near)}" if near else f"name it in {deck.path}: there is none"
            raise SceneError(key, f'there is no {what} "{name}" in {deck.path}', remedy)
        if len(found) == 0:
            remedy = "give nodes of the mesh that no *MODEL CHANGE takes away"
            raise SceneError(key, f"{name} in {deck.path} has no node of an element", remedy)
        return found

    def surface(self, name: str, key: str) -> Surface:
        """Surface of a name, or of all outer faces whose nodes are in the set of this name.

        Raises SceneError where there is none.
        """
        known = capital(name)
        if (surface := self._of_faces(known)) is not None:
            return surface
        nodes = self.nodes(name, key)
        if self.deck.contact_nodes is not None:
            return surface_of_points(known, nodes)
        return surface_of_nodes(self.mesh, known, nodes)

    def cut(self, axis: CyclicAxis | None, contacts: Sequence[ContactSurfaces]) -> CutFaces | None:
        """Cut faces that the study names, else those of the deck, else all nodes that are images; None of no sector.

        contacts: nodes of those with the next sector are on no cut face that is found. Raises SceneError.
        """
        if axis is None:
            return None
        given = self.parameters.cut_faces
        names = self.deck.cut_faces if given is None else (given,)
        if not names:
            across = [surface.nodes for each in contacts if each.sector for surface in (each.first, each.second)]
            return find_cut_faces(self.mesh, axis, np.concatenate([_NONE, *across]))
        sides = ([self.nodes(pair[side], "cut_faces") for pair in names] for side in (0, 1))
        return match_cut_faces(self.mesh, axis, *(np.unique(np.concatenate(each)) for each in sides))

    def clamped(self) -> IntArray | None:
        """Rows of the nodes that the study clamps; None where the deck says what is held. Raises SceneError."""
        names = self.parameters.clamp
        return None if names is None else np.concatenate([_NONE, *(self.nodes(name, "clamp") for name in names)])

    def _of_faces(self, name: str) -> Surface | None:
        """A surface that is given by faces of elements, by its name in capitals."""
        surface = self.deck.surfaces.get(name)
        if surface is None or surface.nodes.size:
            return None
        return surface_of_faces(self.mesh, name, surface.elements, surface.faces)


def capital(name: str) -> str:
    """A name as a deck has it."""
    return name.strip().upper()


def find_surfaces(selections: Selections, axis: CyclicAxis | None) -> tuple[Contacts, Contacts]:
    """Surfaces in contact, at least one pair, that the study names, else those of CONTACT PAIR, else those of TIE.

    Then those that are glued for good: other ties, and contact pairs that the deck glues and the study does not name.
    Raises SceneError where there is no contact, a name is not known, or a pair has no friction coefficient.
    """
    deck, given = selections.deck, selections.parameters.contact
    touching = [pair for pair in deck.contact_pairs if not pair.glued]
    glued = [pair for pair in deck.contact_pairs if pair.glued]
    if given is not None:
        # what the deck says of two surfaces, nothing but their names where it says nothing
        known = (*deck.contact_pairs, *deck.ties)
        chosen = [next((each for each in known if _same(each, pair)), pair) for pair in _pairs(given)]
    else:
        chosen = touching or list(deck.ties)
    if not chosen:
        if glued:
            found = f"{glued[0].glued}: all contact pairs are glued, so that nothing wears"
            raise SceneError("contact", found, "name those that move: `contact` in the study")
        remedy = 'give pairs of surfaces, as [["BLADES", "DISKS"]]'
        raise SceneError("contact", f"{deck.path} has neither CONTACT PAIR nor TIE", remedy)
    # a name that the deck does not have is said before a friction coefficient that is missing for it
    named = [_surfaces(selections, pair, "contact") for pair in chosen]
    friction = _friction(chosen, selections.parameters, deck)
    parts = zip(named, friction, _sectors(selections, named, chosen, axis), strict=True)
    contacts = [replace(each, friction_coefficient=value, sector=sector) for each, value, sector in parts]
    ties = (_surfaces(selections, pair, "model") for pair in (*deck.ties, *glued))
    of_deck = given is None and bool(touching)
    return tuple(contacts), tuple(tie for tie in ties if not _released(tie, contacts, of_deck=of_deck))


def note_free_surfaces(deck: Deck, given: Sequence[tuple[str, str]] | None) -> Deck:
    """The deck with a note on each contact pair that is none of the study. given: contacts of the study."""
    chosen = _pairs(given or ())
    free = [pair for pair in deck.contact_pairs if chosen and not any(_same(pair, each) for each in chosen)]
    why = "is not in `contact` of the study: nothing joins these surfaces, unless they are there by other names."
    notes = (f"*CONTACT PAIR {pair.labels[-1]} {why}" for pair in free if not pair.glued)
    return replace(deck, notes=(*deck.notes, *notes))


def _released(tie: ContactSurfaces, contacts: Sequence[ContactSurfaces], *, of_deck: bool) -> bool:
    """Whether surfaces that the deck glues are those of a contact of the study, by whatever names, or of its default.

    of_deck: whether the deck has the contacts beside the tie. Raises SceneError where one of these, or one with other
    surfaces, has facets of both surfaces of the tie.
    """
    for each in contacts:
        for first, second in ((each.first, each.second), (each.second, each.first)):
            sides = (tie.first, first), (tie.second, second)
            common = min(_common_facets(one, other) for one, other in sides)
            if common and not of_deck and all(np.array_equal(one.nodes, other.nodes) for one, other in sides):
                return True
            if common:
                found = f"{tie.name} is glued, and {each.name} in contact has {common} of its facets"
                remedy = "remove one of them from the deck, or name in `contact` the surfaces that move, all of them"
                raise SceneError("contact", found, remedy)
    return False


def _common_facets(one: Surface, other: Surface) -> int:
    """How many facets are in both surfaces."""
    return len(set.intersection(*({*map(tuple, np.sort(each.facets, axis=1).tolist())} for each in (one, other))))


def _same(one: SurfacePair, other: SurfacePair) -> bool:
    return {one.dependent, one.independent} == {other.dependent, other.independent}


def _pairs(given: Sequence[tuple[str, str]]) -> list[SurfacePair]:
    return [SurfacePair(capital(one), capital(other)) for one, other in given]


def _surfaces(selections: Selections, pair: SurfacePair, key: str) -> ContactSurfaces:
    parameters, length = selections.parameters, selections.units.length
    first, second = (selections.surface(name, key) for name in (pair.dependent, pair.independent))
    tolerance, clearance = parameters.tolerance, pair.clearance
    if tolerance is None and pair.tolerance is not None:
        tolerance = pair.tolerance * length
    if pair.adjusted and clearance is None and parameters.gaps:
        raise SceneError("gaps", f"{pair.adjusted} onto the other surface", "leave out gaps, or else ADJUST")
    if pair.fitted and not parameters.gaps:
        raise SceneError("gaps", f"{pair.fitted}, and the study lets the surfaces touch", "give gaps = true")
    clearance = None if clearance is None else clearance * length
    return ContactSurfaces(first, second, tolerance, None, with_gaps=parameters.gaps, clearance=clearance)


def _check_labels(keys: Mapping[str, str], chosen: Sequence[SurfacePair]) -> None:
    """Raises SceneError where a name is of no contact. keys: of the study, by name."""
    for name, key in keys.items():
        if not any(name in pair.labels for pair in chosen):
            known = ", ".join(pair.labels[-1] for pair in chosen)
            raise SceneError(key, f'no contact has the name "{name}"', f"give one of {known}")


def _sectors(
    selections: Selections, surfaces: list[ContactSurfaces], chosen: list[SurfacePair], axis: CyclicAxis | None
) -> list[int]:
    """Sector of the second surface of each contact: the neighbour, of both, to which the first one is nearer."""
    given, found = selections.parameters.next_sector, []
    names = () if isinstance(given, bool) else tuple(capital(name) for name in given)
    _check_labels(dict.fromkeys(names, "next_sector"), chosen)
    for each, pair in zip(surfaces, chosen, strict=True):
        found.append(0)
        if axis is not None and (given is True or any(name in pair.labels for name in names)):
            first, second = (selections.mesh.coordinates[side.nodes].mean(axis=0) for side in (each.first, each.second))
            ahead, back = (float(np.linalg.norm(axis.turned(second[None], k)[0] - first)) for k in (1, -1))
            found[-1] = 1 if ahead <= back else -1
    return found


def _friction(chosen: list[SurfacePair], parameters: Parameters, deck: Deck) -> list[float | None]:
    """Friction coefficient of each contact; None of all where the study has one number."""
    given = parameters.friction_coefficient
    if isinstance(given, float | int):
        return [None] * len(chosen)
    named = {capital(name): value for name, value in (given or {}).items()}
    keys = {name: f"friction_coefficient.{name}" for name in named}
    _check_labels(keys, chosen)
    for name in named:
        if named[name] < 0.0:
            raise SceneError(keys[name], f"{named[name]}", "give 0 or more")
    found: list[float | None] = []
    for pair in chosen:
        own = [named[label] for label in pair.labels if label in named]
        found.append(own[-1] if own else pair.friction_coefficient)
        if found[-1] is None:
            what = pair.problem or f"missing for {pair.labels[-1]} in {deck.path}"
            raise SceneError("friction_coefficient", what, "give one coefficient, in the study or there with *FRICTION")
    return found
