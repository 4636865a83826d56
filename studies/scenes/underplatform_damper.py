"""One sector of a bladed disk with a wedge under the platforms of neighbouring blades, from finite elements.

Disk, shank, platform and blade are one body. The wedge lies in the gap between this platform and the next one; its own
centrifugal force presses its roof, inclined by `roof_angle` to both sides, against the undersides of both. Without
friction each side carries `F / (2 cos(roof_angle))`, F the centrifugal force. The blade is excited and observed at the
middle of its tip, across the blade.

Displacements of the reduced model: first the relative displacements u_wedge - u_platform, at the next platform
`u_wedge - exp(2 pi i k / N) R u_platform` at nodal diameter k, where R turns by one sector; then modal coordinates of
the sector with its wedge glued to both. Each pair has normal (positive when the pair closes), first tangent (axial) and
second tangent (up or down the roof). A mesh of density m has 4 m axial x (m + 1) pairs on each side of the roof.
"""

from __future__ import annotations

from math import cos, radians, sin, tan

import numpy as np
from pydantic import Field

from solver.model import FloatArray
from studies.finite_element import surfaces
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.element_matrices import Material
from studies.finite_element.joint_model import JointDefinition, Retainer, SetMotion
from studies.finite_element.pairing import ContactSurfaces
from studies.scene_error import SceneError
from studies.scenes.sector import (
    AXIS,
    Sector,
    SectorParameters,
    block_of,
    functions_of,
    graded,
    mesh_of_bodies,
)


class Parameters(SectorParameters):
    """One sector of a bladed disk with an underplatform damper. SI units, except rotation speed and angles."""

    friction_coefficient: float = Field(0.3, ge=0, description="Coulomb friction coefficient of the wedge, -")
    rotation_speed: float = Field(3000.0, gt=0, description="speed of rotation, which presses the wedge, rpm")
    mesh: int = Field(1, ge=1, le=8, description="mesh density m: 4 m axial x (m + 1) contact pairs on each side, -")
    bore_radius: float = Field(0.12, gt=0, description="radius of the clamped bore, m")
    rim_radius: float = Field(0.2, gt=0, description="outer radius of the disk, m")
    platform_radius: float = Field(0.225, gt=0, description="radius of the underside of the platform, m")
    platform_thickness: float = Field(0.005, gt=0, description="radial thickness of the platform, m")
    platform_gap: float = Field(0.001, gt=0, description="gap between neighbouring platforms, m")
    width: float = Field(0.03, gt=0, description="axial width of disk, blade, platform and wedge, m")
    shank_thickness: float = Field(0.006, gt=0, description="thickness of the shank, and of the foot of the blade, m")
    tip_thickness: float = Field(0.004, gt=0, description="thickness of the blade at its tip, m")
    blade_length: float = Field(0.14, gt=0, description="length of the blade above the platform, m")
    tip_angle: float = Field(25.0, ge=-60, le=60, description="angle of the blade to the axis at its tip, degrees")
    roof_angle: float = Field(30.0, gt=0, lt=60, description="angle of both sides of the roof to the tangent, degrees")
    damper_half_width: float = Field(0.005, gt=0, description="half of the tangential width of the wedge, m")
    damper_height: float = Field(0.003, gt=0, description="radial height of the sides of the wedge, m")
    retention_stiffness: float = Field(1e7, ge=0, description="what holds the wedge along the axis, N/m")
    damper_density: float = Field(8000.0, gt=0, description="density of the wedge, kg/m3")

    @property
    def roof_rise(self) -> float:
        """Radial height of the roof over the sides of the wedge, m."""
        return (self.damper_half_width - 0.5 * self.platform_gap) * tan(radians(self.roof_angle))


def define_sector(parameters: Parameters) -> Sector:
    """The sector as a finite-element model, and what is done with it.

    Raises SceneError where the parameters do not go together.
    """
    _check(parameters)
    p, m = parameters, parameters.mesh
    blade_body = (_blade_body(p), ("disk", "shank", "platform", "blade"), p.material)
    wedge_body = ([_wedge(p)], ("wedge",), Material(p.young_modulus, p.poisson_ratio, p.damper_density))
    solid, grids = mesh_of_bodies([blade_body, wedge_body])
    disk, _, platform, blade, wedge = grids
    held = np.zeros((solid.n_nodes, 3), dtype=np.bool_)
    held[disk[0].ravel()] = True
    angle = radians(p.tip_angle)
    tip = SetMotion(blade[-1, :, 2 * m - 1 : 2 * m + 1].ravel(), np.array([0.0, cos(angle), -sin(angle)]))

    def contact(label: str, own: slice, other: slice, sector: int) -> ContactSurfaces:
        first = surfaces.surface_of_nodes(solid, f"roof, {label}", wedge[-1, own].ravel())
        second = surfaces.surface_of_nodes(solid, f"underside, {label}", platform[0, other].ravel())
        return ContactSurfaces(first, second, label=label, sector=sector)

    joint = JointDefinition(
        contacts=(
            contact("this platform", slice(m + 1), slice(-m - 1, None), 0),
            contact("next platform", slice(-m - 1, None), slice(m + 1), 1),
        ),
        held=held,
        load=tip,
        responses={"tip": tip},
        cut=CutFaces(p.axis, disk[:, 0].ravel(), disk[:, -1].ravel()),
        retainer=Retainer(p.retention_stiffness, AXIS),
    )
    return p.model_of(solid), joint


