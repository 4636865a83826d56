"""Studies of models in the formats of other programs, through the front door; files are written after the manuals."""

import importlib.util

import numpy as np
import pytest
from scipy import io

from solver import SolverSettings, march_wear
from studies.finite_element.surfaces import surface_of_nodes
from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from tests.studies.fe_models.matrix_files import write_matrix_input, write_punch
from tests.studies.fe_models.plates import Plates
from tests.studyrunner.test_model_studies import message, scene_of

needs_meshio = pytest.mark.skipif(importlib.util.find_spec("meshio") is None, reason="meshio is not installed")
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


@pytest.mark.parametrize("triangles", ["lower", "both"])
def test_abaqus(folder, triangles):
    write_matrix_input(folder, *Plates().system(), triangles)
    check_same(scene_of("scene.matrices=job"), scene_of())
    check_same(scene_of("scene.matrices=job_STIF1.mtx"), scene_of())


def test_nastran(folder):
    write_punch(folder, *Plates().system())
    check_same(scene_of("scene.matrices=job"), scene_of(), 1e-5)  # of 10 digits, and thin plates


def test_a_table_of_nodes_with_matrices_wears_as_the_deck(folder, capsys):
    """Matrices of all nodes that are not held; forces at the tip as a column beside them."""
    plates = Plates()
    whole, rows = plates.system()
    free = ~np.isin(rows[:, 0], plates.numbers["GROUND"])
    surface = surface_of_nodes(plates.mesh, "UNDER", plates.sets["UNDER"])
    area, normals = surface.areas_and_normals(plates.mesh.coordinates)
    lines = ["node,x,y,z,sets,area,normal_x,normal_y,normal_z"]
    for row, number in enumerate(plates.mesh.numbers):
        if number not in plates.numbers["GROUND"]:
            sets = " ".join(name for name, rows in plates.sets.items() if row in rows)
            contact = [[area[at], *normals[at]] for at in np.flatnonzero(surface.nodes == row)] or [[""] * 4]
            place = map(repr, plates.mesh.coordinates[row].tolist())
            lines.append(",".join(map(str, [number, *place, sets, *contact[0]])))
    (folder / "nodes.csv").write_text("\n".join(lines) + "\n")
    named = {name: each[np.ix_(free, free)] for name, each in whole.items()}
    io.savemat(folder / "job.mat", {**named, "rows": rows[free]})
    tip = [f"{number},3,{2e3 / len(plates.sets['TIP'])!r}" for number in plates.numbers["TIP"]]
    (folder / "stress.csv").write_text("\n".join(["node,dof,end [MPa]", *tip]) + "\n")
    (folder / "wear.toml").write_text(STUDY.replace("[axes]", "stuck_modes = 200\n[axes]", 1))
    of_table = '"nodes.csv"\nmatrices = "job"\nrecovery = "stress.csv"'
    (folder / "table.toml").write_text(
        (folder / "wear.toml").read_text().replace('"lap.inp"', of_table)
        .replace('clamp = ["GROUND"]\n', "").replace("material =", "# material =")
    )  # fmt: skip
    assert main(["table.toml", "--check"]) == 0
    assert "rigid      5 motions with all pairs open" in capsys.readouterr().out
    expected, found = (build_study_scene(read_study(name)) for name in ("wear.toml", "table.toml"))
    check_same(found, expected)
    settings = SolverSettings(harmonics=1, samples=32)
    worn = [
        march_wear(each, 300.0, 20.0, 0.3, 1e-11, 1e3, scheme="implicit", step=500.0, settings=settings)
        for each in (expected, found)
    ]
    volumes = [each.worn_volume[-1] for each in worn]
    assert volumes[0] > 0.0
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)
    # 2000 MPa over 1 m of the tip
    for name in ("response", "response_mean", "response_peak"):
        displacement, stress = getattr(worn[1], name).T
        np.testing.assert_allclose(stress, 2e3 * displacement, rtol=1e-9)
        np.testing.assert_allclose(displacement, getattr(worn[0], name)[:, 0], rtol=1e-6)
    # vibration about the mean
    assert (worn[1].response_peak <= abs(worn[1].response_mean) + 1.1 * abs(worn[1].response)).all()


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["scene.model=lap.med"], "or the path of a scene file or of a model (.inp, .msh, .cdb, .csv)"),
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
    write_matrix_input(folder, *Plates().system())
    assert expected in message(*overrides)
