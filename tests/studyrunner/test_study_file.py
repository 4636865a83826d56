"""Study files: defaults, axes, overrides and the effective study that goes into the result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studyrunner.study_file import bundled_studies, format_study, read_study

SMALLEST = '[study]\nname = "s"\n[scene]\nmodel = "sdof_slider"\n[axes]\nfrequency = 100\n'


def write(folder: Path, text: str) -> str:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_every_default_is_filled_in(tmp_path: Path) -> None:
    study = read_study(write(tmp_path, SMALLEST))
    assert study.dimensions == {
        "frequency": (100.0,),
        "wear_coefficient": (1.1e-11,),
        "excitation_amplitude": (1.0,),
        "step": (1000.0,),
        "scheme": ("implicit",),
        "sweep": ("up",),
    }
    assert (study.solver.harmonics, study.solver.samples, study.solver.tolerance) == (5, 128, 1e-8)
    assert study.cycles_kept == tuple(1000.0 * position for position in range(101))
    assert study.friction_coefficient == 0.5
    assert "loop_force" not in study.outputs.variables
    assert len(study.outputs.variables) == 9


@pytest.mark.parametrize("name", bundled_studies())
def test_bundled_studies_are_called_like_their_files(name: str) -> None:
    assert read_study(name).study.name == name


def test_range_axis_is_that_of_numpy(tmp_path: Path) -> None:
    text = SMALLEST.replace("frequency = 100", "frequency = {start = 186.0, stop = 198.1, num = 25}")
    assert np.array_equal(read_study(write(tmp_path, text)).axes.frequency, np.linspace(186.0, 198.1, 25))


def test_order_of_an_axis_is_the_users(tmp_path: Path) -> None:
    study = read_study(write(tmp_path, SMALLEST), ["axes.frequency=[3, 1.5, 2]"])
    assert study.axes.frequency == (3.0, 1.5, 2.0)


def test_overrides_take_toml_and_bare_words(tmp_path: Path) -> None:
    overrides = ["slow_time.cycles=1e4", "axes.sweep=down", "scene.mass=0.2", "study.title='two words'"]
    study = read_study(write(tmp_path, SMALLEST), overrides)
    assert study.slow_time.cycles == 1e4
    assert study.axes.sweep == ("down",)
    assert study.scene.parameters.model_dump()["mass"] == 0.2
    assert study.study.title == "two words"


def test_override_of_a_part_of_a_range() -> None:
    assert len(read_study("dovetail", ["axes.frequency.num=3"]).axes.frequency) == 3


def test_solver_key_moves_to_the_axes_by_override() -> None:
    study = read_study("dovetail", ["axes.harmonics=[1, 3]", "axes.samples=64"])
    assert list(study.dimensions)[6:] == ["harmonics", "samples"]
    assert study.solver_values("harmonics") == (1, 3)
    assert study.solver_values("tolerance") == (1e-8,)


def test_list_of_outputs(tmp_path: Path) -> None:
    study = read_study(write(tmp_path, SMALLEST), ["slow_time.outputs=[10, 1e3]"])
    assert study.cycles_kept == (10.0, 1000.0)


def test_no_cycles_keep_cycle_0_only(tmp_path: Path) -> None:
    assert read_study(write(tmp_path, SMALLEST), ["slow_time.cycles=0"]).cycles_kept == (0.0,)


def test_effective_study_reads_back_the_same(tmp_path: Path) -> None:
    study = read_study(
        "dovetail", ["axes.harmonics=[1, 3]", "study.title='a \\ \"title\" with é'", "slow_time.outputs=[0, 10]"]
    )
    again = read_study(write(tmp_path, format_study(study)))
    assert again.model_dump() == study.model_dump()
    assert format_study(again) == format_study(study)
