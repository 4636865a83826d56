"""Study files: defaults, axes, overrides and the effective study that goes into the result."""

import os
from pathlib import Path

import h5py
import pytest

from studyrunner.cli import main
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study_file import format_study, read_study
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
    assert [getattr(study.solver, key) for key in SOLVER_AXES] == [("auto",), ("auto",), (1e-8,), (1e-2,)]
    assert (study.solver.time_limit, study.solver.shortcuts) == (None, True)
    assert study.cycles_kept == tuple(1000.0 * position for position in range(101))
    assert study.friction_coefficient == 0.5
    assert "loop_force" not in study.outputs.variables
    assert study.outputs.variables == USUAL
    assert study.outputs.loops == ()


def test_one_word_stands_for_the_default_variables():
    study = read_study("dovetail", ["outputs.variables=['natural_frequency', 'default']"])
    assert study.outputs.variables == (*USUAL, "mesh", "natural_frequency")


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


@pytest.mark.parametrize(
    ("key", "values"),
    [("harmonics", "['auto', 3]"), ("harmonics", "{start = 1, stop = 5, num = 3}"), ("rtol", "[1e-1, 1e-2, 1e-3]")],
)
def test_several_values_of_a_solver_key_are_an_axis(key, values):
    there = read_study("dovetail", [f"axes.{key}={values}", "axes.tolerance=1e-9"])
    here = read_study("dovetail", [f"solver.{key}={values}", "axes.tolerance=1e-9"])
    assert len(here.dimensions[key]) > 1
    assert here.dimensions == there.dimensions
    assert list(here.dimensions)[6:] == sorted([key, "tolerance"], key=SOLVER_AXES.index)
    assert format_study(here) == format_study(there)


@pytest.mark.parametrize("harmonics", ["solver.harmonics=3", "axes.harmonics=[1, 3]", "axes.harmonics=['auto', 3]"])
def test_effective_study_reads_back_the_same(harmonics, tmp_path):
    overrides = [harmonics, "axes.rtol=[0.1, 0.2]", "study.title='a \\ \"title\" with é'", "slow_time.outputs=[0, 10]"]
    study = read_study("dovetail", overrides)
    again = read_study(write(tmp_path, format_study(study)))
    assert again.model_dump() == study.model_dump()
    assert format_study(again) == format_study(study)


LONG = ("--set", "slow_time.cycles=1e6", "--set", "slow_time.outputs=200000")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SMALLEST, encoding="utf-8")
    with h5py.File(tmp_path / "s.nc", "w") as earlier:
        earlier.attrs["study"] = SMALLEST
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
        (["s.toml", "--set", "axes.step=[1,"], ("command line", "axes.step", "[1,", "TOML")),
        (["s.toml", "--set", "study.name.first=a"], ("command line", "study.name.first", "name holds a value")),
        (["s.toml", *LONG, "--set", "outputs.loops=[0]"], ("outputs.loops = [0]", "1.3 GB")),
        (["s.toml", "-o", "nowhere/out.nc"], ("command line", "nowhere/out.nc", "folder that exists")),
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
