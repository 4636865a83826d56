"""What the scenes of bladed disks have in common: parameters of a sector, its bodies in blocks, its functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi
from typing import TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from solver.model import FloatArray, IntArray, ReducedModel
from studies.contact_compliance import ContactStiffness
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.element_matrices import Material
from studies.finite_element.joint_model import JointDefinition, MeshModel, ReductionOptions
from studies.finite_element.reduced_joint import build_fe_scene, natural_frequencies, prepare_model
from studies.finite_element.solid_mesh import ElementGroup, Rotation, SolidMesh
from studies.finite_element.surfaces import describe_mesh
from studies.scene_answers import NaturalFrequencies, SurfaceMesh
from studies.scene_error import SceneError
from studies.scenes.structured_mesh import join_blocks

AXIS, ORIGIN = np.array([0.0, 0.0, 1.0]), np.zeros(3)


class SectorParameters(BaseModel):
    """Parameters that every sector has. SI units, except rotation speed and angles."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient, -")
    contact_stiffness: ContactStiffness = None
    rotation_speed: float = Field(3000.0, ge=0, description="speed of rotation, rpm")
    nodal_diameter: int = Field(0, ge=0, description="nodal diameter of the travelling wave that excites the blades, -")
    loss_factor: float = Field(1e-3, ge=0, description="loss factor of the material, exact at the first frequency, -")
    stress_stiffening: bool = Field(True, description="stress stiffening and spin softening by the rotation, -")
    stuck_modes: int = Field(20, ge=1, le=100, description="modes of the glued sector kept in the reduction, -")

    n_sectors: int = Field(60, ge=4, le=200, description="number of blades, -")
    young_modulus: float = Field(114e9, gt=0, description="Young's modulus, Pa")
    poisson_ratio: float = Field(0.32, ge=0, lt=0.5, description="Poisson's ratio, -")
    density: float = Field(4430.0, gt=0, description="density, kg/m3")

    @property
    def half_pitch(self) -> float:
        """Half the angle of a sector, rad."""
        return pi / self.n_sectors

    @property
    def angular_speed(self) -> float:
        """Speed of rotation, rad/s."""
        return pi * self.rotation_speed / 30.0

    @property
    def axis(self) -> CyclicAxis:
        """The axis of the disk, z."""
        return CyclicAxis(self.n_sectors, ORIGIN, AXIS)

    @property
    def material(self) -> Material:
        """That of disk and blades."""
        return Material(self.young_modulus, self.poisson_ratio, self.density)

    def model_of(self, mesh: SolidMesh) -> MeshModel:
        """The turning mesh."""
        rotation = Rotation(self.angular_speed**2, ORIGIN, AXIS) if self.rotation_speed else None
        return MeshModel(mesh, rotation, self.stress_stiffening)

    def check_wave(self) -> None:
        """Raises SceneError where the ring has no such nodal diameter."""
        if self.nodal_diameter > self.n_sectors // 2:
            remedy = f"use at most n_sectors // 2 = {self.n_sectors // 2}; more is the same wave turning the other way"
            raise SceneError("nodal_diameter", str(self.nodal_diameter), remedy)


Sector = tuple[MeshModel, JointDefinition]
P = TypeVar("P", bound=SectorParameters)


def reduce_sector(sector: Sector, parameters: SectorParameters, n_harmonics: int) -> ReducedModel:
    """Reduced model of a sector for the harmonics 0..n_harmonics of a travelling wave of `nodal_diameter`.

    The centrifugal load enters the static harmonic only, the unit force of 1 N nodal diameter d only. Stress stiffening
    takes the stress of the linear elastic sector with its contacts glued at the given speed, the usual reference state
    of a modal analysis with prestress: in the blade it follows from equilibrium alone, and how the contacts share the
    load matters only beside them. With spin softening, `-Omega^2` times the mass that moves across the axis, it is part
    of every stiffness, the static one included. Coriolis forces are left out. The damping is `loss_factor / omega_1`
    times the elastic stiffness, omega_1 the first frequency of the glued sector, rad/s, at the nodal diameter of the
    excitation.
    """
    options = ReductionOptions(parameters.nodal_diameter, parameters.stuck_modes, parameters.loss_factor)
    return build_fe_scene(*sector, options, n_harmonics).model


def functions_of(
    define_sector: Callable[[P], Sector],
) -> tuple[Callable[[P, int], ReducedModel], Callable[[P], SurfaceMesh], Callable[[P], NaturalFrequencies]]:
    """Functions `build`, `describe_mesh` and `natural_frequencies` of a scene, see `studies.scenes`.

    build: as `reduce_sector`. describe_mesh: outer faces of the sector. natural_frequencies: with all contacts glued,
    at all nodal diameters 0..N/2. All raise SceneError where the parameters do not go together.
    """

    def build(parameters: P, n_harmonics: int) -> ReducedModel:
        return reduce_sector(define_sector(parameters), parameters, n_harmonics)

    def mesh(parameters: P) -> SurfaceMesh:
        return describe_mesh(define_sector(parameters)[0].mesh)

    def frequencies(parameters: P) -> NaturalFrequencies:
        return natural_frequencies(prepare_model(*define_sector(parameters)), parameters.n_sectors)

    return build, mesh, frequencies


def mesh_of_bodies(bodies: Sequence[tuple[Sequence[FloatArray], Sequence[str], Material]]) -> tuple[
    SolidMesh, tuple[IntArray, ...]
]:  # fmt: skip
    """Mesh of several bodies in hexahedra with incompatible modes, and node numbers of all blocks.

    bodies: blocks of points (radial, tangential, axial, 3), the name of each block's part, material. Blocks of one body
    are joined where their points coincide; bodies are not.
    """
    nodes: list[FloatArray] = []
    grids: list[IntArray] = []
    groups: list[ElementGroup] = []
    n_nodes = n_elements = 0
    for blocks, parts, material in bodies:
        mesh, own = join_blocks(blocks)
        first = 0
        for part, grid in zip(parts, own, strict=True):
            last = first + int(np.prod([size - 1 for size in grid.shape]))
            numbers = np.arange(n_elements + first, n_elements + last) + 1
            groups.append(ElementGroup("C3D8I", mesh.elements[first:last] + n_nodes, numbers, material, part))
            first = last
        grids += [grid + n_nodes for grid in own]
        nodes.append(mesh.nodes)
        n_nodes, n_elements = n_nodes + len(mesh.nodes), n_elements + len(mesh.elements)
    return SolidMesh(np.concatenate(nodes), np.arange(n_nodes) + 1, tuple(groups)), tuple(grids)


def block_of(
    radii: FloatArray, angles: FloatArray, axial: FloatArray, inclined: FloatArray | float = 0.0
) -> FloatArray:
    """Points (n_radial, n_tangential, n_axial, 3) of a block.

    radii, angles (n_radial, n_tangential), or what broadcasts to it: m, and rad about the axis in the middle of the
    width. axial (n_axial,): m. inclined (n_radial,): angle of the lines along the width to the axis, degrees.
    """
    radii, angles = np.broadcast_arrays(radii, angles)
    slope = np.tan(np.radians(np.broadcast_to(inclined, len(radii))))[:, None] / radii
    around = angles[:, :, None] + slope[:, :, None] * axial
    radius = radii[:, :, None]
    return np.stack([radius * np.cos(around), radius * np.sin(around), np.broadcast_to(axial, around.shape)], axis=-1)
