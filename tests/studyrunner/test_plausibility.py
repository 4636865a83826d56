"""What is hardly what was meant: a line for each, on stderr and in the result, and never a refusal."""

from dataclasses import replace

import pytest

from studyrunner.cli import main
from studyrunner.plan.plausibility import doubts_of_study
from studyrunner.study.study_file import bundled_studies, read_study
from tests.studyrunner.fakes import FACTS


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
    facts = replace(FACTS, stuck_frequency=225.0 if "dove" in name else 0.25)
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
    facts = replace(FACTS, stuck_frequency=212.0)
    (line,) = doubts_of_study(read_study("dovetail", overrides), facts)
    assert line.startswith(start)
    assert asked in line
    assert line.count("?") == 1


# --- through the command ---


@pytest.mark.slow
def test_lines_come_once_on_stderr(tmp_path, capfd):
    wrong = ["axes.frequency=150", "axes.wear_coefficient=2.9e-8", "slow_time.cycles=100", "slow_time.outputs=2"]
    overrides = [part for text in wrong for part in ("--set", text)]
    assert main(["sdof_slider", *overrides, "-o", str(tmp_path / "out.nc")]) in (0, 3)
    assert capfd.readouterr().err.count("wear_coefficient 2.9e-08 1/Pa") == 1
