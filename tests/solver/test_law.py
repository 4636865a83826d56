"""Elastic pairs and masses on sliders in one joint: each as it is alone."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.coulomb import SEPARATED, SLIP, STICK
from solver.settings import Resolution, SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, PRELOAD, random_model, with_free_masses

KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "3d", "constant_load_one_tangent")
FREE = [1, 3, 4]
FRICTION = 0.4
RESOLUTIONS = [Resolution((1, 2, 3), 32), Resolution((1, 3, 5), 64)]
FloatArray = np.ndarray


def mixed_joint(resolution, free=FREE, friction=FRICTION):
    model = with_free_masses(random_model(1, KINDS), free)
    joint = build_case(model, friction, OMEGA, SolverSettings(), resolution).joint(OMEGA, 60.0)
    assert np.flatnonzero(joint.penalty.inertial).tolist() == free
    return joint


def predicted(joint, seed=2):
    """Predicted force (6, 3, m), N, at which pairs stick, slip and open, and a history, m."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(6, 3, 2 * joint.basis.n_harmonics + 1)) * PRELOAD * 0.6
    values[:, 0, 0] = PRELOAD
    values[:, 1:, 0] *= 0.1
    values[~joint.contact.has_normal, 0, 1:] = 0.0
    values.reshape(18, -1)[np.setdiff1d(np.arange(18), joint.component_index)] = 0.0
    values[~joint.contact.has_normal, 0, 0] = PRELOAD
    history = random.normal(size=(6, 2)) * 0.1 * PRELOAD / joint.penalty.tangential[:, None]
    return values, history


def of_pairs(law, pairs):
    """The law of some of the pairs alone."""
    penalty = replace(law.penalty, **{name: value[pairs] for name, value in vars(law.penalty).items()})
    contact = replace(law.contact, dofs=law.contact.dofs[pairs], area=law.contact.area[pairs])
    return replace(law, penalty=penalty, contact=contact, friction_coefficient=law.friction_coefficient[pairs])


def assert_same(found, expected, pairs):
    for name in ("status_t", "periods"):
        assert np.array_equal(getattr(found, name)[pairs], getattr(expected, name)), name
    # a product of matrices of another height may differ in its last digit
    for name in ("predicted_t", "force_t", "force_h", "state_t", "start", "slip_work"):
        values = getattr(expected, name)
        size = np.abs(values).max()
        assert getattr(found, name)[pairs] == pytest.approx(values, rel=1e-12, abs=1e-12 * size), name


@pytest.mark.parametrize("friction", [FRICTION, np.linspace(0.3, 0.55, 6)], ids=["one", "of each pair"])
@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_pairs_of_a_mixed_joint_are_as_they_are_alone(resolution, friction):
    joint = mixed_joint(resolution, friction=friction)
    values, history = predicted(joint)
    together = joint.law.march(values, history)
    assert {SEPARATED, STICK, SLIP} <= set(together.status_t[FREE].ravel())
    elastic = [0, 2, 5]
    assert {STICK, SLIP} <= set(together.status_t[elastic].ravel())
    force_tangent, slip_tangent = joint.law.tangent(together)
    groups = [FREE, elastic, *([pair] for pair in range(6))]
    for pairs in groups:
        part = of_pairs(joint.law, pairs)
        alone = part.march(values[pairs], history[pairs])
        assert_same(together, alone, pairs)
        its_force_tangent, its_slip_tangent = part.tangent(alone)
        assert force_tangent[pairs] == pytest.approx(its_force_tangent, abs=1e-11)
        assert slip_tangent[pairs] == pytest.approx(its_slip_tangent, abs=1e-11 * np.abs(slip_tangent).max())
    largest_error = max(of_pairs(joint.law, [p]).march(values[[p]], history[[p]]).periodicity_error for p in range(6))
    assert together.periodicity_error == pytest.approx(largest_error, rel=1e-3, abs=1e-9 * PRELOAD)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_the_motion_of_a_joint_is_that_of_the_march(resolution):
    # the harmonics of u = motion(p - lambda) against those of the places that the mass was marched through
    joint = mixed_joint(resolution)
    values, history = predicted(joint)
    values[:, 1:, 0] = 0.0
    found = joint.law.march(values, history)
    moved = joint.law.motion(values - found.force_h)
    for pair in FREE:
        velocity_t = np.diff(found.state_t[pair]) / joint.law.sample_step  # means over the steps
        velocity_h = (velocity_t @ joint.basis.analysis) / joint.basis.step_mean
        expected = np.empty_like(velocity_h[:, 1:])
        rates = OMEGA * np.array(joint.basis.orders)
        expected[:, 0::2], expected[:, 1::2] = -velocity_h[:, 2::2] / rates, velocity_h[:, 1::2] / rates
        # a stop within a step is resolved by the march alone: second order in the step
        slack = 40.0 / resolution.samples**2 * np.abs(expected).max()
        assert np.abs(moved[pair, 1:, 1:] - expected).max() < slack
