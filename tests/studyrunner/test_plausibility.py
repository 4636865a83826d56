"""What is hardly what was meant: a line for each, on stderr and in the result, and never a refusal."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from solver import build_model
from studies import build_scene
from studyrunner.cli import main
from studyrunner.scene.static_response import StaticResponse, static_response
from studyrunner.study.study_file import bundled_studies, read_study
from studyrunner.summary.plausibility import Doubts, doubts_of_study
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import batches, results_of


def on_wear(*values: float) -> tuple[str, ...]:
    return doubts_of_study(read_study("sdof_slider", {"axes.wear_coefficient": list(values)}))


# --- the wear coefficient ---


def test_measured_wear_coefficients_and_none_are_plausible() -> None:
    """TRUTHS: two steels and titanium; the paper's; a study without wear."""
    assert on_wear(2.9e-14, 4.23e-14, 4e-13, 1.1e-11, 0.0) == ()


def test_one_over_megapascal_is_asked_about_by_name() -> None:
    """McColl's flat is 2.9e-8 1/MPa; it is held against the default, which no line may contradict."""
    (line,) = on_wear(1.1e-11, 2.9e-8)
    assert line == (
        "wear_coefficient 2.9e-08 1/Pa is 3e+03 times larger than the default, 1.1e-11 1/Pa: is it in 1/MPa or mm2/N"
        " (then it is 2.9e-14 1/Pa) or in mm3/(N m) or mm3/J (then it is 2.9e-17 1/Pa)?"
    )
    # 52100 steel is 4.23e-5 mm3/J
    assert "mm3/J (then it is 4.23e-14 1/Pa)" in on_wear(4.23e-5)[0]


def test_the_one_farthest_off_speaks_for_all() -> None:
    (line,) = on_wear(1e-18, 1e-25, 1e-9)
    assert line.startswith("wear_coefficient 1e-25 1/Pa is 1e+14 times smaller than the default")
    assert on_wear(1e6) == ("wear_coefficient 1e+06 1/Pa is 9e+16 times larger than the default, 1.1e-11 1/Pa",)


def test_a_table_of_wear_coefficients_is_looked_at_with_its_factors() -> None:
    table = {"wear.law": "table", "wear.pressure": [0.0], "wear.depth": [0.0, 1e-5]}
    for factors, n_lines in (([[2e-14, 3e-14]], 0), ([[2e-14, 3e-8]], 1), ([[0.0, 2e-14]], 0)):
        study = read_study("sdof_slider", {**table, "wear.factor": factors, "axes.wear_coefficient": 1.0})
        assert len(doubts_of_study(study)) == n_lines


@pytest.mark.parametrize("name", sorted(set(bundled_studies()) - {"extremes"}))
def test_bundled_studies_are_plausible(name: str) -> None:
    assert doubts_of_study(read_study(name)) == ()


# --- frequencies and amplitudes ---

GRID = ("axes.excitation_amplitude=[1, 10]", "axes.scheme=adaptive", "slow_time.outputs=2")


def on_loads(
    depth: float,
    response: float,
    static: float | None = 1e-5,
    outcome: int = 0,
    resonance: float = 25.0,
    frequencies: str = "axes.frequency=[150, 160]",
) -> tuple[str, ...]:
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
    found = set()
    for given in (results, results[::-1]):
        doubts = Doubts(study, facts)
        for points, records in batches(study, given):
            doubts.add(points, records)
        found.add(doubts.format())
    (lines,) = found
    return lines


def test_an_amplitude_that_moves_nothing_is_named() -> None:
    (line,) = on_loads(1e-6, 1e-4)
    assert line.startswith("excitation_amplitude 1 N: no pair slips under pressure at any frequency")
    (line,) = on_loads(0.0, 1e-4)
    assert line.startswith("excitation_amplitude 1, 10 N: ")


def test_a_range_without_a_response_above_that_at_rest_asks_for_the_unit() -> None:
    line = on_loads(1e-6, 9e-6)[0]
    assert line.startswith("frequency 150 to 160 Hz: the response is nowhere above")
    assert "is it in rad/s (then it is 23.8732 to 25.4648 Hz)?" in line
    # one point of it is enough: 1.1 times 9.2e-6
    assert not any("rad/s" in line for line in on_loads(1e-6, 9.2e-6))
    assert not any("rad/s" in line for line in on_loads(1e-6, 9e-6, None))
    assert not any("rad/s" in line for line in on_loads(1e-6, 0.0, 0.0))


