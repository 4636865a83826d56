"""Reduced matrices of a sector with both cut faces, in the files of several programs, against its complex matrices."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

from solver import build_model
from studies.fe_models.from_files.check import describe_model
from studies.fe_models.from_files.model import find_files, load_model
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.from_files.scene import reduce_model
from studies.scene_answers import stuck_frequencies
from studies.scene_error import SceneError
from studies.scene_file import read_scene, write_scene
from tests.studies.fe_models.matrix_files import REDUCED
from tests.studies.fe_models.reduced import D, N, Sector

TIP = {"set": "TIP", "direction": [0, np.cos(np.radians(20)), -np.sin(np.radians(20))]}
GIVEN = {
    "units": "SI", "matrices": "job", "contact": [["LEADING", "TRAILING"]], "next_sector": True, "load": TIP,
    "response": {"tip": TIP}, "n_sectors": N, "axis": {"direction": [0, 0, 1]}, "nodal_diameter": D,
    "stuck_modes": 200, "friction_coefficient": 0.3, "recovery": "stress.csv",
}  # fmt: skip


@cache
def sector():
    return Sector()


def write(folder, kind="mat"):
    (folder / "nodes.csv").write_text(sector().table())
    (folder / "stress.csv").write_text(sector().recovery_table())
    REDUCED[kind](folder, sector().named, sector().rows)
    return folder


def load(folder, **changes):
    parameters = Parameters(**(GIVEN | changes))
    return load_model(find_files(folder, "nodes.csv", parameters), parameters), parameters


def model_of(folder, **changes):
    return reduce_model(*load(folder, **changes), 3).model


def seen(model, k, omega):
    """What contact and responses see of a structure at a frequency: compliance, loads, responses."""
    linear, n = model.linear[k], int((model.contact.dofs >= 0).sum())
    stiffness = linear.stiffness + 1j * omega * linear.damping - omega**2 * linear.mass
    outer = np.vstack([np.eye(n, len(stiffness)), linear.response])
    inner = np.column_stack([np.eye(len(stiffness), n), linear.load_static, linear.load_harmonic])
    return outer @ np.linalg.solve(stiffness, inner)


@pytest.mark.parametrize("kind", REDUCED)
def test_each_format_gives_the_complex_matrices_of_each_nodal_diameter(tmp_path, kind):
    expected = sector().scene
    # a user element has no forces
    forces = [{"set": "TIP", "direction": [1, 0, 0], "force": sector().load.sum()}]
    found = model_of(write(tmp_path, kind), preload=forces if kind == "user element" else ())
    tolerance = 1e-4 if kind.startswith("punch") else 1e-9  # a punch file has ten digits
    assert set(found.linear) == set(expected.linear)
    assert found.response_names == expected.response_names
    np.testing.assert_allclose(found.contact.gap, expected.contact.gap, rtol=1e-12)
    for each in (found, expected):
        np.testing.assert_allclose(
            stuck_frequencies(each).frequencies, stuck_frequencies(expected).frequencies, rtol=tolerance
        )
    for k in expected.linear:
        for omega in (0.0, 3e3, 2e4):
            ours, theirs = seen(found, k, omega), seen(expected, k, omega)
            for block in np.split(np.arange(len(ours)), [-2, -1]):
                assert np.abs(ours - theirs)[block].max() <= tolerance * np.abs(theirs[block]).max()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"nodal_diameter": 4}, r"nodal_diameter: 4; use at most n_sectors // 2 = 3"),
        ({"n_sectors": None}, r"n_sectors: missing; give the number of sectors with next_sector"),
        ({"n_sectors": 7, "cut_faces": ["LEFT", "RIGHT"]}, r"n_sectors: cut faces are 60 degrees apart, 7 sectors"),
        ({"n_sectors": 7}, r"contact: 8 of 8 nodes of LEADING are farther than .* after a turn by one sector"),
        ({"contact": [["TRAILING", "LEADING"]]}, r"contact: 8 nodes of TRAILING have no area or normal, as node"),
        ({"rotation_speed": 3000.0}, r"rotation_speed: the model is a table of nodes;"),
        ({"matrices": None, "recovery": None}, r"matrices: missing; give the matrices of the nodes of nodes.csv"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path, changes, sentence):
    with pytest.raises(SceneError, match=sentence):
        model_of(write(tmp_path), **changes)


def test_tables_that_do_not_fit_are_named(tmp_path):
    nodes = write(tmp_path) / "nodes.csv"
    nodes.write_text(sector().table() + "7777,0.3,0.0,0.0,,,,,,\n")
    with pytest.raises(SceneError, match=r"matrices: 1 nodes of nodes.csv have no row in job.mat, as node 7777"):
        model_of(tmp_path)
    nodes.write_text(sector().table().replace(",sets", ",set"))
    with pytest.raises(SceneError, match=r"model: nodes.csv has no column sets"):
        model_of(tmp_path)
    nodes.write_text(sector().table())
    (tmp_path / "stress.csv").write_text("node,dof,root [MPa]\n1,7,1.0\n")
    with pytest.raises(SceneError, match=r"recovery: stress.csv: node 1 with dof 7 is no row"):
        model_of(tmp_path)
    (tmp_path / "stress.csv").write_text(sector().recovery_table().replace("root [MPa]", "tip"))
    with pytest.raises(SceneError, match=r"recovery: stress.csv: a response has the name tip as well"):
        model_of(tmp_path)


def test_a_scene_file_and_a_model_in_python_are_the_same(tmp_path):
    """Of the matrices at each nodal diameter: groups `nd/<k>`, and tables of `build_model`."""
    scene = sector().scene
    write_scene(scene, tmp_path / "scene.h5")
    given = {name: {k: getattr(each, name) for k, each in scene.linear.items()} for name in ("mass", "damping")}
    stiffness = {k: each.stiffness for k, each in scene.linear.items()}
    more = {
        "load_harmonic": scene.linear[D].load_harmonic, "load_static": scene.linear[0].load_static,
        "response": {k: each.response for k, each in scene.linear.items()}, "gap": scene.contact.gap,
        "response_names": scene.response_names, "n_sectors": N, "nodal_diameter": D,
    }  # fmt: skip
    place = scene.contact.dofs, scene.contact.area
    model = build_model(given["mass"], given["damping"], stiffness, *place, **more)
    for found in (model, read_scene(tmp_path / "scene.h5", 3)):
        assert (found.n_sectors, found.nodal_diameter) == (N, D)
        for k, each in scene.linear.items():
            for name in ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response"):
                np.testing.assert_array_equal(getattr(found.linear[k], name), getattr(each, name))
    for wrong, sentence in (
        ({0: stiffness[0]}, "stiffness: give the matrix of nodal diameter 2"),
        ({**stiffness, D: stiffness[D] + np.triu(stiffness[D])}, "stiffness: give a Hermitian matrix"),
        ({**stiffness, 0: stiffness[D]}, "stiffness: give real numbers"),
    ):
        with pytest.raises(ValueError, match=sentence):
            build_model(given["mass"], given["damping"], wrong, *place, **more)


def test_masses_in_a_plane(tmp_path):
    """A lumped model without cyclic symmetry: two directions, and a force that closes the pair."""
    table = "node,x,y,z,sets,area,normal_x,normal_y,normal_z\n1,0,0,0,A,1e-4,0,1,0\n2,0,0,0,B,,,,\n3,0,1,0,TIP,,,,\n"
    (tmp_path / "nodes.csv").write_text(table)
    rows = np.array([[node, dof] for node in (1, 2, 3) for dof in (1, 2)])
    stiffness, mass = np.diag([1e6, 2e6, 3e6, 4e6, 5e6, 6e6]), np.diag([1.0, 1.0, 1.0, 1.0, 2.0, 2.0])
    stiffness[[2, 4, 3, 5], [4, 2, 5, 3]] = -1e6
    named = {"stiffness": stiffness, "mass": mass, "load": np.array([0.0, 50.0, 0.0, -50.0, 0.0, 0.0])}
    REDUCED["market"](tmp_path, named, rows)
    changes = {"contact": [["A", "B"]], "next_sector": False, "n_sectors": None, "axis": None, "nodal_diameter": 0}
    tip = {"set": "TIP", "direction": [1, 0, 0]}
    loaded, parameters = load(tmp_path, **changes, load=tip, response={"tip": tip}, recovery=None)
    scene = reduce_model(loaded, parameters, 3)
    model = scene.model
    assert model.contact.dofs.tolist() == [[0, 1, -1]]
    linear = model.linear[0]
    np.testing.assert_allclose(linear.load_static, [50.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    found, expected = (eigh(*each, eigvals_only=True) for each in ((linear.stiffness, linear.mass), (stiffness, mass)))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    said = dict(describe_model(loaded, scene, parameters))
    assert said["reduction"] == "none: there are no more than 4 modes with the pairs glued"
    assert said["contact"].startswith("1 node of A on B, ")
    assert said["static"] == "normal forces at rest: sum 50 N, the pair closed"
