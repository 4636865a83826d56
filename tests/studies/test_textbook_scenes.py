"""The registry of scenes and the three textbook scenes against their equations and exact motions."""

import subprocess
import sys

import numpy as np
import pytest

from studies.model_check import check_model
from studies.scene_error import SceneError
from studies.scene_help import scene_help
from studies.scenes import BUNDLED, build_scene, scene_parameters
from studyrunner.cli import main
from tests.references import coulomb_orbit, vibro_impact_orbit

TEXTBOOK = ("sdof_slider", "two_masses", "vibro_impact")


def build(model, **values):
    return build_scene(model, scene_parameters(model)(**values), n_harmonics=3)


def dynamic_stiffness(model, omega):
    linear = model.linear[0]
    return linear.stiffness - omega**2 * linear.mass + 1j * omega * linear.damping


@pytest.mark.parametrize("model", TEXTBOOK)
def test_textbook_scenes_are_possible_structures(model):
    check_model(build(model), n_harmonics=21)


def test_an_unknown_scene_is_named_with_the_known_ones():
    with pytest.raises(SceneError, match="bladeless") as caught:
        scene_parameters("bladeless")
    assert caught.value.key == "model"
    assert all(name in caught.value.remedy for name in BUNDLED)


def test_listing_the_scenes_imports_nothing_heavy():
    code = "import sys, studies.scenes; sys.exit(bool({'numpy', 'scipy', 'pydantic', 'h5py'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_slider_on_a_spring_has_the_normal_force_of_the_wear_equation():
    model = build("sdof_slider", normal_load=8.0, normal_stiffness=2e4)
    linear, depth = model.linear[0], 1e-4
    assert model.contact.dofs.tolist() == [[0, 1, -1]]
    # Closed, u_N = W: the rest of the static equilibrium is the contact force.
    assert linear.load_static - linear.stiffness @ [depth, 0.0] == pytest.approx([8.0 - 2e4 * depth, 0.0])


def test_two_masses_are_those_of_the_reference():
    model = build("two_masses")
    linear = model.linear[0]
    assert linear.mass.tolist() == [[1, 0], [0, 1]]
    assert linear.damping.tolist() == [[0.04, -0.02], [-0.02, 0.02]]
    assert linear.stiffness.tolist() == [[2, -1], [-1, 1]]
    assert linear.load_harmonic.tolist() == [1, 0]
    assert 0.5 * model.contact.normal_load[0] == pytest.approx(7.2, rel=1e-15, abs=0)
    assert model.response_names == ("mass_1", "mass_2")
    assert linear.response.tolist() == [[1, 0], [0, 1]]

    orbit = coulomb_orbit(linear.mass, linear.damping, linear.stiffness, 20 * linear.load_harmonic, 1, 7.2, 0.4)
    taken_up = 20 * linear.load_harmonic - dynamic_stiffness(model, 0.4) @ [orbit.harmonic(0), orbit.harmonic(1)]
    assert abs(taken_up[0]) < 1e-9
    assert 7.2 < abs(taken_up[1]) <= 7.2 * 4 / np.pi


def test_the_vibro_impact_scene_is_the_bilinear_spring():
    gap = 0.1
    model = build("vibro_impact", gap=gap)
    omega, n_samples = 1.1, 2048
    orbit = vibro_impact_orbit(1.0, 0.05, 1.0, 0.02, 100.0, gap, omega, sweep_start=1.05)
    displacement = orbit.sample(n_samples)[0]
    closing = np.minimum(displacement, gap)
    contact_force = 100 * np.maximum(displacement - gap, 0)
    assert contact_force.max() > 0
    spectra = [np.fft.rfft(values) / n_samples for values in (closing, displacement, contact_force)]
    load = 0.02 * model.linear[0].load_harmonic / 2
    for harmonic in range(6):
        closing_h, displacement_h, contact_h = (spectrum[harmonic] for spectrum in spectra)
        balance = dynamic_stiffness(model, harmonic * omega) @ [closing_h, displacement_h]
        balance[0] += contact_h
        balance -= load if harmonic == 1 else 0
        # The kinks of the sampled contact force alias; everything else is exact.
        assert np.abs(balance).max() < 1e-5 * np.abs(contact_force).max()


def test_the_command_says_what_a_scene_is(capsys):
    assert main(["--scene-help", "two_masses"]) == 0
    assert capsys.readouterr().out == scene_help("two_masses") + "\n"
