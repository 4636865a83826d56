"""Studies of finite-element models from their files to a result, on a deck of a few elements."""

from __future__ import annotations

import hashlib
import shutil
import subprocess

import numpy as np
import pytest
import xarray as xr

from studies.scene_file import read_mesh, read_scene
from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import format_study, read_study
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


def test_scene_file_of_a_model(folder):
    assert main(["wear.toml", "--write-scene", "scene.h5"]) == 0
    model, mesh = read_scene("scene.h5"), read_mesh("scene.h5")
    assert model.n_sectors == 12
    assert model.contact.surface == ("BLADES-DISKS",) * 9
    assert mesh is not None
    assert np.ptp(mesh.nodes[:, 0]) == pytest.approx(0.3 - 0.1 * np.cos(np.pi / 12), rel=1e-6)


def test_effective_study_is_the_study(folder):
    study = read_study("wear.toml", ["scene.contact=[['Blades','DISKS']]", "scene.clamp=['BORE']"])
    (folder / "again.toml").write_text(format_study(study))
    again = read_study("again.toml")
    assert again.scene.parameters == study.scene.parameters
    assert study.files == (folder.__class__("wear.toml"), folder.__class__("sector.inp"))


def test_preload_closes_the_pairs(folder):
    """What pushes the blade inwards closes the pairs, all of it."""
    without, with_preload = (
        scene_of(f"scene.preload={value}") for value in ("[]", '[{set="TIP",direction=[-2,0,0],force=1e3}]')
    )
    change = with_preload.linear[0].load_static - without.linear[0].load_static
    assert change[:27].reshape(-1, 3)[:, 0].sum() == pytest.approx(1e3, rel=0.02)
    assert with_preload.response_names == ("tip",)
    assert without.linear[0].response.shape == with_preload.linear[0].response.shape


def test_lengths_in_millimetres(folder):
    """The same model in mm, t and s is the same scene."""
    lines, factors = [], None
    keyword = ""
    for line in SECTOR.read_text().splitlines():
        if line.startswith("*"):
            keyword = line.split(",")[0].upper()
            tolerance = line.replace("TOLERANCE=1e-4", "TOLERANCE=1e-1")
            lines.append(tolerance)
            continue
        factors = {"*NODE": (1, 1e3, 1e3, 1e3), "*ELASTIC": (1e-6, 1), "*DENSITY": (1e-12,)}.get(keyword)
        if factors is None:
            lines.append(line)
            continue
        parts = line.split(",")
        first = parts[0] if keyword == "*NODE" else repr(float(parts[0]) * factors[0])
        rest = [repr(float(part) * factor) for part, factor in zip(parts[1:], factors[1:], strict=True)]
        lines.append(",".join([first, *rest]))
    expected = scene_of()
    (folder / "sector.inp").write_text("\n".join(lines) + "\n")
    found = scene_of("scene.units=mm-t-s")
    for k, linear in expected.linear.items():
        for name in ("stiffness", "mass", "load_static", "load_harmonic"):
            ours, theirs = getattr(found.linear[k], name), getattr(linear, name)
            n = 27
            ours, theirs = (each[(slice(n),) * each.ndim] for each in (ours, theirs))
            assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max()
    assert found.contact.area == pytest.approx(expected.contact.area, rel=1e-9)
    assert "density 7.8e+03" in message("scene.units=SI") or "not SI" in message("scene.units=SI")


def test_keys_override_the_deck(folder):
    assert scene_of("scene.n_sectors=12", "scene.axis={direction=[0,0,3]}").n_sectors == 12
    still, turning = scene_of("scene.rotation_speed=0", "scene.preload=[]"), scene_of("scene.preload=[]")
    assert not still.linear[0].load_static.any()
    rpm = 500.0 * 30.0 / np.pi
    given = scene_of(f"scene.rotation_speed={rpm!r}", "scene.preload=[]")
    assert given.linear[0].load_static == pytest.approx(turning.linear[0].load_static, rel=1e-9, abs=1e-6)
    heavy = scene_of(
        "scene.material={young_modulus=2.1e11,poisson_ratio=0.3,density=15600.0}", "scene.rotation_speed=0"
    )
    n = 27
    assert heavy.linear[0].mass[:n, :n] == pytest.approx(2.0 * still.linear[0].mass[:n, :n], rel=1e-6, abs=1e-9)
    blade = scene_of("scene.material={BLADE={young_modulus=2.1e11,poisson_ratio=0.3,density=15600.0}}")
    assert not np.allclose(blade.linear[0].mass[:n, :n], still.linear[0].mass[:n, :n], rtol=1e-3)
    pairs = scene_of("scene.friction_coefficient={BLADES=0.3}").contact.friction_coefficient
    assert pairs is not None
    assert (pairs == 0.3).all()


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (
            ['scene.contact=[["BLADS","DISKS"]]'],
            'scene.contact = there is no surface or set of nodes "BLADS" in sector.inp: give BLADES',
        ),
        (["scene.load.set=TOP"], 'wear.toml: scene.load.set = there is no set of nodes or surface "TOP"'),
        (["scene.response.tip.set=TPI"], 'scene.response.tip.set = there is no set of nodes or surface "TPI"'),
        (["scene.model=none.inp"], "scene.model = there is no file none.inp: give a path relative to the study file"),
        (["scene.matrices=none"], "scene.matrices = there is no none.sti, none_STIF1.mtx"),
        (["scene.units=inch"], 'scene.units = "inch": give'),
        (["scene.n_sectors=47"], "scene.n_sectors = cut faces are 30 degrees apart, 47 sectors need 7.66: give"),
        (["scene.friction_coefficient={BLADE=0.3}"], "coefficient.BLADE = no contact has this name: give one of"),
        (["scene.nodal_diameter=7"], "scene.nodal_diameter = 7: use at most n_sectors // 2 = 6"),
        (["scene.load.direction=[0,0,0]"], "scene.load.direction"),
        (["scene.frction=1"], "scene.frction = 1: unknown key, give"),
        (["scene.clamp=[]"], "scene.clamp = at nodal diameter 0 nothing holds the glued structure"),
        (["scene.tolerance=1e-12", 'scene.contact=[["TIP","DISKS"]]'], "scene.contact ="),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_sentence(overrides, expected, folder):
    assert expected in message(*overrides)


