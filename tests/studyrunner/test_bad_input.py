"""Bad input: exit status 2 and one line that names the file, the key, the value and what would be right."""

import os
from pathlib import Path

import h5py
import pytest

from studyrunner.cli import main

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

WRONG_KEYS = {
    "key in place of a table": ("slow_time=3", "slow_time", "3", "table"),
    "variables in one word": ("outputs.variables=default", "outputs.variables", '"default"', "list of names"),
    "target 0": ("slow_time.until={wear_depth = 0.0}", "slow_time.until", "0.0", "above 0"),
    "half a harmonic in a list": ("solver.harmonics=[1, 1.5]", "solver.harmonics", "1.5", "whole"),
    "half a harmonic in a list of one": ("solver.harmonics=[1.5]", "solver.harmonics", "1.5", "whole"),
    "descending pressures": ("wear.pressure=[2.0, 1.0]", "wear.pressure", "[2.0, 1.0]", "ascending"),
    "negative factor": ("wear.factor=[[-1.0]]", "wear.factor", "-1.0", "0 or more"),
    "unknown key": ("axes.freqency=1", "axes.freqency", "1", "frequency"),
    "unknown table": ("axis.frequency=1", "axis", "frequency", "axes"),
    "a name of the literature": ("axes.k_w=1", "axes.k_w", "1", "unknown key, give wear_coefficient"),
    "values for a key that is no axis": ("scene.mass=[1.0, 2.0]", "scene.mass", "[1.0, 2.0]", "the list as axes.mass"),
    "wrong type": ("axes.frequency=fast", "axes.frequency", '"fast"', "number"),
    "NaN": ("axes.wear_coefficient=nan", "axes.wear_coefficient", "nan", "finite"),
    "negative area": ("scene.area=-1e-4", "scene.area", "-0.0001", "above 0"),
    "frequency 0": ("axes.frequency=0", "axes.frequency", "0", "above 0"),
    "empty axis": ("axes.frequency=[]", "axes.frequency", "[]", "at least one"),
    "duplicates": ("axes.frequency=[1, 2, 1.0]", "axes.frequency", "1.0", "once"),
    "unfinished range": ("axes.frequency={start = 1, stop = 2}", "axes.frequency", "start", "{start, stop, num}"),
    "huge range": ("axes.frequency={start = 1, stop = 2, num = 1e9}", "axes.frequency", "1000000000.0", "at most"),
    "unknown word": ("axes.scheme=euler", "axes.scheme", '"euler"', "explicit"),
    "word for shortcuts": ("solver.shortcuts=no", "solver.shortcuts", '"no"', "true or false"),
    "word for harmonics": ("solver.harmonics=automatic", "solver.harmonics", '"automatic"', 'or "auto"'),
    "half a harmonic": ("solver.harmonics=1.5", "solver.harmonics", "1.5", "whole"),
    "too few samples": ("solver.samples=10", "solver.samples", "10", "at least 11"),
    "tolerance 0": ("solver.tolerance=0", "solver.tolerance", "0", "between 0 and 1"),
    "rtol 0": ("axes.rtol=[0, 0.1]", "axes.rtol", "0", "between 0 and 1"),
    "negative cycles": ("slow_time.cycles=-1", "slow_time.cycles", "-1", "0 or more"),
    "descending outputs": ("slow_time.outputs=[2, 1]", "slow_time.outputs", "[2, 1]", "ascending"),
    "outputs beyond the end": ("slow_time.outputs=[0, 10]", "slow_time.outputs", "10.0", "at most"),
    "unknown law": ("wear.law=reye", "wear.law", '"reye"', '"archard" or "energy" or "threshold" or "table"'),
    "law without its key": ("wear.law=threshold", "wear.law", '"threshold"', "give wear.threshold beside it"),
    "key of another law": ("wear.threshold=1.0", "wear.threshold", "1.0", 'only the law "threshold"'),
    "factors in no rows": ("wear.factor=[1.0]", "wear.factor", "[1.0]", "rows"),
    "factor of no surface": ("wear.surfaces={disk = 1.0}", "wear.surfaces", "disk", "of the surfaces support"),
    "target of what is not": ("slow_time.until={hours = 1}", "slow_time.until", "hours", "{wear_depth = ...}"),
    "two targets": ("slow_time.until={wear_depth = 1, worn_volume = 1}", "slow_time.until", "wear_depth", "one of"),
    "unknown variable": ("outputs.variables=['wear']", "outputs.variables", '"wear"', "wear_depth"),
    "a table among the variables": ("outputs.variables=[{a = 1}]", "outputs.variables", "{a = 1}", "default"),
    "harmonics of no computer": ("solver.harmonics=1e9", "solver.harmonics", "1000000000.0", "at most 1000"),
    "loops": ("outputs.loops=0", "outputs.loops", "0", "list of contact indices"),
    "loops of a pair that is not there": ("outputs.loops=[0, 1]", "outputs.loops", "1", "from 0 to 0"),
    "mesh of a scene without one": ("outputs.variables=['mesh']", "outputs.variables", '"mesh"', "has none"),
    "frequencies of nothing": ("outputs.variables=['natural_frequency']", "outputs.variables", "", "nothing moves"),
    "unknown scene": ("scene.model=turbine", "scene.model", "turbine", "dovetail_sector"),
    "missing scene file": ("scene.model=missing.h5", "scene.model", "missing.h5", "no such file"),
    "scene is a number": ("scene.model=3", "scene.model", "3", "in quotes"),
    "name with a slash": ("study.name='a/b'", "study.name", "a/b", "slash"),
}


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


@pytest.mark.parametrize("case", WRONG_KEYS)
def test_wrong_key(case, folder, capsys):
    override, key, value, remedy = WRONG_KEYS[case]
    line = line_of(["s.toml", "--set", override], capsys)
    start, _, rest = line.partition(f"s.toml: {key} = ")
    assert start == "run-study: "
    shown, _, advice = rest.partition(": ")
    assert value in shown
    assert remedy in advice


TWICE = STUDY.replace("[slow_time]", "harmonics = [1, 3]\n[slow_time]")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STUDY.replace("[study]\nname", "[other]\nname"), ("study",)),
        (STUDY.replace('model = "sdof_slider"\n', ""), ("scene.model",)),
        (STUDY.replace("frequency = [150.0]\n", ""), ("axes.frequency",)),
        (TWICE, ("solver.harmonics = 5", "give it once, here or as axes.harmonics")),
        (TWICE.replace("= 5", "= [5, 7]"), ("solver.harmonics = [5, 7]", "give it once, here or as axes.harmonics")),
        ("[study\n", ("valid TOML",)),
        ("\xff", ("UTF-8",)),
        ("a = 1\n", ("unknown table",)),
    ],
)
def test_wrong_file(text, words, folder, capsys):
    (folder / "s.toml").write_bytes(text.encode("latin-1"))
    line = line_of(["s.toml"], capsys)
    assert all(word in line for word in ("s.toml", *words))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.toml"], ("missing.toml", "no such file")),
        (["unheard_of"], ("unheard_of", "dovetail")),
        (["."], (".", "folder")),
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
