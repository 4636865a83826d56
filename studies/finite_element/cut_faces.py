"""Cut faces of a cyclic sector: nodes that are images of each other under rotation by one sector."""

import cmath
from dataclasses import dataclass

import numpy as np
import scipy  # whose parts are loaded at their first use
from scipy import sparse

from solver.model import FloatArray, IntArray
from studies.finite_element.solid_mesh import SolidMesh
from studies.scene_error import SceneError

_SAME = 1e-3  # distance of two nodes that are images, over the distance of neighbouring nodes on the face
_ANGLE = 0.02  # of a sector, by which the cut faces may be apart more or less before their nodes are looked at
_EXTENT = 1e-6  # the same over the extent of the mesh, where all faces are looked through


def turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation (3, 3) about a unit vector (3,) by an angle in rad (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


@dataclass(frozen=True)
class CyclicAxis:
    """n_sectors: in the whole. point (3,): on the axis, m. axis (3,): unit vector."""

    n_sectors: int
    point: FloatArray
    axis: FloatArray

    def turned(self, points: FloatArray, sectors: int) -> FloatArray:
        """Points (n, 3), m, turned by a number of sectors about the axis, against the clock as seen from its end."""
        return np.asarray(self.point + (points - self.point) @ self.pitch(sectors).T)

    def pitch(self, sectors: int = 1) -> FloatArray:
        """Rotation (3, 3) by a number of sectors."""
        return turn_about(self.axis, 2.0 * np.pi * sectors / self.n_sectors)

    def cylinder(self, coordinates: FloatArray) -> FloatArray:
        """Radius, m, angle, rad, and height, m (n, 3), of points (n, 3)."""
        start = np.eye(3)[np.argmin(np.abs(self.axis))]
        first = start - (start @ self.axis) * self.axis
        first /= np.linalg.norm(first)
        second = np.cross(self.axis, first)
        arms = coordinates - self.point
        x, y = arms @ first, arms @ second
        return np.stack([np.hypot(x, y), np.arctan2(y, x), arms @ self.axis], axis=1)


@dataclass(frozen=True)
class CutFaces:
    """left, right (n,): nodes, each right one the image of the left one under the rotation by one sector.

    `u_right = phase * rotation @ u_left` for a wave that goes round in the sense of the axis. There are none where
    sectors meet in contact alone.
    """

    axis: CyclicAxis
    left: IntArray
    right: IntArray

    def across(self, sectors: IntArray, nodal_diameter: int) -> sparse.bsr_matrix:
        """Factors (3 n, 3 n) from displacements of points (n,) in this sector to those of their images.

        sectors (n,): how far the images are from this sector. nodal_diameter: k in 0..n_sectors // 2; the phase
        `exp(i 2 pi k / N)` is real at both ends.
        """
        n = self.axis.n_sectors
        phase = {0: 1.0, n / 2: -1.0}.get(nodal_diameter, cmath.exp(2j * np.pi * nodal_diameter / n))
        steps, which = np.unique(sectors, return_inverse=True)
        blocks = np.array([phase ** int(each) * self.axis.pitch(int(each)) for each in steps])
        each = np.arange(len(sectors) + 1)
        return sparse.bsr_matrix((blocks[which], each[:-1], each))


def match_cut_faces(mesh: SolidMesh, axis: CyclicAxis, first: IntArray, second: IntArray) -> CutFaces:
    """Cut faces from the nodes (n,) of both, in any order; which one is left is found.

    Raises SceneError where the faces are not one sector apart, or nodes have no image.
    """
    angle, coordinates = 2.0 * np.pi / axis.n_sectors, mesh.coordinates
    cylinder = axis.cylinder(coordinates)
    apart = _mean_angle(cylinder[second]) - _mean_angle(cylinder[first])
    apart = (apart + np.pi) % (2.0 * np.pi) - np.pi
    if axis.n_sectors > 2 and abs(abs(apart) - angle) > _ANGLE * angle:
        found = f"cut faces are {abs(np.degrees(apart)):.4g} degrees apart, {axis.n_sectors} sectors need"
        remedy = "give the number of sectors and the axis of the mesh"
        raise SceneError("n_sectors", f"{found} {np.degrees(angle):.4g}", remedy)
    left, right = (first, second) if apart > 0.0 else (second, first)
    spacing = scipy.spatial.cKDTree(coordinates[left]).query(coordinates[left], k=2)[0][:, 1]
    tolerance = _SAME * (np.median(spacing) if len(left) > 1 else np.ptp(coordinates, axis=0).max())
    image = _images(mesh, axis, left, right, float(tolerance))
    for lonely, other in ((left[image < 0], right), (np.setdiff1d(right, image), left)):
        if len(lonely):
            some = ", ".join(str(number) for number in mesh.numbers[lonely[:5]]) + (", ..." if len(lonely) > 5 else "")
            found = f"{len(lonely)} nodes of one cut face have no image among the {len(other)} of the other: {some}"
            raise SceneError("cut_faces", found, "mesh both cut faces alike, and give all their nodes")
    return _cut_faces(mesh, axis, left, image)


def find_cut_faces(mesh: SolidMesh, axis: CyclicAxis, in_contact: IntArray) -> CutFaces:
    """Cut faces from the mesh alone: all nodes with an image under rotation by one sector.

    in_contact (m,): nodes that touch the next sector. Raises SceneError where there is no image and no such node.
    """
    extent = float(np.ptp(mesh.coordinates, axis=0).max())
    elsewhere = np.setdiff1d(np.arange(mesh.n_nodes), in_contact)
    image = _images(mesh, axis, elsewhere, elsewhere, _EXTENT * extent)
    if (image < 0).all() and len(in_contact) == 0:
        none = f"no node has an image under rotation by {360.0 / axis.n_sectors:.4g} degrees, one of"
        remedy = "give the number of sectors and the axis of the mesh, or the sets of both cut faces"
        raise SceneError("n_sectors", f"{none} {axis.n_sectors} sectors", remedy)
    return _cut_faces(mesh, axis, elsewhere[image >= 0], image[image >= 0])


def _images(mesh: SolidMesh, axis: CyclicAxis, left: IntArray, right: IntArray, tolerance: float) -> IntArray:
    """Of each left node (n,) the right one of its body that it turns into, -1 where none is in the tolerance, m."""
    turned, bodies = axis.turned(mesh.coordinates[left], 1), mesh.bodies
    image = np.full(len(left), -1)
    for place, found in enumerate(scipy.spatial.cKDTree(mesh.coordinates[right]).query_ball_point(turned, tolerance)):
        candidates = right[found]
        if len(candidates) > 1:
            candidates = candidates[bodies[candidates] == bodies[left[place]]]
        if len(candidates) > 1:
            one, other = mesh.numbers[candidates[:2]]
            several = f"node {mesh.numbers[left[place]]} has {len(candidates)} images on the other cut face, as nodes"
            raise SceneError("cut_faces", f"{several} {one} and {other}", "merge nodes of one body that coincide")
        if len(candidates) == 1:
            image[place] = candidates[0]
    return image


def _mean_angle(cylinder: FloatArray) -> float:
    """Mean angle, rad, weighted by the radius, so that nodes near the axis do not count."""
    radius, angle, _ = cylinder.T
    return float(np.angle((radius * np.exp(1j * angle)).sum()))


def _cut_faces(mesh: SolidMesh, axis: CyclicAxis, left: IntArray, right: IntArray) -> CutFaces:
    if len(both := np.intersect1d(left, right)):
        found = f"{len(both)} nodes are on both cut faces, as node {mesh.numbers[both[0]]}"
        raise SceneError("cut_faces", found, "a sector must not reach the axis, nor be the whole ring")
    return CutFaces(axis, left, right)
