"""Study files: defaults, axes, overrides and the effective study that goes into the result."""

import os
from pathlib import Path

import h5py
import pytest

from studyrunner.cli import main
from studyrunner.study.study_file import bundled_studies, format_study, read_study
from studyrunner.variables import USUAL

SMALLEST = '[study]\nname = "s"\n[scene]\nmodel = "sdof_slider"\n[axes]\nfrequency = 100\n'


def write(folder, text):
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_byte_order_mark_is_no_text(tmp_path):
    path = tmp_path / "study.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SMALLEST.replace("\n", "\r\n").encode())
    assert read_study(str(path)).study.name == "s"


def test_every_default_is_filled_in(tmp_path):
    study = read_study(write(tmp_path, SMALLEST))
    assert study.dimensions == {
        "frequency": (100.0,),
        "wear_coefficient": (1.1e-11,),
        "excitation_amplitude": (1.0,),
        "step": (1000.0,),
        "scheme": ("adaptive",),
        "sweep": ("up",),
    }
    assert study.solver.model_dump() == {
        "harmonics": "auto",
        "samples": "auto",
        "tolerance": 1e-8,
        "rtol": 1e-2,
        "time_limit": None,
        "shortcuts": True,
    }
    assert study.cycles_kept == tuple(1000.0 * position for position in range(101))
    assert study.friction_coefficient == 0.5
    assert "loop_force" not in study.outputs.variables
    assert study.outputs.variables == USUAL
    assert study.outputs.loops == ()


@pytest.mark.parametrize(
    ("name", "asked", "found"),
    [
        ("dovetail", "['default']", (*USUAL, "mesh")),
        ("dovetail", "['natural_frequency', 'default']", (*USUAL, "mesh", "natural_frequency")),
        ("sdof_slider", "['default', 'exact', 'worn_volume']", (*USUAL, "exact")),
    ],
)
def test_one_word_stands_for_the_default_variables(name, asked, found):
    assert read_study(name, [f"outputs.variables={asked}"]).outputs.variables == found


@pytest.mark.parametrize("name", bundled_studies())
def test_bundled_studies_are_called_like_their_files(name):
    assert read_study(name).study.name == name


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("{start = 212, stop = 213, num = 6}", "212.0 212.2 212.4 212.6 212.8 213.0"),
        ("{start = 212.3, stop = 212.7, num = 5}", "212.3 212.4 212.5 212.6 212.7"),
        ("{start = 0.3, stop = 0.1, num = 3}", "0.3 0.2 0.1"),
        ("{start = 1e-300, stop = 4e-300, num = 4}", "1e-300 2e-300 3e-300 4e-300"),
        ("{start = 1, stop = 2, num = 4}", "1.0 1.3333333333333333 1.6666666666666667 2.0"),
        ("{start = 7.7, stop = 9, num = 1}", "7.7"),
    ],
)
def test_values_of_a_range_are_those_that_a_person_writes(tmp_path, given, written):
    study = read_study(write(tmp_path, SMALLEST.replace("frequency = 100", f"frequency = {given}")))
    assert " ".join(map(repr, study.axes.frequency)) == written


def test_every_solver_key_can_be_an_axis_in_the_order_of_the_file():
    overrides = ["axes.rtol=[1e-3, 1e-2]", "axes.tolerance=1e-9", "axes.samples=['auto', 64]", "axes.harmonics=auto"]
    study = read_study("dovetail", overrides)
    assert dict(list(study.dimensions.items())[6:]) == {
        "harmonics": ("auto",),
        "samples": ("auto", 64),
        "tolerance": (1e-9,),
        "rtol": (1e-3, 1e-2),
    }


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("harmonics", "[1, 3, 5]"),
        ("harmonics", "['auto', 3]"),
        ("harmonics", "{start = 1, stop = 5, num = 3}"),
        ("samples", "[64, 128]"),
        ("tolerance", "[1e-8, 1e-6]"),
        ("rtol", "[1e-1, 1e-2, 1e-3]"),
    ],
)
def test_several_values_of_a_solver_key_are_an_axis(key, values, tmp_path):
    there = read_study("dovetail", [f"axes.{key}={values}"])
    here = read_study("dovetail", [f"solver.{key}={values}"])
    assert len(here.dimensions[key]) > 1
    assert here.dimensions == there.dimensions
    assert format_study(here) == format_study(there)
    in_the_file = read_study(write(tmp_path, SMALLEST + f"[solver]\n{key} = {values}\n"))
    assert in_the_file.dimensions[key] == there.dimensions[key]


