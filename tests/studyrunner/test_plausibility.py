"""What is hardly what was meant: a line for each, on stderr and in the result, and never a refusal."""

import math
from dataclasses import replace

import netCDF4
import numpy as np
import pytest

from solver import build_model
from studyrunner.cli import main
from studyrunner.scene.static_response import StaticResponse, static_response
from studyrunner.study.study_file import bundled_studies, read_study
from studyrunner.summary.plausibility import Doubts, doubts_of_study
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import results_of, told


def on_wear(*values):
    return doubts_of_study(read_study("sdof_slider", {"axes.wear_coefficient": list(values)}))


# --- the wear coefficient ---


def test_one_over_megapascal_is_asked_about_by_name():
    """McColl's flat is 2.9e-8 1/MPa; it is held against the default, which no line may contradict."""
    (line,) = on_wear(1.1e-11, 2.9e-8)
    assert line == (
        "wear_coefficient 2.9e-08 1/Pa is 3e+03 times larger than the default, 1.1e-11 1/Pa: is it in 1/MPa or mm2/N"
        " (then it is 2.9e-14 1/Pa) or in mm3/(N m) or mm3/J (then it is 2.9e-17 1/Pa)?"
    )
    # 52100 steel is 4.23e-5 mm3/J
    assert "mm3/J (then it is 4.23e-14 1/Pa)" in on_wear(4.23e-5)[0]


@pytest.mark.parametrize("name", [name for name in bundled_studies() if name != "extremes"])
def test_bundled_studies_are_plausible(name):
    facts = replace(FACTS, static_response=StaticResponse(np.array([1e-5]), 225.0 if "dove" in name else 0.25))
    assert doubts_of_study(read_study(name), facts) == ()


@pytest.mark.parametrize(
    ("overrides", "start", "asked"),
    [
        ({"scene.friction_coefficient": 50}, "friction_coefficient 50 ", "in percent (then it is 0.5)"),
        ({"axes.friction_coefficient": [0.5, 2.5]}, "friction_coefficient 2.5 ", "is it meant"),
        ({"scene.rotation_speed": 314}, "rotation_speed 314 rpm ", "in rad/s (then it is 2998.5 rpm)"),
        ({"axes.frequency": [0.2, 0.21]}, "frequency 0.21 Hz", "in kHz (then it is 210 Hz)"),
        ({"axes.frequency": 1e-4}, "frequency 0.0001 Hz", "is it meant"),
    ],
)
def test_other_units_are_asked_about_once(overrides, start, asked):
    facts = replace(FACTS, static_response=StaticResponse(np.array([1e-5]), frequency=212.0))
    (line,) = doubts_of_study(read_study("dovetail", overrides), facts)
    assert line.startswith(start)
    assert asked in line
    assert line.count("?") == 1


# --- frequencies and amplitudes ---

GRID = ("axes.excitation_amplitude=[1, 10]", "axes.scheme=adaptive", "slow_time.outputs=2")


def on_loads(depth, response, static=1e-5, outcome=0, resonance=25.0, frequencies="axes.frequency=[150, 160]"):
    """Lines where the larger amplitude wears and the smaller one does not; a response per N, and the same at rest.

    resonance: Hz, where the shape at rest resonates.
    """
    study = read_study("sdof_slider", (*GRID, frequencies))
    facts = replace(
        FACTS, static_response=None if static is None else StaticResponse(np.array([static]), frequency=resonance)
    )
    amplitudes = study.axes.excitation_amplitude
    results = results_of(
        study,
        largest_wear_depth=lambda point: depth if point[2] else 0.0,
        wear_rate=lambda _: np.zeros(2),
        response_amplitude=lambda point: np.full((2, 1), response * amplitudes[point[2]] * (1 + 0.1 * point[0])),
        outcome=lambda point: outcome if point[0] else 0,
    )
    return told(Doubts.format, lambda: Doubts(study, facts), study, results)


def test_an_amplitude_that_moves_nothing_is_named():
    (line,) = on_loads(1e-6, 1e-4)
    assert line.startswith("excitation_amplitude 1 N: no pair slips under pressure at any frequency")
    (line,) = on_loads(0.0, 1e-4)
    assert line.startswith("excitation_amplitude 1, 10 N: ")


def test_a_range_without_a_response_above_that_at_rest_asks_for_the_unit():
    line = on_loads(1e-6, 9e-6)[0]
    assert line.startswith("frequency 150 to 160 Hz: the response is nowhere above")
    assert "is it in rad/s (then it is 23.8732 to 25.4648 Hz)?" in line
    # one point of it is enough: 1.1 times 9.2e-6
    assert not any("rad/s" in line for line in on_loads(1e-6, 9.2e-6))
    assert not any("rad/s" in line for line in on_loads(1e-6, 9e-6, None))
    assert not any("rad/s" in line for line in on_loads(1e-6, 0.0, 0.0))


def test_static_response_is_that_of_a_beam_of_springs():
    """Two springs in series to the ground and a foot that sticks: the tip moves by F / k2 and resonates on k2."""
    springs = np.array([[0.0, 0.0, 0.0], [0.0, 6e6, -2e6], [0.0, -2e6, 2e6]])
    springs[0, 0] = 1e7
    given = {"contact_dofs": [[0, 1, -1]], "area": 1e-4, "load_harmonic": [0.0, 0.0, 3.0], "response": [2]}
    stuck = static_response(build_model(np.eye(3), None, springs, load_static=[50.0, 0.0, 0.0], **given))
    np.testing.assert_allclose(stuck.amplitude, 3.0 / 2e6, rtol=1e-12)
    np.testing.assert_allclose(stuck.frequency, math.sqrt(2e6) / (2.0 * math.pi), rtol=1e-12)
    # a gap leaves the foot free: 1 / k2 + 1 / k1
    free = static_response(build_model(np.eye(3), None, springs, gap=1e-3, **given))
    np.testing.assert_allclose(free.amplitude, 3.0 / 2e6 + 3.0 / 4e6, rtol=1e-12)
    first = math.sqrt(np.linalg.eigvalsh(springs)[0]) / (2.0 * math.pi)
    assert first < free.frequency < 1.1 * first
    loose = build_model(np.eye(3), None, np.diag([1.0, 1.0, 0.0]), **given)
    assert static_response(loose) is None


# --- through the command ---


@pytest.mark.slow
def test_lines_come_once_on_stderr_and_in_the_result(tmp_path, capfd):
    target = tmp_path / "out.nc"
    wrong = ["axes.frequency=150", "axes.wear_coefficient=2.9e-8", "slow_time.cycles=100", "slow_time.outputs=2"]
    overrides = [part for text in wrong for part in ("--set", text)]
    assert main(["sdof_slider", *overrides, "-o", str(target)]) in (0, 3)
    said = capfd.readouterr().err
    with netCDF4.Dataset(target) as file:
        lines = file.plausibility.splitlines()
    assert lines[0].startswith("wear_coefficient 2.9e-08 1/Pa")
    for line in lines:
        assert said.count(line) == 1
    assert main(["sdof_slider", "--set", "axes.frequency=160", *overrides[4:], "-o", str(target)]) == 0
    assert "wear_coefficient" not in capfd.readouterr().err
    with netCDF4.Dataset(target) as file:
        assert "plausibility" not in file.ncattrs()
