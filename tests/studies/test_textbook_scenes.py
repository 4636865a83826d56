"""The registry of scenes and the three textbook scenes against their equations."""

import subprocess
import sys

import numpy as np
import pytest

from studies import build_scene
from studies.model_check import check_model
from studies.scene_error import SceneError
from studies.scenes import scene_help
from studyrunner.cli import main


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


def test_listing_the_scenes_imports_nothing_heavy():
    code = "import sys, studies.scenes; sys.exit(bool({'numpy', 'scipy', 'pydantic', 'h5py'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


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
