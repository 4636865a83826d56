"""The page on a model of one's own: its commands work when pasted, and print what it says."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from tests.studies.static_contact import solve_static_contact

ROOT = Path(__file__).parents[2]
DECK = ROOT / "studies" / "blade_root.inp"
PAGE = ROOT / "studies" / "fe_models" / "README.md"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
COMMANDS = [text for language, text in BLOCKS if language == "bash"]
PRINTED = [text for language, text in BLOCKS if not language]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")

SMALL = {"harmonics": "1", "samples": "32", "cycles": "100", "outputs": "2", "excitation_amplitude": "2.0"}
NEXT_TO_NOTHING = [
    word
    for each in ("axes.excitation_amplitude=1e-3", "slow_time.cycles=0", "slow_time.outputs=1")
    for word in ("--set", each)
]


def paste(commands, folder):
    """What the commands print."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    done = subprocess.run(
        ["bash", "-e", "-c", commands], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_printed(expected, printed):
    """Every line is there, its numbers to within what rounding changes."""
    lines = printed.splitlines()
    for line in expected.splitlines():
        numbers = [float(each) for each in NUMBER.findall(line)]
        alike = [each for each in lines if NUMBER.sub("#", each) == NUMBER.sub("#", line)]
        found = [[float(number) for number in NUMBER.findall(each)] for each in alike]
        assert any(each == pytest.approx(numbers, rel=2e-2, abs=1e-3) for each in found), (line, alike)


@pytest.fixture
def folder(tmp_path):
    """The files of the example, the study so small that it takes seconds."""
    paste(COMMANDS[0], tmp_path)
    study = (tmp_path / "blade_root.toml").read_text(encoding="utf-8")
    for key, value in SMALL.items():
        study, n = re.subn(rf"^{key} = \S+", f"{key} = {value}", study, flags=re.MULTILINE)
        assert n == 1
    (tmp_path / "blade_root.toml").write_text(study, encoding="utf-8")
    return tmp_path


def test_the_page_shows_the_study_and_the_last_step():
    (table,) = [text for language, text in BLOCKS if language == "toml"]
    assert table in (DECK.parent / "blade_root.toml").read_text(encoding="utf-8")
    assert PRINTED[1] in DECK.read_text(encoding="ascii")


@pytest.mark.slow
def test_the_page_without_calculix(folder):
    check_printed(PRINTED[0], paste(COMMANDS[1], folder))
    assert (folder / "blade_root.check.png").read_bytes().startswith(b"\x89PNG")
    paste(COMMANDS[3], folder)
    with xr.open_dataset(folder / "blade_root.nc") as result:
        assert result.worn_volume.values.ravel()[-1] > 0.0
        assert result.attrs["model_units"] == "mm-t-s"
    assert (folder / "blade_root-report" / "index.html").is_file()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_the_page_with_the_matrices_of_calculix(folder):
    check_printed(PRINTED[2], paste(COMMANDS[2], folder))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_static_forces_are_those_of_the_contact_of_calculix(tmp_path):
    """Normal and shear force of a flank under the centrifugal load, with friction, before anything vibrates."""
    asked = "*CONTACT PRINT,SLAVE=ROOT_A,MASTER=SLOT_A\nCF\n*END STEP\n"
    (tmp_path / "job.inp").write_text(DECK.read_text(encoding="ascii").replace("*END STEP\n", asked, 1))
    paste("ccx -i job", tmp_path)
    printed = (tmp_path / "job.dat").read_text().split("normal force (+ = tension) and shear force (size)")[1]
    _, normal, shear = map(float, printed.split()[:3])
    force = solve_static_contact(build_study_scene(read_study("blade_root")), 0.4)
    flank = force[:18].sum(axis=0)
    assert flank[0] == pytest.approx(-normal, rel=2e-3)
    assert np.hypot(*flank[1:]) == pytest.approx(shear, rel=3e-3)
    assert main(["blade_root", "-o", str(tmp_path / "still.nc"), *NEXT_TO_NOTHING]) == 0
    with xr.open_dataset(tmp_path / "still.nc") as result:
        found = (result.mean_pressure * result.contact_area).values.reshape(2, 18).sum(axis=1)
    assert found == pytest.approx(2 * [-normal], rel=3e-3)
