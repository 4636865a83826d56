"""One sector of a bladed disk with a dovetail root, from finite elements.

The blade is excited and observed at mid-chord of its tip, perpendicular to the chord, positive to the intrados.

Mesh 1 is for first trials. Its higher frequencies lie up to 7 % above those of mesh 2, the default; those of mesh 3
within 2 %, for five times the computing time.

Displacements of the reduced model: first the relative displacements u_blade - u_disk, then modal coordinates of the
glued sector. Each pair has normal (positive when the pair closes), first tangent (axial, to the trailing edge) and
second tangent (up the flank, outwards). Pairs are numbered intrados first (the flank at y > 0, which leads as the disk
turns about +z), then extrados; from the leading to the trailing edge; from the inner to the outer end.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import asin, atan2, cos, hypot, pi, radians, sin, sqrt, tan
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from solver.model import FloatArray, IntArray
from studies.finite_element.pairing import ContactPairs, ContactSurfaces, build_contact_pairs
from studies.finite_element.structure import FeModel, JointDefinition, Retainer
from studies.finite_element.surfaces import surface_of_nodes
from studies.scene import Degree, Metre, NewtonPerMetre, Remark, Rpm
from studies.scenes.sector import AXIS, SectorParameters, block_of, graded, mesh_of_bodies

_TRAVELLING_RETAINER = 1e7  # N/m: stiff against the slip of the flanks, soft against the flanks themselves


class Parameters(SectorParameters):
    """x is the centre line of the sector, y the tangential direction, z the axis of rotation, to the trailing edge.

    Radii of the dovetail and of the blade are measured along the centre line.
    """

    DESCRIPTION: ClassVar = {
        "contact_directions": "axial, up the flank",
        "contact_origin": "Axial 0 is the leading edge, up the flank 0 the inner end",
    }

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient of the flanks")
    rotation_speed: Rpm = Field(3000.0, gt=0, description="speed of rotation, which presses the flanks together")
    n_sectors: int = Field(47, ge=12, le=200, description="number of blades")
    retention_stiffness: Annotated[NewtonPerMetre | None, Remark("default 1e7 under a travelling wave and else 0")] = (
        Field(None, ge=0, description="retainer along the slot")
    )
    mesh: int = Field(2, ge=1, le=8, description="mesh density m: a flank has 4 m axial x (m + 1) contact pairs")
    bore_radius: Metre = Field(0.120, gt=0, description="radius of the clamped bore")
    hub_radius: Metre = Field(0.125, gt=0, description="outer radius of the hub")
    web_inner_radius: Metre = Field(0.146, gt=0, description="radius where the web has become thin")
    web_outer_radius: Metre = Field(0.202, gt=0, description="radius where the web begins to widen to the rim")
    rim_inner_radius: Metre = Field(0.212, gt=0, description="inner radius of the rim")
    slot_bottom_radius: Metre = Field(0.234, gt=0, description="radius of the slot bottom")
    rim_radius: Metre = Field(0.250, gt=0, description="outer radius of the disk")
    hub_width: Metre = Field(0.036, gt=0, description="axial width of the hub")
    web_width: Metre = Field(0.014, gt=0, description="axial width of the web")
    rim_width: Metre = Field(0.040, gt=0, description="axial width of rim, root and platform")

    flank_top_radius: Metre = Field(0.245, gt=0, description="radius of the outer end of the flanks")
    flank_top_half_width: Metre = Field(0.0055, gt=0, description="half width of the root at that end")
    flank_length: Metre = Field(0.007, gt=0, description="length of a flank in the cross-section")
    flank_angle: Degree = Field(45.0, ge=15, le=75, description="angle between flank and radius")
    root_clearance: Metre = Field(0.0012, gt=0, description="clearance of the root at bottom and sides")
    mouth_clearance: Metre = Field(0.0006, gt=0, description="clearance of the neck at the rim radius")

    platform_radius: Metre = Field(0.2525, gt=0, description="radius of the underside of the platform")
    platform_thickness: Metre = Field(0.0025, gt=0, description="thickness of the platform")
    platform_gap: Metre = Field(0.0006, gt=0, description="gap between neighbouring platforms")

    blade_length: Metre = Field(0.160, gt=0, description="length of the blade above the platform")
    root_chord: Metre = Field(0.042, gt=0, description="chord at the foot of the blade")
    tip_chord: Metre = Field(0.040, gt=0, description="chord at the tip")
    root_thickness: Metre = Field(0.0055, gt=0, description="thickness in mid-chord at the foot of the blade")
    tip_thickness: Metre = Field(0.0026, gt=0, description="thickness in mid-chord at the tip")
    root_edge_thickness: float = Field(
        0.90, gt=0, le=1, description="thickness of the edges at the foot over that in mid-chord"
    )
    tip_edge_thickness: float = Field(0.78, gt=0, le=1, description="the same ratio at the tip")
    root_stagger: Degree = Field(12.0, ge=-80, le=80, description="angle of chord to axis at the foot")
    tip_stagger: Degree = Field(48.0, ge=-80, le=80, description="angle of chord to axis at the tip")
    fillet_height: Metre = Field(0.008, gt=0, description="height over which the neck blends into the blade")

    @property
    def flank_bottom(self) -> tuple[float, float]:
        """Radius along the centre line and half width, m, at the inner end of the flanks."""
        angle = radians(self.flank_angle)
        height, width = self.flank_length * cos(angle), self.flank_length * sin(angle)
        return self.flank_top_radius - height, self.flank_top_half_width + width

    def impossible(self) -> Iterator[tuple[bool, str, str]]:  # noqa: D102
        yield from super().impossible()
        (bottom_radius, bottom_half_width), neck = self.flank_bottom, self.flank_top_half_width
        low = bottom_radius <= self.slot_bottom_radius + self.root_clearance
        remedy = "shorten the flanks or lower slot_bottom_radius, so that they end above the slot bottom"
        yield low, "flank_length", remedy
        yield bottom_half_width <= self.root_clearance, "root_clearance", "make it smaller than the root"
        wide = bottom_half_width >= 0.9 * self.slot_bottom_radius * sin(self.half_pitch)
        yield wide, "flank_length", "shorten the flanks or use fewer sectors, so that a post is left between two slots"
        none = neck + self.platform_gap >= self.platform_radius * tan(self.half_pitch)
        yield none, "platform_gap", "make it smaller, the platform vanishes"
        none = neck + self.mouth_clearance >= self.rim_radius * sin(self.half_pitch)
        yield none, "mouth_clearance", "make it smaller, the post vanishes"
        yield self.fillet_height >= self.blade_length, "fillet_height", "make it smaller than blade_length"

    def define_sector(self) -> tuple[FeModel, JointDefinition]:
        """As `SectorParameters.define_sector`.

        The retainer is a spring on the mean axial relative displacement: the slot holds the root along its axis by
        friction alone. Once every pair slips at some time of the period, vibration carries the root along. Under a
        travelling wave it walks, and without a retainer there is no periodic state (measured: at the resonance of nodal
        diameter 3 and 0.5 N of excitation a force of about 100 N holds it). At nodal diameter 0 nothing but unequal
        wear drives it, by 1e-7 of the friction: its mean position is not determined (`solver.wear.jump`).
        """
        self.check()
        m, material = self.mesh, self.material
        bodies = [(_disk_blocks(self), ("disk",) * 3, material), (_blade_blocks(self), ("blade",) * 3, material)]
        solid, (web, post_right, post_left, blade, *_) = mesh_of_bodies(bodies)
        # Coincident nodes, from the leading to the trailing edge, then from the inner to the outer end. Above the slot
        # bottom and above the root bottom there are m rows of elements before the flank begins.
        flank = slice(m, 2 * m + 1)
        disk_flanks = [post_right[flank, 0].T.ravel(), post_left[flank, -1].T.ravel()]
        blade_flanks = [blade[flank, -1].T.ravel(), blade[flank, 0].T.ravel()]
        contacts = tuple(
            ContactSurfaces(
                surface_of_nodes(solid, f"{name} of the blade", moving),
                surface_of_nodes(solid, f"{name} of the disk", opposite),
                label=name,
            )
            for name, moving, opposite in zip(("intrados", "extrados"), blade_flanks, disk_flanks, strict=True)
        )
        # The number of axial stations is even: mid-chord lies halfway between the two middle ones.
        n_across, n_axial = blade[-1].shape
        middle = blade[-1][n_across // 2, n_axial // 2 - 1 : n_axial // 2 + 1]
        tip = middle, _chord_directions(self.tip_stagger)[1]
        left = np.concatenate([web[:, 0], post_left[1:, 0]]).ravel()
        right = np.concatenate([web[:, -1], post_right[1:, -1]]).ravel()
        pairs = build_contact_pairs(solid, contacts, AXIS)
        pairs = _arranged(pairs, np.concatenate(blade_flanks), solid.n_nodes)
        usual = _TRAVELLING_RETAINER if self.nodal_diameter > 0 else 0.0
        retainer = Retainer(usual if self.retention_stiffness is None else self.retention_stiffness, AXIS)
        return self.sector_of(solid, contacts, web[0].ravel(), (left, right), tip, retainer, pairs)


def _arranged(pairs: ContactPairs, flanks: IntArray, n_nodes: int) -> ContactPairs:
    """Pairs in the order of the flanks' nodes, second tangents outwards: frames of both flanks mirror each other."""
    place = np.empty(n_nodes, dtype=np.int64)
    place[pairs.moving] = np.arange(pairs.n_contact)
    ordered = pairs.chosen(place[flanks])
    frames: FloatArray = ordered.frames.copy()
    frames[:, 2] *= np.sign(frames[:, 2, :1])
    return replace(ordered, frames=frames)


