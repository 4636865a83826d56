"""A spring-mounted mass that slides on a rigid support: the textbook case of dry friction.

A spring presses the mass, and wear relaxes the spring: with the wear depth W the normal force is
`N(W) = normal_load - normal_stiffness W` until the pair opens. `contact_stiffness` divides N(W) by
`1 + normal_stiffness / (contact_stiffness area)`. Without wear, damping and contact stiffness, and if the mass never
stops, the motion is that of Den Hartog, Trans. ASME 53 (1931).
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from solver.contact.wear_law import wearing_work
from solver.model import ReducedModel
from solver.model_from_matrices import build_model
from studies.contact_compliance import ContactStiffness
from studies.scene_answers import ExactAnswer, WearQuestion, unknown_answer
from studies.scenes.den_hartog import DenHartogSlider, WearingSlider


class Parameters(BaseModel):
    """The defaults resonate at 201.3 Hz without friction.

    With 10 N at 160 Hz the mass never stops, and 1e5 cycles at 1.1e-11 1/Pa wear off half of the normal force.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient, 1")
    contact_stiffness: ContactStiffness = None
    mass: float = Field(0.1, gt=0, description="mass, kg")
    damping: float = Field(0.0, ge=0, description="viscous damping of the mount, N s/m")
    stiffness: float = Field(1.6e5, gt=0, description="tangential stiffness of the mount, N/m")
    normal_load: float = Field(10.0, gt=0, description="normal force without wear, of a rigid contact, N")
    normal_stiffness: float = Field(
        1e5, ge=0, description="stiffness of the spring that presses, N/m; 0: the normal force is constant"
    )
    area: float = Field(1e-4, gt=0, description="contact area, m2")


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model: the response is the displacement of the mass, the unit harmonic load acts on the mass.

    With a constant normal force the only displacement is that of the mass. With a spring the closing displacement of
    the pair comes before it: a massless degree of freedom, pressed by `normal_load`. `n_harmonics` has no influence:
    all harmonics see the same structure.
    """
    del n_harmonics
    p = parameters
    mass, damping, stiffness = (np.diag(each) for each in (
        (0.0, p.mass), (0.0, p.damping), (p.normal_stiffness, p.stiffness)
    ))  # fmt: skip
    sprung = p.normal_stiffness > 0
    own = slice(0 if sprung else 1, None)  # with the closing displacement, or without it
    return build_model(
        mass[own, own],
        damping[own, own],
        stiffness[own, own],
        [[0, 1, -1]] if sprung else [[-1, 0, -1]],
        p.area,
        load_harmonic=np.array([0.0, 1.0])[own],
        load_static=np.array([p.normal_load, 0.0]) if sprung else None,
        response=np.array([[0.0, 1.0]])[:, own],
        normal_load=0.0 if sprung else p.normal_load,
        surface=("support",),
        response_names=("mass",),
    )


_OF_SCENE = "friction_coefficient", "mass", "stiffness", "normal_load", "normal_stiffness", "area", "worn"
_OF_WEAR = "law", "threshold", "pressure", "depth", "factor", "surfaces"
_OF_AXES = "frequency", "wear_coefficient", "excitation_amplitude"
_KNOWN = {"scene": _OF_SCENE, "wear": _OF_WEAR, "axes": _OF_AXES}
EXACT_ANSWER_KNOWS = frozenset(f"{table}.{key}" for table, keys in _KNOWN.items() for key in keys)
"""Keys of a study on which `exact_answer` depends; a damped mount or a compliant contact has no closed form."""


def exact_answer(parameters: Parameters, asked: WearQuestion) -> ExactAnswer:
    """Wear and vibration from Den Hartog's closed form and the differential equation of the wear depth.

    NaN where the mass stops on its way, or the frequency is one of the singular ones of the form.
    """
    p = parameters
    load = p.normal_load - p.normal_stiffness * asked.worn_depth
    slider = DenHartogSlider(p.mass, p.stiffness, asked.excitation_amplitude, 2.0 * np.pi * asked.frequency)
    if not slider.holds(p.friction_coefficient * max(load, 0.0)):
        return unknown_answer(asked, 1)
    law, contact = asked.law.begun_at(np.array([asked.worn_depth])), build(p, 1).contact
    work = wearing_work(law, contact, np.array([p.friction_coefficient]))
    # the worn state depends on wear coefficient and cycle count through their product alone
    sliding = np.multiply.outer(asked.wear_coefficients, asked.cycles)
    different, places = np.unique(sliding, return_inverse=True)
    pair = WearingSlider(slider, p.friction_coefficient, load, p.normal_stiffness, p.area, work)
    depth, force = pair.worn(different)
    response = slider.first_harmonic(p.friction_coefficient * force)
    places = places.reshape(sliding.shape)
    return ExactAnswer(p.area * depth[places], response[places][..., np.newaxis])