def test_a_scene_that_cannot_resonate_is_not_asked_for_a_resonance() -> None:
    """One without mass, and one that is excited below its first resonance."""
    assert on_loads(1e-6, 9e-6, resonance=math.inf) == on_loads(1e-6, 1e-4, resonance=math.inf)
    assert not any("rad/s" in line for line in on_loads(1e-6, 9e-6, resonance=155.0))
    assert on_loads(0.0, 9e-6, resonance=math.inf)[0].endswith("so that nothing wears: is the load in N?")
    assert on_loads(0.0, 9e-6)[1].endswith("is the load in N, the resonance among the frequencies?")


def test_one_frequency_is_one_number() -> None:
    (line,) = on_loads(1e-6, 9e-6, frequencies="axes.frequency=157")[:1]
    assert line.startswith("frequency 157 Hz: ")
    assert "(then it is 24.9873 Hz)?" in line


def test_nothing_is_said_of_loads_while_points_are_missing() -> None:
    assert on_loads(0.0, 9e-6, outcome=4) == ()


def test_static_response_is_that_of_a_beam_of_springs() -> None:
    """Two springs in series to the ground and a foot that sticks: the tip moves by F / k2 and resonates on k2."""
    springs = np.array([[0.0, 0.0, 0.0], [0.0, 6e6, -2e6], [0.0, -2e6, 2e6]])
    springs[0, 0] = 1e7
    given = {"contact_dofs": [[0, 1, -1]], "area": 1e-4, "load_harmonic": [0.0, 0.0, 3.0], "response": [2]}
    stuck = static_response(build_model(np.eye(3), None, springs, load_static=[50.0, 0.0, 0.0], **given))
    assert stuck is not None
    np.testing.assert_allclose(stuck.amplitude, 3.0 / 2e6, rtol=1e-12)
    np.testing.assert_allclose(stuck.frequency, math.sqrt(2e6) / (2.0 * math.pi), rtol=1e-12)
    # a gap leaves the foot free: 1 / k2 + 1 / k1
    free = static_response(build_model(np.eye(3), None, springs, gap=1e-3, **given))
    assert free is not None
    np.testing.assert_allclose(free.amplitude, 3.0 / 2e6 + 3.0 / 4e6, rtol=1e-12)
    first = math.sqrt(np.linalg.eigvalsh(springs)[0]) / (2.0 * math.pi)
    assert first < free.frequency < 1.1 * first
    loose = build_model(np.eye(3), None, np.diag([1.0, 1.0, 0.0]), **given)
    assert static_response(loose) is None


@pytest.mark.parametrize("name", ["cylinder_on_flat", "sphere_on_flat", "sdof_slider"])
def test_scenes_whose_load_moves_no_mass_have_no_resonance(name: str) -> None:
    found = static_response(build_scene(name))
    assert found is not None
    assert found.frequency == math.inf


@pytest.mark.parametrize(("name", "resonance"), [("two_masses", 0.2251), ("vibro_impact", 0.1592)])
def test_scenes_with_mass_have_one(name: str, resonance: float) -> None:
    found = static_response(build_scene(name))
    assert found is not None
    assert found.frequency == pytest.approx(resonance, rel=1e-3)


# --- through the command ---


@pytest.mark.slow
def test_lines_come_once_on_stderr_and_in_the_result(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
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


@pytest.mark.slow
def test_a_cylinder_without_mass_raises_no_doubts(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "out.nc"
    few = ["slow_time.cycles=1e4", "slow_time.outputs=2", "scene.strips=10", "solver.harmonics=3", "solver.samples=64"]
    assert main(["cylinder_on_flat", *(part for text in few for part in ("--set", text)), "-o", str(target)]) == 0
    assert "resonance" not in capfd.readouterr().err
    with netCDF4.Dataset(target) as file:
        assert "plausibility" not in file.ncattrs()
