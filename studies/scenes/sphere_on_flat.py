"""A sphere on a flat: two elastic half-spaces of one material, no mass.

As `cylinder_on_flat`, with a force along x. Square patches of a quarter of the contact carry uniform tractions; each
patch also stands for its mirror images (`half_space`). Areas, forces and volumes are of all quarters. The
stick zone is that of Cattaneo and Mindlin, without tractions across the force.
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from solver.model import FloatArray, ReducedModel
from studies.scene import Metre, Newton, Remark
from studies.scenes.half_space import PressedBody, patch_compliance, worn_edge

_WIDER = 0.11
"""Of the width of a patch: by so much the circle of equal area is wider than the punch that stuck patches bear as.
Measured: with 20 patches depth and volume worn in the end are then within 2 and 1 %."""
_NEAR = 0.08  # relative change of the width of the patches within which one is looked for whose stuck patches are round
_WIDEST = 0.5  # of the radius of the sphere: beyond it is no paraboloid


def point_worn_depth(r: FloatArray, radius: float, contact_radius: float, stick_radius: float) -> FloatArray:
    """Depth W, m, of both bodies at distances r, m, from the axis where partial slip has worn all that it can.

    `W = [r^2 arcsin(c/r) - c sqrt(r^2 - c^2)] / (pi R) + (2 d / pi) arccos(c/r) - r^2 / (2 R)` with the approach
    `d = 2 a^3 / (3 R c) + c^2 / (3 R)` (Popov 2014).
    """
    c = stick_radius
    away = np.maximum(np.abs(r), c)
    approach = 2.0 * contact_radius**3 / (3.0 * radius * c) + c**2 / (3.0 * radius)
    profile = (away**2 * np.arcsin(c / away) - c * np.sqrt(away**2 - c**2)) / (np.pi * radius)
    overlap = profile + 2.0 * approach / np.pi * np.arccos(c / away) - away**2 / (2.0 * radius)
    return np.asarray(np.where(np.abs(r) > c, np.maximum(overlap, 0.0), 0.0))


class Parameters(PressedBody):
    """The defaults are steel under 100 N, with half of the force at which the sphere slides.

    The radius of the contact is 0.190 mm, the largest pressure 1.32 GPa, and the stick zone has 0.79 of the radius.
    """

    NAME: ClassVar = "sphere"
    DESCRIPTION: ClassVar = {"contact_mirrored": "x, y"}
    SCAR: ClassVar = (4, 4.0 / np.pi)
    worn_depth: ClassVar = staticmethod(point_worn_depth)

    R: Metre = Field(10e-3, gt=0, description="radius of the sphere")
    P: Newton = Field(100.0, gt=0, description="normal force")
    Q: Annotated[Newton | None, Remark("mu P / 2 where no stroke is given")] = Field(
        None, gt=0, description="amplitude of the tangential force"
    )
    patches: int = Field(10, ge=2, le=40, description="number of patches, along a radius of the patched circle")
    half_width: Annotated[
        Metre | None,
        Remark("default: what a study needs; alone, where the contact slides, 1.4 times the unworn contact"),
    ] = Field(None, gt=0, description="radius of the patched circle")

    @property
    def contact(self) -> float:
        """Radius, `a^3 = 3 P R / (4 E*)`."""
        return float(np.cbrt(0.75 * self.P * self.R / self.modulus))

    @property
    def patched(self) -> float:
        """Radius of the patched circle, m."""
        if self.half_width is not None:
            return self.half_width
        if self.share >= 1.0:
            return 1.4 * self.contact
        stick = self.contact * float(np.cbrt(1.0 - self.share))
        worn = worn_edge(point_worn_depth, self.contact, stick)
        # in widths of a patch: distances of the middles, and how many lie nearer than the next one
        along = np.arange(2 * self.patches) + 0.5
        distance, count = np.unique(np.round(np.hypot(along[:, None], along[None, :]), 9), return_counts=True)
        within = np.sqrt(4.0 * np.cumsum(count) / np.pi) - _WIDER
        holds = np.flatnonzero((distance[:-1] < within[:-1]) & (within[:-1] < distance[1:]))
        # not so narrow that the scar reaches the last patches, as few patches would be
        roomy = holds[stick / within[holds] * (self.patches - 0.5) > 1.02 * worn]
        holds = roomy if roomy.size else holds
        change = np.abs(stick / within[holds] * self.patches / (1.2 * worn) - 1.0)
        near = holds[change < _NEAR]
        # the larger the step to the next distance, the rounder
        chosen = near[np.argmax(distance[near + 1] / distance[near])] if near.size else holds[np.argmin(change)]
        return float(stick / within[chosen] * self.patches)

    def stick_under(self, stroke: float) -> float:
        """`stroke = 3 mu P (2 - nu) / (8 a G) (1 - (c/a)^2)`."""
        shear = self.E / (2.0 * (1.0 + self.nu))
        slides = 3.0 * self.friction_coefficient * self.P * (2.0 - self.nu) / (8.0 * self.contact * shear)
        return self.contact * float(np.sqrt(max(1.0 - stroke / slides, 0.0))) if slides > 0.0 else 0.0

    def room(self, worn: float) -> float:
        """Middles of the patches at the edge are half a patch from it, or less."""
        return min(worn * self.patches / (self.patches - 0.5), _WIDEST * self.R)

    def build(self, _: int) -> ReducedModel:
        """Pairs of patches, and the motion of the body."""
        width = self.patched / self.patches
        along = (np.arange(self.patches) + 0.5) * width
        middle = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
        middle = middle[np.linalg.norm(middle, axis=1) < self.patched]
        # within half a patch, as the middle of a last strip; all around there are some
        edge = np.linalg.norm(middle, axis=1) >= self.patched - 0.5 * width
        position, area = np.column_stack([middle, np.zeros(len(middle))]), np.full(len(middle), 4.0 * width**2)
        return self.press(*patch_compliance(middle, width, self.E, self.nu), position, area, edge)
