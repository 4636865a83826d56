"""One sector of a bladed disk whose tip shrouds touch, from finite elements.

Disk, blade and shroud are one body. Each shroud touches that of the next sector, on faces at `shroud_angle` to the
axis. An interference presses them together, as a pre-twist of the blades does; under rotation the blades untwist as
well. The blade is excited and observed at the middle of its shroud, perpendicular to the contact faces.

Displacements of the reduced model: first the relative displacements of the leading face of this sector and the trailing
face of the next one, `u - exp(2 pi i k / N) R u_that` at nodal diameter k, where R turns by one sector; then modal
coordinates of the glued sector. Each pair has normal (positive when the pair closes), first tangent (near the axis) and
second tangent. A mesh of density m has 4 m axial x (m + 1) pairs.
"""

from collections.abc import Iterator
from math import cos, radians, sin

import numpy as np
from pydantic import Field

from solver.model import FloatArray
from studies.finite_element import surfaces
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.structure import FeModel, JointDefinition
from studies.scene import Degree, Metre
from studies.scenes.sector import SectorParameters, block_of, graded, mesh_of_bodies


class Parameters(SectorParameters):
    """One sector of a shrouded bladed disk. SI units, except rotation speed and angles."""

    friction_coefficient: float = Field(0.3, ge=0, description="Coulomb friction coefficient of the shrouds")
    interference: Metre = Field(5e-4, ge=0, description="overlap of neighbouring shrouds before they are put together")
    mesh: int = Field(1, ge=1, le=8, description="mesh density m: a shroud has 4 m axial x (m + 1) contact pairs")
    bore_radius: Metre = Field(0.12, gt=0, description="radius of the clamped bore")
    rim_radius: Metre = Field(0.2, gt=0, description="outer radius of the disk")
    width: Metre = Field(0.03, gt=0, description="axial width of disk, blade and shroud")
    blade_length: Metre = Field(0.16, gt=0, description="length of the blade between disk and shroud")
    blade_thickness: Metre = Field(0.004, gt=0, description="thickness of the blade")
    root_angle: Degree = Field(10.0, ge=-60, le=60, description="angle of the blade to the axis at the disk")
    shroud_angle: Degree = Field(35.0, ge=-60, le=60, description="angle of blade and contact faces at the tip")
    shroud_thickness: Metre = Field(0.006, gt=0, description="radial thickness of the shroud")

    def define_sector(self) -> tuple[FeModel, JointDefinition]:  # noqa: D102
        self.check()
        m, angle = self.mesh, radians(self.shroud_angle)
        solid, (disk, _, shroud) = mesh_of_bodies([(self._blocks(), ("disk", "blade", "shroud"), self.material)])
        leading = surfaces.surface_of_nodes(solid, "leading face", shroud[:, -1].ravel())
        trailing = surfaces.surface_of_nodes(solid, "trailing face", shroud[:, 0].ravel())
        contact = ContactSurfaces(leading, trailing, clearance=-self.interference, label="shroud", sector=1)
        middle, across = shroud[-1, m : m + 2, 2 * m - 1 : 2 * m + 1].ravel(), np.array([0.0, cos(angle), -sin(angle)])
        cut = disk[:, 0].ravel(), disk[:, -1].ravel()
        return self.sector_of(solid, (contact,), disk[0].ravel(), cut, (middle, across))

    def impossible(self) -> Iterator[tuple[bool, str, str]]:  # noqa: D102
        yield from super().impossible()
        wide = self._blade_half_angle(self.rim_radius, self.root_angle) > 0.9 * self.half_pitch
        yield wide, "blade_thickness", "make it thinner, or use fewer blades, so that there is room between the blades"

    def _blade_half_angle(self, radius: float, angle: float) -> float:
        """Half of the thickness of the blade as an angle about the axis, rad; angle: to the axis, degrees."""
        return 0.5 * self.blade_thickness / (radius * cos(radians(angle)))

    def _blocks(self) -> list[FloatArray]:
        """Disk, blade and shroud. Both cut faces are inclined alike, so that they are images of each other."""
        m, half, axial = self.mesh, self.half_pitch, self.width * np.linspace(-0.5, 0.5, 4 * self.mesh)
        tip_radius = self.rim_radius + self.blade_length
        foot = self._blade_half_angle(self.rim_radius, self.root_angle)
        tip = self._blade_half_angle(tip_radius, self.shroud_angle)
        disk = graded([self.bore_radius, self.rim_radius], [4 * m])
        blade = graded([self.rim_radius, tip_radius], [8 * m])
        shroud = graded([tip_radius, tip_radius + self.shroud_thickness], [m])
        share = (blade - self.rim_radius) / self.blade_length
        thickness, turned = foot + share * (tip - foot), self.root_angle + share * (self.shroud_angle - self.root_angle)
        around_foot, around_tip = (graded([-half, -each, each, half], [m, 1, m]) for each in (foot, tip))
        return [
            block_of(disk[:, None], around_foot, axial, self.root_angle * (disk - disk[0]) / np.ptp(disk)),
            block_of(blade[:, None], np.outer(thickness, [-1.0, 1.0]), axial, turned),
            block_of(shroud[:, None], around_tip, axial, self.shroud_angle),
        ]
