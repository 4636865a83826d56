"""Springs in series with the pairs: condensed compliance, closed forms, other unknowns, the rigid limit."""

import numpy as np
import pytest

from solver import frequency_response, march_wear, with_contact_stiffness
from solver.compliant_contact import LARGEST_CONTACT_STIFFNESS as LARGEST
from solver.compliant_contact import TANGENTIAL_RATIO
from solver.structure.condensation import build_structure, relative_indices
from studies import build_scene
from tests.references import den_hartog_amplitude, slider_wear_depth
from tests.solver.models import OMEGA, cyclic_model, random_model

KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only")
SOFT = 2e11  # N/m3; with the areas of the models about their stiffness


@pytest.mark.parametrize(("wave", "contact_stiffness"), [(False, SOFT), (True, 1e-3 * SOFT), (False, LARGEST)])
def test_contact_forces_move_the_contact_by_the_springs_more(wave, contact_stiffness):
    rigid = cyclic_model(9, KINDS, 6, 2, 5) if wave else random_model(1, KINDS, 4)
    soft = with_contact_stiffness(rigid, contact_stiffness)
    relative, components = relative_indices(rigid.contact)
    assert relative_indices(soft.contact)[0].tolist() == relative.tolist()
    orders = (1, 2, 3)
    body, joint = (build_structure(model, OMEGA, 60.0, orders) for model in (rigid, soft))
    # forces of the contact that drive the bodies to some motion v, and the motion u of the contact
    moved = np.random.default_rng(2).normal(size=(relative.size, 7)) * 1e-6
    force = body.force_h() - body.apply(moved)
    ratio = np.where(components % 3 == 0, 1.0, 2.0 * 0.7 / 1.7)
    springs = contact_stiffness * ratio * rigid.contact.area[components // 3]
    contact = moved - force / springs[:, None]
    assert np.abs(joint.force_h() - joint.apply(contact) - force).max() < 1e-9 * np.abs(force).max()
    expected = body.response_h(moved)
    assert joint.response_h(contact) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    # energy: the springs take none, so that what the excitation puts in leaves through the contact or the dampers
    assert joint.input_work(contact) == pytest.approx(body.input_work(moved), rel=1e-8)


def test_a_stuck_block_on_its_foundation_is_a_mass_on_two_springs():
    contact_stiffness = 5e9
    block = build_scene("sdof_slider", normal_load=1e6, normal_stiffness=0.0, contact_stiffness=contact_stiffness)
    spring = 1.6e5 + TANGENTIAL_RATIO * contact_stiffness * 1e-4
    found = frequency_response(block, 300.0, 10.0, friction_coefficient=0.5).response[0, 0]
    assert abs(found) == pytest.approx(10.0 / abs(spring - 0.1 * (2.0 * np.pi * 300.0) ** 2), rel=1e-9)


def test_a_spring_that_presses_gives_way_to_rough_surfaces():
    """The force is divided by 1 + k_N / (contact stiffness times area), as the pages of the scene say."""
    block = build_scene("sdof_slider", contact_stiffness=2e10)
    found = march_wear(block, 160.0, 10.0, 0.5, 0.0, [0.0], wear_depth=[2e-5])
    assert 1e-4 * found.mean_pressure[0, 0] == pytest.approx((10.0 - 1e5 * 2e-5) / 1.05, rel=1e-9)


@pytest.mark.slow
def test_wear_relaxes_the_spring_that_presses_and_the_contact_in_series():
    """Den Hartog's slider: along the support the contact is rigid beside the mount, across it twice as stiff."""
    springs = {"normal_stiffness": 5e10, "contact_stiffness": 1e15}
    cycles = np.array([0.0, 100.0, 250.0])
    expected = slider_wear_depth(
        cycles,
        lambda friction: den_hartog_amplitude(0.1, 1.6e5, 10.0, friction, 2.0 * np.pi * 160.0),
        wear=1.1e-14,
        # the far end of the pressing spring stays where it is
        load=10.0 / (1.0 + 5e10 / 1e11),
        stiffness=1.0 / (1.0 / 5e10 + 1.0 / 1e11),
    )
    history = march_wear(build_scene("sdof_slider", **springs), 160.0, 10.0, 0.5, 1.1e-14, cycles)
    assert expected[-1] > 0.3 * 10.0 / 5e10
    assert history.wear_depth[:, 0] == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("wrong", [0.0, np.nan, 1e23])
def test_a_contact_stiffness_that_cannot_be_is_said(wrong):
    with pytest.raises(ValueError, match="give a positive number, at most 1e"):
        with_contact_stiffness(random_model(1, KINDS, 4), wrong)
