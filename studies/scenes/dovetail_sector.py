"""One sector of a bladed disk with a dovetail root, from finite elements.

The blade is excited and observed at mid-chord of its tip, perpendicular to the chord, positive to the intrados.

Mesh 1 is for first trials. Its higher frequencies lie up to 7 % above those of mesh 2, the default; those of mesh 3
within 2 %, for five times the computing time.

Displacements of the reduced model: first the relative displacements u_blade - u_disk, then modal coordinates of the
glued sector. Each pair has normal (positive when the pair closes), first tangent (axial, to the trailing edge) and
second tangent (up the flank, outwards). Pairs are numbered intrados first (the flank at y > 0, which leads as the disk
turns about +z), then extrados; from the leading to the trailing edge; from the inner to the outer end.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, cos, hypot, pi, radians, sin, sqrt, tan

import numpy as np

from solver.model import FloatArray, IntArray
from studies.finite_element.joint_model import FeModel, JointDefinition, Retainer
from studies.finite_element.pairing import ContactPairs, ContactSurfaces, build_contact_pairs
from studies.finite_element.surfaces import surface_of_nodes
from studies.scenes.dovetail_parameters import DovetailParameters
from studies.scenes.sector import AXIS, block_of, graded, mesh_of_bodies


class Parameters(DovetailParameters):
    """x is the centre line of the sector, y the tangential direction, z the axis of rotation, to the trailing edge.

    Radii of the dovetail and of the blade are measured along the centre line.
    """

    def define_sector(self) -> tuple[FeModel, JointDefinition]:
        """The sector as a finite-element model, and what is done with it.

        The retainer is a spring on the mean axial relative displacement. A prismatic slot holds the root along its axis
        by friction alone. Once every pair slips at some time of the period, vibration carries the root along. Under a
        travelling wave it walks, and without a retainer there is no periodic state (measured: at the resonance of nodal
        diameter 3 and 0.5 N of excitation a force of about 100 N holds it). At nodal diameter 0 nothing but unequal
        wear drives it one way, by 1e-7 of the friction: its mean position is not determined (`solver.wear.jump`).

        Raises SceneError where the parameters do not go together.
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
        retainer = Retainer(self.retainer, AXIS)
        return self.sector_of(solid, contacts, web[0].ravel(), (left, right), tip, retainer, pairs)


def _arranged(pairs: ContactPairs, flanks: IntArray, n_nodes: int) -> ContactPairs:
    """Pairs in the order of the flanks' nodes, second tangents outwards: frames of both flanks mirror each other."""
    place = np.empty(n_nodes, dtype=np.int64)
    place[pairs.moving] = np.arange(pairs.n_contact)
    ordered = pairs.chosen(place[flanks])
    frames: FloatArray = ordered.frames.copy()
    frames[:, 2] *= np.sign(frames[:, 2, :1])
    return replace(ordered, frames=frames)


