"""Contact with the neighbouring sector: the sector alone against all sectors of the ring."""

from dataclasses import fields, replace

import numpy as np
import pytest

from solver import SolverSettings
from solver.contact.coulomb import SLIP
from solver.harmonic_balance.dlft import Balance
from solver.loading_history.start_states import follow_branch
from solver.model import needed_nodal_diameters
from solver.structure.fourier import from_complex, to_complex
from solver.structure.joint import build_case
from solver.structure.penalty import Penalty
from studies.finite_element.reduced_joint import glued_frequencies, prepare_model
from studies.scene_error import SceneError
from studies.scenes import shrouded_sector
from tests.studies.shrouded_ring import reduced_ring, whole_ring

N = 6
STUBBY = shrouded_sector.Parameters(
    n_sectors=N, shroud_angle=20, blade_thickness=0.01, rim_radius=0.15, blade_length=0.08, rotation_speed=0.0
)


def frequencies_of_sector(joint_of=lambda joint: joint):
    model, joint = shrouded_sector.define_sector(STUBBY)
    prepared = prepare_model(model, joint_of(joint), n_reductions=N // 2 + 1)
    return [glued_frequencies(prepared, k, 4) for k in range(N // 2 + 1)]


def test_stuck_frequencies_of_all_waves_are_those_of_the_ring():
    sector = frequencies_of_sector()
    twice = [each for k, each in enumerate(sector) for _ in range(1 if k in (0, N // 2) else 2)]
    ring = glued_frequencies(prepare_model(*whole_ring(*shrouded_sector.define_sector(STUBBY))), 0, 14)
    np.testing.assert_allclose(np.sort(np.concatenate(twice))[:14], ring, rtol=1e-9)


def test_the_order_of_the_surfaces_does_not_matter():
    def other(joint):
        return replace(joint, contacts=tuple(each.turned_round for each in joint.contacts))

    np.testing.assert_allclose(frequencies_of_sector(other), frequencies_of_sector(), rtol=1e-9)


def test_a_ring_that_only_its_shrouds_join():
    """Without nodes on cut faces: the disks are apart, as blades on a stiff disk are."""

    def apart(joint):
        none = np.empty(0, dtype=np.int64)
        return replace(joint, cut=replace(joint.cut, left=none, right=none))

    model, joint = shrouded_sector.define_sector(STUBBY)
    ring = glued_frequencies(prepare_model(*whole_ring(model, apart(joint))), 0, 10)
    sector = frequencies_of_sector(apart)
    twice = [each for k, each in enumerate(sector) for _ in range(1 if k in (0, N // 2) else 2)]
    np.testing.assert_allclose(np.sort(np.concatenate(twice))[:10], ring, rtol=1e-9)


@pytest.mark.parametrize("change", [{"nodal_diameter": 4}, {"blade_thickness": 0.2}, {"rim_radius": 0.1}])
def test_impossible_sectors_are_refused(change):
    key = next(iter(change))
    with pytest.raises(SceneError) as caught:
        shrouded_sector.define_sector(STUBBY.model_copy(update=change))
    assert caught.value.key == key


def test_faces_that_do_not_meet_after_a_turn_are_said():
    model, joint = shrouded_sector.define_sector(STUBBY)
    axis = replace(joint.cut.axis, n_sectors=N + 1)
    with pytest.raises(SceneError, match="turn by one sector"):
        prepare_model(model, replace(joint, cut=replace(joint.cut, axis=axis)))


@pytest.mark.slow
@pytest.mark.parametrize("diameter", [N // 2, N - 1])
def test_a_wave_of_the_sector_is_one_of_the_ring(diameter):
    """Slipping states: turned from sector to sector, with the phase of the wave, they balance the ring as well.

    N - 1 turns the other way. The static friction that a state keeps of its history depends on where a period begins,
    and is left out.
    """
    folded, settings = min(diameter, N - diameter), SolverSettings(harmonics=3, samples=96)
    parameters = STUBBY.model_copy(update={"interference": 5e-4, "nodal_diameter": folded, "stuck_modes": 60})
    model = replace(shrouded_sector.build(parameters, 3), nodal_diameter=diameter)
    assert set(model.linear) == set(needed_nodal_diameters(diameter, N, 3)) | {folded}
    first = frequencies_of_sector()[folded][0]
    ((_, start),) = follow_branch(model, 0.3, 30.0, np.array([0.98 * first]), "up", settings)
    state, resolution, sector = start.state, start.resolution, build_case(model, 0.3, start.penalty_omega, settings)
    assert resolution == sector.resolution

    def turned(values_h):
        phases = np.exp(2j * np.pi * diameter * np.arange(N)[:, None] * np.array(resolution.orders) / N)
        parts = [from_complex(values_h[..., 0], phase * to_complex(values_h)) for phase in phases]
        return np.concatenate(parts)

    damping = parameters.loss_factor / (2.0 * np.pi * first)
    ring = reduced_ring(*shrouded_sector.define_sector(parameters), diameter, 360, damping)
    penalty = Penalty(*(np.tile(getattr(sector.penalty, each.name), N) for each in fields(Penalty)))
    case = replace(build_case(ring, 0.3, start.penalty_omega, settings), penalty=penalty)
    history = np.tile(state.start_history, (N, 1))
    balance = Balance(case.joint(state.omega, 30.0), history, np.zeros(len(history)))
    motion, force = turned(state.displacement_h), turned(state.contact_force_h)
    found = balance.evaluate(balance.predict(motion, force))
    assert (found.status_t == SLIP).mean() > 1e-3
    vibrating = np.abs(force[:, :, 1:]).max()
    np.testing.assert_allclose(found.force_h[:, :, 1:], force[:, :, 1:], atol=1e-8 * vibrating)
    assert np.abs(found.residual[:, 1:]).max() < 1e-6 * vibrating
