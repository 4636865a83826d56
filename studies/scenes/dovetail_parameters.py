"""Parameters of the scene `dovetail_sector`, and what ties them together."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians, sin, tan
from typing import ClassVar

from pydantic import Field

from studies.scenes.sector import SectorParameters

_TRAVELLING_RETAINER = 1e7  # N/m: stiff against the slip of the flanks, soft against the flanks themselves


class DovetailParameters(SectorParameters):
    """Parameters of the sector, without its mesh."""

    ASCENDING: ClassVar = (
        "bore_radius",
        "hub_radius",
        "web_inner_radius",
        "web_outer_radius",
        "rim_inner_radius",
        "slot_bottom_radius",
        "flank_top_radius",
        "rim_radius",
        "platform_radius",
    )

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient of the flanks, -")
    rotation_speed: float = Field(3000.0, gt=0, description="speed of rotation, which presses the flanks together, rpm")
    n_sectors: int = Field(47, ge=12, le=200, description="number of blades, -")
    retention_stiffness: float | None = Field(
        None,
        ge=0,
        description="retainer along the slot; default 1e7 under a travelling wave and else 0, N/m",
    )
    mesh: int = Field(2, ge=1, le=8, description="mesh density m: a flank has 4 m axial x (m + 1) contact pairs, -")
    bore_radius: float = Field(0.120, gt=0, description="radius of the clamped bore, m")
    hub_radius: float = Field(0.125, gt=0, description="outer radius of the hub, m")
    web_inner_radius: float = Field(0.146, gt=0, description="radius where the web has become thin, m")
    web_outer_radius: float = Field(0.202, gt=0, description="radius where the web begins to widen to the rim, m")
    rim_inner_radius: float = Field(0.212, gt=0, description="inner radius of the rim, m")
    slot_bottom_radius: float = Field(0.234, gt=0, description="radius of the slot bottom, m")
    rim_radius: float = Field(0.250, gt=0, description="outer radius of the disk, m")
    hub_width: float = Field(0.036, gt=0, description="axial width of the hub, m")
    web_width: float = Field(0.014, gt=0, description="axial width of the web, m")
    rim_width: float = Field(0.040, gt=0, description="axial width of rim, root and platform, m")

    flank_top_radius: float = Field(0.245, gt=0, description="radius of the outer end of the flanks, m")
    flank_top_half_width: float = Field(0.0055, gt=0, description="half width of the root at that end, m")
    flank_length: float = Field(0.007, gt=0, description="length of a flank in the cross-section, m")
    flank_angle: float = Field(45.0, ge=15, le=75, description="angle between flank and radius, degrees")
    root_clearance: float = Field(0.0012, gt=0, description="clearance of the root at bottom and sides, m")
    mouth_clearance: float = Field(0.0006, gt=0, description="clearance of the neck at the rim radius, m")

    platform_radius: float = Field(0.2525, gt=0, description="radius of the underside of the platform, m")
    platform_thickness: float = Field(0.0025, gt=0, description="thickness of the platform, m")
    platform_gap: float = Field(0.0006, gt=0, description="gap between neighbouring platforms, m")

    blade_length: float = Field(0.160, gt=0, description="length of the blade above the platform, m")
    root_chord: float = Field(0.042, gt=0, description="chord at the foot of the blade, m")
    tip_chord: float = Field(0.040, gt=0, description="chord at the tip, m")
    root_thickness: float = Field(0.0055, gt=0, description="thickness in mid-chord at the foot of the blade, m")
    tip_thickness: float = Field(0.0026, gt=0, description="thickness in mid-chord at the tip, m")
    root_edge_thickness: float = Field(
        0.90, gt=0, le=1, description="thickness of the edges at the foot over that in mid-chord, -"
    )
    tip_edge_thickness: float = Field(0.78, gt=0, le=1, description="the same ratio at the tip, -")
    root_stagger: float = Field(12.0, ge=-80, le=80, description="angle of chord to axis at the foot, degrees")
    tip_stagger: float = Field(48.0, ge=-80, le=80, description="angle of chord to axis at the tip, degrees")
    fillet_height: float = Field(0.008, gt=0, description="height over which the neck blends into the blade, m")

    @property
    def retainer(self) -> float:
        """Stiffness of the retainer, N/m, with its default filled in."""
        if self.retention_stiffness is None:
            return _TRAVELLING_RETAINER if self.nodal_diameter > 0 else 0.0
        return self.retention_stiffness

    @property
    def flank_bottom(self) -> tuple[float, float]:
        """Radius along the centre line and half width, m, at the inner end of the flanks."""
        angle = radians(self.flank_angle)
        return (
            self.flank_top_radius - self.flank_length * cos(angle),
            self.flank_top_half_width + self.flank_length * sin(angle),
        )

    def impossible(self) -> Iterator[tuple[bool, str, str]]:
        """As `SectorParameters.impossible`."""
        (bottom_radius, bottom_half_width), neck = self.flank_bottom, self.flank_top_half_width
        low = bottom_radius <= self.slot_bottom_radius + self.root_clearance
        remedy = "shorten the flanks or lower slot_bottom_radius, so that they end above the slot bottom"
        yield low, "flank_length", remedy
        yield bottom_half_width <= self.root_clearance, "root_clearance", "make it smaller than the root"
        wide = bottom_half_width >= 0.9 * self.slot_bottom_radius * sin(self.half_pitch)
        remedy = "shorten the flanks or use fewer sectors, so that a post is left between two slots"
        yield wide, "flank_length", remedy
        none = neck + self.platform_gap >= self.platform_radius * tan(self.half_pitch)
        yield none, "platform_gap", "make it smaller, the platform vanishes"
        none = neck + self.mouth_clearance >= self.rim_radius * sin(self.half_pitch)
        yield none, "mouth_clearance", "make it smaller, the post vanishes"
        yield self.fillet_height >= self.blade_length, "fillet_height", "make it smaller than blade_length"
