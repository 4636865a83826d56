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

from solver.model import FloatArray
from studies.finite_element import surfaces
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.joint_model import JointDefinition, Retainer, SetMotion
from studies.finite_element.pairing import ContactPairs, ContactSurfaces, build_contact_pairs
from studies.finite_element.solid_mesh import ElementGroup, SolidMesh, check_elements
from studies.scene_error import SceneError
from studies.scenes.dovetail_mesh import DovetailMesh, build_dovetail_mesh, chord_directions
from studies.scenes.dovetail_parameters import Parameters, check_parameters
from studies.scenes.sector import AXIS, Sector, functions_of

__all__ = ["Parameters", "build"]

SURFACES = ("intrados", "extrados")


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
    mesh = build_dovetail_mesh(parameters)
    solid = build_solid_mesh(parameters, mesh)
    try:
        check_elements(solid)
    except SceneError as error:
        raise SceneError("mesh", str(parameters.mesh), f"change the geometry: {error.value}") from error
    contacts = _contacts(solid, mesh)
    held = np.zeros((solid.n_nodes, 3), dtype=np.bool_)
    held[mesh.bore_nodes] = True
    # The number of axial stations is even: mid-chord lies halfway between the two middle ones.
    n_across, n_axial = mesh.tip_nodes.shape
    middle = mesh.tip_nodes[n_across // 2, n_axial // 2 - 1 : n_axial // 2 + 1]
    tip = SetMotion(middle, chord_directions(parameters.tip_stagger)[1])
    joint = JointDefinition(
        contacts=contacts,
        held=held,
        load=tip,
        responses={"tip": tip},
        cut=CutFaces(parameters.axis, mesh.left_nodes, mesh.right_nodes),
        retainer=Retainer(parameters.retainer, AXIS),
        pairs=_arranged(build_contact_pairs(solid.coordinates, solid.numbers, contacts, AXIS), mesh),
    )
    return parameters.model_of(solid), joint


def build_solid_mesh(parameters: Parameters, mesh: DovetailMesh) -> SolidMesh:
    """Disk and blade in hexahedra with incompatible modes."""
    elements = mesh.mesh.elements
    groups = tuple(
        ElementGroup("C3D8I", elements[own], np.flatnonzero(own) + 1, parameters.material, part)
        for part, own in (("disk", ~mesh.blade_elements), ("blade", mesh.blade_elements))
    )
    return SolidMesh(mesh.mesh.nodes, np.arange(len(mesh.mesh.nodes)) + 1, groups)


def _contacts(solid: SolidMesh, mesh: DovetailMesh) -> tuple[ContactSurfaces, ...]:
    """Both flanks, intrados first; the blade moves."""
    return tuple(
        ContactSurfaces(
            surfaces.surface_of_nodes(solid, f"{name} of the blade", blade.ravel()),
            surfaces.surface_of_nodes(solid, f"{name} of the disk", disk.ravel()),
            label=name,
        )
        for name, blade, disk in zip(SURFACES, mesh.blade_flanks, mesh.disk_flanks, strict=True)
    )


def _arranged(pairs: ContactPairs, mesh: DovetailMesh) -> ContactPairs:
    """Pairs in the order of the flanks' grids, second tangents outwards: frames of both flanks mirror each other."""
    place = np.empty(len(mesh.mesh.nodes), dtype=np.int64)
    place[pairs.moving] = np.arange(pairs.n_contact)
    ordered = pairs.chosen(place[mesh.blade_flanks.ravel()])
    frames: FloatArray = ordered.frames.copy()
    frames[:, 2] *= np.sign(frames[:, 2, :1])
    return replace(ordered, frames=frames)


build, describe_mesh, natural_frequencies = functions_of(define_sector)
