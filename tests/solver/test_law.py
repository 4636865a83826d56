"""Elastic pairs and masses on sliders in one joint: each as it is alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.alternating_frequency_time import Marched, law_tangent, march_law
from solver.contact.coulomb import SEPARATED, SLIP, STICK, mean_normal_force, mean_normal_tangent
from solver.contact.period_march import integrate_slip_work, march_period
from solver.contact.rigid_slider import march_masses
from solver.contact.tangent import march_tangent, mass_tangent
from solver.settings import Resolution, SolverSettings
from solver.structure.joint import Joint, build_case
from tests.solver.models import OMEGA, PRELOAD, random_model, with_free_masses

KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "3d", "constant_load_one_tangent")
FREE = [1, 3, 4]
FRICTION = 0.4
RESOLUTIONS = [Resolution((1, 2, 3), 32), Resolution((1, 3, 5), 64)]
FloatArray = np.ndarray


def mixed_joint(resolution: Resolution, free: list[int] = FREE, friction: float | FloatArray = FRICTION) -> Joint:
    model = with_free_masses(random_model(1, KINDS), free)
    joint = build_case(model, friction, OMEGA, SolverSettings(), resolution).joint(OMEGA, 60.0)
    assert np.flatnonzero(joint.penalty.inertial).tolist() == free
    return joint


def predicted(joint: Joint, seed: int = 2) -> tuple[FloatArray, FloatArray]:
    """Predicted force (6, 3, m), N, at which pairs stick, slip and open, and a history, m."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(6, 3, 2 * joint.basis.n_harmonics + 1)) * PRELOAD * 0.6
    values[:, 0, 0] = PRELOAD
    values[:, 1:, 0] *= 0.1
    values[~joint.has_normal, 0, 1:] = 0.0
    values.reshape(18, -1)[np.setdiff1d(np.arange(18), joint.component_index)] = 0.0
    values[~joint.has_normal, 0, 0] = PRELOAD
    history = random.normal(size=(6, 2)) * 0.1 * PRELOAD / joint.penalty.tangential[:, None]
    return values, history


def of_pairs(joint: Joint, pairs: list[int]) -> Joint:
    """The same joint with some of its pairs alone; its structure is not used."""
    penalty = replace(joint.penalty, **{name: value[pairs] for name, value in vars(joint.penalty).items()})
    contact = replace(joint.contact, dofs=joint.contact.dofs[pairs])
    own = {name: getattr(joint, name)[pairs] for name in ("friction_coefficient", "has_normal", "line")}
    return replace(joint, penalty=penalty, contact=contact, **own)


def assert_same(found: Marched, expected: Marched, pairs: list[int]) -> None:
    for name in ("status_t", "periods"):
        assert np.array_equal(getattr(found, name)[pairs], getattr(expected, name)), name
    # a product of matrices of another height may differ in its last digit
    for name in ("predicted_t", "force_t", "force_h", "state_t", "start", "slip_work"):
        values = getattr(expected, name)
        size = np.abs(values).max()
        assert getattr(found, name)[pairs] == pytest.approx(values, rel=1e-12, abs=1e-12 * size), name


