"""Two elastic half-spaces of one material that touch: their compliances, the reduced model, and room for wear.

Compliances are of the relative displacement of both bodies under uniform tractions on strips and rectangles, so that
normal tractions cause no tangential displacement and the other way round (Johnson, Contact Mechanics, 1985, sections
2.6, 3.2, 3.6).

Under gross slip the scar grows without end. Worn flat, a body of radius R lies on the other over a half-width b: wear
has removed a segment of area `2 b^3 / (3 R)` of a cylinder, a cap of volume `pi b^4 / (4 R)` of a sphere, and its depth
is `b^2 / (2 R)`. By Archard's law the volume is at most `4 k_w N P s` after N cycles of stroke s under the force P.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from solver.model import BoolArray, ContactInterface, FloatArray, LinearModel, ReducedModel
from studies.scene import ExpectedWear, Metre, Pascal, Scene
from studies.scene_error import SceneError

_FARTHEST = 20.0  # of the contact: beyond what slip up to 0.9999 of sliding wears
_HOLDER = 1e-9  # stiffness that holds the body over that of the contact: no result changes by more
_SHEAR = 3e-4  # of a prescribed sliding: the bodies still shear by it. Measured: with 3e-7 a history is uncertain
_MARGIN = 1.1
"""Over b from volume and unworn contact, `b^3 = a^3 + 3 R A / 2` or `b^4 = a^4 + 4 R V / pi`. Measured with uniform
slip: up to 5 a the scar is 0.93 to 1.041 times that wide; from the depth, `b^2 = a^2 + 2 R W`, 0.90 to 1.012 times."""


def composite_modulus(young: float, poisson: float) -> float:
    """E*, Pa, of two half-spaces of one material: `1 / E* = 2 (1 - nu^2) / E`."""
    return young / (2.0 * (1.0 - poisson**2))


def strip_compliance(edges: FloatArray, modulus: float, length: float, depth: float) -> FloatArray:
    """Displacements at the middles of strips under unit forces spread over them, (n, n), m/N, in plane strain.

    Normal ones under normal forces, tangential ones under tangential forces. A strip stands for itself and its image in
    the plane x = 0, which carries half of the force. Displacements refer to a depth, m, more than the width of all
    strips: that of a line force is `2 / (pi E*) ln(depth / distance)` times the force per length.
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
    Normal displacements by Love (1929); tractions along x move along x alone, as Cattaneo and Mindlin have it.
    position (n, 2): m, middles in the quadrant x, y > 0. width: of a patch, m. young, poisson: E, Pa, and nu.
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


def worn_edge(worn_depth: Callable[..., FloatArray], contact: float, stick: float) -> float:
    """Half-width b, m, over which the bodies touch where all has worn that can: the last depth above 0.

    worn_depth: of distances from the middle, radius, half-widths of the unworn contact and of the stick zone, m.
    Raises SceneError where the bodies are so far from possible ones that numbers overflow.
    """
    with np.errstate(all="ignore"):
        x = np.linspace(contact, _FARTHEST * contact, 10001)
        touching = x[worn_depth(x, 1.0, contact, stick) > 0.0]
    if not touching.size:
        raise SceneError("model", "the width of the contact is no number", "give parameters of possible bodies")
    return float(touching[-1])


