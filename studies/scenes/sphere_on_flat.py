"""A sphere on a flat: two elastic half-spaces of one material, no mass.

As `cylinder_on_flat`, with a force along x. Square patches of a quarter of the contact carry uniform tractions; each
patch also stands for its mirror images (`half_space`). Areas, forces and volumes are of all quarters. The
stick zone is that of Cattaneo and Mindlin, without tractions across the force.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from solver.model import ReducedModel
from studies.contact_compliance import ContactStiffness
from studies.scene_error import SceneError
from studies.scenes.half_space import (
    ExpectedWear,
    Scar,
    composite_modulus,
    pairs_of_patches,
    patch_compliance,
    press_body,
    round_up,
)
from studies.scenes.hertz import (
    point_radius,
    point_stick_radius,
    point_stick_under_stroke,
    point_worn_edge,
)

_WIDER = 0.11
"""Of the width of a patch: by so much the circle of equal area is wider than the punch that stuck patches bear as.
Measured: with 20 patches depth and volume worn in the end are then within 2 and 1 %."""
_NEAR = 0.08
"""Relative change of the width of the patches within which one is looked for whose stuck patches are round."""

_WIDEST = 0.5
"""Of the radius of the sphere: beyond it is no paraboloid."""

FRICTION_IN_MODEL = True
"""The default load, and the width of what wears, depend on the friction coefficient."""


class Parameters(BaseModel):
    """The defaults are steel under 100 N, with half of the force at which the sphere slides.

    The radius of the contact is 0.190 mm, the largest pressure 1.32 GPa, and the stick zone has 0.79 of the radius.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.6, ge=0, description="Coulomb friction coefficient mu, 1")
    contact_stiffness: ContactStiffness = None
    R: float = Field(10e-3, gt=0, description="radius of the sphere, m")
    P: float = Field(100.0, gt=0, description="normal force, N")
    Q: float | None = Field(
        None, gt=0, description="amplitude of the tangential force, N; mu P / 2 where no stroke is given"
    )
    stroke: float | None = Field(
        None, gt=0, description="amplitude of the prescribed tangential motion in place of Q, m"
    )
    E: float = Field(200e9, gt=0, description="Young's modulus of both bodies, Pa")
    nu: float = Field(0.3, ge=0, lt=0.5, description="Poisson's ratio of both bodies, 1")
    patches: int = Field(10, ge=2, le=40, description="number of patches, along a radius of the patched circle")
    half_width: float | None = Field(
        None,
        gt=0,
        description="radius of the patched circle, m; default: what the worn contact needs, in a study;"
        " without a study, for a sliding stroke, 1.4 times the unworn contact",
    )

    @model_validator(mode="after")
    def _check(self) -> Parameters:
        if self.Q is not None and self.stroke is not None:
            raise SceneError("stroke", str(self.stroke), "give Q or stroke, not both")
        return self


def tangential_force(parameters: Parameters) -> float:
    """Amplitude of the tangential force, N, where no stroke is given."""
    p = parameters
    return 0.5 * p.friction_coefficient * p.P if p.Q is None else p.Q


def patched_radius(parameters: Parameters) -> float:
    """Radius of the patched circle, m."""
    p = parameters
    if p.half_width is not None:
        return p.half_width
    contact = point_radius(p.P, p.R, composite_modulus(p.E, p.nu))
    share = 1.0 if p.stroke is not None else tangential_force(p) / max(p.friction_coefficient * p.P, 1e-300)
    if share >= 1.0:
        return 1.4 * contact
    stick = point_stick_radius(contact, share)
    worn = point_worn_edge(contact, stick)
    wanted = 1.2 * worn
    # in widths of a patch: distances of the middles, and how many lie nearer than the next one
    along = np.arange(2 * p.patches) + 0.5
    distance, count = np.unique(np.round(np.hypot(along[:, None], along[None, :]), 9), return_counts=True)
    within = np.sqrt(4.0 * np.cumsum(count) / np.pi) - _WIDER
    holds = np.flatnonzero((distance[:-1] < within[:-1]) & (within[:-1] < distance[1:]))
    change = stick / within[holds] * p.patches / wanted - 1.0
    # not so narrow that the scar reaches the last patches, as few patches would be
    roomy = stick / within[holds] * (p.patches - 0.5) > 1.02 * worn
    if roomy.any():
        holds, change = holds[roomy], change[roomy]
    near = holds[np.abs(change) < _NEAR]
    if not near.size:
        return float(stick / within[holds[np.argmin(np.abs(change))]] * p.patches)
    # the larger the step to the next distance, the rounder
    chosen = near[np.argmax(distance[near + 1] / distance[near])]
    return float(stick / within[chosen] * p.patches)


def with_room_for_wear(parameters: Parameters, expected: ExpectedWear) -> Parameters:
    """With the radius that a stroke needs: where it slides by what is worn, below that by what can be.

    As they are where the radius is given, wear has no end, or no more is needed than is taken without it.
    """
    p = parameters
    if p.half_width is not None or p.stroke is None:
        return p
    stroke = p.stroke * expected.amplitude
    contact = point_radius(p.P, p.R, composite_modulus(p.E, p.nu))
    volume = min(4.0 * expected.per_slip_work * p.P * stroke, expected.volume)
    worn = Scar(p.R, contact, 4, 4.0 / np.pi).half_width(volume, expected.depth)
    stick = point_stick_under_stroke(stroke, p.friction_coefficient, p.P, contact, p.E, p.nu)
    if stick > 0.0:
        worn = min(worn, 1.1 * point_worn_edge(contact, stick))
    # middles of the patches at the edge are half a patch from it, or less
    needed = min(worn * p.patches / (p.patches - 0.5), _WIDEST * p.R)
    if not np.isfinite(worn) or needed <= patched_radius(p):
        return p
    return p.model_copy(update={"half_width": round_up(needed)})


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model; `n_harmonics` has no influence: all harmonics see the same structure."""
    del n_harmonics
    p = parameters
    radius = patched_radius(p)
    width = radius / p.patches
    along = (np.arange(p.patches) + 0.5) * width
    middle = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    middle = middle[np.linalg.norm(middle, axis=1) < radius]
    # within half a patch, as the middle of a last strip; all around there are some
    edge = np.linalg.norm(middle, axis=1) >= radius - 0.5 * width
    position = np.column_stack([middle, np.zeros(len(middle))])
    gap = (middle**2).sum(axis=1) / (2.0 * p.R)
    contact = pairs_of_patches(position, np.full(len(middle), 4.0 * width**2), gap, "flat/sphere", edge)
    force = tangential_force(p) if p.stroke is None else None
    return press_body(patch_compliance(middle, width, p.E, p.nu), contact, p.P, force, p.stroke, "sphere")
