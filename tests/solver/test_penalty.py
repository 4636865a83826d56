"""Which formulation the scene leads to, and that units do not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.joint import build_case
from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.penalty import build_penalty, static_penalty
from solver.settings import SolverSettings
from tests.solver.models import OMEGA, dovetail, random_model, scene

DOVETAIL_OMEGA = 2 * np.pi * 212.0


@pytest.mark.parametrize("n_harmonics", [1, 5, 21])
@pytest.mark.parametrize(
    ("name", "values", "omega", "at_velocity"),
    [
        ("sdof_slider", {}, 2 * np.pi * 160, True),
        ("sdof_slider", {"normal_stiffness": 0.0}, 2 * np.pi * 160, True),
        ("two_masses", {}, 0.5, True),
        ("vibro_impact", {}, 1.2, False),
    ],
)
def test_a_mass_directly_on_a_slider_is_taken_at_velocity_level(
    name: str, values: dict[str, float], omega: float, at_velocity: bool, n_harmonics: int
) -> None:
    penalty = build_penalty(scene(name, n_harmonics, **values), omega, n_harmonics)
    assert penalty.at_velocity.tolist() == [at_velocity]


@pytest.mark.parametrize("n_harmonics", [1, 3, 7])
def test_an_elastic_joint_is_taken_at_displacement_level_near_its_stiffness(n_harmonics: int) -> None:
    model = dovetail()
    penalty = build_penalty(model, DOVETAIL_OMEGA, n_harmonics)
    assert not penalty.at_velocity.any()
    relative = model.contact.dofs.ravel()
    full = model.linear[0].stiffness
    inner = np.setdiff1d(np.arange(full.shape[0]), relative)
    condensed = full[np.ix_(relative, relative)] - full[np.ix_(relative, inner)] @ np.linalg.solve(
        full[np.ix_(inner, inner)], full[np.ix_(inner, relative)]
    )
    largest = np.linalg.eigvalsh(condensed).max()
    assert (penalty.tangential < largest * 1.5).all()
    assert (penalty.tangential > largest * 1e-3).all()
    assert (penalty.normal > largest * 1e-3).all()


def scaled(model: ReducedModel, length: float, force: float, rate: float) -> ReducedModel:
    """The same structure in other units: 1 m, 1 N and 1 rad/s are `length`, `force` and `rate` of the new ones."""

    def linear(old: LinearModel) -> LinearModel:
        stiffness = force / length
        return LinearModel(
            mass=old.mass * (stiffness / rate**2),
            damping=old.damping * (stiffness / rate),
            stiffness=old.stiffness * stiffness,
            load_static=old.load_static * force,
            load_harmonic=old.load_harmonic * force,
            response=old.response,
        )

    contact: ContactInterface = replace(
        model.contact, gap=model.contact.gap * length, normal_load=model.contact.normal_load * force
    )
    return replace(model, linear={k: linear(old) for k, old in model.linear.items()}, contact=contact)


@pytest.mark.parametrize("seed", [0, 1])
def test_units_do_not_matter(seed: int) -> None:
    # random stiffness and mass: whichever formulation is chosen, it must be the same one in all units
    kinds = ("3d", "constant_load", "normal_only", "one_tangent")
    model = random_model(seed, kinds)
    length, force, rate = 1e3, 1e-6, 2.0**-7
    for omega in (OMEGA, 10 * OMEGA):
        before = build_penalty(model, omega, 3)
        after = build_penalty(scaled(model, length, force, rate), rate * omega, 3)
        assert np.array_equal(after.at_velocity, before.at_velocity)
        tangential = before.tangential * force / length / np.where(before.at_velocity, rate, 1.0)
        exists = (model.contact.dofs[:, 1:] >= 0).any(axis=1)
        assert after.tangential[exists] == pytest.approx(tangential[exists], rel=1e-10, abs=0.0)
        assert after.mean[exists] == pytest.approx((before.mean * force / length)[exists], rel=1e-10, abs=0.0)
        closing = model.contact.dofs[:, 0] >= 0
        assert after.normal[closing] == pytest.approx((before.normal * force / length)[closing], rel=1e-10, abs=0.0)


def test_a_pair_without_a_displacement_has_a_penalty_to_divide_by() -> None:
    model = random_model(3, ("constant_load", "normal_only"))
    penalty = build_penalty(model, OMEGA, 3)
    for values in (penalty.normal, penalty.tangential, penalty.mean):
        assert (values > 0).all()
        assert np.isfinite(values).all()


def test_a_static_state_is_at_displacement_level_with_the_same_stiffness() -> None:
    slider = build_penalty(scene("sdof_slider"), 2 * np.pi * 160, 5)
    static = static_penalty(slider)
    assert not static.at_velocity.any()
    rate = 6 * 2 * np.pi * 160
    assert static.tangential == pytest.approx(slider.tangential * rate, rel=1e-12, abs=0.0)
    assert np.array_equal(static.normal, slider.normal)
    joint = static_penalty(build_penalty(dovetail(), DOVETAIL_OMEGA, 3))
    assert np.array_equal(joint.tangential, build_penalty(dovetail(), DOVETAIL_OMEGA, 3).tangential)


@pytest.mark.parametrize("at_velocity", [False, True])
def test_motion_and_surplus_of_a_joint_are_inverse(at_velocity: bool) -> None:
    case = build_case(random_model(4), 0.4, OMEGA, SolverSettings(3, 16))
    penalty = replace(case.penalty, at_velocity=np.array([at_velocity, False, at_velocity]))
    joint = replace(case, penalty=penalty).joint(OMEGA, 60.0)
    surplus = np.random.default_rng(5).normal(size=(3, 3, 7))
    motion = joint.motion(surplus)
    assert joint.surplus(motion) == pytest.approx(surplus, abs=1e-12)
    if at_velocity:
        # a sliding velocity, not a displacement: amplitude over i n omega eps
        amplitude = surplus[0, 1, 3] - 1j * surplus[0, 1, 4]
        moved = motion[0, 1, 3] - 1j * motion[0, 1, 4]
        assert moved == pytest.approx(amplitude / (2j * OMEGA * penalty.tangential[0]), rel=1e-12, abs=0.0)
    else:
        assert motion[0, 1] == pytest.approx(surplus[0, 1] / penalty.tangential[0], rel=1e-12, abs=0.0)
