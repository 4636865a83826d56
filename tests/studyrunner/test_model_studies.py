"""Studies of finite-element models from their files to a result, on a deck of a few elements."""

import hashlib
import shutil
import subprocess

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from studyrunner.user_error import UserError
from tests.studies.fe_models.decks import SECTOR

STUDY = """
[study]
name = "wear"
[scene]
model = "sector.inp"
units = "SI"
load = {set = "TIP", direction = [0, 1, 0]}
response = {tip = {set = "tip", direction = [0, 2, 0]}}
preload = [{set = "TIP", direction = [-1, 0, 0], force = 1.1e5}]
friction_coefficient = 0.1
nodal_diameter = 3
[axes]
frequency = 300.0
excitation_amplitude = 1000.0
[slow_time]
cycles = 1e4
outputs = 3
[solver]
harmonics = 1
samples = 64
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copy(SECTOR, tmp_path / "sector.inp")
    (tmp_path / "wear.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def scene_of(*overrides):
    return build_study_scene(read_study("wear.toml", overrides))


def message(*overrides):
    with pytest.raises(UserError) as caught:
        scene_of(*overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.slow
def test_from_deck_to_worn_volume(folder, capsys):
    assert main(["wear.toml"]) == 0
    assert main(["wear.nc", "-o", "again.nc"]) == 0
    assert main(["wear.toml", "--write-scene", "scene.h5"]) == 0
    (folder / "file.toml").write_text(
        STUDY[: STUDY.index("[scene]")]
        + '[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.1\n'
        + STUDY[STUDY.index("[axes]") :]
    )
    assert main(["file.toml", "-o", "file.nc"]) == 0
    with xr.open_dataset("wear.nc") as result:
        volume = result.worn_volume.values.ravel()
        assert volume[0] == 0.0
        assert 0.0 < volume[1] < volume[2]
        digest = hashlib.sha256(SECTOR.read_bytes()).hexdigest()
        assert result.attrs["model_files"] == f"sector.inp sha256:{digest}"
        assert result.attrs["model_units"] == "SI"
        assert result.attrs["model_reduced_by"].startswith("fretwear ")
        assert {"mesh_x", "mesh_quad"} <= set(result.variables)
        for other in ("again.nc", "file.nc"):
            with xr.open_dataset(other) as twin:
                assert np.array_equal(twin.worn_volume.values.ravel(), volume)
                for name in ("model_files", "model_units", "scene_sha256"):
                    assert twin.attrs[name] == result.attrs[name]
    capsys.readouterr()
    # the result holds the scene as it was reduced
    assert main(["wear.nc", "-o", "other.nc", "--set", "scene.nodal_diameter=2"]) == 2
    assert "scene.nodal_diameter = 2: leave it out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (['scene.contact=[["BLADS","DISKS"]]'], 'no surface or set of nodes "BLADS" in sector.inp: give BLADES'),
        (["scene.load.set=TOP"], 'wear.toml: scene.load.set: there is no set of nodes or surface "TOP"'),
        (["scene.response.tip.set=TPI"], 'scene.response.tip.set: there is no set of nodes or surface "TPI"'),
        (["scene.model=none.inp"], "scene.model: there is no file none.inp: give a path relative to the study file"),
        (["scene.matrices=none"], "scene.matrices: there is no none.sti, "),
        (["scene.units=inch"], 'scene.units = "inch": give'),
        (["scene.n_sectors=47"], "scene.n_sectors: cut faces are 30 degrees apart, 47 sectors need 7.66: give"),
        (["scene.friction_coefficient={BLADE=0.3}"], "coefficient.BLADE: no contact has this name: give one of"),
        (["scene.nodal_diameter=7"], "scene.nodal_diameter = 7: use at most n_sectors // 2 = 6"),
        (["scene.load.direction=[0,0,0]"], "scene.load.direction"),
        (["scene.frction=1"], "scene.frction = 1: unknown key, give"),
        (["scene.clamp=[]"], "scene.clamp: at nodal diameter 0 nothing holds the glued structure"),
        (["scene.tolerance=1e-12", 'scene.contact=[["TIP","DISKS"]]'], "scene.contact: DISKS and TIP face"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_sentence(overrides, expected, folder):
    assert expected in message(*overrides)


def test_check_says_what_the_model_is(folder, capsys):
    assert main(["wear.toml", "--check"]) == 0
    shown = capsys.readouterr().out
    assert "mass       3.80696 kg" in shown
    assert "speed      4774.65 rpm about (0, 0, 1)" in shown
    assert "sectors    12, 30 degrees each, 12 nodes on a cut face" in shown
    assert "9 nodes of BLADES on DISKS" in shown
    assert "held by friction alone: give retention_stiffness" in shown
    assert (folder / "wear.check.png").read_bytes().startswith(b"\x89PNG")
    assert main(["two_masses", "--check"]) == 2
    assert "give a study of a finite-element model" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_matrices_of_calculix_give_the_scene_of_the_mesh(folder, capsys):
    subprocess.run(["ccx", "-i", "sector"], check=True, capture_output=True, timeout=300)
    expected, found = scene_of(), scene_of("scene.matrices=sector")
    n = 27
    for k, linear in expected.linear.items():
        for name in ("stiffness", "mass", "load_static", "load_harmonic"):
            ours, theirs = (
                getattr(each, name)[(slice(n),) * getattr(each, name).ndim] for each in (found.linear[k], linear)
            )
            assert np.abs(ours - theirs).max() <= 1e-6 * np.abs(theirs).max()
    assert main(["wear.toml", "--check", "--set", "scene.matrices=sector"]) == 0
    shown = capsys.readouterr().out
    assert "speed      4774.65 rpm about (0, 0, 1); the stiffness holds 4774.65 rpm" in shown
    assert "sector.sti sha256:" in shown
    assert "rotation_speed = 3000 rpm, the stiffness holds 4774.65 rpm" in message(
        "scene.matrices=sector", "scene.rotation_speed=3000"
    )


PAIRS = """\
*SURFACE INTERACTION,NAME=ROOT
*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR
1e13
*FRICTION
0.4,1e13
*CONTACT PAIR,INTERACTION=ROOT,TYPE=SURFACE TO SURFACE
"""
TIE = "*TIE,NAME=GLUE,POSITION TOLERANCE=1e-4\n"


def test_contact_pairs_give_the_scene_of_a_tie_and_their_friction(folder):
    tied = scene_of()
    text = SECTOR.read_text()
    (folder / "sector.inp").write_text(text.replace(TIE, PAIRS))
    touching = scene_of()
    assert np.array_equal(touching.linear[0].stiffness, tied.linear[0].stiffness)
    (folder / "wear.toml").write_text(STUDY.replace("friction_coefficient = 0.1\n", ""))
    pairs = scene_of().contact.friction_coefficient
    assert pairs is not None
    assert (pairs == 0.4).all()
