"""A chain of two masses; the second mass slides on a rigid support under a constant normal force.

The chain is `ground - spring 1 - mass 1 - spring 2 - mass 2`, with a damper beside each spring. The excitation acts on
mass 1. Mass 2 may stick while mass 1 moves.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from solver.model import FloatArray, ReducedModel
from solver.model_from_matrices import build_model
from studies.contact_compliance import ContactStiffness


class Parameters(BaseModel):
    """The defaults resonate at 0.098 and 0.257 Hz without friction; the friction force, 7.2 N, suits about 20 N."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient, 1")
    contact_stiffness: ContactStiffness = None
    mass_1: float = Field(1.0, gt=0, description="mass that is excited, kg")
    mass_2: float = Field(1.0, gt=0, description="mass that slides, kg")
    damping_1: float = Field(0.02, ge=0, description="viscous damping between ground and mass 1, N s/m")
    damping_2: float = Field(0.02, ge=0, description="viscous damping between the masses, N s/m")
    stiffness_1: float = Field(1.0, gt=0, description="spring between ground and mass 1, N/m")
    stiffness_2: float = Field(1.0, gt=0, description="spring between the masses, N/m")
    normal_load: float = Field(14.4, gt=0, description="constant normal force on mass 2, N")
    area: float = Field(1e-4, gt=0, description="contact area, m2")


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model in the displacements of mass 1 and mass 2, both of which are responses.

    `n_harmonics` has no influence: all harmonics see the same structure.
    """
    del n_harmonics
    p = parameters
    return build_model(
        np.diag([p.mass_1, p.mass_2]),
        _chain(p.damping_1, p.damping_2),
        _chain(p.stiffness_1, p.stiffness_2),
        [[-1, 1, -1]],
        p.area,
        load_harmonic=[1.0, 0.0],
        normal_load=p.normal_load,
        surface=("support",),
        response_names=("mass_1", "mass_2"),
    )


def _chain(to_ground: float, between: float) -> FloatArray:
    return np.array([[to_ground + between, -between], [-between, between]])
