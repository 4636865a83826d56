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

from collections.abc import Iterator
from math import cos, radians, sin, tan

import numpy as np
from pydantic import Field

from solver.model import FloatArray
from studies.finite_element import surfaces
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.solid_mesh import Material
from studies.finite_element.structure import FeModel, JointDefinition, Retainer
from studies.scene import Degree, Density, Metre, NewtonPerMetre, Rpm
from studies.scenes.sector import AXIS, SectorParameters, block_of, graded, mesh_of_bodies


class Parameters(SectorParameters):
    """One sector of a bladed disk with an underplatform damper. SI units, except rotation speed and angles."""

    friction_coefficient: float = Field(0.3, ge=0, description="Coulomb friction coefficient of the wedge")
    rotation_speed: Rpm = Field(3000.0, gt=0, description="speed of rotation, which presses the wedge")
    mesh: int = Field(1, ge=1, le=8, description="mesh density m: 4 m axial x (m + 1) contact pairs on each side")
    bore_radius: Metre = Field(0.12, gt=0, description="radius of the clamped bore")
    rim_radius: Metre = Field(0.2, gt=0, description="outer radius of the disk")
    platform_radius: Metre = Field(0.225, gt=0, description="radius of the underside of the platform")
    platform_thickness: Metre = Field(0.005, gt=0, description="radial thickness of the platform")
    platform_gap: Metre = Field(0.001, gt=0, description="gap between neighbouring platforms")
    width: Metre = Field(0.03, gt=0, description="axial width of disk, blade, platform and wedge")
    shank_thickness: Metre = Field(0.006, gt=0, description="thickness of the shank, and of the foot of the blade")
    tip_thickness: Metre = Field(0.004, gt=0, description="thickness of the blade at its tip")
    blade_length: Metre = Field(0.14, gt=0, description="length of the blade above the platform")
    tip_angle: Degree = Field(25.0, ge=-60, le=60, description="angle of the blade to the axis at its tip")
    roof_angle: Degree = Field(30.0, gt=0, lt=60, description="angle of both sides of the roof to the tangent")
    damper_half_width: Metre = Field(0.005, gt=0, description="half of the tangential width of the wedge")
    damper_height: Metre = Field(0.003, gt=0, description="radial height of the sides of the wedge")
    retention_stiffness: NewtonPerMetre = Field(1e7, ge=0, description="what holds the wedge along the axis")
    damper_density: Density = Field(8000.0, gt=0, description="density of the wedge")

    @property
    def roof_rise(self) -> float:
        """Radial height of the roof over the sides of the wedge, m."""
        return (self.damper_half_width - 0.5 * self.platform_gap) * tan(radians(self.roof_angle))

    def define_sector(self) -> tuple[FeModel, JointDefinition]:  # noqa: D102
        self.check()
        m, angle = self.mesh, radians(self.tip_angle)
        blade_body = (self._blade_body(), ("disk", "shank", "platform", "blade"), self.material)
        wedge_material = Material(self.young_modulus, self.poisson_ratio, self.damper_density)
        solid, grids = mesh_of_bodies([blade_body, ([self._wedge()], ("wedge",), wedge_material)])
        disk, _, platform, blade, wedge = grids

        def contact(label: str, own: slice, other: slice, sector: int) -> ContactSurfaces:
            first = surfaces.surface_of_nodes(solid, f"roof, {label}", wedge[-1, own].ravel())
            second = surfaces.surface_of_nodes(solid, f"underside, {label}", platform[0, other].ravel())
            return ContactSurfaces(first, second, label=label, sector=sector)

        low, high = slice(m + 1), slice(-m - 1, None)
        contacts = contact("this platform", low, high, 0), contact("next platform", high, low, 1)
        middle, across = blade[-1, :, 2 * m - 1 : 2 * m + 1].ravel(), np.array([0.0, cos(angle), -sin(angle)])
        cut, retainer = (disk[:, 0].ravel(), disk[:, -1].ravel()), Retainer(self.retention_stiffness, AXIS)
        return self.sector_of(solid, contacts, disk[0].ravel(), cut, (middle, across), retainer)

    def impossible(self) -> Iterator[tuple[bool, str, str]]:  # noqa: D102
        yield from super().impossible()
        half, room = self.damper_half_width, 0.95 * self.half_pitch * self.platform_radius
        yield 0.5 * self.platform_gap >= half, "platform_gap", "make it smaller than the wedge is wide"
        remedy = "make it smaller, or use fewer blades, so that the wedge has room beside the shank"
        yield half + 0.5 * self.shank_thickness >= room, "damper_half_width", remedy
        remedy = f"make it larger than the roof is high, {self.roof_rise:.3g} m"
        yield self.roof_rise >= 0.9 * self.platform_thickness, "platform_thickness", remedy
        high = self.platform_radius - self.damper_height <= self.rim_radius
        yield high, "damper_height", "make it smaller, so that the wedge is above the disk"

    @property
    def _around(self) -> tuple[float, float, float]:
        """Half of the shank, outer side of the wedge and edge of the platform as angles about the axis, rad.

        The latter two are measured from the middle between two blades.
        """
        lengths = 0.5 * self.shank_thickness, self.damper_half_width, 0.5 * self.platform_gap
        shank, side, edge = (length / self.platform_radius for length in lengths)
        return shank, side, edge

    @property
    def _axial(self) -> FloatArray:
        return self.width * np.linspace(-0.5, 0.5, 4 * self.mesh)

    def _blade_body(self) -> list[FloatArray]:
        """Disk, shank, platform and blade."""
        m, half, axial, (shank, side, edge) = self.mesh, self.half_pitch, self._axial, self._around
        top = self.platform_radius + self.platform_thickness
        disk = graded([self.bore_radius, self.rim_radius], [4 * m])
        between = graded([self.rim_radius, self.platform_radius], [2 * m])
        blade = graded([top, top + self.blade_length], [8 * m])
        platform = graded([-half + edge, -half + side, -shank, shank, half - side, half - edge], [m, m, 1, m, m])
        rise = np.clip(np.abs(platform) - (half - side), 0.0, None) / (side - edge) * self.roof_rise
        underside = self.platform_radius + rise
        share = np.linspace(0.0, 1.0, m + 1)[:, None]
        along = (blade - top) / self.blade_length
        thickness = shank + along * (0.5 * self.tip_thickness / blade[-1] - shank)
        return [
            block_of(disk[:, None], graded([-half, -shank, shank, half], [m, 1, m]), axial),
            block_of(between[:, None], np.array([-shank, shank]), axial),
            block_of(underside + share * (top - underside), platform, axial),
            block_of(blade[:, None], np.outer(thickness, [-1.0, 1.0]), axial, self.tip_angle * along),
        ]

    def _wedge(self) -> FloatArray:
        """The wedge: its roof begins and ends at its sides, and is flat below the gap."""
        m, (_, side, edge) = self.mesh, self._around
        stations = graded([-side, -edge, edge, side], [m, 1, m])
        rise = self.roof_rise * np.clip((side - np.abs(stations)) / (side - edge), 0.0, 1.0)
        roof, bottom = self.platform_radius + rise, self.platform_radius - self.damper_height
        share = np.linspace(0.0, 1.0, m + 1)[:, None]
        return block_of(bottom + share * (roof - bottom), self.half_pitch + stations, self._axial)
