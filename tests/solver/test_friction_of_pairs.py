"""A friction coefficient for each pair: equal ones are one for all, different ones are those of joints of their own."""

from dataclasses import fields, replace

import numpy as np
import pytest

from solver import frequency_response
from solver import march_wear as march_from_unworn
from solver.accuracy.certificate import certify
from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.settings import SolverSettings
from solver.structure.joint import build_case, friction_of_pairs
from tests.solver.models import OMEGA, first_point, random_balance, random_model

SETTINGS = SolverSettings(5, 128)
KINDS = ("3d", "one_tangent", "constant_load")


def side_by_side(one, other):
    """Two structures that have nothing to do with each other as one."""

    def blocks(first, second):
        whole = np.zeros((len(first) + len(second), first.shape[1] + second.shape[1]), np.result_type(first, second))
        whole[: len(first), : first.shape[1]], whole[len(first) :, first.shape[1] :] = first, second
        return whole

    a, b = one.linear[0], other.linear[0]
    matrices = ("mass", "damping", "stiffness", "response")
    linear = LinearModel(
        **{name: blocks(getattr(a, name), getattr(b, name)) for name in matrices},
        load_static=np.append(a.load_static, b.load_static),
        load_harmonic=np.append(a.load_harmonic, b.load_harmonic),
    )
    beyond = np.where(other.contact.dofs < 0, -1, other.contact.dofs + len(a.load_static))
    joined = ("area", "gap", "normal_load", "position")
    contact = ContactInterface(
        dofs=np.concatenate([one.contact.dofs, beyond]),
        **{name: np.concatenate([getattr(one.contact, name), getattr(other.contact, name)]) for name in joined},
        surface=(*one.contact.surface, *other.contact.surface),
    )
    names = (*(f"{name} 1" for name in one.response_names), *(f"{name} 2" for name in other.response_names))
    return ReducedModel({0: linear}, contact, names)


def with_own_friction(model, friction):
    return replace(model, contact=replace(model.contact, friction_coefficient=np.array(friction)))


def assert_same_bits(one, other, but=()):
    for field in fields(one):
        values, others = getattr(one, field.name), getattr(other, field.name)
        if field.name not in but:
            np.testing.assert_array_equal(values, others, err_msg=field.name)


def test_equal_coefficients_give_the_bits_of_one_for_all():
    model, bent = random_model(3, KINDS), random_model(3, KINDS)
    balance, predicted = random_balance(model, SETTINGS, 3, wear=True)
    case = build_case(bent, np.full(3, 0.4), OMEGA, SETTINGS)
    other = replace(balance, joint=case.joint(OMEGA, 60.0))
    at, beside = balance.evaluate(predicted), other.evaluate(predicted)
    assert_same_bits(at, beside)
    tangent, its = balance.linearise(at), other.linearise(beside)
    np.testing.assert_array_equal(tangent.force_tangent, its.force_tangent)
    np.testing.assert_array_equal(tangent.motion_tangent, its.motion_tangent)
    assert certify(balance.joint, at) == certify(other.joint, beside)


def test_elastic_pairs_with_their_own_coefficients_are_those_that_stand_alone():
    models = [random_model(seed, ("3d",)) for seed in (1, 2)]
    friction = np.array([0.2, 0.45])
    settings = SolverSettings(3, 64, 1e-10)
    whole = build_case(side_by_side(*models), friction, OMEGA, settings)
    assert not whole.penalty.inertial.any()
    both = first_point(whole, OMEGA, 60.0, np.zeros(2)).evaluation
    for pair, model in enumerate(models):
        alone = first_point(
            build_case(model, float(friction[pair]), OMEGA, settings), OMEGA, 60.0, np.zeros(1)
        ).evaluation
        for name in ("force_h", "displacement_h", "slip_work"):
            expected = getattr(alone, name)[0]
            assert getattr(both, name)[pair] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())
    assert both.slip_work.min() > 0.0


@pytest.mark.parametrize(
    ("own", "given", "message"),
    [
        (None, None, "missing"),
        ([0.1, 0.2, 0.3], 0.5, "given twice"),
        (None, np.full(2, 0.5), r"shape \(2,\).* shape \(3,\)"),
        (None, np.full((3, 1), 0.5), r"shape \(3, 1\)"),
    ],
)
def test_coefficients_that_are_not_one_of_each_pair_are_refused(own, given, message):
    model = random_model(3, KINDS)
    model = model if own is None else with_own_friction(model, own)
    with pytest.raises(ValueError, match=message):
        friction_of_pairs(model, given)


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