def test_wrong_decks_end_with_one_line(folder, capsys):
    (folder / "sector.inp").write_bytes(b"*NODE\n1, 0., nan, 1e999\n\xff\x00")
    assert main(["wear.toml", "--plan"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("run-study: wear.toml: scene.model = sector.inp")


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


def test_check_counts_what_pulls(folder, capsys):
    assert main(["wear.toml", "--check", "--set", "scene.preload=[]"]) == 0
    assert "9 of 9 pull: the joint opens, give a preload" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_matrices_of_calculix_give_the_scene_of_the_mesh(folder, capsys):
    subprocess.run(["ccx", "-i", "sector"], check=True, capture_output=True, timeout=100)
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
*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=TIED
1e13
*FRICTION
0.4,1e13
*CONTACT PAIR,INTERACTION=ROOT,TYPE=SURFACE TO SURFACE
"""
TIE = "*TIE,NAME=GLUE,POSITION TOLERANCE=1e-4\n"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("*EQUATION,REMOVE ALL\n", "", "BLADES: 9 of 9 nodes have no dof in sector.dof (tied or fixed)"),
        ("*STEP,PERTURBATION", "*STEP", "the deck spins at 500 rad/s, the stiffness holds 0"),
        (TIE, PAIRS, "the stiffness couples BLADES and DISKS (1.6e+09 N/m)"),
    ],
)
def test_what_is_wrong_with_an_export_is_said_in_a_sentence(old, new, expected, folder):
    text = SECTOR.read_text()
    assert old in text
    (folder / "sector.inp").write_text(text.replace(old, new))
    subprocess.run(["ccx", "-i", "sector"], check=True, capture_output=True, timeout=100)
    assert expected in message("scene.matrices=sector")


def test_pairs_that_are_too_far_apart_are_counted(folder):
    lines = SECTOR.read_text().splitlines()
    # the blade, three millimetres further out: the deck ties within a tenth of one
    disk = {int(word) for word in _numbers(lines, "*ELEMENT,TYPE=C3D8,ELSET=DISK")}
    for at, line in enumerate(lines[1:], start=1):
        if line.startswith("*"):
            break
        number, x, y, z = line.split(",")
        if int(number) not in disk:
            lines[at] = f"{number},{float(x) + 3e-3!r},{y},{z}"
    (folder / "sector.inp").write_text("\n".join(lines) + "\n")
    assert "9 of 9 nodes of BLADES are farther than 0.0001 m from DISKS" in message()


def _numbers(lines, keyword):
    """Node numbers of the elements behind a keyword."""
    begin = lines.index(keyword) + 1
    for line in lines[begin:]:
        if line.startswith("*"):
            return
        yield from line.split(",")[1:]


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


def test_nodes_of_cut_faces_that_do_not_match_are_named(folder):
    text = SECTOR.read_text()
    line = next(each for each in text.splitlines() if each.startswith("38,"))
    number, x, y, z = line.split(",")
    (folder / "sector.inp").write_text(text.replace(line, f"{number},{x},{y},{float(z) + 2e-3!r}"))
    assert "scene.cut_faces = 1 nodes of one cut face have no image among the 12 of the other: 1: mesh" in message()


def test_decks_that_are_cut_off_are_read_or_refused(folder):
    text = SECTOR.read_text()
    said = []
    for share in np.linspace(0.05, 0.99, 8):
        (folder / "sector.inp").write_text(text[: int(share * len(text))])
        try:
            scene_of()
        except UserError as error:
            said.append(str(error))
    # without the last steps it is a model without a speed
    assert len(said) >= 6
    assert all("\n" not in each and each.startswith("wear.toml: scene.") for each in said)
