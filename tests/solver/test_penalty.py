"""Which formulation the scene leads to, and that units do not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.settings import Resolution, SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.structure.penalty import build_penalty, static_penalty
from tests.solver.models import OMEGA, dovetail, random_model, scene, with_free_masses

DOVETAIL_OMEGA = 2 * np.pi * 212.0


@pytest.mark.parametrize("n_harmonics", [1, 5, 21])
@pytest.mark.parametrize(
    ("name", "values", "omega", "inertial"),
    [
        ("sdof_slider", {}, 2 * np.pi * 160, True),
        ("sdof_slider", {"normal_stiffness": 0.0}, 2 * np.pi * 160, True),
        ("two_masses", {}, 0.5, True),
        ("vibro_impact", {}, 1.2, False),
    ],
)
def test_a_mass_directly_on_a_slider_is_marched_with_its_mass(
    name: str, values: dict[str, float], omega: float, inertial: bool, n_harmonics: int
) -> None:
    penalty = build_penalty(scene(name, n_harmonics, **values), omega, n_harmonics)
    assert penalty.inertial.tolist() == [inertial]


@pytest.mark.parametrize("n_harmonics", [1, 3, 7])
def test_an_elastic_joint_is_taken_at_displacement_level_near_its_stiffness(n_harmonics: int) -> None:
    model = dovetail()
    penalty = build_penalty(model, DOVETAIL_OMEGA, n_harmonics)
    assert not penalty.inertial.any()
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
        assert np.array_equal(after.inertial, before.inertial)
        tangential = before.tangential * force / length
        stiffness = force / length
        fast = before.inertial
        assert after.mass[fast] == pytest.approx(before.mass[fast] * stiffness / rate**2, rel=1e-9, abs=0.0)
        assert after.drag[fast] == pytest.approx(before.drag[fast] * stiffness / rate, rel=1e-9, abs=0.0)
        exists = (model.contact.dofs[:, 1:] >= 0).any(axis=1)
        assert after.tangential[exists] == pytest.approx(tangential[exists], rel=1e-10, abs=0.0)
        assert after.mean[exists] == pytest.approx((before.mean * force / length)[exists], rel=1e-10, abs=0.0)
        closing = model.contact.dofs[:, 0] >= 0
        assert after.normal[closing] == pytest.approx((before.normal * force / length)[closing], rel=1e-10, abs=0.0)


def test_a_pair_without_a_displacement_has_a_penalty_to_divide_by() -> None:
    model = random_model(3, ("constant_load", "normal_only"))
    penalty = build_penalty(model, OMEGA, 3)
    for values in (penalty.normal, penalty.tangential, penalty.mean, penalty.mass, penalty.drag):
        assert (values > 0).all()
        assert np.isfinite(values).all()


def test_a_static_state_is_at_displacement_level_with_the_same_stiffness() -> None:
    slider = build_penalty(scene("sdof_slider"), 2 * np.pi * 160, 5)
    static = static_penalty(slider)
    assert slider.inertial.all()
    assert not static.inertial.any()
    # k + s^2 m of the slider at the rate s of the first harmonic left out
    rate = 6 * 2 * np.pi * 160
    assert static.tangential == pytest.approx(1.6e5 + 0.1 * rate**2, rel=1e-12, abs=0.0)
    at_frequency = 1.6e5 + 0.1 * (2 * np.pi * 160) ** 2
    assert static.mean == pytest.approx(1e-5 * at_frequency, rel=1e-12, abs=0.0)
    assert np.array_equal(static.normal, slider.normal)
    joint = static_penalty(build_penalty(dovetail(), DOVETAIL_OMEGA, 3))
    assert np.array_equal(joint.tangential, build_penalty(dovetail(), DOVETAIL_OMEGA, 3).tangential)


@pytest.mark.parametrize(("name", "mass"), [("sdof_slider", 0.1), ("two_masses", 1.0)])
@pytest.mark.parametrize("highest", [1, 5, 21])
def test_the_mass_of_a_slider_is_its_own(name: str, mass: float, highest: int) -> None:
    omega = {"sdof_slider": 2 * np.pi * 160, "two_masses": 0.5}[name]
    penalty = build_penalty(scene(name), omega, highest)
    # seen through the spring to the other mass: of the order (w_0 / s)^4 for two masses, exact for one
    rate = (highest + 1) * omega
    slack = 1e-12 if name == "sdof_slider" else 4.0 / rate**4 + 1e-12
    assert penalty.mass == pytest.approx([mass], rel=slack, abs=0.0)
    assert penalty.drag == pytest.approx(0.1 * penalty.mass * omega, rel=1e-12, abs=0.0)


def test_a_free_mass_among_elastic_pairs_is_found_by_itself() -> None:
    model = with_free_masses(random_model(6, ("3d", "constant_load", "one_tangent", "3d")), [1, 3])
    assert build_penalty(model, OMEGA, 3).inertial.tolist() == [False, True, False, True]


@pytest.mark.parametrize("orders", [(1, 2, 3), (1, 3, 5), (1,)])
@pytest.mark.parametrize("free", [[], [0, 2], [0, 1, 2]])
def test_motion_and_surplus_of_a_joint_are_inverse(free: list[int], orders: tuple[int, ...]) -> None:
    model = with_free_masses(random_model(4), free)
    case = build_case(model, 0.4, OMEGA, SolverSettings(), Resolution(orders, 16))
    penalty = case.penalty
    assert np.flatnonzero(penalty.inertial).tolist() == free
    joint = case.joint(OMEGA, 60.0)
    correction = np.random.default_rng(5).normal(size=(3, 3, 2 * len(orders) + 1))
    motion = joint.motion(correction)
    assert joint.force_correction(motion) == pytest.approx(correction, abs=1e-12)
    several = np.random.default_rng(6).normal(size=(*correction.shape, 4))
    together = joint.motion(several)
    for column in range(4):
        alone = joint.motion(several[..., column])
        assert together[..., column] == pytest.approx(alone, rel=1e-13, abs=1e-13 * np.abs(alone).max())
    for pair in range(3):
        assert motion[pair, 0] == pytest.approx(correction[pair, 0] / penalty.normal[pair], rel=1e-12, abs=0.0)
        if pair not in free:
            assert motion[pair, 1] == pytest.approx(correction[pair, 1] / penalty.tangential[pair], rel=1e-12, abs=0.0)


def test_the_motion_of_a_marched_mass_is_that_of_newtons_law_as_the_steps_get_short() -> None:
    model = scene("sdof_slider")
    errors = []
    for samples in (32, 64, 128):
        case = build_case(model, 0.4, OMEGA, SolverSettings(), Resolution((1, 3, 5), samples))
        joint, penalty = case.joint(OMEGA, 60.0), case.penalty
        correction = np.random.default_rng(5).normal(size=(1, 3, 7))
        moved, force = to_complex(joint.motion(correction))[0, 1], to_complex(correction)[0, 1]
        rates = 1j * OMEGA * np.array([1, 3, 5])
        exact = force / (rates * (rates * penalty.mass[0] + penalty.drag[0]))
        errors.append(np.abs(moved / exact - 1.0).max())
        assert joint.motion(correction)[0, 1, 0] == pytest.approx(correction[0, 1, 0] / penalty.mean[0], rel=1e-12)
    # the trapezoidal rule: its error falls with the square of the step
    assert errors[0] < 0.1
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
