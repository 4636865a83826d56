"""One sector of a bladed disk with a dovetail root, from finite elements.

The blade is excited and observed at mid-chord of its tip, perpendicular to the chord, positive to the intrados.

Mesh 1 is for first trials. Its higher frequencies lie up to 7 % above those of mesh 2, the default; those of mesh 3
within 2 %, for five times the computing time.

Displacements of the reduced model: first the relative displacements u_blade - u_disk, then modal coordinates of the
glued sector. Each pair has normal (positive when the pair closes), first tangent (axial, to the trailing edge) and
second tangent (up the flank, outwards). Pairs are numbered intrados first (the flank at y > 0, which leads as the disk
turns about +z), then extrados; from the leading to the trailing edge; from the inner to the outer end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.model import FloatArray, IntArray
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.joint_model import JointDefinition, Retainer, SetMotion
from studies.finite_element.pairing import ContactPairs, ContactSurfaces, build_contact_pairs
from studies.finite_element.solid_mesh import check_elements
from studies.finite_element.surfaces import surface_of_nodes
from studies.scene_error import SceneError
from studies.scenes.dovetail_mesh import blade_blocks, chord_directions, disk_blocks
from studies.scenes.dovetail_parameters import Parameters, check_parameters
from studies.scenes.sector import AXIS, Sector, functions_of, mesh_of_bodies

__all__ = ["Parameters", "build"]


def define_sector(parameters: Parameters) -> Sector:
    """The sector as a finite-element model, and what is done with it.

    The retainer is a spring on the mean axial relative displacement. A prismatic slot holds the root along its axis by
    friction alone. Once every pair slips at some time of the period, vibration carries the root along. Under a
    travelling wave it walks, and without a retainer there is no periodic state (measured: at the resonance of nodal
    diameter 3 and 0.5 N of excitation a force of about 100 N holds it). At nodal diameter 0 nothing but unequal wear
    drives it one way, by 1e-7 of the friction: its mean position is not determined (`solver.wear.jump`).

    Raises SceneError where the parameters do not go together.
    """
    check_parameters(parameters)
    p, m = parameters, parameters.mesh
    bodies = [(disk_blocks(p), ("disk",) * 3, p.material), (blade_blocks(p), ("blade",) * 3, p.material)]
    solid, (web, post_right, post_left, blade, *_) = mesh_of_bodies(bodies)
    try:
        check_elements(solid)
    except SceneError as error:
        raise SceneError("mesh", str(m), f"change the geometry: {error.value}") from error
    # Coincident nodes, from the leading to the trailing edge, then from the inner to the outer end. Above the slot
    # bottom and above the root bottom there are m rows of elements before the flank begins.
    flank = slice(m, 2 * m + 1)
    disk_flanks = [post_right[flank, 0].T.ravel(), post_left[flank, -1].T.ravel()]
    blade_flanks = [blade[flank, -1].T.ravel(), blade[flank, 0].T.ravel()]
    contacts = tuple(
        ContactSurfaces(
            surface_of_nodes(solid, f"{name} of the blade", moving),
            surface_of_nodes(solid, f"{name} of the disk", opposite),
            label=name,
        )
        for name, moving, opposite in zip(("intrados", "extrados"), blade_flanks, disk_flanks, strict=True)
    )
    held = np.zeros((solid.n_nodes, 3), dtype=np.bool_)
    held[web[0].ravel()] = True
    # The number of axial stations is even: mid-chord lies halfway between the two middle ones.
    n_across, n_axial = blade[-1].shape
    middle = blade[-1][n_across // 2, n_axial // 2 - 1 : n_axial // 2 + 1]
    tip = SetMotion(middle, chord_directions(p.tip_stagger)[1])
    left, right = (
        np.concatenate([web[:, side], post[1:, side]]).ravel() for side, post in ((0, post_left), (-1, post_right))
    )
    pairs = build_contact_pairs(solid.coordinates, solid.numbers, contacts, AXIS)
    joint = JointDefinition(
        contacts=contacts,
        held=held,
        load=tip,
        responses={"tip": tip},
        cut=CutFaces(p.axis, left, right),
        retainer=Retainer(p.retainer, AXIS),
        pairs=_arranged(pairs, np.concatenate(blade_flanks), solid.n_nodes),
    )
    return p.model_of(solid), joint


def _arranged(pairs: ContactPairs, flanks: IntArray, n_nodes: int) -> ContactPairs:
    """Pairs in the order of the flanks' nodes, second tangents outwards: frames of both flanks mirror each other."""
    place = np.empty(n_nodes, dtype=np.int64)
    place[pairs.moving] = np.arange(pairs.n_contact)
    ordered = pairs.chosen(place[flanks])
    frames: FloatArray = ordered.frames.copy()
    frames[:, 2] *= np.sign(frames[:, 2, :1])
    return replace(ordered, frames=frames)


build, describe_mesh, natural_frequencies = functions_of(define_sector)
