"""Studies whose excitation follows the resonance: what they take, what they compute, what they say."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.report.figures.wear import draw_excitation
from studyrunner.result.view import Result
from studyrunner.study.study_file import format_study, read_study
from tests.studyrunner.test_scene_axes import arguments, compute

pytestmark = pytest.mark.usefixtures("folder")
SLIDER = {
    "axes.frequency": "resonance",
    "axes.wear_coefficient": [1.1e-11, 5.5e-12],
    "axes.excitation_amplitude": 10.0,
    "axes.scheme": "adaptive",
    "loading.between": [180.0, 230.0],
    "scene.damping": 20.0,
    "slow_time.cycles": 4e4,
    "slow_time.outputs": 5,
    "solver.harmonics": 3,
    "solver.samples": 64,
}


def words_of(**more):
    """Overrides of a study of the slider."""
    given = {**SLIDER, **{name.replace("__", "."): value for name, value in more.items()}}
    return [f"{key}='{value}'" if isinstance(value, str) else f"{key}={value}" for key, value in given.items()]


def computed(path, **more):
    """The result of a study of the slider."""
    return compute("sdof_slider", path, *words_of(**more))


@pytest.mark.slow
def test_the_frequency_of_each_count_is_in_the_result(capsys):
    found = computed("out.nc")
    said = capsys.readouterr()
    assert found.frequency.values.tolist() == [205.0]
    followed = found.excitation_frequency.squeeze()
    assert followed.dims == ("wear_coefficient", "cycle")
    assert followed.units == "Hz"
    assert (np.diff(followed) > 0.0).all()
    # half the wear coefficient wears half as fast
    np.testing.assert_allclose(followed[1, ::2], followed[0, :3], rtol=1e-12)
    assert (found.excitation_frequency_error > 0.0).all()
    first, last = float(followed[0, 0]), float(followed[0, -1])
    assert f"moved from {first:.6g} to {last:.6g} " in said.out


@pytest.mark.slow
def test_every_point_without_a_resonance_says_why(capsys):
    # so little excitation that the slider sticks: its resonance is far above the range
    words = words_of(axes__excitation_amplitude=1.0, slow_time__cycles=10.0, scatter__samples=2)
    scatter = "scatter.excitation_amplitude={uniform={half_width=0.1}}"
    assert main(arguments("sdof_slider", "none.nc", *words, scatter)) == 3
    said = capsys.readouterr().out
    with xr.open_dataset("none.nc") as found:
        messages = {str(message) for message in found.message.values.ravel()}
    assert messages == {"the sweep up meets no resonance between 180 and 230 Hz: give another range"}
    assert 'sweep = "down"' in said
    assert "ramp" not in said
    assert "205 Hz" not in said


def test_the_report_draws_the_frequency_over_cycles():
    found = computed("drawn.nc")
    result = Result(Path("drawn.nc"), found)
    figure, *_ = draw_excitation(result)
    lines = figure.axes[0].get_lines()
    followed = found.excitation_frequency.squeeze().values
    assert len(lines) == len(followed) == 2
    for line, expected in zip(lines, followed, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), expected)
    # the middle of the range is no frequency of the point
    assert "205" not in result.describe(result.shown_point(), ["frequency"])


def test_without_cycles_the_result_is_the_resonance_of_the_unworn_joint():
    found = computed("unworn.nc", slow_time__cycles=0, axes__wear_coefficient=1.1e-11)
    at = float(found.excitation_frequency.squeeze())
    assert 198.0 < at < 201.0
    assert abs(float(found.response_phase.squeeze()) + 0.5 * np.pi) < 1e-7
    assert 0.0 < float(found.excitation_frequency_error.squeeze()) < 1.0


@pytest.mark.slow
def test_each_scene_and_each_sample_has_its_own_frequency():
    of_scenes = computed("scenes.nc", slow_time__cycles=0, axes__wear_coefficient=1.1e-11, axes__mass=[0.1, 0.11])
    one, other = of_scenes.excitation_frequency.squeeze().values
    # friction hardly moves the resonance from that of the mass on its spring
    assert one / other == pytest.approx(np.sqrt(1.1), rel=5e-3)
    words = words_of(slow_time__cycles=0, axes__wear_coefficient=1.1e-11, scatter__samples=4)
    samples = compute("sdof_slider", "samples.nc", *words, "scatter.mass={uniform={half_width=0.01}}")
    square = samples.excitation_frequency.squeeze() ** 2 * samples.sample_mass
    np.testing.assert_allclose(square, one**2 * 0.1, rtol=1e-2)
    assert float(samples.excitation_frequency.std()) > 1.0


def test_the_effective_study_is_the_same_study():
    study = read_study("sdof_slider", SLIDER)
    text = format_study(study)
    assert 'frequency = "resonance"' in text
    assert "between = [180.0, 230.0]" in text
    Path("again.toml").write_text(text, encoding="utf-8")
    again = read_study("again.toml")
    assert again.follow == study.follow
    assert format_study(again) == text
