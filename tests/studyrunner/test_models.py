"""Studies of models of other programs, from their files to a result; files are written after the manuals."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy import io

from solver import SolverSettings, march_wear, with_contact_stiffness
from solver.outcome import Outcome
from studies.fe_models.from_files import model as scene_of_files
from studies.finite_element.solid_mesh import Material
from studies.finite_element.surfaces import surface_of_nodes
from studies.scene import silent, stuck_frequencies
from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene_building import SceneTask, build_scene_task
from studyrunner.study.study_file import read_study
from studyrunner.user_error import UserError
from tests.mpi.launching import results
from tests.random_decks import static_forces
from tests.studies.fe_models.decks import SECTOR
from tests.studies.fe_models.matrix_files import node_table, write_matrix_input, write_punch
from tests.studies.fe_models.plates import Plates
from tests.studies.fe_models.sectors import faces_where
from tests.studies.fe_models.solid_meshes import block, deck_lines, joined, needs_ccx, node_set, run_ccx
from tests.studyrunner.small_studies import LAP_JOINT, ROOT_OF_A_DECK, UNWORN, compute, same_values

STIFFNESSES = (1e11, 1e13)


@pytest.fixture(autouse=True)
def decks(folder):
    shutil.copy(SECTOR, "sector.inp")
    Path("wear.toml").write_text(ROOT_OF_A_DECK)
    Path("lap.inp").write_text(Plates().deck())
    Path("lap.toml").write_text(LAP_JOINT)


def scene_of(study, *overrides):
    return build_study_scene(read_study(study, overrides))


def check_same(found, expected, tolerance=1e-8):
    """Matrices of the relative displacements, and the loads on them; modes may differ in sign."""
    n = 3 * expected.contact.n_contact
    assert found.contact.n_contact == expected.contact.n_contact
    assert found.contact.area == pytest.approx(expected.contact.area, rel=1e-9)
    for k, linear in expected.linear.items():
        for name in ("stiffness", "mass", "load_static", "load_harmonic"):
            ours, theirs = (getattr(each, name) for each in (found.linear[k], linear))
            part = (slice(n),) * ours.ndim
            assert np.abs(ours[part] - theirs[part]).max() <= tolerance * np.abs(theirs[part]).max()
        ours, theirs = (np.linalg.eigvalsh(each.stiffness[n:, n:]) for each in (found.linear[k], linear))
        assert ours == pytest.approx(theirs, rel=10.0 * tolerance)


# --- a deck of a root ---


def test_a_deck_may_lie_in_another_folder():
    Path("decks").mkdir()
    shutil.move("lap.inp", "decks/lap.inp")
    Path("lap.toml").write_text(LAP_JOINT.replace('"lap.inp"', '"decks/lap.inp"'))
    assert main(["lap.toml", "--plan"]) == 0


@pytest.mark.slow
def test_from_deck_to_worn_volume():
    result = compute("wear.toml", "wear.nc")
    volume = result.worn_volume.values.ravel()
    assert volume[0] == 0.0 < volume[1] < volume[2]
    assert result.attrs["model_files"] == f"sector.inp sha256:{hashlib.sha256(SECTOR.read_bytes()).hexdigest()}"
    assert result.attrs["model_units"] == "SI"
    assert result.attrs["model_reduced_by"].startswith("fretwear ")
    assert {"mesh_x", "mesh_quad"} <= set(result.variables)
    assert main(["wear.toml", "--write-scene", "scene.h5"]) == 0
    head, _, rest = ROOT_OF_A_DECK.partition("[scene]")
    table = '[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.1\n'
    Path("file.toml").write_text(head + table + rest[rest.index("[axes]") :])
    for again, path in (("wear.nc", "again.nc"), ("file.toml", "file.nc")):
        twin = compute(again, path)
        assert np.array_equal(twin.worn_volume.values.ravel(), volume)
        for name in ("model_files", "model_units", "scene_sha256"):
            assert twin.attrs[name] == result.attrs[name]
    # the result holds the scene as it was reduced
    with pytest.raises(UserError, match=r"scene.nodal_diameter = 2: leave it out"):
        read_study("wear.nc", ["scene.nodal_diameter=2"])


@pytest.mark.slow
@needs_ccx
def test_matrices_of_calculix_give_the_scene_of_the_mesh(folder, capsys):
    run_ccx(folder, SECTOR.read_text().splitlines(), "sector")
    check_same(scene_of("wear.toml", "scene.matrices=sector"), scene_of("wear.toml"), 1e-6)
    assert main(["wear.toml", "--check", "--set", "scene.matrices=sector"]) == 0
    shown = capsys.readouterr().out
    assert "speed      4774.65 rpm about (0, 0, 1); the stiffness holds 4774.65 rpm" in shown
    assert "sector.sti sha256:" in shown
    with pytest.raises(UserError, match=r"rotation_speed = 3000 rpm, .* 4774.65 rpm"):
        scene_of("wear.toml", "scene.matrices=sector", "scene.rotation_speed=3000")


def test_contact_pairs_give_the_scene_of_a_tie_and_their_friction():
    tied, tie = scene_of("wear.toml"), "*TIE,NAME=GLUE,POSITION TOLERANCE=1e-4\n"
    pairs = "*SURFACE INTERACTION,NAME=ROOT\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n1e13\n*FRICTION\n0.4,1e13\n"
    pairs += "*CONTACT PAIR,INTERACTION=ROOT,TYPE=SURFACE TO SURFACE\n"
    Path("sector.inp").write_text(SECTOR.read_text().replace(tie, pairs))
    assert np.array_equal(scene_of("wear.toml").linear[0].stiffness, tied.linear[0].stiffness)
    Path("wear.toml").write_text(ROOT_OF_A_DECK.replace("friction_coefficient = 0.1\n", ""))
    assert scene_of("wear.toml").contact.friction_coefficient.tolist() == [0.4] * 9


@pytest.mark.slow
def test_friction_of_a_surface_of_a_deck_is_an_axis():
    Path("wear.toml").write_text(ROOT_OF_A_DECK.replace("friction_coefficient = 0.1\n", ""))
    own = compute("wear.toml", "own.nc", "scene.friction_coefficient={BLADES=0.2}", *UNWORN)
    both = compute("wear.toml", "both.nc", "axes.friction_coefficient={BLADES=[0.1, 0.2]}", *UNWORN)
    same_values(both.sel(friction_coefficient_BLADES=0.2), own)


def test_a_deck_is_reduced_once_for_all_contact_stiffnesses(monkeypatch):
    reduced, reduce = [], scene_of_files.reduce_model
    monkeypatch.setattr(scene_of_files, "reduce_model", lambda *given: reduced.append(given) or reduce(*given))
    first, second = (scene_of("wear.toml", f"scene.contact_stiffness={k}") for k in STIFFNESSES)
    assert len(reduced) == 1
    rigid = scene_of("wear.toml")
    lowest = [stuck_frequencies(model)[0][0] for model in (first, second, rigid)]
    assert lowest == sorted(lowest)
    expected = describe_scene(with_contact_stiffness(rigid, STIFFNESSES[0])).digest
    assert describe_scene(first).digest == expected
    # another deck under the same name is another model
    Path("sector.inp").write_text(SECTOR.read_text().replace("*DENSITY\n7800", "*DENSITY\n7801"))
    assert describe_scene(scene_of("wear.toml", f"scene.contact_stiffness={STIFFNESSES[0]}")).digest != expected


# --- a lap joint in other formats ---


@pytest.mark.slow
def test_gmsh():
    Path("lap.msh").write_text(Plates().gmsh())
    check_same(scene_of("lap.toml", "scene.model=lap.msh"), scene_of("lap.toml"))
    by_volume = "scene.material={lower={young_modulus=210e9,poisson_ratio=0.3,density=7800.0}}"
    for wrong, said in ((by_volume, "2 elements of lap.msh have none"), ("scene.load.set=TIPS", "give TIP")):
        with pytest.raises(UserError, match=said):
            scene_of("lap.toml", "scene.model=lap.msh", wrong)
    # a new study of the mesh asks for what only the user knows
    assert main(["--new", "own", "--from", "lap.msh"]) == 0
    known = ['scene.contact=[["UNDER","OVER"]]', 'scene.clamp=["GROUND"]']
    for wrong, said in ((known[1:], 'contact.*"\\?" in lap.msh: give'), (known[:1], 'clamp.*"\\?" in lap.msh: give')):
        with pytest.raises(UserError, match=said):
            scene_of("own.toml", *wrong)
    assert scene_of("own.toml", *known).contact.n_contact == 4


@pytest.mark.parametrize(
    ("write", "tolerance"),
    # of 10 digits, and thin plates
    [(write_matrix_input, 1e-8), (write_punch, 1e-5)],
)
def test_matrices_of_abaqus_and_nastran(write, tolerance, folder):
    write(folder, *Plates().system())
    check_same(scene_of("lap.toml", "scene.matrices=job"), scene_of("lap.toml"), tolerance)


def write_table_of_nodes(plates):
    """Matrices of all nodes that are not held, stresses at the tip, and a study of them."""
    whole, rows = plates.system()
    free = ~np.isin(rows[:, 0], plates.numbers["GROUND"])
    surface = surface_of_nodes(plates.mesh, "UNDER", plates.sets["UNDER"])
    nodes = np.setdiff1d(np.arange(plates.mesh.n_nodes), plates.sets["GROUND"])
    Path("nodes.csv").write_text(node_table(plates.mesh, nodes, plates.sets, surface))
    io.savemat("job.mat", {**{name: each[np.ix_(free, free)] for name, each in whole.items()}, "rows": rows[free]})
    tip = [f"{number},3,{2e3 / len(plates.sets['TIP'])!r}" for number in plates.numbers["TIP"]]
    Path("stress.csv").write_text("\n".join(["node,dof,end [MPa]", *tip]) + "\n")
    study = LAP_JOINT.replace('"lap.inp"', '"nodes.csv"\nmatrices = "job"\nrecovery = "stress.csv"\nstuck_modes = 200')
    study = study.replace('clamp = ["GROUND"]\n', "").replace("material =", "# material =")
    Path("table.toml").write_text(study)


def test_a_table_of_nodes_with_matrices_wears_as_the_deck(capsys):
    write_table_of_nodes(Plates())
    assert main(["table.toml", "--check"]) == 0
    assert "rigid      5 motions with all pairs open" in capsys.readouterr().out
    assert main(["wear.toml", "--check"]) == 0
    assert "held by friction alone: give retention_stiffness" in capsys.readouterr().out
    expected, found = scene_of("lap.toml", "scene.stuck_modes=200"), scene_of("table.toml")
    check_same(found, expected)
    settings = SolverSettings(harmonics=1, samples=32)
    deck, table = (
        march_wear(each, 300.0, 20.0, 0.3, 1e-11, 1e3, scheme="implicit", step=500.0, settings=settings)
        for each in (expected, found)
    )
    assert table.worn_volume[-1] == pytest.approx(deck.worn_volume[-1], rel=1e-9)
    assert deck.worn_volume[-1] > 0.0
    # 2000 MPa over 1 m of the tip
    for name in ("response", "response_mean", "response_peak"):
        displacement, stress = getattr(table, name).T
        np.testing.assert_allclose(stress, 2e3 * displacement, rtol=1e-9)
        np.testing.assert_allclose(displacement, getattr(deck, name)[:, 0], rtol=1e-6)
    # vibration about the mean
    assert (table.response_peak <= abs(table.response_mean) + 1.1 * abs(table.response)).all()


# --- a deck without cyclic symmetry, against Hertz ---

CYLINDER = """
study = {name = "cylinder"}
axes = {frequency = 50.0, wear_coefficient = 1e-11, excitation_amplitude = 20.0}
slow_time = {cycles = 1e4, outputs = 2}
solver = {rtol = 5e-2}
[scene]
model = "cylinder.inp"
units = "mm-t-s"
contact = [["ROUND", "FLAT"]]
gaps = true
tolerance = 1e-4
friction_coefficient = 0.1
load = {set = "TOP", direction = [1, 0, 0]}
preload = [{set = "TOP", direction = [0, 0, -1], force = 363.0}]
"""


def cylinder_deck(radius=10.0, n=16):
    """The lowest part of a cylinder on a block, in plane strain: one layer of elements that is held along the axis."""
    steel = Material(210e3, 0.3, 7.8e-9)  # MPa, t/mm3

    def placed(points, is_upper):
        """Finer towards the middle, and towards the contact at the height 0."""
        x = 2.0 * points[:, 0] - 1.0
        x = 0.4 * x + 0.6 * x**3
        low = radius - np.sqrt(radius**2 - x**2)
        height = low + (2.0 - low) * points[:, 2] ** 1.5 if is_upper else -2.0 * (1.0 - points[:, 2]) ** 1.5
        return np.stack([x, 0.25 * points[:, 1], height], axis=1)

    parts = (partial(placed, is_upper=True), partial(placed, is_upper=False))
    upper, lower = (block("C3D8I", (n, 1, 8), place, steel)[0] for place in parts)
    mesh = joined(upper, lower)
    x, _, z = mesh.coordinates.T
    of_upper = np.arange(mesh.n_nodes) < upper.n_nodes
    touching = np.abs(z - np.where(of_upper, radius - np.sqrt(radius**2 - x**2), 0.0)) < 1e-6
    lines = deck_lines(mesh)
    for name, inside in (("BOTTOM", z < -2.0 + 1e-6), ("TOP", z > 2.0 - 1e-6)):
        lines += node_set(name, mesh.numbers[inside])
    for name, inside in (("ROUND", of_upper & touching), ("FLAT", ~of_upper & touching)):
        faces = zip(*faces_where(mesh, inside), strict=True)
        lines += [f"*SURFACE, NAME={name}", *(f"{element}, S{face}" for element, face in faces)]
    return "\n".join([*lines, "*BOUNDARY", "BOTTOM, 1, 3", "NALL, 2, 2"]) + "\n"


@pytest.mark.slow
def test_cylinder_on_a_flat():
    Path("cylinder.toml").write_text(CYLINDER)
    Path("cylinder.inp").write_text(cylinder_deck())
    result = compute("cylinder.toml", "still.nc", "axes.excitation_amplitude=1e-3", *UNWORN).squeeze()
    pressure, x = result.mean_pressure.values, result.contact_x.values
    assert (pressure * result.contact_area.values).sum() == pytest.approx(363.0, rel=1e-6)
    # Hertz, plane strain: p = p_0 sqrt(1 - x^2 / a^2)
    load, modulus = 363.0 / 0.25e-3, 210e9 / (2.0 * (1.0 - 0.3**2))
    half_width = np.sqrt(4.0 * load * 0.01 / (np.pi * modulus))
    hertz = 2.0 * load / (np.pi * half_width) * np.sqrt(np.maximum(1.0 - (x / half_width) ** 2, 0.0))
    assert np.abs(pressure - hertz).max() < 0.06 * hertz.max()
    assert (pressure[np.abs(x) > 0.5e-3] == 0.0).all()
    # in partial slip the middle sticks and does not wear, the edges do
    assert main(["cylinder.toml"]) == 0
    worn = results("cylinder.nc").squeeze()
    wear = worn.wear_depth.isel(cycle=-1).values
    assert wear[np.abs(x) < 0.1e-3].max() < 1e-6 * wear.max()
    assert wear[(np.abs(x) > 0.35e-3) & (np.abs(x) < 0.5e-3)].min() > 0.1 * wear.max()
    assert worn.worn_volume.values[-1] > 0.0
    # the wear at the edges converges as 1/H: the rate with 81 harmonics differs by 13 % from that with 27; 55 are used
    assert worn.outcome == Outcome.INACCURATE
    assert 0.06 < worn.error_estimate < 0.5


# --- the page on a model of one's own ---

ROOT = Path(__file__).parents[2]
DECK = ROOT / "studies" / "blade_root.inp"
PAGE = ROOT / "studies" / "fe_models" / "README.md"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SMALL = {"harmonics": "1", "samples": "32", "cycles": "100", "outputs": "2", "excitation_amplitude": "2.0"}


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


@pytest.mark.slow
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


@pytest.mark.slow
@needs_ccx
def test_static_forces_are_those_of_the_contact_of_calculix():
    """Normal and shear force of a flank under the centrifugal load, with friction, before anything vibrates."""
    asked = "*CONTACT PRINT,SLAVE=ROOT_A,MASTER=SLOT_A\nCF\n*END STEP\n"
    Path("job.inp").write_text(DECK.read_text(encoding="ascii").replace("*END STEP\n", asked, 1))
    paste("ccx -i job")
    printed = Path("job.dat").read_text().split("normal force (+ = tension) and shear force (size)")[1]
    _, normal, shear = map(float, printed.split()[:3])
    force = static_forces(build_study_scene(read_study("blade_root")), None)
    flank = force[:18].sum(axis=0)
    assert flank[0] == pytest.approx(-normal, rel=2e-3)
    assert np.hypot(*flank[1:]) == pytest.approx(shear, rel=3e-3)
    result = compute("blade_root", "still.nc", "axes.excitation_amplitude=1e-3", *UNWORN)
    found = (result.mean_pressure * result.contact_area).values.reshape(2, 18).sum(axis=1)
    assert found == pytest.approx(2 * [-normal], rel=3e-3)


@pytest.mark.slow
def test_a_run_warns_of_nodes_that_are_not_tied():
    (built,) = build_scene_task(SceneTask(0, read_study("bolted_beam")), silent)
    assert len(built.warnings) == 6
    assert all("12 of 28 nodes" in each and "not tied" in each for each in built.warnings)
