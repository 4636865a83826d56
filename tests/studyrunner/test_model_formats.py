"""Studies of models in the formats of other programs, through the front door; files are written after the manuals."""

import importlib.util

import numpy as np
import pytest

from tests.studies.fe_models.matrix_files import write_abaqus, write_nastran
from tests.studies.fe_models.plates import Plates
from tests.studyrunner.test_model_studies import message, scene_of

needs_meshio = pytest.mark.skipif(importlib.util.find_spec("meshio") is None, reason="meshio is not installed")
needs_ansys = pytest.mark.skipif(
    importlib.util.find_spec("ansys") is None or importlib.util.find_spec("ansys.mapdl.reader") is None,
    reason="ansys-mapdl-reader is not installed",
)

STUDY = """
[study]
name = "lap"
[scene]
model = "lap.inp"
units = "SI"
contact = [["UNDER", "OVER"]]
clamp = ["GROUND"]
load = {set = "TIP", direction = [0, 0, 1]}
preload = [{set = "OVER", direction = [0, 0, -1], force = 500.0}]
friction_coefficient = 0.3
material = {young_modulus = 210e9, poisson_ratio = 0.3, density = 7800.0}
retention_stiffness = 1e6
retention_direction = [1, 0, 0]
[axes]
frequency = 300.0
wear_coefficient = 1e-11
excitation_amplitude = 20.0
[slow_time]
cycles = 1000
outputs = 2
[solver]
harmonics = 1
samples = 32
"""
LEAST = 1e-8


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "wear.toml").write_text(STUDY)
    (tmp_path / "lap.inp").write_text(Plates().deck())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check_same(found, expected, tolerance=LEAST):
    """Matrices of the relative displacements, and the loads on them; modes may differ in sign."""
    n = 3 * expected.contact.n_contact
    assert found.contact.n_contact == expected.contact.n_contact
    assert found.contact.area == pytest.approx(expected.contact.area, rel=1e-9)
    for name in ("stiffness", "mass", "load_static", "load_harmonic"):
        ours, theirs = (getattr(each.linear[0], name) for each in (found, expected))
        part = (slice(n),) * ours.ndim
        assert np.abs(ours[part] - theirs[part]).max() <= tolerance * np.abs(theirs[part]).max()
    ours, theirs = (np.linalg.eigvalsh(each.linear[0].stiffness[n:, n:]) for each in (found, expected))
    assert ours == pytest.approx(theirs, rel=10.0 * tolerance)


@pytest.mark.slow
@needs_meshio
def test_gmsh(folder):
    (folder / "lap.msh").write_text(Plates().gmsh())
    check_same(scene_of("scene.model=lap.msh"), scene_of())
    by_volume = "scene.material={lower={young_modulus=210e9,poisson_ratio=0.3,density=7800.0}}"
    assert "1 elements" not in message("scene.model=lap.msh", by_volume)
    assert "2 elements of lap.msh have none, as element 3" in message("scene.model=lap.msh", by_volume)
    assert "give TIP" in message("scene.model=lap.msh", "scene.load.set=TIPS")


@needs_ansys
def test_cdb(folder):
    (folder / "lap.cdb").write_text(Plates().cdb())
    check_same(scene_of("scene.model=lap.cdb"), scene_of())


@pytest.mark.parametrize("triangles", ["lower", "both"])
def test_abaqus(folder, triangles):
    write_abaqus(folder, "job", triangles, Plates().system())
    check_same(scene_of("scene.matrices=job"), scene_of())
    check_same(scene_of("scene.matrices=job_STIF1.mtx"), scene_of())


def test_nastran(folder):
    write_nastran(folder, "job", system=Plates().system())
    check_same(scene_of("scene.matrices=job"), scene_of(), 1e-5)  # of 10 digits, and thin plates


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["scene.model=lap.med"], "or the path of a scene file or of a model (.inp, .msh, .cdb)"),
        (["scene.units=mm-t-s", "scene.matrices=job"], "not mm-t-s: give `units` that fit"),
        (["scene.matrices=job", "scene.stress_stiffening=false"], "scene.stress_stiffening = false: leave it out"),
        (['scene.contact=[["UNDER","UNDER"]]'], "scene.contact: UNDER and UNDER share"),
        (["scene.cut_faces=['TIP','GROUND']"], "scene.n_sectors: missing: give the number of sectors"),
        (["scene.rotation_speed=100"], "scene.axis: missing: give {point, direction}"),
        (["scene.clamp=['GROUND','UNDER']"], "scene.contact = 4 nodes of UNDER are clamped, as node"),
        (["scene.preload=[{set='BOLT',direction=[0,0,1],force=1.0}]"], "scene.preload.set: there is no set of nodes"),
        (["scene.clamp=['GRND']"], 'scene.clamp: there is no set of nodes or surface "GRND" in lap.inp: give GROUND'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_sentence(overrides, expected, folder):
    (folder / "lap.med").write_text("")
    write_abaqus(folder, system=Plates().system())
    assert expected in message(*overrides)
