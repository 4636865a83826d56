"""Small bladed sectors: one in any kind of element, meshes matching or not, and one with shrouds; two cubes."""

from functools import partial

import numpy as np

from studies.finite_element.cut_faces import CyclicAxis, match_cut_faces
from studies.finite_element.elements import ELEMENT_KINDS
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.solid_mesh import Rotation, SolidMesh
from studies.finite_element.structure import FeModel, JointDefinition, mean_motion
from studies.finite_element.surfaces import surface_of_faces
from studies.scenes import shrouded_sector
from tests.studies.fe_models.solid_meshes import STEEL, block, joined

N_SECTORS = 12
OMEGA_SQUARED = 2.5e5
Z = np.array([0.0, 0.0, 1.0])
HALF = np.tan(np.pi / N_SECTORS)


def wedge_shape(points, begin=0.2):
    """A wedge from x = begin, 0.1 m long: in place of blades, a ring whose joint runs through the cut faces."""
    x = begin + 0.1 * points[:, 0]
    return np.stack([x, x * HALF * (2.0 * points[:, 1] - 1.0), 0.04 * points[:, 2]], axis=1)


def blade_shape(points):
    """A twisted blade on the middle of that face."""
    x, y, z = points.T
    angle = 0.6 * x
    across, along = 0.036 * (y - 0.5), 0.03 * (z - 0.5)
    turned = across * np.cos(angle) - along * np.sin(angle), along * np.cos(angle) + across * np.sin(angle)
    return np.stack([0.2 + 0.1 * x, turned[0], 0.02 + turned[1]], axis=1)


def faces_where(mesh: SolidMesh, inside):
    """Element numbers and faces (from 1) of the faces all of whose nodes are inside (n_nodes,)."""
    elements, faces = [], []
    for group in mesh.groups:
        for number, face in enumerate(ELEMENT_KINDS[group.kind].faces, start=1):
            chosen = inside[group.nodes[:, list(face)]].all(axis=1)
            elements += group.numbers[chosen].tolist()
            faces += [number] * int(chosen.sum())
    return np.array(elements, dtype=np.int64), np.array(faces, dtype=np.int64)


def surface_where(mesh: SolidMesh, name, inside):
    """The surface of these faces."""
    return surface_of_faces(mesh, name, *faces_where(mesh, inside))


def cubes_on_each_other(lower, upper, lower_divisions, upper_divisions, lift=0.0, material=STEEL):
    """Two unit cubes that touch at z = 1, the upper one lifted; surfaces LOW and UP."""
    first, a = block(lower, lower_divisions, material=material)
    second, b = block(upper, upper_divisions, lambda points: points + [0.0, 0.0, 1.0 + lift], material)
    mesh = joined(first, second)
    height = np.append(a[:, 2], 2.0 + b[:, 2])
    return mesh, surface_where(mesh, "LOW", height == 1.0), surface_where(mesh, "UP", height == 2.0)


class Sector:
    """Mesh, sets and faces of the sector; `joint` gives what is done with it."""

    def __init__(self, disk_kind, blade_kind, disk=(2, 4, 2), blade=(3, 2, 2), blade_shape=blade_shape):
        """Cut faces are where the angle is that of a sector, on the blade as well."""
        first, _ = block(disk_kind, disk, partial(wedge_shape, begin=0.1), part="disk", straight=True)
        second, _ = block(blade_kind, blade, blade_shape, part="blade", straight=True)
        self.mesh = joined(first, second)
        x, y, _ = self.mesh.coordinates.T
        of_blade = np.arange(self.mesh.n_nodes) >= first.n_nodes
        self.left, self.right = (np.flatnonzero(np.abs(y + sign * HALF * x) < 1e-9) for sign in (1.0, -1.0))
        self.bore = np.flatnonzero(~of_blade & (np.abs(x - 0.1) < 1e-9))
        self.tip = np.flatnonzero(of_blade & (np.abs(x - 0.3) < 1e-9))
        self.disk_faces = faces_where(self.mesh, ~of_blade & (np.abs(x - 0.2) < 1e-9))
        self.blade_faces = faces_where(self.mesh, of_blade & (np.abs(x - 0.2) < 1e-9))

    @property
    def surfaces(self):
        blade = surface_of_faces(self.mesh, "BLADES", *self.blade_faces)
        return blade, surface_of_faces(self.mesh, "DISKS", *self.disk_faces)

    def joint(self, **changes):
        held = np.zeros((self.mesh.n_nodes, 3), dtype=bool)
        held[self.bore] = True
        axis = CyclicAxis(N_SECTORS, np.zeros(3), Z)
        tip = mean_motion(self.tip, np.array([0.0, 2.0, 0.0]), self.mesh.n_nodes)
        given = {
            "contacts": (ContactSurfaces(*self.surfaces, tolerance=1e-6),),
            "held": held,
            "load": tip,
            "responses": {"tip": tip},
            "cut": match_cut_faces(self.mesh, axis, self.left, self.right),
        }
        return JointDefinition(**(given | changes))

    def model(self, prestress=True):
        rotation = Rotation(OMEGA_SQUARED, np.zeros(3), Z)
        return FeModel(self.mesh, rotation if prestress else None)


def stubby(n_sectors: int) -> shrouded_sector.Parameters:
    """A sector with shrouds, at rest, with few elements."""
    size = {"blade_thickness": 0.01, "rim_radius": 0.15, "blade_length": 0.08}
    return shrouded_sector.Parameters(n_sectors=n_sectors, shroud_angle=20, rotation_speed=0.0, **size)
