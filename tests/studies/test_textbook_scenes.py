"""The registry of scenes and the three textbook scenes against their equations and exact motions."""

import subprocess
import sys

import numpy as np
import pytest

from studies import build_scene
from studies.model_check import check_model
from studies.scene_error import SceneError
from studies.scenes import scene_help
from studyrunner.cli import main
from tests.references import coulomb_orbit, vibro_impact_orbit


def dynamic_stiffness(model, omega):
    linear = model.linear[0]
    return linear.stiffness - omega**2 * linear.mass + 1j * omega * linear.damping


@pytest.mark.parametrize(
    ("name", "values"),
    [
        *((name, {}) for name in ("sdof_slider", "two_masses", "vibro_impact")),
        *((name, values) for name in ("cylinder_on_flat", "sphere_on_flat") for values in ({}, {"stroke": 1e-6})),
    ],
)
def test_scenes_are_possible_structures(name, values):
    check_model(build_scene(name, **values), n_harmonics=21)


@pytest.mark.parametrize(
    ("name", "values", "key"),
    [
        ("cylinder_on_flat", {"R": 1e308}, "model"),
        ("cylinder_on_flat", {"depth": 1e-9}, "depth"),
        ("sphere_on_flat", {"R": 1e308}, "model"),
        ("dovetail_sector", {"mesh": 1, "young_modulus": 1e-300}, "model"),
    ],
)
def test_numbers_far_from_what_can_be_are_refused(name, values, key):
    with pytest.raises(SceneError) as caught:
        build_scene(name, **values)
    assert caught.value.key == key


def test_listing_the_scenes_imports_nothing_heavy():
    code = "import sys, studies.scenes; sys.exit(bool({'numpy', 'scipy', 'pydantic', 'h5py'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_slider_on_a_spring_has_the_normal_force_of_the_wear_equation():
    model = build_scene("sdof_slider", normal_load=8.0, normal_stiffness=2e4)
    linear, depth = model.linear[0], 1e-4
    assert model.contact.dofs.tolist() == [[0, 1, -1]]
    # Closed, u_N = W: the rest of the static equilibrium is the contact force.
    assert linear.load_static - linear.stiffness @ [depth, 0.0] == pytest.approx([8.0 - 2e4 * depth, 0.0])


def test_two_masses_are_those_of_the_reference():
    """The exact motion with friction at the second mass balances the forces on the first."""
    model = build_scene("two_masses")
    linear = model.linear[0]
    mass, damping, stiffness = np.eye(2), np.array([[0.04, -0.02], [-0.02, 0.02]]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    for name, expected in (("mass", mass), ("damping", damping), ("stiffness", stiffness)):
        np.testing.assert_array_equal(getattr(linear, name), expected)
    assert 0.5 * model.contact.normal_load[0] == pytest.approx(7.2, rel=1e-15, abs=0)
    load = 20 * linear.load_harmonic
    orbit = coulomb_orbit(mass, damping, stiffness, load, 1, 7.2, 0.4)
    taken_up = load - dynamic_stiffness(model, 0.4) @ [orbit.harmonic(0), orbit.harmonic(1)]
    assert abs(taken_up[0]) < 1e-9
    assert 7.2 < abs(taken_up[1]) <= 7.2 * 4 / np.pi


def test_the_vibro_impact_scene_is_the_bilinear_spring():
    gap, omega, n_samples = 0.1, 1.1, 2048
    model = build_scene("vibro_impact", gap=gap)
    orbit = vibro_impact_orbit(1.0, 0.05, 1.0, 0.02, 100.0, gap, omega, begin=1.05)
    displacement = orbit.sample(n_samples)[0]
    contact_force = 100 * np.maximum(displacement - gap, 0)
    assert contact_force.max() > 0
    rows = (np.minimum(displacement, gap), displacement, contact_force)
    closing_h, displacement_h, contact_h = (np.fft.rfft(values) / n_samples for values in rows)
    load = 0.02 * model.linear[0].load_harmonic / 2
    for harmonic in range(6):
        balance = dynamic_stiffness(model, harmonic * omega) @ [closing_h[harmonic], displacement_h[harmonic]]
        balance[0] += contact_h[harmonic]
        balance -= load if harmonic == 1 else 0
        # The kinks of the sampled contact force alias; everything else is exact.
        assert np.abs(balance).max() < 1e-5 * np.abs(contact_force).max()


def test_the_command_says_what_a_scene_is(capsys):
    assert main(["--scene-help", "two_masses"]) == 0
    assert capsys.readouterr().out == scene_help("two_masses") + "\n"
