"""Study, scene and result files that are damaged, too large or of another kind: status 2 and one line."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from studyrunner.cli import main
from studyrunner.report import cli as report
from tests.studies.scene_models import poke, put

STUDY = """
[study]
name = "s"
[scene]
model = "scene.h5"
friction_coefficient = 0.5
[axes]
frequency = [150.0]
[slow_time]
cycles = 0
outputs = 1
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The slider's scene file, and a result of it."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["sdof_slider", "--write-scene", "scene.h5"]) == 0
        Path("study").write_text(STUDY, encoding="utf-8")
        assert main(["study", "-o", "result"]) == 0
        Path("result.progress").unlink()
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    for name in ("scene.h5", "study", "result"):
        shutil.copy(made / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(capsys):
    def run(arguments, command=main):
        assert command(arguments) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        (line,) = captured.err.splitlines()
        assert line.isprintable()
        return line

    return run


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize("place", ["scene.h5", "result"])
def test_a_truncated_file(share, place, folder, refused):
    content = (folder / place).read_bytes()
    (folder / place).write_bytes(content[: int(share * len(content))])
    assert f"{place}: " in refused(["result" if place == "result" else "study", "--plan"])
    if place == "result":
        assert "result: " in refused(["result"], report.main)


def test_a_result_that_is_none(folder, refused):
    (folder / "result").write_bytes(b"CDF\x01" + bytes(100))
    assert "is no NetCDF file (NetCDF-4)" in refused(["result"], report.main)
    assert "there is none of this name" in refused(["none.nc"], report.main)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (poke("stiffness", (0, 0), np.nan), "stiffness"),
        (put("response/names", ["\x1b[31mred", "\x1b[31mred"]), r"\x1b[31mred"),
    ],
)
def test_a_scene_that_is_none(change, sentence, folder, refused):
    with h5py.File("scene.h5", "r+") as file:
        change(file)
    line = refused(["study"])
    assert line.startswith("run-study: scene.h5: ")
    assert sentence in line


def test_names_of_files_do_not_reach_the_terminal_raw(folder, refused, capsys):
    name = "\x1b[2J\udcff.toml"
    Path(name).write_text("[study", encoding="utf-8")
    assert r"\x1b[2J\udcff.toml" in refused([name])
    assert "[2J" in refused(["study", "--set", "axes.step=\x1b[2J"])
    (folder / "study").write_text(STUDY.replace('name = "s"', 'name = "s"\ntitle = "\\u001b[2J"'), encoding="utf-8")
    assert main(["study", "--plan"]) == 0
    assert "\x1b" not in capsys.readouterr().out