@pytest.mark.parametrize("harmonics", ["solver.harmonics=3", "axes.harmonics=[1, 3]", "axes.harmonics=['auto', 3]"])
def test_effective_study_reads_back_the_same(harmonics, tmp_path):
    overrides = [harmonics, "axes.rtol=[0.1, 0.2]", "study.title='a \\ \"title\" with é'", "slow_time.outputs=[0, 10]"]
    study = read_study("dovetail", overrides)
    again = read_study(write(tmp_path, format_study(study)))
    assert again.model_dump() == study.model_dump()
    assert format_study(again) == format_study(study)


STUDY = """
[study]
name = "s"
[scene]
model = "sdof_slider"
[axes]
frequency = [150.0]
[slow_time]
cycles = 0
[solver]
harmonics = 5
"""

LONG = ("--set", "slow_time.cycles=1e6", "--set", "slow_time.outputs=200000")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(STUDY, encoding="utf-8")
    with h5py.File(tmp_path / "s.nc", "w") as earlier:
        earlier.attrs["study"] = STUDY
    return tmp_path


def line_of(arguments, capsys):
    """The one line that bad input ends with; nothing else is said, nothing is written."""
    before = {path: path.stat().st_mtime_ns for path in Path.cwd().iterdir()}
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    said = captured.err.splitlines()
    assert len(said) == 1
    assert {path: path.stat().st_mtime_ns for path in Path.cwd().iterdir()} == before
    return said[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.toml"], ("missing.toml", "no such file")),
        (["unheard_of"], ("unheard_of", "dovetail")),
        (["."], (".", "folder")),
        (["s.toml", "--from", "deck.inp"], ("command line", "--from", "--new NAME")),
        (["s.toml", "--bogus"], ("command line", "--bogus", "--help")),
        (["s.toml", "--set", "axes.step"], ("command line", "--set", "axes.step", "KEY=VALUE")),
        (["s.toml", "--set", "axes.step=[1,"], ("command line", "axes.step", "[1,", "TOML")),
        (["s.toml", "--set", "axes.step=1\nb=2"], ("command line", "axes.step", "one TOML value")),
        (["s.toml", "--set", "study.name.first=a"], ("command line", "study.name.first", "name holds a value")),
        (["s.toml", *LONG, "--set", "outputs.loops=[0]"], ("outputs.loops = [0]", "1.2 GB")),
        (["s.toml", "-o", "."], ("command line", "-o", "folder")),
        (["s.toml", "-o", "nowhere/out.nc"], ("command line", "nowhere/out.nc", "folder that exists")),
        (["s.toml", "-o", "/dev/null"], ("command line", "/dev/null", "ordinary file")),
        (["s.toml", "-o", "x" * 300], ("command line", "-o", "can be written")),
        (["s.toml", "-o", "s.toml/out.nc"], ("command line", "folder that exists", "s.toml is no folder")),
        (["s.toml", "-o", "\udcff.nc"], ("command line", r"\udcff.nc", "give a name in UTF-8")),
        (["s.toml", "-o", "s.toml"], ("command line", "s.toml", "read by the run")),
        (["s.toml", "--write-scene", "nowhere/out.h5"], ("command line", "--write-scene", "folder that exists")),
    ],
)
def test_command_line(arguments, words, folder, capsys):
    line = line_of(arguments, capsys)
    for word in words:
        assert word in line


def test_write_protected_output(folder, capsys, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "write-protected" in line_of(["s.toml"], capsys)