@pytest.mark.parametrize("friction", [FRICTION, np.linspace(0.3, 0.55, 6)], ids=["one", "of each pair"])
@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_pairs_of_a_mixed_joint_are_as_they_are_alone(resolution: Resolution, friction: float | FloatArray) -> None:
    joint = mixed_joint(resolution, friction=friction)
    values, history = predicted(joint)
    together = march_law(joint, values, history)
    assert {SEPARATED, STICK, SLIP} <= set(together.status_t[FREE].ravel())
    elastic = [0, 2, 5]
    assert {STICK, SLIP} <= set(together.status_t[elastic].ravel())
    force_tangent, slip_tangent = law_tangent(joint, together)
    groups = [FREE, elastic, *([pair] for pair in range(6))]
    for pairs in groups:
        part = of_pairs(joint, pairs)
        alone = march_law(part, values[pairs], history[pairs])
        assert_same(together, alone, pairs)
        its_force_tangent, its_slip_tangent = law_tangent(part, alone)
        assert force_tangent[pairs] == pytest.approx(its_force_tangent, abs=1e-11)
        assert slip_tangent[pairs] == pytest.approx(its_slip_tangent, abs=1e-11 * np.abs(slip_tangent).max())
    largest_error = max(march_law(of_pairs(joint, [p]), values[[p]], history[[p]]).periodicity_error for p in range(6))
    assert together.periodicity_error == pytest.approx(largest_error, rel=1e-3, abs=1e-9 * PRELOAD)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_elastic_pairs_are_those_of_their_kernel(resolution: Resolution) -> None:
    joint = mixed_joint(resolution, [])
    values, history = predicted(joint)
    found = march_law(joint, values, history)
    predicted_t = values @ joint.basis.synthesis
    start = history * joint.penalty.tangential[:, None]
    closure = 1e-10 * FRICTION * predicted_t[:, 0].max()
    force_t, state_t, status_t, periods, error = march_period(
        predicted_t, joint.friction_coefficient, start, closure, 400
    )
    assert np.array_equal(found.force_t, force_t)
    assert np.array_equal(found.state_t, state_t)
    assert np.array_equal(found.status_t, status_t)
    assert np.array_equal(found.periods, periods)
    assert np.array_equal(found.start, start)
    assert found.periodicity_error == error.max()
    assert found.slip_work == pytest.approx(integrate_slip_work(force_t, state_t) / joint.penalty.tangential, rel=1e-14)
    assert found.force_h[:, 1:] == pytest.approx((force_t @ joint.basis.analysis)[:, 1:], rel=1e-12, abs=1e-12)
    normal_h = mean_normal_force(predicted_t) @ joint.basis.analysis
    assert found.force_h[:, 0] == pytest.approx(normal_h, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_masses_are_those_of_their_kernel_under_means_over_the_steps(resolution: Resolution) -> None:
    joint = mixed_joint(resolution)
    values, history = predicted(joint)
    found = march_law(joint, values, history)
    n_samples, orders = joint.basis.n_samples, joint.basis.orders
    # the mean over a step around a sample, by quadrature
    points, weights = np.polynomial.legendre.leggauss(8)
    means = np.zeros((6, 3, n_samples))
    for point, weight in zip(points, weights, strict=True):
        phase = 2.0 * np.pi * (np.arange(n_samples) + 0.5 * point) / n_samples
        rows = np.array([np.ones(n_samples), *(f(n * phase) for n in orders for f in (np.cos, np.sin))])
        means += 0.5 * weight * (values @ rows)
    means[:, 0] = values[:, 0] @ joint.basis.synthesis
    assert found.predicted_t[FREE] == pytest.approx(means[FREE], rel=1e-12, abs=1e-10)
    mass, drag, line = joint.penalty.mass[FREE], joint.penalty.drag[FREE], joint.line[FREE]
    step = 2.0 * np.pi / OMEGA / n_samples
    assert joint.sample_step == pytest.approx(step, rel=1e-15)
    force_t, velocity_t, place_t, _, slip_work, _ = march_masses(
        means[FREE], joint.friction_coefficient[FREE], mass, drag, line, step
    )
    assert found.force_t[FREE] == pytest.approx(force_t, abs=1e-9)
    assert found.state_t[FREE] == pytest.approx(place_t, abs=1e-9 * np.abs(place_t).max())
    assert found.start[FREE] == pytest.approx(velocity_t[:, :, 0], abs=1e-9 * np.abs(velocity_t).max())
    assert found.slip_work[FREE] == pytest.approx(slip_work, rel=1e-9)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_the_motion_of_a_joint_is_that_of_the_march(resolution: Resolution) -> None:
    # the harmonics of u = motion(p - lambda) against those of the places that the mass was marched through
    joint = mixed_joint(resolution)
    values, history = predicted(joint)
    values[:, 1:, 0] = 0.0
    found = march_law(joint, values, history)
    moved = joint.motion(values - found.force_h)
    for pair in FREE:
        velocity_t = np.diff(found.state_t[pair]) / joint.sample_step  # means over the steps
        velocity_h = (velocity_t @ joint.basis.analysis) / joint.step_mean_factor()
        expected = np.empty_like(velocity_h[:, 1:])
        rates = OMEGA * np.array(joint.basis.orders)
        expected[:, 0::2], expected[:, 1::2] = -velocity_h[:, 2::2] / rates, velocity_h[:, 1::2] / rates
        # a stop within a step is resolved by the march alone: second order in the step
        slack = 40.0 / resolution.samples**2 * np.abs(expected).max()
        assert np.abs(moved[pair, 1:, 1:] - expected).max() < slack


def test_the_harmonics_of_a_stuck_mass_are_those_of_its_predicted_force() -> None:
    joint = mixed_joint(RESOLUTIONS[1])
    values, history = predicted(joint)
    values[:, 0] = 0.0
    values[:, 0, 0] = 1e6
    found = march_law(joint, values, history)
    assert (found.status_t[FREE] == STICK).all()
    assert found.force_h[FREE] == pytest.approx(values[FREE], abs=1e-10 * PRELOAD + 1e-15 * 1e6)
    assert not found.slip_work.any()
    force_tangent, slip_tangent = law_tangent(joint, found)
    assert not slip_tangent.any()
    m = values.shape[2]
    for pair in FREE:
        own = joint.component_index[joint.component_index // 3 == pair] % 3
        select = (own[own > 0][:, None] * m + np.arange(m)).ravel()
        block = force_tangent[pair][np.ix_(select, select)]
        assert block == pytest.approx(np.eye(select.size), abs=1e-12)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_pairs_that_stick_or_are_open_all_period_long_have_the_tangents_of_the_kernels(resolution: Resolution) -> None:
    joint = mixed_joint(resolution)
    values, history = predicted(joint)
    m = values.shape[2]
    # two pairs stick, two are open, of each kind one; the others switch
    values[[0, 3], 0] = 0.0
    values[[0, 3], 0, 0] = 1e3 * PRELOAD
    values[[2, 4], 0] = 0.0
    values[[2, 4], 0, 0] = -PRELOAD
    found = march_law(joint, values, history)
    assert [set(found.status_t[pair]) for pair in (0, 2, 3, 4)] == [{STICK}, {SEPARATED}, {STICK}, {SEPARATED}]
    assert len(set(found.status_t[5])) > 1
    force_tangent, slip_tangent = law_tangent(joint, found)
    assert not slip_tangent[[0, 2, 3, 4]].any()
    basis, factor = joint.basis, joint.step_mean_factor()
    elastic = [0, 2, 5]
    by_kernel, _ = march_tangent(
        found.predicted_t[elastic],
        joint.friction_coefficient[elastic],
        *(part[elastic] for part in (found.start, found.state_t, found.periods, joint.line)),
        basis.synthesis,
        basis.analysis,
        joint.has_normal[elastic],
    )
    masses, _ = mass_tangent(
        found.predicted_t[FREE],
        joint.friction_coefficient[FREE],
        *(part[FREE] for part in (joint.penalty.mass, joint.penalty.drag, joint.line)),
        joint.sample_step,
        found.start[FREE],
        basis.synthesis,
        basis.synthesis * factor[:, None],
        basis.analysis / factor,
        joint.has_normal[FREE],
    )
    normal = mean_normal_tangent(found.predicted_t, basis.synthesis, basis.analysis, joint.has_normal)
    for pair in range(6):
        kernel = by_kernel[elastic.index(pair)] if pair in elastic else masses[FREE.index(pair)]
        kernel[:m, :m] = normal[pair]
        own = joint.component_index[joint.component_index // 3 == pair] % 3
        select = np.ix_(*2 * [(own[:, None] * m + np.arange(m)).ravel()])
        assert force_tangent[pair][select] == pytest.approx(kernel[select], abs=1e-11)
