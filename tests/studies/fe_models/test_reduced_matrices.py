"""Reduced matrices of a sector with both cut faces, in the files of several programs, against its complex matrices."""

import re
from functools import cache, cached_property

import numpy as np
import pytest
from scipy.linalg import eigh

from solver import build_model
from solver.model import ContactInterface, LinearModel, ReducedModel, needed_nodal_diameters
from studies.fe_models.from_files.check import describe_model
from studies.fe_models.from_files.model import find_files, load_model, reduce_model
from studies.fe_models.from_files.parameters import Parameters
from studies.finite_element.pairing import local_frames
from studies.finite_element.solid_mesh import assemble_mass, assemble_stiffness
from studies.scene import stuck_frequencies
from studies.scene_error import SceneError
from tests.studies.fe_models.matrix_files import REDUCED, node_table
from tests.studies.fe_models.sectors import stubby

N, D, N_MODES = 6, 2, 12
PARAMETERS = stubby(N)
TIP = {"set": "TIP", "direction": [0, np.cos(np.radians(20)), -np.sin(np.radians(20))]}
GIVEN = {
    "units": "SI", "matrices": "job", "contact": [["LEADING", "TRAILING"]], "next_sector": True, "load": TIP,
    "response": {"tip": TIP}, "n_sectors": N, "axis": {"direction": [0, 0, 1]}, "nodal_diameter": D,
    "stuck_modes": 200, "friction_coefficient": 0.3, "recovery": "stress.csv",
}  # fmt: skip


def symmetric(matrix):
    return 0.5 * (matrix + matrix.conj().T)


class Sector:
    """A shrouded sector as a company shares it: Craig-Bampton matrices that keep shrouds, tip and cut faces.

    rows (n, 2): node and dof, 0 of a mode. named: stiffness, mass, damping (n, n) and load (n,), constant forces.
    weights (2, n): of the mean displacement of the tip, and of a quantity in MPa.
    """

    def __init__(self):
        model, self.joint = PARAMETERS.define_sector()
        self.mesh, contact, cut = model.mesh, self.joint.contacts[0], self.joint.cut
        loose = ~self.joint.held.any(axis=1)
        self.left, self.right = cut.left[loose[cut.left]], cut.right[loose[cut.right]]
        self.first, self.second = contact.first, contact.second
        tip = self.tip = np.flatnonzero(self.joint.load.reshape(-1, 3).any(axis=1))
        self.nodes = np.unique(np.concatenate([self.left, self.right, self.first.nodes, self.second.nodes, tip]))
        kept = (3 * self.nodes[:, None] + np.arange(3)).ravel()
        inner = np.setdiff1d(np.flatnonzero(np.repeat(loose, 3)), kept)
        stiffness, mass = (each.toarray() for each in (assemble_stiffness(self.mesh), assemble_mass(self.mesh)))
        static = -np.linalg.solve(stiffness[np.ix_(inner, inner)], stiffness[np.ix_(inner, kept)])
        modes = eigh(stiffness[np.ix_(inner, inner)], mass[np.ix_(inner, inner)], subset_by_index=(0, N_MODES - 1))[1]
        shapes = np.zeros((len(stiffness), len(kept) + N_MODES))
        shapes[kept, : len(kept)] = np.eye(len(kept))
        shapes[inner] = np.hstack([static, modes])
        stiffness, mass = (symmetric(shapes.T @ each @ shapes) for each in (stiffness, mass))
        forces = np.zeros((self.mesh.n_nodes, 3))
        forces[tip, 0] = 300.0
        self.named = {"stiffness": stiffness, "mass": mass, "damping": 2e-6 * stiffness + 3.0 * mass}
        self.named["load"] = shapes.T @ forces.ravel()
        labels = np.stack([np.repeat(self.mesh.numbers[self.nodes], 3), np.tile([1, 2, 3], len(self.nodes))], axis=1)
        self.rows = np.concatenate([labels, [[9001 + n, 0] for n in range(N_MODES)]])
        mean = np.append(self.joint.load[kept], np.zeros(N_MODES))
        self.weights = np.stack([mean, np.random.default_rng(3).normal(size=len(self.rows)) * 1e5])

    def table(self):
        """The table of the nodes."""
        groups = {"LEFT": self.left, "RIGHT": self.right, "TIP": self.tip}
        groups |= {"LEADING": self.first.nodes, "TRAILING": self.second.nodes}
        return node_table(self.mesh, self.nodes, groups, self.first, -PARAMETERS.interference)

    def recovery_table(self, rows):
        """Weights of the quantity in MPa with the labels of their rows, those of the nodes in another order."""
        lines = [f"{node},{dof},{weight!r}" for (node, dof), weight in zip(rows, self.weights[1].tolist(), strict=True)]
        return "\n".join(["node,dof,root [MPa]", *reversed(lines[:-N_MODES]), *lines[-N_MODES:]]) + "\n"

    @cached_property
    def scene(self):
        """The scene for three harmonics: `u_right = exp(2 pi i k / N) R u_left`, relative displacements first."""
        axis, place = self.joint.cut.axis, {node: 3 * n for n, node in enumerate(self.nodes)}
        area, normals = self.first.areas_and_normals(self.mesh.coordinates)
        position = self.mesh.coordinates[self.first.nodes]
        frames, turn = local_frames(normals, axis.axis), axis.pitch(1)
        there = axis.turned(self.mesh.coordinates[self.second.nodes], 1)
        opposite = [self.second.nodes[np.linalg.norm(there - at, axis=1).argmin()] for at in position]
        follow = {*self.right, *self.first.nodes}
        n_relative, others = 3 * len(self.first.nodes), [node for node in self.nodes if node not in follow]
        start = {node: n_relative + 3 * n for n, node in enumerate(others)}
        linear = {}
        for k in needed_nodal_diameters(D, N, 3):
            phase = np.exp(2j * np.pi * k / N)
            shapes = np.zeros((len(self.rows), n_relative + 3 * len(others) + N_MODES), dtype=complex)
            for node in others:
                shapes[place[node] : place[node] + 3, start[node] : start[node] + 3] = np.eye(3)
            for left, right in zip(self.left, self.right, strict=True):
                shapes[place[right] : place[right] + 3, start[left] : start[left] + 3] = phase * turn
            for pair, (node, other) in enumerate(zip(self.first.nodes, opposite, strict=True)):
                rows = slice(place[node], place[node] + 3)
                shapes[rows, 3 * pair : 3 * pair + 3] = frames[pair].T
                shapes[rows, start[other] : start[other] + 3] = phase * turn
            shapes[-N_MODES:, -N_MODES:] = np.eye(N_MODES)
            shapes = shapes if k not in (0, N / 2) else shapes.real
            parts = (self.named[name] for name in ("mass", "damping", "stiffness"))
            forms = (symmetric(shapes.conj().T @ part @ shapes) for part in parts)
            static = (shapes.T @ self.named["load"]).real * (k == 0)
            harmonic = (shapes.conj().T @ self.weights[0]).astype(complex) * (k == D)
            linear[k] = LinearModel(*forms, static, harmonic, self.weights @ shapes)
        n = len(area)
        gap, labels = np.full(n, -PARAMETERS.interference), ("LEADING-TRAILING",) * n
        dofs = np.arange(n_relative).reshape(-1, 3)
        contact = ContactInterface(dofs, area, gap, np.zeros(n), position, labels)
        return ReducedModel(linear, contact, ("tip", "root [MPa]"), N, D)


