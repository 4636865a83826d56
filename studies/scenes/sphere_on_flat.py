"""A sphere on a flat: two elastic half-spaces of one material, without mass.

Square patches of a quarter of the contact carry uniform tractions; each stands for its mirror images, too
(`half_space.influence`). A constant force presses; an oscillating tangential force Q along x, or a prescribed stroke,
moves the sphere. `excitation_amplitude` multiplies Q or the stroke, and the frequency has no influence. Unworn, the
pressure is Hertz's and the stick zone that of Cattaneo and Mindlin, whose tractions across the force are left out, and
partial slip wears to a profile that is known (`closed_forms.hertz`). The depth of a pair is that of flat and sphere
together; areas, forces and volumes are of all four quarters.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from solver.model import ReducedModel
from studies.scene_error import SceneError
from studies.scenes.closed_forms.hertz import point_radius
from studies.scenes.half_space.influence import composite_modulus, patch_compliance
from studies.scenes.half_space.pressed_body import pairs_of_patches, press_body


class Parameters(BaseModel):
    """Bodies, loads and patches.

    The defaults are steel under 100 N with half of the force that would slide: the radius of the contact is 0.190 mm,
    the largest pressure 1.32 GPa, and the stick zone reaches to 0.79 of the radius.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.6, ge=0, description="Coulomb friction coefficient mu, 1")
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
        None, gt=0, description="radius of the patched circle, m; 1.4 times that of the unworn contact if not given"
    )

    @model_validator(mode="after")
    def _check(self) -> Parameters:
        if self.Q is not None and self.stroke is not None:
            raise SceneError("stroke", str(self.stroke), "give Q or stroke, not both")
        return self


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model; `n_harmonics` has no influence: all harmonics see the same structure."""
    del n_harmonics
    p = parameters
    radius = p.half_width
    if radius is None:
        radius = 1.4 * point_radius(p.P, p.R, composite_modulus(p.E, p.nu))
    width = radius / p.patches
    along = (np.arange(p.patches) + 0.5) * width
    middle = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    middle = middle[np.linalg.norm(middle, axis=1) < radius]
    position = np.column_stack([middle, np.zeros(len(middle))])
    gap = (middle**2).sum(axis=1) / (2.0 * p.R)
    contact = pairs_of_patches(position, np.full(len(middle), 4.0 * width**2), gap, "flat/sphere")
    force = None
    if p.stroke is None:
        force = 0.5 * p.friction_coefficient * p.P if p.Q is None else p.Q
    return press_body(patch_compliance(middle, width, p.E, p.nu), contact, p.P, force, p.stroke, "sphere")
