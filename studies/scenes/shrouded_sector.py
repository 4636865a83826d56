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

from math import cos, radians, sin

import numpy as np
from pydantic import Field

from solver.model import FloatArray
from studies.finite_element import surfaces
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.joint_model import JointDefinition, SetMotion
from studies.finite_element.pairing import ContactSurfaces
from studies.scene_error import SceneError
from studies.scenes.sector import (
    Sector,
    SectorParameters,
    block_of,
    functions_of,
    graded,
    mesh_of_bodies,
)


class Parameters(SectorParameters):
    """One sector of a shrouded bladed disk. SI units, except rotation speed and angles."""

    friction_coefficient: float = Field(0.3, ge=0, description="Coulomb friction coefficient of the shrouds, -")
    interference: float = Field(
        5e-4, ge=0, description="overlap of neighbouring shrouds before they are put together, m"
    )
    mesh: int = Field(1, ge=1, le=8, description="mesh density m: a shroud has 4 m axial x (m + 1) contact pairs, -")
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


def define_sector(parameters: Parameters) -> Sector:
    """The sector as a finite-element model, and what is done with it.

    Raises SceneError where the parameters do not go together.
    """
    _check(parameters)
    p, m = parameters, parameters.mesh
    solid, (disk, _, shroud) = mesh_of_bodies([(_blocks(p), ("disk", "blade", "shroud"), p.material)])
    held = np.zeros((solid.n_nodes, 3), dtype=np.bool_)
    held[disk[0].ravel()] = True
    angle = radians(p.shroud_angle)
    middle = shroud[-1, m : m + 2, 2 * m - 1 : 2 * m + 1].ravel()
    tip = SetMotion(middle, np.array([0.0, cos(angle), -sin(angle)]))
    leading = surfaces.surface_of_nodes(solid, "leading face", shroud[:, -1].ravel())
    trailing = surfaces.surface_of_nodes(solid, "trailing face", shroud[:, 0].ravel())
    joint = JointDefinition(
        contacts=(ContactSurfaces(leading, trailing, clearance=-p.interference, label="shroud", sector=1),),
        held=held,
        load=tip,
        responses={"tip": tip},
        cut=CutFaces(p.axis, disk[:, 0].ravel(), disk[:, -1].ravel()),
    )
    return p.model_of(solid), joint


def _check(parameters: Parameters) -> None:
    p = parameters
    p.check_wave()
    if p.bore_radius >= p.rim_radius:
        raise SceneError("rim_radius", str(p.rim_radius), f"make it larger than bore_radius = {p.bore_radius}")
    if _blade_half_angle(p, p.rim_radius, p.root_angle) > 0.9 * p.half_pitch:
        remedy = "make it thinner, or use fewer blades, so that there is room between the blades"
        raise SceneError("blade_thickness", str(p.blade_thickness), remedy)


def _blade_half_angle(parameters: Parameters, radius: float, angle: float) -> float:
    """Half of the thickness of the blade as an angle about the axis, rad; angle: of the blade to the axis, degrees."""
    return 0.5 * parameters.blade_thickness / (radius * cos(radians(angle)))


def _blocks(parameters: Parameters) -> list[FloatArray]:
    """Disk, blade and shroud. Both cut faces are inclined alike, so that they are images of each other."""
    p, m = parameters, parameters.mesh
    half, foot = p.half_pitch, _blade_half_angle(p, p.rim_radius, p.root_angle)
    tip = _blade_half_angle(p, p.tip_radius, p.shroud_angle)
    disk, blade = graded([p.bore_radius, p.rim_radius], [4 * m]), graded([p.rim_radius, p.tip_radius], [8 * m])
    shroud = graded([p.tip_radius, p.tip_radius + p.shroud_thickness], [m])
    share = (blade - p.rim_radius) / p.blade_length
    thickness, turned = foot + share * (tip - foot), p.root_angle + share * (p.shroud_angle - p.root_angle)
    axial = p.width * np.linspace(-0.5, 0.5, 4 * m)
    around_foot, around_tip = (graded([-half, -each, each, half], [m, 1, m]) for each in (foot, tip))
    return [
        block_of(disk[:, None], around_foot, axial, p.root_angle * (disk - disk[0]) / np.ptp(disk)),
        block_of(blade[:, None], np.outer(thickness, [-1.0, 1.0]), axial, turned),
        block_of(shroud[:, None], around_tip, axial, p.shroud_angle),
    ]


build, describe_mesh, natural_frequencies = functions_of(define_sector)
