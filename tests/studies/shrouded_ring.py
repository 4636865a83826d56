"""A small shrouded sector, and all sectors of a ring with all their contacts, without cyclic symmetry."""

from dataclasses import replace

import numpy as np

from studies.finite_element import surfaces
from studies.finite_element.solid_mesh import ElementGroup, SolidMesh
from studies.finite_element.structure import FeModel, JointDefinition
from studies.scenes import shrouded_sector


def stubby(n_sectors: int) -> shrouded_sector.Parameters:
    """A sector at rest with few elements."""
    size = {"blade_thickness": 0.01, "rim_radius": 0.15, "blade_length": 0.08}
    return shrouded_sector.Parameters(n_sectors=n_sectors, shroud_angle=20, rotation_speed=0.0, **size)


def whole_ring(model: FeModel, joint: JointDefinition) -> tuple[FeModel, JointDefinition]:
    """The ring of a sector: nodes of the cut faces are common, contacts join neighbours; responses tip0, tip1, ..."""
    mesh, axis = model.mesh, joint.cut.axis
    n, size = axis.n_sectors, mesh.n_nodes
    node = np.arange(n * size).reshape(n, size)
    for j in range(n):
        node[j][joint.cut.right] = node[(j + 1) % n][joint.cut.left]
    used, own = np.unique(node, return_inverse=True)
    own = own.reshape(n, size)
    coordinates = np.concatenate([axis.turned(mesh.coordinates, j) for j in range(n)])[used]
    groups = tuple(
        ElementGroup(each.kind, own[j][each.nodes], each.numbers + 10000 * j, each.material, f"{each.part}{j}")
        for j in range(n)
        for each in mesh.groups
    )
    ring = SolidMesh(coordinates, np.arange(len(used)) + 1, groups)
    held = np.zeros((len(used), 3), dtype=bool)
    for j in range(n):
        held[own[j]] |= joint.held
    contacts = []
    for each in joint.contacts:
        for j in range(n):
            first = surfaces.surface_of_nodes(ring, f"first {j}", own[j][each.first.nodes])
            second = surfaces.surface_of_nodes(ring, f"second {j}", own[(j + each.sector) % n][each.second.nodes])
            contacts.append(replace(each, first=first, second=second, sector=0, label=f"{each.name}{j}"))
    tips = np.zeros((n, len(used), 3))
    for j in range(n):
        tips[j, own[j]] = joint.load.reshape(-1, 3) @ axis.pitch(j).T
    named = {f"tip{j}": tip.ravel() for j, tip in enumerate(tips)}
    return FeModel(ring), JointDefinition(tuple(contacts), held, named["tip0"], named)