def _across(density: int) -> int:
    """Number of elements across the root and the slot; even, so that there are nodes in the middle plane."""
    return 2 * (density // 2 + 1)


def _axial_stations(p: DovetailParameters) -> FloatArray:
    """Axial stations, -1/2 to 1/2 of the width."""
    return np.linspace(-0.5, 0.5, 4 * p.mesh)


def _disk_width(p: DovetailParameters, radius: FloatArray) -> FloatArray:
    """Axial width of the disk at each radius, m: hub, web and rim with half-cosine transitions."""
    stations = [p.hub_radius, p.web_inner_radius, p.web_outer_radius, p.rim_inner_radius]
    phase = np.interp(radius, stations, [0.0, pi, pi, 2.0 * pi])
    outer = np.where(radius < p.web_outer_radius, p.hub_width, p.rim_width)
    return np.asarray(p.web_width + (outer - p.web_width) * 0.5 * (1.0 + np.cos(phase)))


def _disk_blocks(p: DovetailParameters) -> list[FloatArray]:
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
    spans = [m, m, m]
    wall_x, wall_y = (graded([point[axis] for point in wall], spans) for axis in (0, 1))
    post_angles = np.stack([np.linspace(atan2(y, x), p.half_pitch, m + 1) for x, y in zip(wall_x, wall_y, strict=True)])
    post_radii = np.array([hypot(x, y) for x, y in zip(wall_x, wall_y, strict=True)])
    radii = graded(
        [p.bore_radius, p.hub_radius, p.web_inner_radius, p.web_outer_radius, p.rim_inner_radius, p.slot_bottom_radius],
        [max(1, m // 2), 2 * m, 2 * m, 2 * m, max(1, m // 2)],
    )
    slot_angles = np.linspace(-slot_angle, slot_angle, _across(m) + 1)
    angles = np.concatenate([-post_angles[0, :0:-1], slot_angles, post_angles[0, 1:]])
    return [
        block_of(each[:, None], around, _disk_width(p, each)[:, None] * _axial_stations(p))
        for each, around in ((radii, angles), (post_radii, post_angles), (post_radii, -post_angles[:, ::-1]))
    ]


def _blade_blocks(p: DovetailParameters) -> list[FloatArray]:
    """Root, neck and blade in one; platform at y > 0; platform at y < 0; grids (radial, tangential, axial)."""
    m, neck = p.mesh, p.flank_top_half_width
    bottom_x, bottom_y = p.flank_bottom
    platform_top = p.platform_radius + p.platform_thickness
    spans = [m, m, m, max(1, m // 2)]
    root_bottom = p.slot_bottom_radius + p.root_clearance
    x = graded([root_bottom, bottom_x, p.flank_top_radius, p.platform_radius, platform_top], spans)
    half_width = graded([bottom_y - p.root_clearance, bottom_y, neck, neck, neck], spans)
    across = np.linspace(-1.0, 1.0, _across(m) + 1)
    root = _flat_grid(p, x, half_width[:, None] * across)
    heights = graded([0.0, p.fillet_height, p.blade_length], [max(2, m), 12 * m])[1:]
    airfoil = np.stack([_airfoil_section(p, height, across) for height in heights])
    rows = x[-1 - spans[-1] :]
    edge = rows * tan(p.half_pitch) - 0.5 * p.platform_gap / cos(p.half_pitch)
    overhang = np.linspace(np.full(len(rows), neck), edge, m + 1, axis=1)
    return [
        np.concatenate([root, airfoil]),
        _flat_grid(p, rows, overhang),
        _flat_grid(p, rows, -overhang[:, ::-1]),
    ]


def _flat_grid(p: DovetailParameters, x: FloatArray, y: FloatArray) -> FloatArray:
    """Prismatic grid of points (n_rows, n_columns, n_axial, 3) from x (n_rows,) and y (n_rows, n_columns)."""
    stations = _axial_stations(p)
    grid = np.empty((*y.shape, len(stations), 3))
    grid[..., 0] = x[:, None, None]
    grid[..., 1] = y[..., None]
    grid[..., 2] = p.rim_width * stations
    return grid


def _chord_directions(stagger_degrees: float) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,): along the chord to the trailing edge, and perpendicular to it, to the intrados."""
    angle = radians(stagger_degrees)
    return np.array([0.0, -sin(angle), cos(angle)]), np.array([0.0, cos(angle), sin(angle)])


def _airfoil_section(p: DovetailParameters, height: float, across: FloatArray) -> FloatArray:
    """Points (n_thickness, n_axial, 3) of the section at a height above the platform, fillet included.

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
    airfoil = (
        chord * stations[None, :, None] * along
        + 0.5 * thickness * profile[None, :, None] * across[:, None, None] * normal
    )
    rectangle = np.zeros_like(airfoil)
    rectangle[..., 1] = p.flank_top_half_width * across[:, None]
    rectangle[..., 2] = p.rim_width * stations
    blend = max(0.0, 1.0 - height / p.fillet_height) ** 2
    section = blend * rectangle + (1.0 - blend) * airfoil
    section[..., 0] = p.platform_radius + p.platform_thickness + height
    return section
