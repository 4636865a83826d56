"""A spring-mounted mass that slides on a rigid support: the textbook case of dry friction.

The mass moves along one tangent. A constant force presses the mass on the support, or a spring that wear relaxes: with
the wear depth W the normal force is `N(W) = normal_load - normal_stiffness W` until the pair opens. Without wear the
motion has the closed form of Den Hartog, "Forced vibrations with combined Coulomb and viscous friction", Trans. ASME 53
(1931), if the mass never stops and has no viscous damping.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from studies.contact_compliance import ContactStiffness
from studies.scene_answers import ExactAnswer
from studies.scenes.closed_forms.den_hartog import DenHartogSlider, worn_normal_force


class Parameters(BaseModel):
    """Parameters of mass, mount and support.

    The defaults resonate at 201.3 Hz without friction. Excited with 10 N at 160 Hz the mass never stops, and half of
    the normal force is lost by wear within 1e5 cycles at a wear coefficient of 1.1e-11 1/Pa.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient, 1")
    contact_stiffness: ContactStiffness = None
    mass: float = Field(0.1, gt=0, description="mass, kg")
    damping: float = Field(0.0, ge=0, description="viscous damping of the mount, N s/m")
    stiffness: float = Field(1.6e5, gt=0, description="tangential stiffness of the mount, N/m")
    normal_load: float = Field(10.0, gt=0, description="normal force without wear, N")
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
    if p.normal_stiffness > 0:
        mass, damping, stiffness = (
            np.diag(pair) for pair in ((0.0, p.mass), (0.0, p.damping), (p.normal_stiffness, p.stiffness))
        )
        load_static = np.array([p.normal_load, 0.0])
        dofs, normal_load = [0, 1, -1], 0.0
    else:
        mass, damping, stiffness = (np.array([[value]]) for value in (p.mass, p.damping, p.stiffness))
        load_static = np.zeros(1)
        dofs, normal_load = [-1, 0, -1], p.normal_load
    on_mass = np.zeros(len(load_static))
    on_mass[-1] = 1.0
    linear = LinearModel(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        load_static=load_static,
        load_harmonic=on_mass.astype(np.complex128),
        response=on_mass[np.newaxis, :],
    )
    contact = ContactInterface(
        dofs=np.array([dofs], dtype=np.int64),
        area=np.array([p.area]),
        gap=np.zeros(1),
        normal_load=np.array([normal_load]),
        position=np.full((1, 3), np.nan),
        surface=("support",),
    )
    return ReducedModel(linear={0: linear}, contact=contact, response_names=("mass",))


def exact_answer(
    parameters: Parameters,
    frequency: float,
    excitation_amplitude: float,
    wear_coefficients: FloatArray,
    cycles: FloatArray,
) -> ExactAnswer:
    """Wear and vibration from Den Hartog's closed form and the differential equation of the wear depth.

    frequency: Hz. excitation_amplitude: N. wear_coefficients (n_wear,): 1/Pa. cycles (n_cycles,): counts. NaN where the
    form does not hold: the mount is damped, the contact is no rigid one, the mass stops on its way, or the frequency is
    one of its singular ones.
    """
    p = parameters
    slider = DenHartogSlider(p.mass, p.stiffness, excitation_amplitude, 2.0 * np.pi * frequency)
    limit = p.friction_coefficient * p.normal_load
    sliding = np.multiply.outer(wear_coefficients, cycles)
    if p.damping > 0.0 or p.contact_stiffness is not None or not slider.holds(limit):
        return ExactAnswer(np.full(sliding.shape, np.nan), np.full((*sliding.shape, 1), np.nan))
    # the worn state depends on wear coefficient and cycle count through their product alone
    different, places = np.unique(sliding, return_inverse=True)
    relieved = worn_normal_force(slider, p.friction_coefficient, p.normal_load, p.normal_stiffness, p.area, different)
    if p.normal_stiffness > 0.0:
        depth = np.abs(np.expm1(relieved)) * p.normal_load / p.normal_stiffness
    else:
        depth = p.normal_load / p.area * 4.0 * slider.amplitude(np.array(limit)) * different
    response = slider.first_harmonic(limit * np.exp(relieved))
    places = places.reshape(sliding.shape)
    return ExactAnswer(p.area * depth[places], response[places][..., np.newaxis])
