"""Fretting loops: exact cases, the laws in every loop, and loops between the steps of a march."""

from functools import lru_cache

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.results.state_report import LOOP_PHASES, at_phases, loop_phases
from solver.settings import Scheme, SolverSettings
from tests.solver.models import branch_states, march_wear, scene

FRICTION = 0.5
AREA = 1e-4
WEAR = 1.1e-11  # 1/Pa
SLIDER = SolverSettings(harmonics=9, samples=256)
DOVETAIL = SolverSettings(harmonics=5, samples=64)
SCHEMES: tuple[Scheme, ...] = ("explicit", "implicit", "adaptive")
CYCLES = np.array([0.0, 2000.0, 8000.0, 14000.0, 16000.0])


@lru_cache
def slider_start(settings=SLIDER):
    model = scene("sdof_slider", settings.harmonics)
    (start,) = branch_states(model, FRICTION, 10.0, [2 * np.pi * 160.0], settings)
    return model, start


def slider_march(scheme, cycles, settings=SLIDER):
    model, start = slider_start(settings)
    return march_wear(model, FRICTION, start, WEAR, 8000.0, scheme, cycles, settings, loops=(0,))


@lru_cache
def dovetail_start():
    model = scene("dovetail_sector", 5, mesh=1)
    return model, branch_states(model, FRICTION, 0.5, [2 * np.pi * 212.0, 2 * np.pi * 213.0], DOVETAIL)[1]


@lru_cache
def dovetail_march(scheme):
    model, start = dovetail_start()
    cycles = np.array([0.0, 500.0, 2000.0])
    history = march_wear(model, FRICTION, start, WEAR, 1000.0, scheme, cycles, DOVETAIL, loops=tuple(range(16)))
    assert history.outcome is Outcome.CONVERGED
    assert history.slip_range.max() > 1e-7
    return history


def closed(values):
    """The loop with its first phase once more at its end; phases on axis -2."""
    return np.concatenate([values, values[..., :1, :]], axis=-2)


def loop_work(history):
    """Integral of the tangential force over the displacement (n_output, n_loops), N m."""
    motion, force = (closed(values)[..., 1:] for values in (history.loop_displacement, history.loop_force))
    mean = 0.5 * (force[..., 1:, :] + force[..., :-1, :])
    return np.sum(mean * np.diff(motion, axis=-2), axis=(-2, -1))


@pytest.mark.parametrize(("samples", "lead"), [(64, 0.0), (96, 0.5), (200, 0.0), (256, 0.5)])
def test_between_samples_the_values_are_those_of_straight_lines(samples, lead):
    values = np.random.default_rng(samples).normal(size=(2, samples))
    phases = 2 * np.pi * (np.arange(samples) - lead) / samples
    found = at_phases(values, lead)
    for row, own in zip(found, values, strict=True):
        assert row == pytest.approx(np.interp(loop_phases(), phases, own, period=2 * np.pi), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_loop_of_a_sliding_mass_is_a_rectangle(scheme):
    history = slider_march(scheme, CYCLES)
    motion, force = history.loop_displacement[:, 0], history.loop_force[:, 0]
    assert motion.shape == force.shape == (CYCLES.size, LOOP_PHASES, 3)
    normal = 10.0 - 1e5 * history.wear_depth[:, 0]
    assert force[..., 0] == pytest.approx(np.repeat(normal[:, None], LOOP_PHASES, 1), rel=1e-9, abs=0.0)
    assert motion[..., 0] == pytest.approx(np.repeat(history.wear_depth, LOOP_PHASES, 1), rel=1e-9, abs=1e-15)
    assert not motion[..., 2].any()
    assert not force[..., 2].any()
    # the force is at its limit but in the steps in which the mass turns, of both states that are interpolated
    share = np.abs(force[..., 1]) / (FRICTION * force[..., 0])
    assert share.max() <= 1 + 1e-12
    assert np.count_nonzero(share < 1 - 1e-9, axis=1).max() <= 4
    # and against the motion
    velocity = np.roll(motion[..., 1], -1, axis=1) - np.roll(motion[..., 1], 1, axis=1)
    fast = np.abs(velocity) > 0.1 * np.abs(velocity).max()
    assert (velocity * force[..., 1] > 0.0)[fast].all()


@pytest.mark.parametrize(("scheme", "samples"), [("explicit", 64), ("implicit", 256), ("adaptive", 64)])
def test_the_loop_encloses_the_energy_that_friction_takes(scheme, samples):
    history = slider_march(scheme, np.array([0.0, 8000.0, 16000.0]), SolverSettings(harmonics=9, samples=samples))
    work = loop_work(history)[:, 0]
    sliding = 0.5 * np.ptp(history.loop_displacement[:, 0, :, 1], axis=1)
    limit = FRICTION * history.mean_pressure[:, 0] * AREA
    # 128 straight lines cut the corners of the rectangle, by the square of a step
    assert work == pytest.approx(4 * limit * sliding, rel=3e-3, abs=0.0)
    assert work == pytest.approx(FRICTION * history.wear_rate / WEAR, rel=3e-3, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_loops_of_a_joint_keep_the_laws(scheme):
    history = dovetail_march(scheme)
    model, _ = dovetail_start()
    normal, tangential = history.loop_force[..., 0], np.linalg.norm(history.loop_force[..., 1:], axis=-1)
    assert (normal >= 0.0).all()
    assert (tangential <= FRICTION * normal * (1 + 1e-12) + 1e-12 * normal.max()).all()
    # a pair that opens does so between two samples
    mean = history.mean_pressure * model.contact.area
    always = history.open_fraction == 0.0
    assert normal.mean(axis=-1)[always] == pytest.approx(mean[always], rel=1e-9, abs=0.0)
    assert np.abs(normal.mean(axis=-1) - mean).max() < 5e-3 * mean.max()
    # a closed pair lies on its worn surface
    depth = np.repeat(history.wear_depth[..., None], LOOP_PHASES, axis=-1)
    lifted = history.loop_displacement[..., 0] - depth
    largest = np.abs(history.loop_displacement[..., 1:]).max()
    assert np.abs(lifted[always]).max() < 1e-2 * largest
    # where much slips the slip is nearly all of the motion
    motion = history.loop_displacement[..., 1:]
    distance = np.linalg.norm(motion[..., :, None, :] - motion[..., None, :, :], axis=-1).max(axis=(-2, -1))
    slips = history.slip_range > 0.5 * history.slip_range.max()
    assert distance[slips] == pytest.approx(history.slip_range[slips], rel=0.1, abs=0.0)


@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_between_steps_loops_are_interpolated_like_all_else(scheme):
    ends, between = (slider_march(scheme, cycles) for cycles in (CYCLES[[0, 2, 4]], CYCLES))
    for name in ("loop_displacement", "loop_force", "mean_pressure"):
        whole, inner = getattr(ends, name), getattr(between, name)
        scale = np.abs(whole).max()
        assert inner[[0, 2, 4]] == pytest.approx(whole, rel=0.0, abs=1e-14 * scale)
        assert inner[1] == pytest.approx(0.75 * whole[0] + 0.25 * whole[1], rel=0.0, abs=1e-12 * scale)
        assert inner[3] == pytest.approx(0.25 * whole[1] + 0.75 * whole[2], rel=0.0, abs=1e-12 * scale)
