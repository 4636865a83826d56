"""A spring-mounted mass that slides on a rigid support: the textbook case of dry friction.

A spring presses the mass, and wear relaxes the spring: with the wear depth W the normal force is
`N(W) = normal_load - normal_stiffness W` until the pair opens. `contact_stiffness` divides N(W) by
`1 + normal_stiffness / (contact_stiffness area)`. Without wear, damping and contact stiffness, and if the mass never
stops, the motion is that of Den Hartog, Trans. ASME 53 (1931).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from solver.contact.wear_law import wearing_work
from solver.model import ReducedModel
from solver.model_from_matrices import build_model
from studies.scene import ExactAnswer, Scene, WearQuestion
from studies.scenes.den_hartog import DenHartogSlider, WearingSlider

_KNOWN = {"scene.worn", *(f"axes.{key}" for key in ("frequency", "wear_coefficient", "excitation_amplitude"))}
_KNOWN |= {f"wear.{key}" for key in ("law", "threshold", "pressure", "depth", "factor", "surfaces")}
"""Keys of a study, beside the parameters of the scene, on which the exact answer depends."""


class Parameters(Scene):
    """The defaults resonate at 201.3 Hz without friction.

    With 10 N at 160 Hz the mass never stops, and 1e5 cycles at 1.1e-11 1/Pa wear off half of the normal force.
    """

    OFFERS: ClassVar = ("exact",)

    mass: float = Field(0.1, gt=0, description="mass, kg")
    damping: float = Field(0.0, ge=0, description="viscous damping of the mount, N s/m")
    stiffness: float = Field(1.6e5, gt=0, description="tangential stiffness of the mount, N/m")
    normal_load: float = Field(10.0, gt=0, description="normal force without wear, of a rigid contact, N")
    normal_stiffness: float = Field(
        1e5, ge=0, description="stiffness of the spring that presses, N/m; 0: the normal force is constant"
    )
    area: float = Field(1e-4, gt=0, description="contact area, m2")

    def reduced_model(self) -> ReducedModel:
        """The response is the displacement of the mass, on which the load acts.

        With a spring the closing displacement of the pair comes before that of the mass: a massless degree of freedom,
        pressed by `normal_load`.
        """
        mass, damping, stiffness = (np.diag(each) for each in (
            (0.0, self.mass), (0.0, self.damping), (self.normal_stiffness, self.stiffness)
        ))  # fmt: skip
        sprung = self.normal_stiffness > 0
        own = slice(0 if sprung else 1, None)  # with the closing displacement, or without it
        return build_model(
            mass[own, own],
            damping[own, own],
            stiffness[own, own],
            [[0, 1, -1]] if sprung else [[-1, 0, -1]],
            self.area,
            load_harmonic=np.array([0.0, 1.0])[own],
            load_static=np.array([self.normal_load, 0.0]) if sprung else None,
            response=np.array([[0.0, 1.0]])[:, own],
            normal_load=0.0 if sprung else self.normal_load,
            surface=("support",),
            response_names=("mass",),
        )

    def exact_answer(self, asked: WearQuestion) -> ExactAnswer:
        """Wear and vibration from Den Hartog's closed form and the differential equation of the wear depth.

        NaN where the mass stops on its way, the frequency is one of the singular ones of the form, the mount is damped
        or the contact compliant, or a key of the study is changed that the form does not know.
        """
        mu, load = self.friction_coefficient, self.normal_load - self.normal_stiffness * asked.worn_depth
        slider = DenHartogSlider(self.mass, self.stiffness, asked.excitation_amplitude, 2.0 * np.pi * asked.frequency)
        # the worn state depends on wear coefficient and cycle count through their product alone
        sliding = np.multiply.outer(asked.wear_coefficients, asked.cycles)
        known = self.damping == 0.0 and self.contact_stiffness is None and asked.changed <= _KNOWN
        if not (known and slider.holds(mu * max(load, 0.0))):
            return ExactAnswer(np.full(sliding.shape, np.nan), np.full((*sliding.shape, 1), np.nan))
        law, contact = asked.law.begun_at(np.array([asked.worn_depth])), self.reduced_model().contact
        different, places = np.unique(sliding, return_inverse=True)
        work = wearing_work(law, contact, np.array([mu]))
        depth, force = WearingSlider(slider, mu, load, self.normal_stiffness, self.area, work).worn(different)
        response, places = slider.first_harmonic(mu * force), places.reshape(sliding.shape)
        return ExactAnswer(self.area * depth[places], response[places][..., np.newaxis])
