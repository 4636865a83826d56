"""Contact with the neighbouring sector: the sector alone against all sectors of the ring."""

from dataclasses import replace

import numpy as np
import pytest

from solver import frequency_response
from solver.model import needed_nodal_diameters
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
@pytest.mark.parametrize("diameter", [1, N // 2, N - 1])
def test_a_wave_on_the_sector_moves_as_on_the_ring(diameter):
    """The mirror N - 1 turns the other way."""
    folded = min(diameter, N - diameter)
    parameters = STUBBY.model_copy(update={"interference": 5e-4, "nodal_diameter": folded})
    sector = replace(shrouded_sector.build(parameters, 13), nodal_diameter=diameter)
    assert set(sector.linear) == set(needed_nodal_diameters(diameter, N, 13)) | {folded}
    first = frequencies_of_sector()[folded][0]
    damping = parameters.loss_factor / (2.0 * np.pi * first)
    ring = reduced_ring(*shrouded_sector.define_sector(parameters), diameter, 40, damping)
    found, expected = (frequency_response(each, [0.95 * first], 5.0, 0.3) for each in (sector, ring))
    turned = np.exp(2j * np.pi * diameter * np.arange(N) / N)
    np.testing.assert_allclose(expected.response[0], turned * found.response[0, 0], rtol=0.01)
