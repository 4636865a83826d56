"""Displacements of the surface of an elastic half-space under uniform tractions on strips and rectangles.

Both bodies are taken together: all compliances are of the relative displacement of two half-spaces of one material, so
that normal tractions cause no tangential displacement and the other way round (Johnson, Contact Mechanics, 1985,
sections 2.6, 3.2, 3.6).
"""

from __future__ import annotations

import numpy as np

from solver.model import FloatArray


def composite_modulus(young: float, poisson: float) -> float:
    """E*, Pa, of two half-spaces of one material: `1 / E* = 2 (1 - nu^2) / E`."""
    return young / (2.0 * (1.0 - poisson**2))


def strip_compliance(edges: FloatArray, modulus: float, length: float, depth: float) -> FloatArray:
    """Displacements at the middles of strips under unit forces spread over them, (n, n), m/N, in plane strain.

    A strip stands for itself and its image in the plane x = 0, which carries half of the force.

    A displacement of a half-plane needs a place to refer to: that of a line force is `2 / (pi E*) ln(depth / distance)`
    times the force per length. Normal displacement under a normal force, or tangential under a tangential one: both are
    the same.

    Parameters
    ----------
    edges
        (n + 1,), m, ascending from 0 or above.
    modulus
        E*, Pa.
    length
        Of the strips, m, which carries the force.
    depth
        m; more than the width of all strips, so that the compliance is positive definite.
    """
    middle = 0.5 * (edges[1:] + edges[:-1])
    whole = np.zeros((middle.size, middle.size))
    for side in (edges, -edges[::-1]):
        from_edge = middle[:, None] - side[None, :]
        # antiderivative of ln(depth / |t|)
        spread = from_edge * (1.0 - np.log(np.abs(from_edge) / depth))
        strips = spread[:, :-1] - spread[:, 1:]
        whole += 0.5 * (strips if side is edges else strips[:, ::-1])
    compliance = 2.0 / (np.pi * modulus * length) * whole / np.diff(edges)[None, :]
    return np.asarray(0.5 * (compliance + compliance.T))


def patch_compliance(position: FloatArray, width: float, young: float, poisson: float) -> tuple[FloatArray, FloatArray]:
    """Displacements at the middles of square patches under unit forces spread over them and over their mirror images.

    A patch stands for itself and its images in the planes x = 0 and y = 0, which carry a quarter of the force each.
    Normal tractions cause normal displacements (Love 1929); tractions along x displacements along x, for which those
    along y are left out, as in the theory of Cattaneo and Mindlin.

    Parameters
    ----------
    position
        (n, 2), m, middles in the quadrant x, y > 0.
    width
        Of a patch, m.
    young, poisson
        E, Pa, and nu of both bodies.

    Returns
    -------
    tuple of arrays
        Normal and tangential compliance, (n, n), m/N.
    """
    over_r, over_r3 = np.zeros((2, len(position), len(position)))
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        x, y = (position[:, None, axis] - signs[axis] * position[None, :, axis] for axis in (0, 1))
        for end_x, sign_x in ((0.5, 1.0), (-0.5, -1.0)):
            for end_y, sign_y in ((0.5, 1.0), (-0.5, -1.0)):
                one, two = x + end_x * width, y + end_y * width
                # integrals of 1 / r and of x^2 / r^3
                by_y, by_x = two * np.arcsinh(one / np.abs(two)), one * np.arcsinh(two / np.abs(one))
                over_r += 0.25 * sign_x * sign_y * (by_y + by_x)
                over_r3 += 0.25 * sign_x * sign_y * by_y
    shear = young / (2.0 * (1.0 + poisson))
    normal = over_r / (np.pi * composite_modulus(young, poisson) * width**2)
    tangential = ((1.0 - poisson) * over_r + poisson * over_r3) / (np.pi * shear * width**2)
    return 0.5 * (normal + normal.T), 0.5 * (tangential + tangential.T)
