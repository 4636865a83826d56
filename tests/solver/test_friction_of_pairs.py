"""A friction coefficient for each pair: from the study or from the model. `test_law.py` has pairs of different ones."""

from dataclasses import fields, replace

import numpy as np
import pytest

from solver import frequency_response
from solver import march_wear as march_from_unworn
from solver.settings import SolverSettings
from tests.solver.models import OMEGA, random_model


def with_own_friction(model, friction):
    return replace(model, contact=replace(model.contact, friction_coefficient=np.array(friction)))


def assert_same_bits(one, other, but=()):
    for field in fields(one):
        values, others = getattr(one, field.name), getattr(other, field.name)
        if field.name not in but:
            np.testing.assert_array_equal(values, others, err_msg=field.name)


@pytest.mark.slow
def test_the_public_functions_take_one_for_all_one_of_each_or_those_of_the_model():
    model, settings = random_model(3, ("constant_load_one_tangent",) * 2), SolverSettings(1, 32)
    frequency, load, own = OMEGA / (2.0 * np.pi), 120.0, with_own_friction(model, [0.2, 0.6])
    numbers = ((model, 0.4), (model, [0.4, 0.4]), (model, [0.2, 0.6]))
    one, same, other = (frequency_response(of, frequency, load, given, settings=settings) for of, given in numbers)
    assert_same_bits(one, same)
    assert one.response[0, 0] != other.response[0, 0]
    step = {"scheme": "implicit", "step": 10.0, "settings": settings}
    histories = [
        march_from_unworn(of, frequency, load, given, 1e-11, 10.0, **step)
        for of, given in ((model, [0.2, 0.6]), (own, None))
    ]
    assert histories[0].worn_volume[-1] > 0.0
    assert histories[0].response[0, 0] == other.response[0, 0]
    assert_same_bits(*histories, but=("run_time",))
    with pytest.raises(ValueError, match=r"^friction_coefficient is given twice: the scene has one of each pair"):
        frequency_response(own, frequency, load, 0.4)
    with pytest.raises(ValueError, match=r"^friction_coefficient has shape \(3,\): give a number or shape \(2,\)"):
        frequency_response(model, frequency, load, [0.2, 0.4, 0.6])
