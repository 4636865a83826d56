"""What is hardly what was meant: a question for each, on stderr and in `--plan`, and never a refusal."""

import math
from dataclasses import replace

import pytest

from studyrunner.cli import main
from studyrunner.plan import doubts_of_study
from studyrunner.study.study_file import bundled_studies, read_study
from tests.mpi.launching import options
from tests.studyrunner.fakes import FACTS


@pytest.mark.parametrize("name", [name for name in bundled_studies() if name != "extremes"])
def test_bundled_studies_are_plausible(name):
    facts = replace(FACTS, stuck_frequency=225.0 if "dove" in name else math.nan)
    assert doubts_of_study(read_study(name), facts) == ()


@pytest.mark.parametrize(
    ("study", "override", "start", "asked"),
    [
        # of 52100 steel, 4.23e-5 mm3/J; McColl's flat, 2.9e-8 1/MPa, where the farthest speaks
        ("sdof_slider", "axes.wear_coefficient=4.23e-5", "wear_coefficient 4.23e-05 ", "mm3/J (then it is 4.23e-14 "),
        ("sdof_slider", "axes.wear_coefficient=[1.1e-11, 2.9e-8]", "wear_coefficient 2.9e-08 1/Pa ", "in 1/MPa or"),
        ("dovetail", "scene.friction_coefficient=50", "friction_coefficient 50 ", "in percent (then it is 0.5)"),
        (
            "dovetail",
            "axes.friction_coefficient=[0.5, 2.5]",
            "friction_coefficient 2.5 ",
            "in percent (then it is 0.025)",
        ),
        ("dovetail", "scene.rotation_speed=314", "rotation_speed 314 rpm ", "in rad/s (then it is 2998.5 rpm)"),
        ("dovetail", "axes.frequency=[0.2, 0.21]", "frequency 0.21 Hz", "in kHz (then it is 210 Hz)"),
        ("dovetail", "axes.frequency=1e-4", "frequency 0.0001 Hz", "is it meant"),
        ("dovetail", "axes.frequency=150e3", "frequency 1.5e+05 Hz", "in mHz (then it is 150 Hz)"),
        ("dovetail", "axes.excitation_amplitude=[1, 1e9]", "excitation_amplitude 1e+09 N", "(then it is 1e+06 N)"),
        ("dovetail", "scene.worn={depth=1.0}", "scene.worn 1 m", "in mm (then it is 0.001 m)"),
        ("dovetail", "slow_time.until={wear_depth=5.0}", "slow_time.until.wear_depth 5 m", "in um (then it is 5e-06"),
        ("mission", "mission.0.excitation_amplitude=1e9", "excitation_amplitude 1e+09 N", "in mN"),
    ],
)
def test_other_units_are_asked_about_once(study, override, start, asked):
    (line,) = doubts_of_study(read_study(study, [override]), replace(FACTS, stuck_frequency=212.0))
    assert line.startswith(start)
    assert asked in line
    assert line.count("?") == 1


@pytest.mark.slow
def test_lines_come_once_on_stderr(tmp_path, capfd):
    wrong = ("axes.frequency=150", "axes.wear_coefficient=2.9e-8", "slow_time.cycles=100", "slow_time.outputs=2")
    assert main(["sdof_slider", *options(*wrong), "-o", str(tmp_path / "out.nc")]) in (0, 3)
    assert capfd.readouterr().err.count("wear_coefficient 2.9e-08 1/Pa") == 1
