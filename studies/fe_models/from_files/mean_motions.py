"""Reference nodes that follow the mean motion of a surface (*DISTRIBUTING), as linear constraints.

The surface has a mass by its area: its mean motion is that of a rigid body with the same linear and angular momentum
about the centre (Abaqus Theory Guide, distributing coupling elements). A force on the reference node, which depends on
the surface, is then shared by area, and its moment about the centre by `F_i = w_i T^-1 M x r_i`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import Deck, Equation, MeanMotion
from studies.fe_models.files import IntArray
from studies.fe_models.from_files.selections import Selections
from studies.finite_element.surfaces import faces_of_elements, integrate_shapes
from studies.scene_error import SceneError


def equations_of_mean_motions(selections: Selections) -> tuple[Equation, ...]:
    """An equation, in the units of the file, for each dof of a reference node. Raises SceneError.

    Of its rotations those to which something is joined.
    """
    return tuple(each for motion in selections.deck.mean_motions for each in _equations(selections, motion))


def _equations(selections: Selections, motion: MeanMotion) -> Iterator[Equation]:
    deck, mesh, surface = selections.deck, selections.mesh, selections.deck.surfaces[motion.surface]
    faces = faces_of_elements(mesh, motion.surface, surface.elements, surface.faces)
    weights = integrate_shapes(mesh.coordinates, faces)[0]
    nodes = np.unique([node for face in faces for node in face.nodes]).astype(np.int64)
    numbers = mesh.numbers[nodes]
    joined = _check(deck, motion, numbers)
    weights = weights[nodes] / weights.sum()
    places = deck.coordinates[deck.rows_of_nodes(np.append(numbers, motion.reference))]
    centre = weights @ places[:-1]
    arms, arm = places[:-1] - centre, places[-1] - centre
    cross = np.cross(arms[:, None], np.eye(3)).swapaxes(1, 2)  # arm x u = cross @ u
    inertia = np.einsum("i,iab,icb->ac", weights, cross, cross)
    # rows (3, n, 3) of the mean rotation and of the displacement of the reference node
    turn = np.einsum("ab,i,ibc->aic", np.linalg.inv(inertia), weights, cross)
    moved = weights[:, None] * np.eye(3)[:, None] + np.einsum("ba,bic->aic", np.cross(np.eye(3), arm), turn)
    of_dofs = np.tile([1, 2, 3], len(numbers))
    for dof, row in enumerate((*moved, *turn), 1):
        if dof <= 3 or (joined and dof in motion.turns):
            terms = np.append(motion.reference, np.repeat(numbers, 3)), np.append(dof, of_dofs)
            yield Equation(motion.place, *terms, np.append(1.0, -row.ravel()))


def _check(deck: Deck, motion: MeanMotion, numbers: IntArray) -> bool:
    """Whether something is joined to the rotations of the reference node. numbers: of the nodes of the surface.

    Raises SceneError where dofs of the nodes are along other axes, or the rotations are held or those of another node.
    """
    reference = motion.reference
    turned = np.intersect1d(np.append(numbers, reference), [node for each in deck.transforms for node in each.nodes])
    joined = [each for each in deck.rigid_motions if each.reference == reference and each.turns]
    held = any(reference in each.nodes and each.last_dof > 3 for each in deck.boundaries)
    for wrong, found, remedy in (
        (not numbers.size, f"{motion.surface} has no face", "give faces that no step takes away"),
        (reference in numbers, f"the reference node {reference} is on the surface", "give a node of its own"),
        (turned.size, f"node {min(turned, default=0)} has *TRANSFORM", "leave *TRANSFORM out there"),
        (held, f"the rotations of node {reference} are held", "hold nodes of the surface, or leave it out"),
        (any(each.rotation for each in joined), f"node {reference} has a ROT NODE", "leave ROT NODE out"),
    ):
        if wrong:
            raise SceneError("model", f"{motion.place}: {found}", remedy)
    return bool(joined)
