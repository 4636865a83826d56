"""One sector of a bladed disk whose tip shrouds touch, from finite elements.

Disk, blade and shroud are one body. Each shroud touches that of the next sector, on faces at `shroud_angle` to the
axis. An interference presses them together, as a pre-twist of the blades does; under rotation the blades untwist as
well. The blade is excited and observed at the middle of its shroud, perpendicular to the contact faces.

Displacements of the reduced model: first the relative displacements of the leading face of this sector and the trailing
face of the next one, `u - exp(2 pi i k / N) R u_that` at nodal diameter k, where R turns by one sector; then modal
coordinates of the glued sector. Each pair has normal (positive when the pair closes), first tangent (near the axis) and
second tangent. A mesh of density m has 4 m axial x (m + 1) pairs.
"""

from __future__ import annotations

from math import cos, pi, radians

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from solver.model import FloatArray, ReducedModel
from studies.contact_compliance import ContactStiffness
from studies.finite_element.elements.solid_mesh import ElementGroup, Material, Rotation, SolidMesh
from studies.finite_element.joint import surfaces
from studies.finite_element.joint.cut_faces import CutFaces, CyclicAxis
from studies.finite_element.joint.pairing import ContactSurfaces
from studies.finite_element.joint_model import JointDefinition, MeshModel, ReductionOptions, SetMotion
from studies.finite_element.reduced_joint import PreparedModel, build_fe_scene, prepare_model
from studies.finite_element.reduced_joint import natural_frequencies as frequencies_of_all_waves
from studies.scene_answers import KeepFrequencies, NaturalFrequencies, SurfaceMesh
from studies.scene_error import SceneError
from studies.scenes.structured_mesh import find_stations, graded, join_blocks

_AXIS, _ORIGIN = np.array([0.0, 0.0, 1.0]), np.zeros(3)


class Parameters(BaseModel):
    """One sector of a shrouded bladed disk. SI units, except rotation speed and angles."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    friction_coefficient: float = Field(0.3, ge=0, description="Coulomb friction coefficient of the shrouds, -")
    contact_stiffness: ContactStiffness = None
    rotation_speed: float = Field(3000.0, ge=0, description="speed of rotation, rpm")
    nodal_diameter: int = Field(0, ge=0, description="nodal diameter of the travelling wave that excites the blades, -")
    loss_factor: float = Field(1e-3, ge=0, description="loss factor of the material, exact at the first frequency, -")
    interference: float = Field(
        5e-4, ge=0, description="overlap of neighbouring shrouds before they are put together, m"
    )
    mesh: int = Field(1, ge=1, le=8, description="mesh density m: a shroud has 4 m axial x (m + 1) contact pairs, -")
    stress_stiffening: bool = Field(True, description="stress stiffening and spin softening by the rotation, -")
    stuck_modes: int = Field(20, ge=1, le=100, description="modes of the glued sector kept in the reduction, -")

    n_sectors: int = Field(60, ge=4, le=200, description="number of blades, -")
    young_modulus: float = Field(114e9, gt=0, description="Young's modulus, Pa")
    poisson_ratio: float = Field(0.32, ge=0, lt=0.5, description="Poisson's ratio, -")
    density: float = Field(4430.0, gt=0, description="density, kg/m3")
    bore_radius: float = Field(0.12, gt=0, description="radius of the clamped bore, m")
    rim_radius: float = Field(0.2, gt=0, description="outer radius of the disk, m")
    width: float = Field(0.03, gt=0, description="axial width of disk, blade and shroud, m")
    blade_length: float = Field(0.16, gt=0, description="length of the blade between disk and shroud, m")
    blade_thickness: float = Field(0.004, gt=0, description="thickness of the blade, m")
    root_angle: float = Field(10.0, ge=-60, le=60, description="angle of the blade to the axis at the disk, degrees")
    shroud_angle: float = Field(35.0, ge=-60, le=60, description="angle of blade and contact faces at the tip, degrees")
    shroud_thickness: float = Field(0.006, gt=0, description="radial thickness of the shroud, m")

    @property
    def tip_radius(self) -> float:
        """Inner radius of the shroud, m."""
        return self.rim_radius + self.blade_length


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model of the sector for the harmonics 0..n_harmonics of a travelling wave of `nodal_diameter`.

    Raises SceneError where the parameters do not go together.
    """
    options = ReductionOptions(parameters.nodal_diameter, parameters.stuck_modes, parameters.loss_factor)
    return build_fe_scene(*define_sector(parameters), options, n_harmonics).model


def describe_mesh(parameters: Parameters) -> SurfaceMesh:
    """Outer faces of the sector. Raises SceneError where the parameters do not go together."""
    return surfaces.describe_mesh(define_sector(parameters)[0].mesh)


