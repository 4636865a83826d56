"""What is hardly what was meant: a line for each, on stderr and in the result, and never a refusal."""

import pytest

from studyrunner.cli import main
from studyrunner.plan.plausibility import doubts_of_study
from studyrunner.study.study_file import read_study


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


@pytest.mark.parametrize("name", ["dovetail", "work_precision"])
def test_bundled_studies_are_plausible(name):
    assert doubts_of_study(read_study(name)) == ()


# --- through the command ---


@pytest.mark.slow
def test_lines_come_once_on_stderr(tmp_path, capfd):
    wrong = ["axes.frequency=150", "axes.wear_coefficient=2.9e-8", "slow_time.cycles=100", "slow_time.outputs=2"]
    overrides = [part for text in wrong for part in ("--set", text)]
    assert main(["sdof_slider", *overrides, "-o", str(tmp_path / "out.nc")]) in (0, 3)
    assert capfd.readouterr().err.count("wear_coefficient 2.9e-08 1/Pa") == 1
