"""A chain of two masses; the second mass slides on a rigid support under a constant normal force.

The chain is `ground - spring 1 - mass 1 - spring 2 - mass 2`, with a damper beside each spring. The excitation acts on
mass 1. Mass 2 may stick while mass 1 moves.
"""

import numpy as np
from pydantic import Field

from solver.model import ReducedModel
from solver.model_from_matrices import build_model
from studies.scene import Damping, Kilogram, Newton, NewtonPerMetre, Scene, SquareMetre


class Parameters(Scene):
    """The defaults resonate at 0.098 and 0.257 Hz without friction; the friction force, 7.2 N, suits about 20 N."""

    mass_1: Kilogram = Field(1.0, gt=0, description="mass that is excited")
    mass_2: Kilogram = Field(1.0, gt=0, description="mass that slides")
    damping_1: Damping = Field(0.02, ge=0, description="viscous damping between ground and mass 1")
    damping_2: Damping = Field(0.02, ge=0, description="viscous damping between the masses")
    stiffness_1: NewtonPerMetre = Field(1.0, gt=0, description="spring between ground and mass 1")
    stiffness_2: NewtonPerMetre = Field(1.0, gt=0, description="spring between the masses")
    normal_load: Newton = Field(14.4, gt=0, description="constant normal force on mass 2")
    area: SquareMetre = Field(1e-4, gt=0, description="contact area")

    def build(self, _: int) -> ReducedModel:
        """In the displacements of mass 1 and mass 2, both of which are responses."""
        pairs = (self.damping_1, self.damping_2), (self.stiffness_1, self.stiffness_2)
        damping, stiffness = ([[ground + between, -between], [-between, between]] for ground, between in pairs)
        return build_model(
            np.diag([self.mass_1, self.mass_2]),
            damping,
            stiffness,
            [[-1, 1, -1]],
            self.area,
            load_harmonic=[1.0, 0.0],
            normal_load=self.normal_load,
            surface=("support",),
            response_names=("mass_1", "mass_2"),
        )
