"""Which formulation the scene leads to, and the motion that belongs to a force in each of them."""

import numpy as np
import pytest

from solver.settings import Resolution, SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.structure.penalty import build_penalty
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
def test_a_mass_directly_on_a_slider_is_marched_with_its_mass(name, values, omega, inertial, n_harmonics):
    penalty = build_penalty(scene(name, n_harmonics, **values), omega, n_harmonics)
    assert penalty.inertial.tolist() == [inertial]


@pytest.mark.parametrize("n_harmonics", [1, 3, 7])
def test_an_elastic_joint_is_taken_at_displacement_level_near_its_stiffness(n_harmonics):
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


@pytest.mark.parametrize("orders", [(1, 2, 3), (1, 3, 5), (1,)])
@pytest.mark.parametrize("free", [[], [0, 2], [0, 1, 2]])
def test_motion_and_surplus_of_a_joint_are_inverse(free, orders):
    model = with_free_masses(random_model(4), free)
    case = build_case(model, 0.4, OMEGA, SolverSettings(), Resolution(orders, 16))
    penalty = case.penalty
    assert np.flatnonzero(penalty.inertial).tolist() == free
    joint = case.joint(OMEGA, 60.0)
    correction = np.random.default_rng(5).normal(size=(3, 3, 2 * len(orders) + 1))
    motion = joint.law.motion(correction)
    assert joint.law.force(motion) == pytest.approx(correction, abs=1e-12)
    several = np.random.default_rng(6).normal(size=(*correction.shape, 4))
    together = joint.law.motion(several)
    for column in range(4):
        alone = joint.law.motion(several[..., column])
        assert together[..., column] == pytest.approx(alone, rel=1e-13, abs=1e-13 * np.abs(alone).max())
    for pair in range(3):
        assert motion[pair, 0] == pytest.approx(correction[pair, 0] / penalty.normal[pair], rel=1e-12, abs=0.0)
        if pair not in free:
            assert motion[pair, 1] == pytest.approx(correction[pair, 1] / penalty.tangential[pair], rel=1e-12, abs=0.0)


def test_the_motion_of_a_marched_mass_is_that_of_newtons_law_as_the_steps_get_short():
    model = scene("sdof_slider")
    errors = []
    for samples in (32, 64, 128):
        case = build_case(model, 0.4, OMEGA, SolverSettings(), Resolution((1, 3, 5), samples))
        joint, penalty = case.joint(OMEGA, 60.0), case.penalty
        correction = np.random.default_rng(5).normal(size=(1, 3, 7))
        moved, force = to_complex(joint.law.motion(correction))[0, 1], to_complex(correction)[0, 1]
        rates = 1j * OMEGA * np.array([1, 3, 5])
        exact = force / (rates * (rates * penalty.mass[0] + penalty.drag[0]))
        errors.append(np.abs(moved / exact - 1.0).max())
        assert joint.law.motion(correction)[0, 1, 0] == pytest.approx(correction[0, 1, 0] / penalty.mean[0], rel=1e-12)
    # the trapezoidal rule: its error falls with the square of the step
    assert errors[0] < 0.1
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