class PressedBody(Scene):
    """A body of radius R that a force P presses on a flat, and a force Q or a stroke moves.

    SCAR: n and c of `b^n = a^n + c R V`, half-width of a scar of the worn volume V, per length of a cylinder.
    worn_depth: depth that partial slip wears, as `worn_edge` takes it. NAME: of the body.
    """

    FRICTION_IN_MODEL: ClassVar = True  # the default load and the width of what wears
    NAME: ClassVar[str]
    SCAR: ClassVar[tuple[int, float]]
    worn_depth: ClassVar[Callable[..., FloatArray]]

    friction_coefficient: float = Field(0.6, ge=0, description="Coulomb friction coefficient mu")
    R: float
    P: float
    Q: float | None
    stroke: Metre | None = Field(
        None, gt=0, description="amplitude of the motion of the body in place of Q: it shears, and slides by less"
    )
    sliding: Metre | None = Field(
        None, gt=0, description="amplitude by which all of the contact slides, in place of Q or stroke"
    )
    E: Pascal = Field(200e9, gt=0, description="Young's modulus of both bodies")
    nu: float = Field(0.3, ge=0, lt=0.5, description="Poisson's ratio of both bodies")
    half_width: float | None

    @model_validator(mode="after")
    def _check_motion(self) -> Self:
        given = [name for name in ("Q", "stroke", "sliding") if getattr(self, name) is not None]
        if len(given) > 1:
            raise SceneError(given[1], str(getattr(self, given[1])), f"give {' or '.join(given)}, not both")
        return self

    @property
    def prescribed(self) -> float | None:
        """Amplitude of a motion that is prescribed, m; None where a force moves the body."""
        return self.sliding if self.stroke is None else self.stroke

    @property
    def modulus(self) -> float:
        """E*, Pa."""
        return composite_modulus(self.E, self.nu)

    @property
    def tangential_force(self) -> float:
        """Amplitude of the tangential force, where no stroke is given; in the unit of P."""
        return 0.5 * self.friction_coefficient * self.P if self.Q is None else self.Q

    @property
    def share(self) -> float:
        """Of the force at which the body slides; 1 for a motion that is prescribed."""
        sliding = max(self.friction_coefficient * self.P, 1e-300)
        return self.tangential_force / sliding if self.prescribed is None else 1.0

    @property
    def thickness(self) -> float:
        """Length over which P and Q are distributed, m; 1 where they are forces."""
        return 1.0

    @property
    @abstractmethod
    def contact(self) -> float:
        """Half-width a of the unworn contact, m."""

    @property
    @abstractmethod
    def patched(self) -> float:
        """Half-width that pairs cover, m."""

    @abstractmethod
    def stick_under(self, stroke: float) -> float:
        """Half-width of the stick zone under a stroke, m; 0 where all slides."""

    @abstractmethod
    def room(self, worn: float) -> float:
        """Half-width that pairs have to cover, m, where the worn one is given, as far as the model allows."""

    def scar(self, volume: float, depth: float) -> float:
        """Half-width of what is worn, m, with a margin, to a volume, m3 (m2 of a cylinder), and a depth, m, at most."""
        n, form = self.SCAR
        by_volume = math.pow(self.contact**n + form * self.R * volume, 1.0 / n)
        return _MARGIN * min(by_volume, math.sqrt(self.contact**2 + 2.0 * self.R * depth))

    def with_room_for_wear(self, expected: ExpectedWear) -> Self:
        """With the half-width that a stroke needs: where it slides by what is worn, below that by what can be.

        As it is where a half-width is given, wear has no end, or no more is needed.
        """
        if self.half_width is not None or self.prescribed is None:
            return self
        stroke = self.prescribed * expected.amplitude
        volume = min(4.0 * expected.per_slip_work * self.P * stroke, expected.volume / self.thickness)
        worn, stick = self.scar(volume, expected.depth), 0.0 if self.stroke is None else self.stick_under(stroke)
        if stick > 0.0:
            worn = min(worn, 1.1 * worn_edge(self.worn_depth, self.contact, stick))
        needed = self.room(worn)
        if not np.isfinite(worn) or needed <= self.patched:
            return self
        return self.model_copy(update={"half_width": round_up(needed)})

    def press(
        self, normal: FloatArray, tangential: FloatArray, position: FloatArray, area: FloatArray, edge: BoolArray
    ) -> ReducedModel:
        """Reduced model; displacements are u_N of all pairs, u_T of all pairs, d, and where a force moves the body, s.

        With the contact forces lambda (N, compression positive), the approach d of the body and its tangential motion
        s, `u_N = d - C_N lambda_N` and `u_T = s - C_T lambda_T`: the stiffnesses are the inverse compliances, between
        the pairs and the one displacement that moves them all. Under a stroke s is no unknown, and `C_T^-1 s` a load on
        u_T; where the sliding is prescribed, the bodies do not shear. The response is then "slip", u_T of the pair
        nearest to the middle, else s.

        normal, tangential: compliances C_N, C_T (n_contact, n_contact), m/N. position (n_contact, 3): m, from the
        middle. area (n_contact,): m2. edge (n_contact,): pairs beside which the half-spaces go on without pairs.
        """
        n, prescribed = len(area), self.prescribed
        pressing, shearing = (np.asarray(np.linalg.inv(each), np.float64) for each in (normal, tangential))
        moved = prescribed is None
        stiffness = np.zeros((2 * n + 1 + moved, 2 * n + 1 + moved))
        _join(stiffness, np.arange(n), 2 * n, pressing)
        load_static, load_harmonic = np.zeros((2, len(stiffness)))
        load_static[2 * n] = self.P * self.thickness
        response = np.zeros((1, len(stiffness)))
        if prescribed is None:
            _join(stiffness, np.arange(n, 2 * n), 2 * n + 1, shearing)
            load_harmonic[2 * n + 1] = self.tangential_force * self.thickness
            response[0, 2 * n + 1] = 1.0
        else:
            if self.sliding is not None:
                shear = self.friction_coefficient * self.P * self.thickness * float(tangential.mean())
                shearing *= max(shear / (_SHEAR * self.sliding), 1.0)
            stiffness[n : 2 * n, n : 2 * n] = 0.5 * (shearing + shearing.T)
            load_harmonic[n : 2 * n] = prescribed * shearing.sum(axis=1)
            response[0, n + int(np.argmin(np.linalg.norm(position, axis=1)))] = 1.0
        nothing = np.zeros_like(stiffness)
        linear = LinearModel(nothing, nothing, stiffness, load_static, load_harmonic.astype(np.complex128), response)
        dofs = np.stack([np.arange(n), np.arange(n, 2 * n), np.full(n, -1)], axis=1)
        gap = (position**2).sum(axis=1) / (2.0 * self.R)
        contact = ContactInterface(dofs, area, gap, np.zeros(n), position, (f"flat/{self.NAME}",) * n, edge=edge)
        return ReducedModel({0: linear}, contact, (self.NAME if moved else "slip",))


def _join(stiffness: FloatArray, pairs: np.ndarray, body: int, joint: FloatArray) -> None:
    """Add the energy of the differences between one displacement of the body and those of the pairs, in place."""
    joint = 0.5 * (joint + joint.T)
    stiffness[np.ix_(pairs, pairs)] = joint
    stiffness[pairs, body] = stiffness[body, pairs] = -joint.sum(axis=1)
    stiffness[body, body] = (1.0 + _HOLDER) * joint.sum()


def round_up(width: float) -> float:
    """To three digits, as a study shows it."""
    unit = 10.0 ** (math.floor(math.log10(width)) - 2)
    return float(f"{math.ceil(width / unit * (1.0 - 1e-9)) * unit:.6g}")
