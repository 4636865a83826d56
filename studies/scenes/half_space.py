"""Two elastic half-spaces of one material that touch: their compliances, the reduced model, and room for wear.

Compliances are of the relative displacement of both bodies under uniform tractions on strips and rectangles, so that
normal tractions cause no tangential displacement and the other way round (Johnson, Contact Mechanics, 1985, sections
2.6, 3.2, 3.6).

Under gross slip the scar grows beyond the unworn contact, without end. Worn flat, a body of radius R lies on the other
over a half-width b: wear has removed a segment of area `2 b^3 / (3 R)` of a cylinder, a cap of volume `pi b^4 / (4 R)`
of a sphere, and its depth is `b^2 / (2 R)`. By Archard's law the volume is at most `4 k_w N P s` after N cycles of
stroke s under the force P.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.model import BoolArray, ContactInterface, FloatArray, LinearModel, ReducedModel

_HOLDER = 1e-9  # stiffness that holds the body over that of the contact: no result changes by more
_MARGIN = 1.1
"""Over b from volume and unworn contact, `b^3 = a^3 + 3 R A / 2` or `b^4 = a^4 + 4 R V / pi`. Measured with uniform
slip: up to 5 a the scar is 0.93 to 1.041 times that wide; from the depth, `b^2 = a^2 + 2 R W`, 0.90 to 1.012 times."""


def composite_modulus(young: float, poisson: float) -> float:
    """E*, Pa, of two half-spaces of one material: `1 / E* = 2 (1 - nu^2) / E`."""
    return young / (2.0 * (1.0 - poisson**2))


def strip_compliance(edges: FloatArray, modulus: float, length: float, depth: float) -> FloatArray:
    """Displacements at the middles of strips under unit forces spread over them, (n, n), m/N, in plane strain.

    A strip stands for itself and its image in the plane x = 0, which carries half of the force. Normal displacements
    under normal forces and tangential ones under tangential forces are the same. They refer to a depth, m, more than
    the width of all strips: that of a line force is `2 / (pi E*) ln(depth / distance)` times the force per length.
    edges (n + 1,): m, ascending from 0 or above. modulus: E*, Pa. length: of the strips, m.
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
    """Normal and tangential displacements at the middles of square patches under unit forces spread over them, m/N.

    A patch stands for itself and its images in the planes x = 0 and y = 0, which carry a quarter of the force each.
    Normal tractions cause normal displacements (Love 1929); tractions along x displacements along x, for which those
    along y are left out, as in the theory of Cattaneo and Mindlin.

    position (n, 2): m, middles in the quadrant x, y > 0. width: of a patch, m. young, poisson: E, Pa, and nu of both
    bodies.
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


def press_body(
    compliance: tuple[FloatArray, FloatArray],
    contact: ContactInterface,
    load: float,
    force: float | None,
    stroke: float | None,
    name: str,
) -> ReducedModel:
    """Reduced model; displacements are u_N of all pairs, u_T of all pairs, d, and where a force moves the body, s.

    A stroke moves the body whatever force it takes: the motion s is then no unknown, and `C_T^-1 s` a load on u_T.

    With the contact forces lambda of the pairs (N, compression positive), the approach d of the body and its tangential
    motion s, the relative displacements are `u_N = d - C_N lambda_N`, `u_T = s - C_T lambda_T`. So the stiffnesses are
    the inverse compliances, between the pairs and the one displacement that moves them all. There is no mass: all is
    quasi-static, and the frequency is that of the load alone.

    compliance: normal and tangential one, (n_contact, n_contact), m/N. load: normal force, N. force, stroke: amplitude
    of the tangential force, N, or of the motion, m, per unit of excitation amplitude; the other is None. name: of the
    response under a force, which is s. Under a stroke it is u_T of the pair nearest to the middle, "slip".
    """
    n = contact.n_contact
    normal, tangential = (np.asarray(np.linalg.inv(each), np.float64) for each in compliance)
    moved = force is not None
    stiffness = np.zeros((2 * n + 1 + moved, 2 * n + 1 + moved))
    _join(stiffness, np.arange(n), 2 * n, normal)
    load_static, load_harmonic = np.zeros((2, len(stiffness)))
    load_static[2 * n] = load
    response = np.zeros((1, len(stiffness)))
    if force is not None:
        _join(stiffness, np.arange(n, 2 * n), 2 * n + 1, tangential)
        load_harmonic[2 * n + 1] = force
        response[0, 2 * n + 1] = 1.0
    else:
        assert stroke is not None
        stiffness[n : 2 * n, n : 2 * n] = 0.5 * (tangential + tangential.T)
        load_harmonic[n : 2 * n] = stroke * tangential.sum(axis=1)
        response[0, n + int(np.argmin(np.linalg.norm(contact.position, axis=1)))] = 1.0
    linear = LinearModel(
        mass=np.zeros_like(stiffness),
        damping=np.zeros_like(stiffness),
        stiffness=stiffness,
        load_static=load_static,
        load_harmonic=load_harmonic.astype(np.complex128),
        response=response,
    )
    return ReducedModel({0: linear}, contact, (name if moved else "slip",))


def _join(stiffness: FloatArray, pairs: np.ndarray, body: int, joint: FloatArray) -> None:
    """Add the energy of the differences between one displacement of the body and those of the pairs, in place."""
    joint = 0.5 * (joint + joint.T)
    stiffness[np.ix_(pairs, pairs)] = joint
    stiffness[pairs, body] = stiffness[body, pairs] = -joint.sum(axis=1)
    stiffness[body, body] = (1.0 + _HOLDER) * joint.sum()


def pairs_of_patches(
    position: FloatArray, area: FloatArray, gap: FloatArray, surface: str, edge: BoolArray
) -> ContactInterface:
    """Pairs with a closing and one tangential displacement; position (n_contact, 3), m, area, m2, and gap, m.

    edge (n_contact,): those beside which the half-spaces go on without pairs.
    """
    n = len(area)
    dofs = np.stack([np.arange(n), np.arange(n, 2 * n), np.full(n, -1)], axis=1)
    return ContactInterface(dofs, area, gap, np.zeros(n), position, (surface,) * n, edge=edge)


@dataclass(frozen=True)
class ExpectedWear:
    """What a study wears at most.

    amplitude: largest excitation amplitude. per_slip_work: largest `k_w N`, m3/J: volume worn over slip work of a
    cycle; inf where cycles have no end. volume, m3, and depth, m: at which the wear ends, inf where they end nothing.
    """

    amplitude: float
    per_slip_work: float
    volume: float = math.inf
    depth: float = math.inf


@dataclass(frozen=True)
class Scar:
    """Half-width of a worn contact, m. radius: R, m. contact: a, m, of the unworn one.

    exponent, form: n and c of `b^n = a^n + c R V`.
    """

    radius: float
    contact: float
    exponent: int
    form: float

    def half_width(self, volume: float, depth: float) -> float:
        """Where both volume, m3, and depth, m, are at most these: with a margin; inf where neither has an end."""
        n = self.exponent
        by_volume = math.pow(self.contact**n + self.form * self.radius * volume, 1.0 / n)
        by_depth = math.sqrt(self.contact**2 + 2.0 * self.radius * depth)
        return _MARGIN * min(by_volume, by_depth)


def round_up(width: float) -> float:
    """To three digits, as a study shows it."""
    unit = 10.0 ** (math.floor(math.log10(width)) - 2)
    return float(f"{math.ceil(width / unit * (1.0 - 1e-9)) * unit:.6g}")