def _check(parameters: Parameters) -> None:
    p = parameters
    p.check_wave()
    for inner, outer in (("bore_radius", "rim_radius"), ("rim_radius", "platform_radius")):
        if getattr(p, inner) >= getattr(p, outer):
            remedy = f"make it larger than {inner} = {getattr(p, inner)}"
            raise SceneError(outer, str(getattr(p, outer)), remedy)
    if 0.5 * p.platform_gap >= p.damper_half_width:
        raise SceneError("platform_gap", str(p.platform_gap), "make it smaller than the wedge is wide")
    if p.damper_half_width + 0.5 * p.shank_thickness >= 0.95 * p.half_pitch * p.platform_radius:
        remedy = "make it smaller, or use fewer blades, so that the wedge has room beside the shank"
        raise SceneError("damper_half_width", str(p.damper_half_width), remedy)
    if p.roof_rise >= 0.9 * p.platform_thickness:
        remedy = f"make it larger than the roof is high, {p.roof_rise:.3g} m"
        raise SceneError("platform_thickness", str(p.platform_thickness), remedy)
    if p.platform_radius - p.damper_height <= p.rim_radius:
        raise SceneError("damper_height", str(p.damper_height), "make it smaller, so that the wedge is above the disk")


def _around(parameters: Parameters) -> tuple[float, float, float]:
    """Half of the shank, outer side of the wedge and edge of the platform as angles about the axis, rad.

    The latter two are measured from the middle between two blades.
    """
    p = parameters
    lengths = 0.5 * p.shank_thickness, p.damper_half_width, 0.5 * p.platform_gap
    shank, side, edge = (length / p.platform_radius for length in lengths)
    return shank, side, edge


def _axial(parameters: Parameters) -> FloatArray:
    return parameters.width * np.linspace(-0.5, 0.5, 4 * parameters.mesh)


def _blade_body(parameters: Parameters) -> list[FloatArray]:
    """Disk, shank, platform and blade."""
    p, m = parameters, parameters.mesh
    half, axial, (shank, side, edge) = p.half_pitch, _axial(p), _around(p)
    top = p.platform_radius + p.platform_thickness
    disk = graded([p.bore_radius, p.rim_radius], [4 * m])
    between = graded([p.rim_radius, p.platform_radius], [2 * m])
    blade = graded([top, top + p.blade_length], [8 * m])
    stations = [-half + edge, -half + side, -shank, shank, half - side, half - edge]
    platform = graded(stations, [m, m, 1, m, m])
    rise = np.clip(np.abs(platform) - (half - side), 0.0, None) / (side - edge) * p.roof_rise
    underside = p.platform_radius + rise
    share = np.linspace(0.0, 1.0, m + 1)[:, None]
    along = (blade - top) / p.blade_length
    thickness = shank + along * (0.5 * p.tip_thickness / blade[-1] - shank)
    return [
        block_of(disk[:, None], graded([-half, -shank, shank, half], [m, 1, m]), axial),
        block_of(between[:, None], np.array([-shank, shank]), axial),
        block_of(underside + share * (top - underside), platform, axial),
        block_of(blade[:, None], np.outer(thickness, [-1.0, 1.0]), axial, p.tip_angle * along),
    ]


def _wedge(parameters: Parameters) -> FloatArray:
    """The wedge: its roof begins and ends at its sides, and is flat below the gap."""
    p, m = parameters, parameters.mesh
    _, side, edge = _around(p)
    stations = graded([-side, -edge, edge, side], [m, 1, m])
    roof = p.platform_radius + p.roof_rise * np.clip((side - np.abs(stations)) / (side - edge), 0.0, 1.0)
    bottom = p.platform_radius - p.damper_height
    share = np.linspace(0.0, 1.0, m + 1)[:, None]
    return block_of(bottom + share * (roof - bottom), p.half_pitch + stations, _axial(p))


build, describe_mesh, natural_frequencies = functions_of(define_sector)
