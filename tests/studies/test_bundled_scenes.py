"""The registry of scenes, the three textbook scenes against their equations, and the bundled dovetail sector."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from solver.model import needed_nodal_diameters
from studies import build_scene
from studies.finite_element.solid_mesh import assemble_mass, centrifugal_load
from studies.model_check import check_model
from studies.scene_error import SceneError
from studies.scenes import scene_help
from studies.scenes.dovetail_sector import Parameters
from studyrunner.cli import main
from tests.random_decks import static_forces


@pytest.mark.parametrize(
    ("name", "values"),
    [
        *((name, {}) for name in ("sdof_slider", "two_masses", "vibro_impact")),
        *((name, values) for name in ("cylinder_on_flat", "sphere_on_flat") for values in ({}, {"stroke": 1e-6})),
    ],
)
def test_scenes_are_possible_structures(name, values):
    check_model(build_scene(name, **values), n_harmonics=21)


DAMPER = {"rim_radius": 0.1, "platform_gap": 0.02, "damper_half_width": 0.1, "platform_thickness": 0.002}
DAMPER["damper_height"] = 0.1


@pytest.mark.parametrize(
    ("name", "values", "key"),
    [
        ("cylinder_on_flat", {"R": 1e308}, "model"),
        ("cylinder_on_flat", {"depth": 1e-9}, "depth"),
        ("sphere_on_flat", {"R": 1e308}, "model"),
        ("dovetail_sector", {"mesh": 1, "young_modulus": 1e-300}, "model"),
        *(("shrouded_sector", {key: value}, key) for key, value in {"blade_thickness": 0.2, "rim_radius": 0.1}.items()),
        *(("underplatform_damper", {key: value}, key) for key, value in DAMPER.items()),
    ],
)
def test_numbers_far_from_what_can_be_are_refused(name, values, key):
    with pytest.raises(SceneError) as caught:
        build_scene(name, **values)
    assert caught.value.key == key


# mass, damping, stiffness, constant and harmonic load of the exact motions of `tests.references`
CHAIN = np.eye(2), [[0.04, -0.02], [-0.02, 0.02]], [[2.0, -1.0], [-1.0, 1.0]], [0.0, 0.0], [1.0, 0.0]
WALL = np.diag([0.0, 1.0]), np.diag([0.0, 0.05]), [[100.0, -100.0], [-100.0, 101.0]], [0.0, 0.0], [0.0, 1.0]
PRESSED = np.diag([0.0, 0.1]), np.zeros((2, 2)), np.diag([2e4, 1.6e5]), [8.0, 0.0], [0.0, 1.0]
TEXTBOOK = {
    "two_masses": ({}, CHAIN, [-1, 1, -1], (0.0, 14.4)),
    "vibro_impact": ({}, WALL, [0, -1, -1], (0.1, 0.0)),
    "sdof_slider": ({"normal_load": 8.0, "normal_stiffness": 2e4}, PRESSED, [0, 1, -1], (0.0, 0.0)),
}


@pytest.mark.parametrize("name", TEXTBOOK)
def test_a_textbook_scene_is_the_structure_of_its_exact_motion(name):
    """The slider: closed, u_N = W, its spring leaves N_0 - k_N W to the contact."""
    values, structure, dofs, (gap, normal_load) = TEXTBOOK[name]
    model = build_scene(name, **values)
    names = ("mass", "damping", "stiffness", "load_static", "load_harmonic")
    for part, expected in zip(names, structure, strict=True):
        np.testing.assert_allclose(getattr(model.linear[0], part), expected, rtol=1e-15, err_msg=part)
    assert model.contact.dofs.tolist() == [dofs]
    assert (model.contact.gap[0], model.contact.normal_load[0]) == (gap, normal_load)


def test_the_command_says_what_a_scene_is(capsys):
    assert main(["--scene-help", "two_masses"]) == 0
    assert capsys.readouterr().out == scene_help("two_masses") + "\n"


# --- the dovetail sector ---

# Glued, nodal diameter 0, Hz, of 20-node elements.
AT_REST = np.array([190.5, 377.9, 777.0, 1288.1, 1620.2, 2054.0])
N_PAIRS = 48
N_RELATIVE = 3 * N_PAIRS


@pytest.fixture(scope="module")
def at_rest():
    return Parameters(stress_stiffening=False).build(5)


def frequencies(linear, n_relative=N_RELATIVE):
    return np.sqrt(np.diag(linear.stiffness).real[n_relative:]) / (2.0 * np.pi)


def test_frequencies_of_the_glued_sector_at_rest(at_rest):
    assert np.abs(frequencies(at_rest.linear[0])[:6] / AT_REST - 1.0).max() < 0.03


def test_contact_pairs(at_rest):
    contact = at_rest.contact
    assert np.array_equal(contact.dofs, np.arange(N_RELATIVE).reshape(N_PAIRS, 3))
    assert contact.surface == ("intrados",) * 24 + ("extrados",) * 24
    assert contact.area.reshape(2, 24).sum(axis=1) == pytest.approx([280e-6, 280e-6], rel=1e-9, abs=0)
    assert np.all(contact.gap == 0.0)
    intrados, extrados = contact.position.reshape(2, 8, 3, 3)
    assert np.all(intrados[..., 1] > 0.0)
    assert np.allclose(intrados * [1.0, -1.0, 1.0], extrados, atol=1e-12)
    assert np.all(np.diff(intrados[..., 2], axis=0) > 0.0)
    assert np.all(np.diff(intrados[..., 0], axis=1) > 0.0)
    assert intrados[:, -1, 0] == pytest.approx(0.245)


def test_axial_sliding_is_the_only_motion_that_closed_flanks_leave_free(at_rest):
    linear, dofs = at_rest.linear[0], at_rest.contact.dofs
    kept = np.setdiff1d(np.arange(len(linear.mass)), dofs[:, 0])
    values, vectors = linalg.eigh(linear.stiffness[np.ix_(kept, kept)], linear.mass[np.ix_(kept, kept)])
    assert abs(values[0]) < 1e-6 * values[1]
    sliding = np.zeros(len(linear.mass))
    sliding[kept] = vectors[:, 0]
    axial, radial = sliding[dofs[:, 1]], sliding[dofs[:, 2]]
    assert np.allclose(axial, axial[0], rtol=1e-6)
    assert np.abs(radial).max() < 1e-6 * abs(axial[0])


def test_flanks_carry_the_centrifugal_force_of_the_blade(at_rest):
    model, _ = Parameters(stress_stiffening=False).define_sector()
    # the blade with the nodes of the disk, which move nothing
    blade = tuple(group for group in model.mesh.groups if group.part == "blade")
    mass = assemble_mass(replace(model.mesh, groups=blade))
    pull = centrifugal_load(mass, model.mesh.coordinates, model.rotation).reshape(-1, 3).sum(axis=0)[0]
    for friction_coefficient in (0.5, 1e-6, 1000.0):
        force = static_forces(at_rest, friction_coefficient).reshape(2, 24, 3).sum(axis=1)
        assert np.all(force[:, 0] > 0.0)
        assert np.sqrt(0.5) * (force[:, 0] + force[:, 2]).sum() == pytest.approx(pull, rel=1e-6)


def test_stiffening_grows_with_the_square_of_speed_and_softening_shows():
    speeds = (1e-3, 2000.0, 4000.0)
    models = (Parameters(mesh=1, rotation_speed=rpm).build(0) for rpm in speeds)
    squares = [frequencies(model.linear[0], 48)[0] ** 2 for model in models]
    assert (squares[2] - squares[0]) / (squares[1] - squares[0]) == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize(("nodal_diameter", "n_sectors"), [(1, 47), (23, 47), (23, 46)])
def test_travelling_wave_has_the_nodal_diameters_it_needs(nodal_diameter, n_sectors):
    """Half the number of the sectors is a real one, as 0 is."""
    model = Parameters(mesh=1, nodal_diameter=nodal_diameter, n_sectors=n_sectors).build(5)
    assert tuple(model.linear) == needed_nodal_diameters(nodal_diameter, n_sectors, 5)
    assert n_sectors == 47 or tuple(model.linear) == (0, 23)
    assert (model.n_sectors, model.nodal_diameter) == (n_sectors, nodal_diameter)
    for k, linear in model.linear.items():
        for matrix in (linear.mass, linear.damping, linear.stiffness):
            assert np.iscomplexobj(matrix) == (k not in (0, n_sectors / 2))
            assert np.array_equal(matrix, matrix.conj().T)
        assert linalg.eigvalsh(linear.mass)[0] > 0.0
        damping = linalg.eigvalsh(linear.damping)
        assert damping[0] > -1e-10 * damping[-1]
        assert np.any(linear.load_static != 0.0) == (k == 0)
        assert np.any(linear.load_harmonic != 0.0) == (k == nodal_diameter)
    excited = model.linear[nodal_diameter]
    # Force and response are one and the same point and direction.
    assert np.allclose(excited.load_harmonic, excited.response[0].conj())


def test_loss_factor_is_exact_at_the_first_frequency(at_rest):
    linear = at_rest.linear[0]
    omega = 2.0 * np.pi * frequencies(linear)[0]
    assert np.allclose(omega * linear.damping, 1e-3 * linear.stiffness, rtol=1e-9, atol=1e-6)
