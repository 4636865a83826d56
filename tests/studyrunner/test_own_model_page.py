"""The page on a model of one's own: its commands work when pasted, and print what it says; its forces are true."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from tests.studies.fe_models.solid_meshes import needs_ccx
from tests.studies.static_contact import solve_static_contact
from tests.studyrunner.small_studies import UNWORN, compute

ROOT = Path(__file__).parents[2]
DECK = ROOT / "studies" / "blade_root.inp"
PAGE = ROOT / "studies" / "fe_models" / "README.md"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SMALL = {"harmonics": "1", "samples": "32", "cycles": "100", "outputs": "2", "excitation_amplitude": "2.0"}

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]


def paste(commands):
    """What the commands print."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    command = ["bash", "-e", "-c", commands]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_printed(expected, printed):
    """Every line is there, its numbers to within what rounding changes."""
    for line in expected.splitlines():
        numbers = [float(each) for each in NUMBER.findall(line)]
        alike = [each for each in printed.splitlines() if NUMBER.sub("#", each) == NUMBER.sub("#", line)]
        found = [[float(number) for number in NUMBER.findall(each)] for each in alike]
        assert any(each == pytest.approx(numbers, rel=2e-2, abs=1e-3) for each in found), (line, alike)


def make_small():
    """The study takes seconds."""
    study = Path("blade_root.toml").read_text(encoding="utf-8")
    for key, value in SMALL.items():
        study, n = re.subn(rf"^{key} = \S+", f"{key} = {value}", study, flags=re.MULTILINE)
        assert n == 1
    Path("blade_root.toml").write_text(study, encoding="utf-8")


def test_every_command_prints_what_stands_below_it(folder):
    deck, printed = DECK.read_text(encoding="ascii"), None
    for language, text in BLOCKS:
        if language == "bash":
            printed = paste(text) if "ccx" not in text or shutil.which("ccx") else None
            if text.startswith("cp "):
                make_small()
        elif language == "toml":
            assert text in DECK.with_suffix(".toml").read_text(encoding="utf-8")
        elif text not in deck and printed is not None:
            check_printed(text, printed)
    assert (folder / "blade_root.check.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "blade_root-report" / "index.html").is_file()


@needs_ccx
def test_static_forces_are_those_of_the_contact_of_calculix():
    """Normal and shear force of a flank under the centrifugal load, with friction, before anything vibrates."""
    asked = "*CONTACT PRINT,SLAVE=ROOT_A,MASTER=SLOT_A\nCF\n*END STEP\n"
    Path("job.inp").write_text(DECK.read_text(encoding="ascii").replace("*END STEP\n", asked, 1))
    paste("ccx -i job")
    printed = Path("job.dat").read_text().split("normal force (+ = tension) and shear force (size)")[1]
    _, normal, shear = map(float, printed.split()[:3])
    force = solve_static_contact(build_study_scene(read_study("blade_root")), 0.4)
    flank = force[:18].sum(axis=0)
    assert flank[0] == pytest.approx(-normal, rel=2e-3)
    assert np.hypot(*flank[1:]) == pytest.approx(shear, rel=3e-3)
    result = compute("blade_root", "still.nc", "axes.excitation_amplitude=1e-3", *UNWORN)
    found = (result.mean_pressure * result.contact_area).values.reshape(2, 18).sum(axis=1)
    assert found == pytest.approx(2 * [-normal], rel=3e-3)
