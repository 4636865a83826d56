"""Studies of models in the formats of other programs, through the front door; files are written after the manuals."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from studies.fe_models import checks
from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from studyrunner.user_error import UserError
from tests.studies.fe_models.matrix_files import write_abaqus, write_calculix, write_nastran
from tests.studies.fe_models.plates import Plates, component

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
    (tmp_path / "lap.toml").write_text(STUDY)
    (tmp_path / "lap.inp").write_text(Plates().deck())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def scene_of(*overrides):
    return build_study_scene(read_study("lap.toml", overrides))


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


def message(*overrides):
    with pytest.raises(UserError) as caught:
        scene_of(*overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text


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


@needs_ansys
@needs_meshio
def test_matrices_on_a_mesh_of_another_program(folder):
    write_abaqus(folder, system=Plates().system())
    for name in ("gmsh", "cdb"):
        path = folder / {"gmsh": "lap.msh", "cdb": "lap.cdb"}[name]
        path.write_text(getattr(Plates(), name)())
        check_same(scene_of("scene.matrices=job", f"scene.model={path.name}"), scene_of())


@pytest.mark.slow
@needs_ansys
def test_full_of_the_package(folder, capsys, monkeypatch):
    """HexBeam.cdb and file.full of ansys-mapdl-reader: one beam, 1 x 1 x 5, whose sides are put in contact here."""
    from ansys.mapdl.reader import Archive, examples

    nodes = Archive(examples.hexarchivefile, parse_vtk=False)
    x, _, z = nodes.nodes[:, :3].T
    sets = {
        "HELD": z == 0.0,
        "LEFT": (x == 0.0) & (z >= 0.5),
        "RIGHT": (x == 1.0) & (z >= 0.5),
        "TIP": z == 5.0,
    }
    text = Path(examples.hexarchivefile).read_text()
    added = "\n".join(component(name, nodes.nnum[inside]) for name, inside in sets.items())
    (folder / "beam.cdb").write_text(f"{text}\n{added}\n")
    (folder / "beam.full").write_bytes(Path(examples.fullfile).read_bytes())
    beam = [
        *("scene.model=beam.cdb", "scene.matrices=beam", 'scene.contact=[["LEFT","RIGHT"]]', 'scene.clamp=["HELD"]'),
        *("scene.tolerance=1.5", "scene.preload=[]"),
    ]
    # steel in pounds and inches, of which the study knows nothing
    assert "mass 0.002 kg, extent 5 m: not SI: give `units` that fit" in message(*beam)
    monkeypatch.setattr(checks, "_LEAST_DENSITY", 0.0)
    assert main(["lap.toml", "--check", *(word for each in beam for word in ("--set", each))]) == 0
    shown = capsys.readouterr().out
    assert "beam.full sha256:" in shown
    assert "nodes of LEFT on RIGHT" in shown
    assert "21 of 21 nodes have no dof in beam.full (tied or fixed)" in message(*beam, 'scene.contact=[["HELD","TIP"]]')
    assert "have no dof in beam.full" in message(*beam, "scene.clamp=[]")


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["scene.model=lap.med"], "or the path of a scene file or of a model (.inp, .msh, .cdb)"),
        (["scene.units=mm-t-s", "scene.matrices=job"], "not mm-t-s: give `units` that fit"),
        (["scene.matrices=job", "scene.stress_stiffening=false"], "scene.stress_stiffening = false: leave it out"),
        (["scene.nodal_diameter=2"], "scene.nodal_diameter = 2: only a cyclic sector has one: use 0"),
        (['scene.contact=[["UNDER","UNDER"]]'], "scene.contact = UNDER and UNDER share"),
        (['scene.contact=[["UNDER","TIP"]]'], "scene.contact ="),
        (["scene.cut_faces=['TIP','GROUND']"], "scene.n_sectors = missing: give the number of sectors"),
        (["scene.rotation_speed=100"], "scene.axis = missing: give {point, direction}"),
        (["scene.clamp=['GROUND','UNDER']"], "scene.contact = 4 nodes of UNDER are clamped, as node"),
        (["scene.clamp=[]"], "scene.clamp = at nodal diameter 0 nothing holds the glued structure"),
        (["scene.preload=[{set='BOLT',direction=[0,0,1],force=1.0}]"], "scene.preload.set = there is no set of nodes"),
        (["scene.clamp=['GRND']"], 'scene.clamp = there is no set of nodes or surface "GRND" in lap.inp: give GROUND'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_sentence(overrides, expected, folder):
    (folder / "lap.med").write_text("")
    write_abaqus(folder, system=Plates().system())
    assert expected in message(*overrides)


def test_calculix(folder):
    write_calculix(folder, system=Plates().system())
    check_same(scene_of("scene.matrices=job"), scene_of())


def test_active_boundary_conditions_are_found(folder):
    """Abaqus writes 1e36 on the diagonal of what is held."""
    stiffness, mass, node, direction = Plates().system()
    held = np.isin(node, Plates().numbers["GROUND"])
    stiffness[held, held] = 1e36
    write_abaqus(folder, system=(stiffness, mass, node, direction))
    assert "12 entries of the diagonal are 1e36: boundary conditions were active at export" in message(
        "scene.matrices=job"
    )


def test_contact_left_in_the_stiffness_is_found(folder):
    stiffness, mass, node, direction = Plates().system()
    sets = Plates().numbers
    for one, other in zip(sets["UNDER"], sets["OVER"], strict=True):
        rows = [np.flatnonzero((node == each) & (direction == 3))[0] for each in (one, other)]
        stiffness[np.ix_(rows, rows)] += 1.6e10 * np.array([[1, -1], [-1, 1]])
    write_abaqus(folder, system=(stiffness, mass, node, direction))
    assert "the stiffness couples UNDER and OVER (1.6e+10 N/m): add *MODEL CHANGE" in message("scene.matrices=job")


def test_eliminated_nodes_are_counted(folder):
    stiffness, mass, node, direction = Plates().system()
    kept = ~np.isin(node, Plates().numbers["OVER"])
    part = np.ix_(kept, kept)
    write_abaqus(folder, system=(stiffness[part], mass[part], node[kept], direction[kept]))
    assert "OVER: 4 of 4 nodes have no dof in job_STIF1.mtx (tied or fixed): export without ties" in message(
        "scene.matrices=job"
    )


@pytest.mark.parametrize(
    ("units", "young", "density", "expected"),
    [
        ("SI", "210e9", "7.8e-9", "density 7.8e-09 kg/m3: not SI: give `units` that fit"),
        ("SI", "210e3", "7800", "is 2.1e+05 Pa: not SI"),
        ("mm-t-s", "210e9", "7.8e-9", "is 2.1e+17 Pa: not mm-t-s"),
        ("mm-t-s", "210e3", "7.8e-6", "density 7.8e-06 t/mm3: not mm-t-s"),
    ],
)
def test_materials_in_other_units_are_found(units, young, density, expected, folder):
    text = Plates().deck().replace("210000000000.0", young).replace("7800.0", density)
    (folder / "lap.inp").write_text(text)
    assert expected in message(f"scene.units={units}")