def natural_frequencies(parameters: Parameters, known: NaturalFrequencies, keep: KeepFrequencies) -> NaturalFrequencies:
    """Lowest frequencies with the shrouds glued at all nodal diameters 0..N/2, as `reduced_joint` gives them."""

    def prepare() -> PreparedModel:
        return prepare_model(*define_sector(parameters), n_reductions=parameters.n_sectors // 2 + 1)

    return frequencies_of_all_waves(prepare, parameters.n_sectors, known, keep)


def define_sector(parameters: Parameters) -> tuple[MeshModel, JointDefinition]:
    """The sector as a finite-element model, and what is done with it.

    Raises SceneError where the parameters do not go together.
    """
    _check(parameters)
    p, m = parameters, parameters.mesh
    mesh, grids = join_blocks(_blocks(p))
    disk, _, shroud = grids
    ends = np.cumsum([(grid.shape[0] - 1) * (grid.shape[1] - 1) * (grid.shape[2] - 1) for grid in grids])
    material = Material(p.young_modulus, p.poisson_ratio, p.density)
    groups = tuple(
        ElementGroup("C3D8I", mesh.elements[start:end], np.arange(start, end) + 1, material, part)
        for part, start, end in zip(("disk", "blade", "shroud"), [0, *ends[:-1]], ends, strict=True)
    )
    solid = SolidMesh(mesh.nodes, np.arange(len(mesh.nodes)) + 1, groups)
    held = np.zeros((solid.n_nodes, 3), dtype=np.bool_)
    held[disk[0].ravel()] = True
    angle = radians(p.shroud_angle)
    middle = shroud[-1, m : m + 2, 2 * m - 1 : 2 * m + 1].ravel()
    tip = SetMotion(middle, np.array([0.0, cos(angle), -np.sin(angle)]))
    leading = surfaces.surface_of_nodes(solid, "leading face", shroud[:, -1].ravel())
    trailing = surfaces.surface_of_nodes(solid, "trailing face", shroud[:, 0].ravel())
    joint = JointDefinition(
        contacts=(ContactSurfaces(leading, trailing, clearance=-p.interference, label="shroud", sector=1),),
        held=held,
        load=tip,
        responses={"tip": tip},
        cut=CutFaces(CyclicAxis(p.n_sectors, _ORIGIN, _AXIS), disk[:, 0].ravel(), disk[:, -1].ravel()),
    )
    rotation = Rotation((pi * p.rotation_speed / 30.0) ** 2, _ORIGIN, _AXIS) if p.rotation_speed else None
    return MeshModel(solid, rotation, p.stress_stiffening, layers=find_stations(grids, solid.n_nodes)), joint


def _check(parameters: Parameters) -> None:
    p = parameters
    if p.nodal_diameter > p.n_sectors // 2:
        remedy = f"use at most n_sectors // 2 = {p.n_sectors // 2}; more is the same wave turning the other way"
        raise SceneError("nodal_diameter", str(p.nodal_diameter), remedy)
    if p.bore_radius >= p.rim_radius:
        raise SceneError("rim_radius", str(p.rim_radius), f"make it larger than bore_radius = {p.bore_radius}")
    if _blade_half_angle(p, p.rim_radius, p.root_angle) > 0.9 * pi / p.n_sectors:
        remedy = "make it thinner, or use fewer blades, so that there is room between the blades"
        raise SceneError("blade_thickness", str(p.blade_thickness), remedy)


def _blade_half_angle(parameters: Parameters, radius: float, angle: float) -> float:
    """Half of the thickness of the blade as an angle about the axis, rad; angle: of the blade to the axis, degrees."""
    return 0.5 * parameters.blade_thickness / (radius * cos(radians(angle)))


def _blocks(parameters: Parameters) -> list[FloatArray]:
    """Disk, blade and shroud, grids (radial, tangential, axial) of points."""
    p, m = parameters, parameters.mesh
    half, foot = pi / p.n_sectors, _blade_half_angle(p, p.rim_radius, p.root_angle)
    top = p.tip_radius + p.shroud_thickness
    tip = _blade_half_angle(p, p.tip_radius, p.shroud_angle)
    disk, blade = graded([p.bore_radius, p.rim_radius], [4 * m]), graded([p.rim_radius, p.tip_radius], [8 * m])
    shroud = graded([p.tip_radius, top], [m])
    share = (blade - p.rim_radius) / p.blade_length
    thickness = foot + share * (tip - foot)
    return [
        _grid(p, disk, [-half, -foot, foot, half], [m, 1, m], p.root_angle * (disk - disk[0]) / np.ptp(disk)),
        _grid(p, blade, [-1.0, 1.0], [1], p.root_angle + share * (p.shroud_angle - p.root_angle), thickness),
        _grid(p, shroud, [-half, -tip, tip, half], [m, 1, m], np.full(len(shroud), p.shroud_angle)),
    ]


def _grid(
    parameters: Parameters,
    radii: FloatArray,
    stations: list[float],
    divisions: list[int],
    inclined: FloatArray,
    scale: FloatArray | float = 1.0,
) -> FloatArray:
    """Points (n_radii, n_tangential, n_axial, 3).

    stations: angles about the axis, rad, over the scale (n_radii,). inclined (n_radii,): angle of the lines along the
    blade to the axis, degrees: both cut faces are inclined alike, so that they are images of each other.
    """
    axial = parameters.width * np.linspace(-0.5, 0.5, 4 * parameters.mesh)
    across = np.multiply.outer(np.broadcast_to(scale, radii.shape), graded(stations, divisions))
    angles = across[:, :, None] + (np.tan(np.radians(inclined)) / radii)[:, None, None] * axial
    height = np.broadcast_to(axial, angles.shape)
    radius = radii[:, None, None]
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=-1)
