"""A study in gross slip lays its pairs as far as it wears them, and says where they were not laid far enough."""

import math

import pytest

from solver.outcome import Outcome
from studies import build_scene, read_scene
from studyrunner import read_study
from studyrunner.cli import main
from studyrunner.scene.answers import write_study_scene
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.parts import expected_wear, parts_of
from studyrunner.study.study_file import format_study
from tests.mpi.launching import options, results
from tests.studyrunner.small_studies import compute

STUDY = """
[study]
name = "sliding"
[scene]
model = "cylinder_on_flat"
stroke = 10e-6
friction_coefficient = 0.8
P = 20e3
strips = 12
[axes]
frequency = 20.0
wear_coefficient = 1e-13
sweep = "ramp"
[slow_time]
cycles = 2000
outputs = 5
[solver]
harmonics = 3
samples = 32
"""


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "sliding.toml"
    found.write_text(STUDY)
    return found


def half_width(study):
    value = dict(study.scene.parameters)["half_width"]
    assert isinstance(value, float)
    return value


def test_all_that_is_made_of_the_study_has_the_width_that_it_shows(path):
    study = read_study(path)
    width = half_width(study)
    model = build_study_scene(study)
    assert model.contact.position[-1, 0] == pytest.approx(width * 11 / 12)
    digest = describe_scene(model).digest
    # the whole study again, also where it would wear more by now
    path.write_text(format_study(study))
    assert read_study(path) == read_study(path, {"scene.half_width": width})
    assert half_width(read_study(path, {"slow_time.cycles": 1e6})) == width
    # its scene file, and the scene in Python
    write_study_scene(study, path.with_name("scene.h5"), print)
    given = {key: value for key, value in study.scene.parameters if key != "friction_coefficient"}
    for again in (read_scene(path.with_name("scene.h5")), build_scene("cylinder_on_flat", **given)):
        assert describe_scene(again).digest == digest


@pytest.mark.parametrize(
    ("overrides", "factor"),
    [
        ({}, 1.0),
        ({"axes.wear_coefficient": [1e-14, 3e-13, 0.0]}, 3.0),
        ({"slow_time.cycles": 3000}, 1.5),
        ({"slow_time.outputs": [10, 1000]}, 0.5),
        ({"wear.law": "threshold", "wear.threshold": 1.0}, 1.0),
        ({"wear.surfaces": {"flat": 2.0, "cylinder": 3.0}, "wear.law": "energy"}, 4.0),
        ({"wear": {"law": "table", "pressure": [1e8, 1e9], "depth": [0, 1e-6], "factor": [[2, 7], [1, 3]]}}, 7.0),
    ],
)
def test_it_is_the_most_that_any_point_wears(path, overrides, factor):
    study = read_study(path, overrides)
    expected = expected_wear(study)
    assert expected.per_slip_work == pytest.approx(factor * 1e-13 * 2000, rel=1e-12)
    assert (expected.amplitude, expected.volume, expected.depth) == (1.0, math.inf, math.inf)
    # b^3 - a^3 of the segment is proportional to it
    assert half_width(study) == pytest.approx(half_width(read_study(path)) * factor ** (1.0 / 3.0), rel=0.08)


def test_a_scene_has_room_for_nearly_all_samples_whatever_their_number(path):
    scatter = {"samples": 8, "wear_coefficient": {"lognormal": {"factor": 1.5}}}
    study = read_study(path, {"scatter": scatter})
    assert expected_wear(study).per_slip_work == pytest.approx(1.5**3.1 * 1e-13 * 2000)
    assert half_width(study) > half_width(read_study(path))
    assert half_width(read_study(path, {"scatter": {**scatter, "samples": 1024}})) == half_width(study)
    widths = {half_width(part.study) for part in parts_of(study)}
    assert widths == {half_width(study)}
    # one scene for all
    assert len(find_scenes(study).studies) == 1


def test_each_sample_with_a_scene_of_its_own_has_room_for_its_wear(path):
    inputs = {name: {"lognormal": {"factor": 1.5}} for name in ("P", "wear_coefficient")}
    study = read_study(path, {"scatter": {"samples": 8, **inputs}})
    for part in parts_of(study):
        own = {"scene.P": dict(part.study.scene.parameters)["P"]}
        alone = read_study(path, {**own, "axes.wear_coefficient": part.study.axes.wear_coefficient[0]})
        assert half_width(part.study) == half_width(alone)


@pytest.mark.slow
def test_a_scar_that_is_cut_off_is_a_failed_point_with_a_remedy(path, folder, capsys):
    assert main([str(path), "-o", "out.nc", *options("scene.half_width=5e-5")]) == 3
    assert "The contact goes on beyond the modelled pairs" in capsys.readouterr().out
    cut = results().squeeze()
    assert cut.outcome == Outcome.CONTACT_CUT_OFF
    assert "edge of the modelled contact" in cut.message.item()
    wide = compute(str(path), "out.nc").squeeze()
    assert not wide.mean_pressure.values[:, -1].any()
    assert 0.0 < float(wide.wear_depth.isel(cycle=-1).max()) < float(cut.wear_depth.isel(cycle=-1).max())
