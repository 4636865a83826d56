"""Contact of a cylinder or a sphere with a flat: pressure, stick zone, and what partial slip wears in the end.

Half-spaces of one material with the composite modulus E* (Johnson, Contact Mechanics, 1985, sections 4.2, 7.2). Worn to
the end (Ciavarella and Hills 1999 for the line contact, Popov 2014 for the point contact), the stick zone, which never
moves, carries all, and the overlap of the bodies beside it has gone.
"""

from __future__ import annotations

import numpy as np

from solver.model import FloatArray

_FARTHEST = 20.0
"""Of the contact: beyond what slip up to 0.9999 of sliding wears."""


def line_half_width(load: float, radius: float, modulus: float) -> float:
    """Half-width a, m, of a line contact: `a^2 = 4 P R / (pi E*)`. load: N/m. radius: m. modulus: E*, Pa."""
    return float(np.sqrt(4.0 * load * radius / (np.pi * modulus)))


def point_radius(load: float, radius: float, modulus: float) -> float:
    """Radius a, m, of a point contact: `a^3 = 3 P R / (4 E*)`. load: N. radius: m. modulus: E*, Pa."""
    return float(np.cbrt(0.75 * load * radius / modulus))


def line_stick_width(half_width: float, share: float) -> float:
    """Half-width c, m, of the stick zone under a share Q / (mu P) of the force that slides: `c = a sqrt(1 - share)`."""
    return float(half_width * np.sqrt(1.0 - share))


def point_stick_radius(contact_radius: float, share: float) -> float:
    """Radius c, m, of the stick zone under a share Q / (mu P) of the force that slides: `c = a cbrt(1 - share)`."""
    return float(contact_radius * np.cbrt(1.0 - share))


def line_stick_under_stroke(
    stroke: float, friction_coefficient: float, load: float, half_width: float, modulus: float, depth: float
) -> float:
    """Half-width c, m, of the stick zone of a line contact whose body moves by +- stroke, m; 0 where all of it slides.

    `stroke = mu (d(P, a) - d(P_c, c))` with `P_c = P (c/a)^2` and the approach
    `d(P, a) = 2 P / (pi E*) (ln(2 depth / a) + 1/2)`, depth, m, being what displacements refer to. load: N/m.
    """
    c = half_width * np.linspace(0.0, 1.0, 2001)[1:]
    approach = 2.0 * load / (np.pi * modulus) * (c / half_width) ** 2 * (np.log(2.0 * depth / c) + 0.5)
    motion = friction_coefficient * (approach[-1] - approach)
    return float(np.interp(-stroke, -motion, c, left=0.0))


def point_stick_under_stroke(
    stroke: float, friction_coefficient: float, load: float, radius: float, young: float, poisson: float
) -> float:
    """The same of a point contact of this radius, m, load in N: `stroke = 3 mu P (2 - nu) / (8 a G) (1 - (c/a)^2)`."""
    shear = young / (2.0 * (1.0 + poisson))
    slides = 3.0 * friction_coefficient * load * (2.0 - poisson) / (8.0 * radius * shear)
    return float(radius * np.sqrt(max(1.0 - stroke / slides, 0.0))) if slides > 0.0 else 0.0


def line_worn_depth(x: FloatArray, radius: float, half_width: float, stick_width: float) -> FloatArray:
    """Depth W, m, of both bodies at distances x, m, from the middle where partial slip has worn all that it can.

    `W = (1/2R) [a^2 arccosh(|x|/c) - |x| sqrt(x^2 - c^2)]` between the stick zone and where the bodies part, else 0.
    """
    away = np.maximum(np.abs(x), stick_width)
    overlap = half_width**2 * np.arccosh(away / stick_width) - away * np.sqrt(away**2 - stick_width**2)
    return np.asarray(np.maximum(overlap, 0.0) / (2.0 * radius))


def point_worn_depth(r: FloatArray, radius: float, contact_radius: float, stick_radius: float) -> FloatArray:
    """The same of a sphere, at distances r, m, from the axis (method of dimensionality reduction).

    `W = [r^2 arcsin(c/r) - c sqrt(r^2 - c^2)] / (pi R) + (2 d / pi) arccos(c/r) - r^2 / (2 R)` with the approach
    `d = 2 a^3 / (3 R c) + c^2 / (3 R)`.
    """
    c = stick_radius
    away = np.maximum(np.abs(r), c)
    approach = 2.0 * contact_radius**3 / (3.0 * radius * c) + c**2 / (3.0 * radius)
    profile = (away**2 * np.arcsin(c / away) - c * np.sqrt(away**2 - c**2)) / (np.pi * radius)
    overlap = profile + 2.0 * approach / np.pi * np.arccos(c / away) - away**2 / (2.0 * radius)
    return np.asarray(np.where(np.abs(r) > c, np.maximum(overlap, 0.0), 0.0))


def line_worn_edge(half_width: float, stick_width: float) -> float:
    """Half-width b, m, over which the bodies lie on each other where all has worn that can: the last depth above 0."""
    x = np.linspace(half_width, _FARTHEST * half_width, 10001)
    return float(x[line_worn_depth(x, 1.0, half_width, stick_width) > 0.0][-1])


def point_worn_edge(contact_radius: float, stick_radius: float) -> float:
    """Radius b, m, of the same of a sphere."""
    r = np.linspace(contact_radius, _FARTHEST * contact_radius, 10001)
    return float(r[point_worn_depth(r, 1.0, contact_radius, stick_radius) > 0.0][-1])
