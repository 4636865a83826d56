"""What the scenes of bladed disks have in common: parameters of a sector, its bodies in blocks, its reduction."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import pi
from typing import ClassVar

import numpy as np
from pydantic import Field

from solver.model import FloatArray, IntArray, ReducedModel
from studies.finite_element.cut_faces import CutFaces, CyclicAxis
from studies.finite_element.pairing import ContactPairs, ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene, prepare_model
from studies.finite_element.solid_mesh import ElementGroup, Material, Rotation, SolidMesh
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, Retainer, mean_motion
from studies.finite_element.surfaces import describe_mesh
from studies.scene import N_MODES, Density, Pascal, Rpm, Scene, SurfaceMesh, lowest
from studies.scene_error import SceneError
from studies.sectors import OfRing

_SAME_NODE = 1e-9  # points closer than this, in m, are one node
AXIS, ORIGIN = np.array([0.0, 0.0, 1.0]), np.zeros(3)


class SectorParameters(OfRing, Scene):
    """Parameters that every sector has. SI units, except rotation speed and angles.

    Keys that end in `_radius` ascend as their defaults do.
    """

    OFFERS: ClassVar = ("mesh",)

    rotation_speed: Rpm = Field(3000.0, ge=0, description="speed of rotation")
    nodal_diameter: int = Field(0, ge=0, description="nodal diameter of the travelling wave that excites the blades")
    loss_factor: float = Field(1e-3, ge=0, description="loss factor of the material, exact at the first frequency")
    stress_stiffening: bool = Field(True, description="stress stiffening and spin softening by the rotation")
    stuck_modes: int = Field(20, ge=1, le=100, description="modes of the glued sector kept in the reduction")

    n_sectors: int = Field(60, ge=4, le=200, description="number of blades")
    young_modulus: Pascal = Field(114e9, gt=0, description="Young's modulus")
    poisson_ratio: float = Field(0.32, ge=0, lt=0.5, description="Poisson's ratio")
    density: Density = Field(4430.0, gt=0, description="density")

    @property
    def half_pitch(self) -> float:
        """Half the angle of a sector, rad."""
        return pi / self.n_sectors

    @property
    def material(self) -> Material:
        """That of disk and blades."""
        return Material(self.young_modulus, self.poisson_ratio, self.density)

    def define_sector(self) -> tuple[FeModel, JointDefinition]:
        """The sector as a finite-element model, and what is done with it.

        Raises SceneError where the parameters do not go together.
        """
        raise NotImplementedError

    def impossible(self) -> Iterator[tuple[bool, str, str]]:
        """Whether parameters that are fine one by one do not go together, which one, and what would be right."""
        fields = type(self).model_fields
        radii = sorted((name for name in fields if name.endswith("_radius")), key=lambda name: fields[name].default)
        for inner, outer in pairwise(radii):
            below = getattr(self, inner)
            yield below >= getattr(self, outer), outer, f"make it larger than {inner} = {below}"

    def check(self) -> None:
        """Raises SceneError where parameters do not go together."""
        for wrong, key, remedy in self.impossible():
            if wrong:
                raise SceneError(key, str(getattr(self, key)), remedy)

    def sector_of(
        self,
        mesh: SolidMesh,
        contacts: tuple[ContactSurfaces, ...],
        clamped: IntArray,
        cut: tuple[IntArray, IntArray],
        tip: tuple[IntArray, FloatArray],
        retainer: Retainer | None = None,
        pairs: ContactPairs | None = None,
    ) -> tuple[FeModel, JointDefinition]:
        """The turning mesh, clamped at some nodes, with two cut faces, and what is done with it.

        tip: nodes (n,) and direction (3,) of the excitation and of the response.
        """
        held = np.zeros((mesh.n_nodes, 3), dtype=np.bool_)
        held[clamped] = True
        load, faces = mean_motion(*tip, mesh.n_nodes), CutFaces(CyclicAxis(self.n_sectors, ORIGIN, AXIS), *cut)
        rotation = Rotation((pi * self.rotation_speed / 30.0) ** 2, ORIGIN, AXIS) if self.rotation_speed else None
        joint = JointDefinition(contacts, held, load, {"tip": load}, faces, retainer, pairs=pairs)
        return FeModel(mesh, rotation, self.stress_stiffening), joint

    def build(self, n_harmonics: int) -> ReducedModel:
        """As `build_fe_scene`.

        Stress stiffening takes the stress of the glued sector: in the blade it follows from equilibrium alone, and how
        the contacts share the load matters only beside them.
        """
        ring = self.sectors is not None
        options = ReductionOptions(self.nodal_diameter, self.stuck_modes, self.loss_factor, all_sectors=ring)
        return build_fe_scene(*self.define_sector(), options, n_harmonics).model

    def describe_mesh(self) -> SurfaceMesh:
        """Outer faces of the sector."""
        return describe_mesh(self.define_sector()[0].mesh)

    def natural_frequencies(self, model: ReducedModel) -> dict[int, FloatArray]:
        """With all contacts glued, at all nodal diameters 0..N/2; of a compliant contact those of the model."""
        if self.contact_stiffness is not None:
            return super().natural_frequencies(model)
        prepared = prepare_model(*self.define_sector())
        return {k: lowest(prepared.frequencies(k, N_MODES)) for k in range(self.n_sectors // 2 + 1)}


def mesh_of_bodies(
    bodies: Sequence[tuple[Sequence[FloatArray], Sequence[str], Material]],
) -> tuple[SolidMesh, tuple[IntArray, ...]]:
    """Mesh of several bodies in hexahedra with incompatible modes, and node numbers (n_i, n_j, n_k) of all blocks.

    bodies: blocks, right-handed grids of points (n_i, n_j, n_k, 3), m, the name of each block's part, material. Points
    of one body that coincide become one node; those of several do not.
    """
    nodes: list[FloatArray] = []
    grids: list[IntArray] = []
    groups: list[ElementGroup] = []
    n_nodes = n_elements = 0
    for blocks, parts, material in bodies:
        points = np.concatenate([block.reshape(-1, 3) for block in blocks])
        places = np.round(points / _SAME_NODE).astype(np.int64)
        _, first, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
        node = np.argsort(np.argsort(first))[place.ravel()]  # numbered as they first appear
        ends = np.cumsum([0] + [block[..., 0].size for block in blocks])
        for block, part, (start, end) in zip(blocks, parts, pairwise(ends), strict=True):
            grids.append(n_nodes + node[start:end].reshape(block.shape[:3]).astype(np.int64))
            ahead = [(i, j, k) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
            n_i, n_j, n_k = (size - 1 for size in grids[-1].shape)
            corners = [grids[-1][i : i + n_i, j : j + n_j, k : k + n_k] for i, j, k in ahead]
            cells = np.stack(corners, axis=-1).reshape(-1, 8)
            groups.append(ElementGroup("C3D8I", cells, n_elements + np.arange(len(cells)) + 1, material, part))
            n_elements += len(cells)
        nodes.append(points[np.sort(first)])
        n_nodes += len(first)
    return SolidMesh(np.concatenate(nodes), np.arange(n_nodes) + 1, tuple(groups)), tuple(grids)


def graded(stations: Sequence[float], divisions: Sequence[int]) -> FloatArray:
    """Values through all stations, with so many equal divisions from each station to the next."""
    spans = zip(pairwise(stations), divisions, strict=True)
    parts = [np.linspace(start, end, n, endpoint=False) for (start, end), n in spans]
    return np.append(np.concatenate(parts), stations[-1])


def block_of(
    radii: FloatArray, angles: FloatArray, axial: FloatArray, inclined: FloatArray | float = 0.0
) -> FloatArray:
    """Points (n_radial, n_tangential, n_axial, 3) of a block.

    radii, angles (n_radial, n_tangential), or what broadcasts to it: m, and rad about the axis in the middle of the
    width. axial (n_axial,) or (n_radial, n_axial): m. inclined (n_radial,): angle of the lines along the width to the
    axis, degrees.
    """
    radii, angles = np.broadcast_arrays(radii, angles)
    along = np.broadcast_to(axial, (len(radii), np.shape(axial)[-1]))[:, None]
    slope = np.tan(np.radians(np.broadcast_to(inclined, len(radii))))[:, None] / radii
    around = angles[:, :, None] + slope[:, :, None] * along
    radius = radii[:, :, None]
    return np.stack([radius * np.cos(around), radius * np.sin(around), np.broadcast_to(along, around.shape)], axis=-1)
