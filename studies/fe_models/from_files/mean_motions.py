"""Reference nodes that follow the mean motion of a surface (*DISTRIBUTING), as linear constraints.

The surface has a mass by its area: its mean motion is that of a rigid body with the same linear and angular momentum
about the centre (Abaqus Theory Guide, distributing coupling elements). A force on the reference node, which depends on
the surface, is then shared by area, and its moment about the centre by `F_i = w_i T^-1 M x r_i`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import Deck, Equation, MeanMotion
from studies.fe_models.from_files.selections import Selections
from studies.finite_element.surfaces import faces_of_elements, integrate_shapes
from studies.scene_error import SceneError


def equations_of_mean_motions(selections: Selections) -> tuple[Equation, ...]:
    """An equation, in the units of the file, for each dof of a reference node. Raises SceneError.

    Of its rotations those to which something is joined.
    """
    return tuple(each for motion in selections.deck.mean_motions for each in _equations(selections, motion))


def _equations(selections: Selections, motion: MeanMotion) -> Iterator[Equation]:
    deck, mesh = selections.deck, selections.mesh
    surface = deck.surfaces[motion.surface]
    faces = faces_of_elements(mesh, motion.surface, surface.elements, surface.faces)
    if not faces:
        raise SceneError("model", f"{motion.place}: {motion.surface} has no face", "give faces that no step takes away")
    nodes = np.unique(np.concatenate([face.nodes for face in faces]))
    numbers = mesh.numbers[nodes]
    joined = _check(deck, motion, set(numbers.tolist()))
    weights = integrate_shapes(mesh.coordinates, faces)[0][nodes]
    weights /= weights.sum()
    places = deck.coordinates[deck.rows_of_nodes(np.append(numbers, motion.reference))]
    centre = weights @ places[:-1]
    arms, arm = places[:-1] - centre, places[-1] - centre
    cross = np.cross(arms[:, None], np.eye(3)).swapaxes(1, 2)  # arm x u = cross @ u
    inertia = np.einsum("i,iab,icb->ac", weights, cross, cross)
    # rows (3, n, 3) of the mean rotation and of the displacement of the reference node
    turn = np.einsum("ab,i,ibc->aic", np.linalg.inv(inertia), weights, cross)
    moved = weights[:, None] * np.eye(3)[:, None] + np.einsum("ba,bic->aic", np.cross(np.eye(3), arm), turn)
    rows = dict(zip((1, 2, 3, 4, 5, 6), (*moved, *turn), strict=True))
    for dof in (1, 2, 3, *(dof for dof in motion.turns if joined)):
        nodes = np.append(motion.reference, np.repeat(numbers, 3))
        dofs = np.append(dof, np.tile([1, 2, 3], len(numbers)))
        yield Equation(motion.place, nodes, dofs, np.append(1.0, -rows[dof].ravel()))


def _check(deck: Deck, motion: MeanMotion, surface: set[int]) -> bool:
    """Whether something is joined to the rotations of the reference node. surface: node numbers.

    Raises SceneError where dofs of the nodes are along other axes, or the rotations are held or those of another node.
    """

    def wrong(found: str, remedy: str) -> SceneError:
        return SceneError("model", f"{motion.place}: {found}", remedy)

    reference = motion.reference
    if reference in surface:
        raise wrong(f"the reference node {reference} is on the surface", "give a node of its own")
    for transform in deck.transforms:
        turned = surface.union([reference]).intersection(transform.nodes.tolist())
        if turned:
            raise wrong(f"node {min(turned)} has *TRANSFORM", "leave *TRANSFORM out there")
    held = any(reference in each.nodes and each.last_dof > 3 for each in deck.boundaries)
    following = [each for each in deck.rigid_motions if each.reference == reference and each.turns]
    if held or any(each.rotation for each in following):
        what = "are held" if held else "are those of a ROT NODE"
        raise wrong(
            f"the rotations of the reference node {reference} {what}", "hold nodes of the surface, or leave it out"
        )
    return bool(following)
