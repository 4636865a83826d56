"""A spring-mounted mass that hits an elastic wall behind a gap: a bilinear spring as a unilateral contact.

The wall is a spring to ground, whose massless tip stands `gap` away from the resting mass. The closing displacement is
`u_N = x - y`, with x of the mass and y of the tip; the energy of the wall is `wall_stiffness (x - u_N)^2 / 2`. Open,
the tip rests (`u_N = x`); closed, `u_N = gap`, and the force is `wall_stiffness (x - gap)`.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from solver.model import ReducedModel
from solver.model_from_matrices import build_model
from studies.scene import Damping, Kilogram, Metre, NewtonPerMetre, Remark, Scene, SquareMetre


class Parameters(Scene):
    """The defaults resonate at 0.159 Hz without the wall.

    With 0.02 N the response has two branches, with and without impacts, from 0.175 to 0.248 Hz.
    """

    friction_coefficient: Annotated[float, Remark("without influence: the pair has no tangent")] = Field(
        0.0, ge=0, description="Coulomb friction coefficient"
    )
    mass: Kilogram = Field(1.0, gt=0, description="mass")
    damping: Damping = Field(0.05, ge=0, description="viscous damping of the mount")
    stiffness: NewtonPerMetre = Field(1.0, gt=0, description="stiffness of the mount")
    wall_stiffness: NewtonPerMetre = Field(100.0, gt=0, description="stiffness of the wall")
    gap: Annotated[Metre, Remark("negative: they press on each other")] = Field(
        0.1, description="distance between the resting mass and the wall"
    )
    area: SquareMetre = Field(1e-4, gt=0, description="contact area")

    def build(self, _: int) -> ReducedModel:
        """In (closing displacement, displacement of the mass), the response."""
        wall = self.wall_stiffness
        return build_model(
            np.diag([0.0, self.mass]),
            np.diag([0.0, self.damping]),
            [[wall, -wall], [-wall, wall + self.stiffness]],
            [[0, -1, -1]],
            self.area,
            load_harmonic=[0.0, 1.0],
            response=[[0.0, 1.0]],
            gap=self.gap,
            surface=("wall",),
            response_names=("mass",),
        )
