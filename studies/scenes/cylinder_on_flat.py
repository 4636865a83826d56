"""A cylinder on a flat, the classic fretting test: plane strain, one material, no mass.

A constant force P presses. A tangential force Q or a stroke moves the cylinder; `excitation_amplitude` multiplies Q or
the stroke, and the frequency has no influence. Strips of half of the contact carry uniform tractions on two elastic
half-planes; each strip also stands for its mirror image (`half_space`). Areas, forces and volumes are of both
halves, a depth is the sum of both bodies. A stroke has to be small against the contact. Without wear the pressure is
that of Hertz, the stick zone that of Cattaneo; partial slip wears to a known profile.
"""

from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from solver.model import FloatArray, ReducedModel
from studies.scene import Metre, NewtonPerMetre, Remark
from studies.scene_error import SceneError
from studies.scenes.half_space import PressedBody, strip_compliance, worn_edge

_WIDER = 1.0 / 6.0
"""Of its width: by this much strips of uniform traction are wider, at each end, than the flat punch that they bear as.
Measured: the area worn in the end is then within 0.2 % with 8 to 128 strips in half of the stick zone, with 0 it is 13
to 0.9 % off, of first order."""
_WIDEST = 0.45  # of the depth that displacements refer to: half of the width of all strips has to be below a half of it


def line_worn_depth(x: FloatArray, radius: float, half_width: float, stick_width: float) -> FloatArray:
    """Depth W, m, of both bodies at distances x, m, from the middle where partial slip has worn all that it can.

    `W = (1/2R) [a^2 arccosh(|x|/c) - |x| sqrt(x^2 - c^2)]` between the stick zone and where the bodies part, else 0
    (Ciavarella and Hills 1999): the stick zone carries all, and beside it the overlap of the bodies has gone.
    """
    away = np.maximum(np.abs(x), stick_width)
    overlap = half_width**2 * np.arccosh(away / stick_width) - away * np.sqrt(away**2 - stick_width**2)
    return np.asarray(np.maximum(overlap, 0.0) / (2.0 * radius))


class Parameters(PressedBody):
    """The defaults are steel under 120 N/mm, with half of the force at which the cylinder slides.

    The half-width is 0.0913 mm, the largest pressure 836 MPa, and half of the contact area sticks.
    """

    NAME: ClassVar = "cylinder"
    DESCRIPTION: ClassVar = {"contact_mirrored": "x"}
    SCAR: ClassVar = (3, 1.5)
    worn_depth: ClassVar = staticmethod(line_worn_depth)

    R: Metre = Field(6e-3, gt=0, description="radius of the cylinder")
    P: NewtonPerMetre = Field(1.2e5, gt=0, description="normal force per length")
    Q: Annotated[NewtonPerMetre | None, Remark("mu P / 2 where no stroke is given")] = Field(
        None, gt=0, description="amplitude of the tangential force per length"
    )
    length: Metre = Field(0.01, gt=0, description="length of the cylinder")
    strips: int = Field(100, ge=4, le=800, multiple_of=2, description="number of strips, of both halves")
    half_width: Annotated[
        Metre | None,
        Remark("default: what a study needs; alone, where the contact slides, 1.5 times the unworn contact"),
    ] = Field(None, gt=0, description="half of the width of all strips")
    depth: Annotated[Metre | None, Remark("default: R")] = Field(
        None, gt=0, description="depth that displacements refer to, larger than the width of all strips"
    )

    @model_validator(mode="after")
    def _check_depth(self) -> Self:
        width, reference = 2.0 * self.patched, self._reference_depth
        if reference <= width:
            raise SceneError("depth", f"{reference:g}", f"give more than the width of all strips, {width:g} m")
        return self

    @property
    def _reference_depth(self) -> float:
        """Depth that displacements refer to, m."""
        return self.R if self.depth is None else self.depth

    @property
    def thickness(self) -> float:
        """Length of the cylinder, m."""
        return self.length

    @property
    def contact(self) -> float:
        """`a^2 = 4 P R / (pi E*)`."""
        return float(np.sqrt(4.0 * self.P * self.R / (np.pi * self.modulus)))

    @property
    def patched(self) -> float:
        """Half of the width of all strips, m."""
        if self.half_width is not None:
            return self.half_width
        if self.share >= 1.0:
            return 1.5 * self.contact
        stick = self.contact * float(np.sqrt(1.0 - self.share))
        worn = worn_edge(line_worn_depth, self.contact, stick)
        # not so many that the scar reaches the last strip, as it would where there are few
        most = int(0.5 * (self.strips - 1) * stick / (1.02 * worn) + _WIDER)
        within = max(min(round(0.5 * self.strips * stick / (1.2 * worn)), most), 1)
        return 0.5 * self.strips * stick / (within - _WIDER)

    def stick_under(self, stroke: float) -> float:
        """`stroke = mu (d(P, a) - d(P_c, c))` with `P_c = P (c/a)^2`.

        The approach is `d(P, a) = 2 P / (pi E*) (ln(2 depth / a) + 1/2)`.
        """
        c = self.contact * np.linspace(0.0, 1.0, 2001)[1:]
        logarithm = np.log(2.0 * self._reference_depth / c) + 0.5
        approach = 2.0 * self.P / (np.pi * self.modulus) * (c / self.contact) ** 2 * logarithm
        motion = self.friction_coefficient * (approach[-1] - approach)
        return float(np.interp(-stroke, -motion, c, left=0.0))

    def room(self, worn: float) -> float:
        """The middle of the last strip is half a strip before its end."""
        return min(worn * self.strips / (self.strips - 1), _WIDEST * self._reference_depth)

    def build(self, _: int) -> ReducedModel:
        """Pairs of strips, and the motion of the body."""
        edges = np.linspace(0.0, self.patched, self.strips // 2 + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        compliance = strip_compliance(edges, self.modulus, self.length, self._reference_depth)
        position = np.stack([middle, np.zeros_like(middle), np.zeros_like(middle)], axis=1)
        area, last = 2.0 * np.diff(edges) * self.length, middle == middle[-1]
        return self.press(compliance, compliance, position, area, last)
