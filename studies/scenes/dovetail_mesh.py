"""Mesh of the dovetail sector: blocks of the disk and of the blade, whose points on the two flanks coincide.

Cross-sections lie in the plane x (radius along the centre line), y (tangential); all parts have the same number of
axial stations from z < 0 (leading edge) to z > 0. Mesh density m gives 4 m axial x (m + 1) nodes on a flank.
"""

from __future__ import annotations

from math import asin, atan2, cos, hypot, pi, radians, sin, sqrt, tan

import numpy as np

from solver.model import FloatArray
from studies.scenes.dovetail_parameters import Parameters
from studies.scenes.sector import graded


def _across(density: int) -> int:
    """Number of elements across the root and the slot; even, so that there are nodes in the middle plane."""
    return 2 * (density // 2 + 1)


def _axial_stations(parameters: Parameters) -> FloatArray:
    """Axial stations, -1/2 to 1/2 of the width."""
    return np.linspace(-0.5, 0.5, 4 * parameters.mesh)


def _disk_width(parameters: Parameters, radius: FloatArray) -> FloatArray:
    """Axial width of the disk at each radius, m: hub, web and rim with half-cosine transitions."""
    p = parameters
    stations = [p.hub_radius, p.web_inner_radius, p.web_outer_radius, p.rim_inner_radius]
    phase = np.interp(radius, stations, [0.0, pi, pi, 2.0 * pi])
    outer = np.where(radius < p.web_outer_radius, p.hub_width, p.rim_width)
    return np.asarray(p.web_width + (outer - p.web_width) * 0.5 * (1.0 + np.cos(phase)))


def disk_blocks(parameters: Parameters) -> list[FloatArray]:
    """Web below the slot, post at y > 0, post at y < 0; grids (radial, tangential, axial)."""
    p, m = parameters, parameters.mesh
    half_pitch = p.half_pitch
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
    post_angles = np.stack([np.linspace(atan2(y, x), half_pitch, m + 1) for x, y in zip(wall_x, wall_y, strict=True)])
    post_radii = np.array([hypot(x, y) for x, y in zip(wall_x, wall_y, strict=True)])
    radii = graded(
        [p.bore_radius, p.hub_radius, p.web_inner_radius, p.web_outer_radius, p.rim_inner_radius, p.slot_bottom_radius],
        [max(1, m // 2), 2 * m, 2 * m, 2 * m, max(1, m // 2)],
    )
    slot_angles = np.linspace(-slot_angle, slot_angle, _across(m) + 1)
    angles = np.concatenate([-post_angles[0, :0:-1], slot_angles, post_angles[0, 1:]])
    return [
        _disk_grid(p, radii, np.broadcast_to(angles, (len(radii), len(angles)))),
        _disk_grid(p, post_radii, post_angles),
        _disk_grid(p, post_radii, -post_angles[:, ::-1]),
    ]


def _disk_grid(parameters: Parameters, radii: FloatArray, angles: FloatArray) -> FloatArray:
    """Grid of points (n_radii, n_angles, n_axial, 3) from radii (n_radii,) and angles (n_radii, n_angles)."""
    stations = _axial_stations(parameters)
    grid = np.empty((*angles.shape, len(stations), 3))
    grid[..., 0] = (radii[:, None] * np.cos(angles))[..., None]
    grid[..., 1] = (radii[:, None] * np.sin(angles))[..., None]
    grid[..., 2] = (_disk_width(parameters, radii)[:, None] * stations)[:, None, :]
    return grid


def blade_blocks(parameters: Parameters) -> list[FloatArray]:
    """Root, neck and blade in one; platform at y > 0; platform at y < 0; grids (radial, tangential, axial)."""
    p, m = parameters, parameters.mesh
    bottom_x, bottom_y = p.flank_bottom
    neck = p.flank_top_half_width
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


def _flat_grid(parameters: Parameters, x: FloatArray, y: FloatArray) -> FloatArray:
    """Prismatic grid of points (n_rows, n_columns, n_axial, 3) from x (n_rows,) and y (n_rows, n_columns)."""
    stations = _axial_stations(parameters)
    grid = np.empty((*y.shape, len(stations), 3))
    grid[..., 0] = x[:, None, None]
    grid[..., 1] = y[..., None]
    grid[..., 2] = parameters.rim_width * stations
    return grid


def chord_directions(stagger_degrees: float) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,): along the chord to the trailing edge, and perpendicular to it, to the intrados."""
    angle = radians(stagger_degrees)
    return np.array([0.0, -sin(angle), cos(angle)]), np.array([0.0, cos(angle), sin(angle)])


def _airfoil_section(parameters: Parameters, height: float, across: FloatArray) -> FloatArray:
    """Points (n_thickness, n_axial, 3) of the section at a height above the platform, fillet included.

    Chord, thicknesses and stagger vary linearly from foot to tip. Over the fillet the section blends quadratically from
    the rectangle of the neck to the airfoil.
    """
    p = parameters
    share = height / p.blade_length
    chord = p.root_chord + share * (p.tip_chord - p.root_chord)
    thickness = p.root_thickness + share * (p.tip_thickness - p.root_thickness)
    along, normal = chord_directions(p.root_stagger + share * (p.tip_stagger - p.root_stagger))
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