@cache
def sector():
    return Sector()


def write(folder, kind="mat"):
    """Modes are nodes of their own, or all of them node 0."""
    rows = np.where(sector().rows[:, 1:] == 0, 0, sector().rows) if kind == "one triangle" else sector().rows
    (folder / "nodes.csv").write_text(sector().table())
    (folder / "stress.csv").write_text(sector().recovery_table(rows))
    REDUCED[kind](folder, sector().named, rows)
    return folder


def load(folder, **changes):
    parameters = Parameters(**(GIVEN | changes))
    return load_model(find_files(folder, "nodes.csv", parameters), parameters)


def model_of(folder, **changes):
    return reduce_model(load(folder, **changes), 3).model


def seen(model, k, omega):
    """What contact and responses see of a structure at a frequency: compliance, loads, responses."""
    linear, n = model.linear[k], int((model.contact.dofs >= 0).sum())
    stiffness = linear.stiffness + 1j * omega * linear.damping - omega**2 * linear.mass
    outer = np.vstack([np.eye(n, len(stiffness)), linear.response])
    inner = np.column_stack([np.eye(len(stiffness), n), linear.load_static, linear.load_harmonic])
    return outer @ np.linalg.solve(stiffness, inner)


@pytest.mark.parametrize("kind", ["mat", "user element", "one triangle"])
def test_tables_of_nodes_and_matrices_give_the_complex_matrices_of_each_nodal_diameter(tmp_path, kind):
    """Of formats with forces, and one without."""
    expected = sector().scene
    forces = [{"set": "TIP", "direction": [1, 0, 0], "force": sector().named["load"].sum()}]
    found = model_of(write(tmp_path, kind), preload=forces if kind == "user element" else ())
    assert set(found.linear) == set(expected.linear)
    assert found.response_names == expected.response_names
    np.testing.assert_allclose(found.contact.gap, expected.contact.gap, rtol=1e-12)
    stuck = (np.array([*stuck_frequencies(each).values()]) for each in (found, expected))
    np.testing.assert_allclose(*stuck, rtol=1e-9)
    for k in expected.linear:
        for omega in (0.0, 3e3, 2e4):
            ours, theirs = seen(found, k, omega), seen(expected, k, omega)
            for block in np.split(np.arange(len(ours)), [-2, -1]):
                assert np.abs(ours - theirs)[block].max() <= 1e-9 * np.abs(theirs[block]).max()


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"nodal_diameter": 4}, "nodal_diameter: 4"),
        ({"n_sectors": None}, "n_sectors: missing"),
        ({"next_sector": ["TIP"]}, 'next_sector: no contact has the name "TIP"'),
        ({"n_sectors": 7, "cut_faces": ["LEFT", "RIGHT"]}, "n_sectors: cut faces are 60 degrees apart"),
        ({"n_sectors": 7}, "contact: 8 of 8 nodes of LEADING"),
        ({"contact": [["TRAILING", "LEADING"]]}, "contact: 8 nodes of TRAILING"),
        ({"rotation_speed": 3000.0}, "rotation_speed: "),
        ({"matrices": None, "recovery": None}, "matrices: missing"),
    ],
)
def test_mistakes_are_named(tmp_path, changes, key):
    with pytest.raises(SceneError, match=f"^{key}"):
        model_of(write(tmp_path), **changes)


