"""Files that were made to do harm: exit status 2 within 5 s and 1 GB, one line, nothing that a terminal obeys."""

import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from studyrunner.cli import main
from studyrunner.study.study_of_result import check_result_file
from studyrunner.user_error import UserError
from tests.studyrunner.hostile_files import ALLOWED, SCENES, STUDY, TEXTS, change_scene, sparse_file
from tests.studyrunner.own_time import Stopwatch

# all files but those of the command alone
pytestmark = [pytest.mark.usefixtures("reader"), pytest.mark.processes]


IN_A_RESULT = ("huge matrix", "inflating chunk", "external link", "many objects", "not a number")
"""One of each kind of harm: behind this door is the same reader of scenes."""

VALUES_ONLY = {
    *("huge matrix", "bomb of zeros", "64 bit overflow", "label with an escape sequence", "not a number"),
    *("bomb within the limit", "denormal area", "next to the largest", "wrong byte order", "huge number of sectors"),
    *("long texts", "objects", "attribute of text", "circle of groups", "name with an escape sequence"),
}
"""No harm to a program that reads parts of what it knows."""


MEASURED = """
import resource, subprocess, sys
# started by a small process: the largest size of a new one is at first that of its parent
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(status, used.ru_maxrss, used.ru_utime + used.ru_stime)
"""
SECONDS = 5.0
LARGEST = 2**30


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The slider's scene file, and a result of it."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["sdof_slider", "--write-scene", "scene.h5"]) == 0
        Path("study").write_text(STUDY, encoding="utf-8")
        assert main(["study"]) == 0
        Path("s.nc.progress").unlink()
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    for name in ("scene.h5", "study", "s.nc"):
        shutil.copy(made / name, tmp_path / name)
    (tmp_path / "s.nc").rename(tmp_path / "result")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(reader, capsys):
    def run(arguments, allowed=False):
        # memory is that of this process: the one that reads has a limit of its own
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        watch, waited = Stopwatch(), reader.waited
        status = main(arguments)
        seconds = watch.seconds(reader.waited - waited)
        captured = capsys.readouterr()
        grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - own)
        assert status == 2 or (allowed and status == 0)
        assert seconds < SECONDS
        assert grown < LARGEST
        if status == 0:
            return ""
        assert captured.out == ""
        said = captured.err.splitlines()
        assert len(said) == 1
        assert said[0].isprintable()
        assert len(said[0]) < 2000
        assert said[0].startswith("run-study: ")
        return said[0]

    return run


@pytest.mark.slow
@pytest.mark.parametrize("case", SCENES)
def test_scene_file(case, folder, refused):
    change_scene(folder / "scene.h5", SCENES[case])
    line = refused(["study", "--plan"], allowed=case in ALLOWED)
    assert not line or line.startswith("run-study: scene.h5: ")


def put_scene_into_result():
    """The scene file takes the place of the scene in the result; the test is skipped where it cannot be copied."""
    with h5py.File("result", "r+") as result, h5py.File("scene.h5") as scene:
        del result["scene"]
        try:
            scene.copy(scene["/"], result, "scene", expand_soft=False, expand_external=False)
        except (OSError, RuntimeError, ValueError, KeyError):
            pytest.skip("the library cannot copy it")


@pytest.mark.slow
@pytest.mark.parametrize("case", IN_A_RESULT)
def test_scene_in_a_result_file(case, folder, refused):
    change_scene(folder / "scene.h5", SCENES[case])
    put_scene_into_result()
    line = refused(["result", "--plan"], allowed=case in ALLOWED)
    assert not line or "result: " in line


@pytest.mark.slow
@pytest.mark.parametrize("case", sorted(set(SCENES) - VALUES_ONLY))
def test_result_file_for_those_who_open_it(case, folder):
    check_result_file(folder / "result", "result")
    change_scene(folder / "scene.h5", SCENES[case])
    put_scene_into_result()
    with pytest.raises(UserError) as caught:
        check_result_file(folder / "result", "result")
    assert str(caught.value).startswith("result: ")
    assert str(caught.value).isprintable()


@pytest.mark.slow
@pytest.mark.parametrize("case", TEXTS)
def test_study_file(case, folder, refused):
    (folder / "study").write_bytes(TEXTS[case])
    refused(["study", "--plan"])


def truncated(path):
    content = path.read_bytes()
    path.write_bytes(content[: int(0.3 * len(content))])


def replaced_by(make):
    def replace(path):
        path.unlink()
        make(path)

    return replace


DAMAGES = {
    "truncated": truncated,
    "sparse terabyte": sparse_file,
    "fifo": replaced_by(os.mkfifo),
    "link to itself": replaced_by(lambda path: path.symlink_to(path.name)),
    "device": replaced_by(lambda path: path.symlink_to("/dev/zero")),
}


@pytest.mark.parametrize("place", ["study", "scene.h5", "result"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_files_that_are_damaged_or_none(damage, place, folder, refused):
    DAMAGES[damage](folder / place)
    refused(["result" if place == "result" else "study", "--plan"])


def test_names_of_files_do_not_reach_the_terminal_raw(folder, refused, capsys):
    name = "\x1b[2J\udcff.toml"
    Path(name).write_text("[study", encoding="utf-8")
    assert r"\x1b[2J\udcff.toml" in refused([name])
    assert r"\x1b[2J" in refused(["study", "--set", "axes.step=\x1b[2J"])
    (folder / "study").write_text(STUDY.replace('name = "s"', 'name = "s"\ntitle = "\\u001b[2J"'), encoding="utf-8")
    assert main(["study", "--plan"]) == 0
    assert "\x1b" not in capsys.readouterr().out


@pytest.mark.slow
def test_the_command_alone(folder):
    """Time of the processors and memory of the whole command, its start included."""
    change_scene(folder / "scene.h5", SCENES["inflating chunk"])
    command = [sys.executable, "-m", "studyrunner.cli", "study", "--plan"]
    done = subprocess.run([sys.executable, "-c", MEASURED, *command], capture_output=True, text=True, check=False)
    status, largest, seconds = (float(word) for word in done.stdout.split()[-3:])
    assert seconds < 2 * SECONDS
    assert status == 2
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert 1024 * largest < LARGEST


@pytest.mark.slow
@pytest.mark.parametrize("case", ["nested arrays", "escape sequence in a key"])
def test_study_in_a_result_file(case, folder, refused):
    with h5py.File("result", "r+", libver="latest") as result:
        del result.attrs["study"]
        result.attrs.create("study", TEXTS[case], dtype=h5py.string_dtype("utf-8"))
    (folder / "scene.h5").unlink()
    refused(["result", "--plan"])
