"""A cylinder on a flat, the classic fretting test: plane strain, one material, no mass.

A constant force P presses. A tangential force Q or a stroke moves the cylinder; `excitation_amplitude` multiplies Q or
the stroke, and the frequency has no influence. Strips of half of the contact carry uniform tractions on two elastic
half-planes; each strip also stands for its mirror image (`half_space`). Areas, forces and volumes are of both
halves, a depth is the sum of both bodies. A stroke has to be small against the contact. Without wear the pressure is
that of Hertz, the stick zone that of Cattaneo; partial slip wears to a known profile (`hertz`).
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
    press_body,
    round_up,
    strip_compliance,
)
from studies.scenes.hertz import (
    line_half_width,
    line_stick_under_stroke,
    line_stick_width,
    line_worn_edge,
)

_WIDER = 1.0 / 6.0
"""Of its width: by this much strips of uniform traction are wider, at each end, than the flat punch that they bear as.
Measured: the area worn in the end is then within 0.2 % with 8 to 128 strips in half of the stick zone, with 0 it is 13
to 0.9 % off, of first order."""

_WIDEST = 0.45
"""Of the depth that displacements refer to: half of the width of all strips has to be below a half of it."""

FRICTION_IN_MODEL = True
"""The default load, and the width of what wears, depend on the friction coefficient."""


class Parameters(BaseModel):
    """The defaults are steel under 120 N/mm, with half of the force at which the cylinder slides.

    The half-width is 0.0913 mm, the largest pressure 836 MPa, and half of the contact area sticks.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.6, ge=0, description="Coulomb friction coefficient mu, 1")
    contact_stiffness: ContactStiffness = None
    R: float = Field(6e-3, gt=0, description="radius of the cylinder, m")
    P: float = Field(1.2e5, gt=0, description="normal force per length, N/m")
    Q: float | None = Field(
        None, gt=0, description="amplitude of the tangential force per length, N/m; mu P / 2 where no stroke is given"
    )
    stroke: float | None = Field(
        None, gt=0, description="amplitude of the prescribed tangential motion in place of Q, m"
    )
    E: float = Field(200e9, gt=0, description="Young's modulus of both bodies, Pa")
    nu: float = Field(0.3, ge=0, lt=0.5, description="Poisson's ratio of both bodies, 1")
    length: float = Field(0.01, gt=0, description="length of the cylinder, m")
    strips: int = Field(100, ge=4, le=800, multiple_of=2, description="number of strips, of both halves")
    half_width: float | None = Field(
        None,
        gt=0,
        description="half of the width of all strips, m; default: what the worn contact needs, in a study;"
        " without a study, for a sliding stroke, 1.5 times the unworn contact",
    )
    depth: float | None = Field(
        None,
        gt=0,
        description="depth that displacements refer to, m, larger than the width of all strips; default: R",
    )

    @model_validator(mode="after")
    def _check(self) -> Parameters:
        if self.Q is not None and self.stroke is not None:
            raise SceneError("stroke", str(self.stroke), "give Q or stroke, not both")
        width, reference = 2.0 * strips_half_width(self), reference_depth(self)
        if reference <= width:
            raise SceneError("depth", f"{reference:g}", f"give more than the width of all strips, {width:g} m")
        return self


def strips_half_width(parameters: Parameters) -> float:
    """Half of the width of all strips, m."""
    p = parameters
    if p.half_width is not None:
        return p.half_width
    contact = line_half_width(p.P, p.R, composite_modulus(p.E, p.nu))
    share = 1.0 if p.stroke is not None else tangential_force(p) / max(p.friction_coefficient * p.P, 1e-300)
    if share >= 1.0:
        return 1.5 * contact
    stick = line_stick_width(contact, share)
    worn = line_worn_edge(contact, stick)
    # not so many that the scar reaches the last strip, as it would where there are few
    most = int(0.5 * (p.strips - 1) * stick / (1.02 * worn) + _WIDER)
    within = max(min(round(0.5 * p.strips * stick / (1.2 * worn)), most), 1)
    return 0.5 * p.strips * stick / (within - _WIDER)


def with_room_for_wear(parameters: Parameters, expected: ExpectedWear) -> Parameters:
    """With the half-width that a stroke needs: where it slides by what is worn, below that by what can be.

    As they are where the half-width is given, wear has no end, or no more is needed than is taken without it.
    """
    p = parameters
    if p.half_width is not None or p.stroke is None:
        return p
    modulus, stroke = composite_modulus(p.E, p.nu), p.stroke * expected.amplitude
    contact = line_half_width(p.P, p.R, modulus)
    volume = min(4.0 * expected.per_slip_work * p.P * stroke, expected.volume / p.length)
    worn = Scar(p.R, contact, 3, 1.5).half_width(volume, expected.depth)
    stick = line_stick_under_stroke(stroke, p.friction_coefficient, p.P, contact, modulus, reference_depth(p))
    if stick > 0.0:
        worn = min(worn, 1.1 * line_worn_edge(contact, stick))
    # the middle of the last strip is half a strip before its end
    needed = min(worn * p.strips / (p.strips - 1), _WIDEST * reference_depth(p))
    if not np.isfinite(worn) or needed <= strips_half_width(p):
        return p
    return p.model_copy(update={"half_width": round_up(needed)})


def tangential_force(parameters: Parameters) -> float:
    """Amplitude of the tangential force per length, N/m, where no stroke is given."""
    p = parameters
    return 0.5 * p.friction_coefficient * p.P if p.Q is None else p.Q


def reference_depth(parameters: Parameters) -> float:
    """Depth that displacements refer to, m."""
    return parameters.R if parameters.depth is None else parameters.depth


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model; `n_harmonics` has no influence: all harmonics see the same structure."""
    del n_harmonics
    p = parameters
    edges = np.linspace(0.0, strips_half_width(p), p.strips // 2 + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    compliance = strip_compliance(edges, composite_modulus(p.E, p.nu), p.length, reference_depth(p))
    position = np.stack([middle, np.zeros_like(middle), np.zeros_like(middle)], axis=1)
    area, gap, last = 2.0 * np.diff(edges) * p.length, middle**2 / (2.0 * p.R), middle == middle[-1]
    contact = pairs_of_patches(position, area, gap, "flat/cylinder", last)
    force = tangential_force(p) * p.length if p.stroke is None else None
    return press_body((compliance, compliance), contact, p.P * p.length, force, p.stroke, "cylinder")