@pytest.mark.parametrize(
    ("kind", "file", "old", "new", "key"),
    [
        ("mat", "nodes.csv", r"\Z", "7777,0.3,0.0,0.0,,,,,,\n", "matrices: 1 nodes of nodes.csv .* node 7777"),
        ("mat", "nodes.csv", ",sets", ",set", "model: nodes.csv .* sets"),
        ("mat", "stress.csv", r"\Z", "1,7,1.0\n", "recovery: stress.csv: node 1 with dof 7"),
        ("mat", "stress.csv", r"\Z", "0,0,1.0\n", "recovery: stress.csv: node 0 with dof 0"),
        ("mat", "stress.csv", r"root \[MPa\]", "tip", "recovery: stress.csv: .* tip"),
        ("one triangle", "stress.csv", r".*\n\Z", "", f"recovery: stress.csv: {N_MODES - 1} rows"),
    ],
)
def test_tables_that_do_not_fit_are_named(tmp_path, kind, file, old, new, key):
    path = write(tmp_path, kind) / file
    path.write_text(re.sub(old, new, path.read_text(), count=1))
    with pytest.raises(SceneError, match=f"^{key}"):
        model_of(tmp_path)


def test_a_model_in_python_has_the_matrices_of_each_nodal_diameter():
    scene = sector().scene
    mass, damping, stiffness, response = (
        {k: getattr(each, name) for k, each in scene.linear.items()}
        for name in ("mass", "damping", "stiffness", "response")
    )
    more = {
        "load_harmonic": scene.linear[D].load_harmonic, "load_static": scene.linear[0].load_static,
        "response": response, "gap": scene.contact.gap, "response_names": scene.response_names,
        "n_sectors": N, "nodal_diameter": D,
    }  # fmt: skip
    place = scene.contact.dofs, scene.contact.area
    found = build_model(mass, damping, stiffness, *place, **more)
    assert (found.n_sectors, found.nodal_diameter) == (N, D)
    for k, each in scene.linear.items():
        for name in ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response"):
            np.testing.assert_array_equal(getattr(found.linear[k], name), getattr(each, name))
    one_triangle = stiffness[D] + np.triu(stiffness[D])
    for wrong in ({0: stiffness[0]}, {**stiffness, D: one_triangle}, {**stiffness, 0: stiffness[D]}):
        with pytest.raises(ValueError, match=r"^stiffness: "):
            build_model(mass, damping, wrong, *place, **more)


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
    loaded = load(tmp_path, **changes, load=tip, response={"tip": tip}, recovery=None)
    scene = reduce_model(loaded, 3)
    assert scene.model.contact.dofs.tolist() == [[0, 1, -1]]
    linear = scene.model.linear[0]
    np.testing.assert_allclose(linear.load_static, [50.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    found, expected = (eigh(*each, eigvals_only=True) for each in ((linear.stiffness, linear.mass), (stiffness, mass)))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    said = dict(describe_model(loaded, scene))
    for key, words in (("reduction", "none: "), ("contact", "1 node of A on B, "), ("static", "50 N, the pair closed")):
        assert words in said[key]