def _axial_stations(p: Parameters) -> FloatArray:
    """Axial stations, -1/2 to 1/2 of the width."""
    return np.linspace(-0.5, 0.5, 4 * p.mesh)


def _disk_width(p: Parameters, radius: FloatArray) -> FloatArray:
    """Axial width of the disk at each radius, m: hub, web and rim with half-cosine transitions."""
    stations = [p.hub_radius, p.web_inner_radius, p.web_outer_radius, p.rim_inner_radius]
    phase = np.interp(radius, stations, [0.0, pi, pi, 2.0 * pi])
    outer = np.where(radius < p.web_outer_radius, p.hub_width, p.rim_width)
    return np.asarray(p.web_width + (outer - p.web_width) * 0.5 * (1.0 + np.cos(phase)))


def _disk_blocks(p: Parameters) -> list[FloatArray]:
    """Web below the slot, post at y > 0, post at y < 0; grids (radial, tangential, axial)."""
    m = p.mesh
    bottom_x, bottom_y = p.flank_bottom
    slot_angle = asin(bottom_y / p.slot_bottom_radius)
    mouth_y = p.flank_top_half_width + p.mouth_clearance
    wall = [
        (p.slot_bottom_radius * cos(slot_angle), bottom_y),
        (bottom_x, bottom_y),
        (p.flank_top_radius, p.flank_top_half_width),
        (sqrt(p.rim_radius**2 - mouth_y**2), mouth_y),
    ]
    wall_x, wall_y = (graded([point[axis] for point in wall], [m, m, m]) for axis in (0, 1))
    post_angles = np.stack([np.linspace(atan2(y, x), p.half_pitch, m + 1) for x, y in zip(wall_x, wall_y, strict=True)])
    post_radii = np.array([hypot(x, y) for x, y in zip(wall_x, wall_y, strict=True)])
    web = [
        p.bore_radius,
        p.hub_radius,
        p.web_inner_radius,
        p.web_outer_radius,
        p.rim_inner_radius,
        p.slot_bottom_radius,
    ]
    radii = graded(web, [max(1, m // 2), 2 * m, 2 * m, 2 * m, max(1, m // 2)])
    # as across the root: elements even in number, so that there are nodes in the middle plane
    slot_angles = np.linspace(-slot_angle, slot_angle, 2 * (m // 2) + 3)
    angles = np.concatenate([-post_angles[0, :0:-1], slot_angles, post_angles[0, 1:]])
    return [
        block_of(each[:, None], around, _disk_width(p, each)[:, None] * _axial_stations(p))
        for each, around in ((radii, angles), (post_radii, post_angles), (post_radii, -post_angles[:, ::-1]))
    ]


def _blade_blocks(p: Parameters) -> list[FloatArray]:
    """Root, neck and blade in one; platform at y > 0; platform at y < 0; grids (radial, tangential, axial)."""
    m, neck = p.mesh, p.flank_top_half_width
    bottom_x, bottom_y = p.flank_bottom
    platform_top = p.platform_radius + p.platform_thickness
    spans = [m, m, m, max(1, m // 2)]
    root_bottom = p.slot_bottom_radius + p.root_clearance
    x = graded([root_bottom, bottom_x, p.flank_top_radius, p.platform_radius, platform_top], spans)
    half_width = graded([bottom_y - p.root_clearance, bottom_y, neck, neck, neck], spans)
    across = np.linspace(-1.0, 1.0, 2 * (m // 2) + 3)
    root = _flat_grid(p, x, half_width[:, None] * across)
    heights = graded([0.0, p.fillet_height, p.blade_length], [max(2, m), 12 * m])[1:]
    airfoil = np.stack([_airfoil_section(p, height, across) for height in heights])
    rows = x[-1 - spans[-1] :]
    edge = rows * tan(p.half_pitch) - 0.5 * p.platform_gap / cos(p.half_pitch)
    overhang = np.linspace(np.full(len(rows), neck), edge, m + 1, axis=1)
    return [np.concatenate([root, airfoil]), _flat_grid(p, rows, overhang), _flat_grid(p, rows, -overhang[:, ::-1])]


def _flat_grid(p: Parameters, x: FloatArray, y: FloatArray) -> FloatArray:
    """Prismatic grid of points (n_rows, n_columns, n_axial, 3) from x (n_rows,) and y (n_rows, n_columns)."""
    parts = x[:, None, None], y[..., None], p.rim_width * _axial_stations(p)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _chord_directions(stagger_degrees: float) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,): along the chord to the trailing edge, and perpendicular to it, to the intrados."""
    angle = radians(stagger_degrees)
    return np.array([0.0, -sin(angle), cos(angle)]), np.array([0.0, cos(angle), sin(angle)])


def _airfoil_section(p: Parameters, height: float, across: FloatArray) -> FloatArray:
    """Points (n_thickness, n_axial, 3) of the section at a height above the platform.

    Chord, thicknesses and stagger vary linearly from foot to tip. Over the fillet the section blends quadratically from
    the rectangle of the neck to the airfoil.
    """
    share = height / p.blade_length
    chord = p.root_chord + share * (p.tip_chord - p.root_chord)
    thickness = p.root_thickness + share * (p.tip_thickness - p.root_thickness)
    along, normal = _chord_directions(p.root_stagger + share * (p.tip_stagger - p.root_stagger))
    stations = _axial_stations(p)
    edge = p.root_edge_thickness + share * (p.tip_edge_thickness - p.root_edge_thickness)
    profile = edge + (1.0 - edge) * (1.0 - (2.0 * stations) ** 2)
    half = 0.5 * thickness * profile[None, :, None]
    airfoil = chord * stations[None, :, None] * along + half * across[:, None, None] * normal
    rectangle = np.zeros_like(airfoil)
    rectangle[..., 1] = p.flank_top_half_width * across[:, None]
    rectangle[..., 2] = p.rim_width * stations
    blend = max(0.0, 1.0 - height / p.fillet_height) ** 2
    section = blend * rectangle + (1.0 - blend) * airfoil
    section[..., 0] = p.platform_radius + p.platform_thickness + height
    return section
