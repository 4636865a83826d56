"""Nodes, elements and surfaces of a mesh by the names that its file gives them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from solver.model import IntArray
from studies.fe_models.deck.mesh import Deck
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
