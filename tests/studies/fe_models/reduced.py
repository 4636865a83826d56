"""A shrouded sector as a company shares it: Craig-Bampton matrices and a table of nodes; its scene by hand."""

from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from solver.model import ContactInterface, LinearModel, ReducedModel, needed_nodal_diameters
from studies.finite_element.pairing import local_frames
from studies.finite_element.solid_mesh import assemble_mass, assemble_stiffness
from studies.scenes import shrouded_sector
from tests.studies.shrouded_ring import stubby

N = 6
D = 2
DAMPING = 2e-6
PARAMETERS = stubby(N)


class Sector:
    """The matrices keep shrouds, tip and cut faces, and some modes with these at rest.

    rows (n, 2): node and dof, 0 of a mode. stiffness, mass, damping (n, n). load (n,): constant forces.
    """

    def __init__(self, n_modes=12):
        self.n_modes = n_modes
        model, self.joint = shrouded_sector.define_sector(PARAMETERS)
        self.mesh, contact, cut = model.mesh, self.joint.contacts[0], self.joint.cut
        loose = ~self.joint.held.any(axis=1)
        self.left, self.right = cut.left[loose[cut.left]], cut.right[loose[cut.right]]
        self.first, self.second = contact.first, contact.second
        tip = self.joint.load.nodes
        self.nodes = np.unique(np.concatenate([self.left, self.right, self.first.nodes, self.second.nodes, tip]))
        kept = (3 * self.nodes[:, None] + np.arange(3)).ravel()
        inner = np.setdiff1d(np.flatnonzero(np.repeat(loose, 3)), kept)
        stiffness, mass = (each.toarray() for each in (assemble_stiffness(self.mesh), assemble_mass(self.mesh)))
        static = -np.linalg.solve(stiffness[np.ix_(inner, inner)], stiffness[np.ix_(inner, kept)])
        modes = eigh(stiffness[np.ix_(inner, inner)], mass[np.ix_(inner, inner)], subset_by_index=(0, n_modes - 1))[1]
        shapes = np.zeros((len(stiffness), len(kept) + n_modes))
        shapes[kept, : len(kept)] = np.eye(len(kept))
        shapes[inner] = np.hstack([static, modes])
        self.stiffness, self.mass = (shapes.T @ each @ shapes for each in (stiffness, mass))
        self.stiffness, self.mass = (0.5 * (each + each.T) for each in (self.stiffness, self.mass))
        self.damping = DAMPING * self.stiffness + 3.0 * self.mass
        forces = np.zeros((self.mesh.n_nodes, 3))
        forces[tip, 0] = 300.0
        self.load = shapes.T @ forces.ravel()
        labels = np.stack([np.repeat(self.mesh.numbers[self.nodes], 3), np.tile([1, 2, 3], len(self.nodes))], axis=1)
        self.rows = np.concatenate([labels, [[9001 + n, 0] for n in range(n_modes)]])

    @property
    def named(self):
        """Matrices and forces by name."""
        return {name: getattr(self, name) for name in ("stiffness", "mass", "damping", "load")}

    def table(self):
        """The table of the nodes."""
        area, normals = self.first.areas_and_normals(self.mesh.coordinates)
        groups = {"LEFT": self.left, "RIGHT": self.right, "TIP": self.joint.load.nodes}
        groups |= {"LEADING": self.first.nodes, "TRAILING": self.second.nodes}
        lines = ["node,x,y,z,sets,area,normal_x,normal_y,normal_z,gap"]
        for node in self.nodes:
            sets = " ".join(name for name, members in groups.items() if node in members)
            where = np.flatnonzero(self.first.nodes == node)
            more = [area[where[0]], *normals[where[0]], -PARAMETERS.interference] if len(where) else [""] * 5
            place = [repr(float(x)) for x in self.mesh.coordinates[node]]
            lines.append(",".join(map(str, [self.mesh.numbers[node], *place, sets, *more])))
        return "\n".join(lines) + "\n"

    @cached_property
    def scene(self):
        """The scene for three harmonics: `u_right = exp(2 pi i k / N) R u_left`, relative displacements first."""
        axis, place = self.joint.cut.axis, {node: 3 * n for n, node in enumerate(self.nodes)}
        area, normals = self.first.areas_and_normals(self.mesh.coordinates)
        frames, turn = local_frames(normals, axis.axis), axis.pitch(1)
        there = axis.turned(self.mesh.coordinates[self.second.nodes], 1)
        opposite = [
            self.second.nodes[np.linalg.norm(there - self.mesh.coordinates[node], axis=1).argmin()]
            for node in self.first.nodes
        ]
        follow = {*self.right, *self.first.nodes}
        n_relative, others = 3 * len(self.first.nodes), [node for node in self.nodes if node not in follow]
        start = {node: n_relative + 3 * n for n, node in enumerate(others)}
        n = n_relative + 3 * len(others) + self.n_modes
        linear = {}
        for k in needed_nodal_diameters(D, N, 3):
            phase = np.exp(2j * np.pi * k / N)
            shapes = np.zeros((len(self.stiffness), n), dtype=complex)
            for node in others:
                shapes[place[node] : place[node] + 3, start[node] : start[node] + 3] = np.eye(3)
            for left, right in zip(self.left, self.right, strict=True):
                shapes[place[right] : place[right] + 3, start[left] : start[left] + 3] = phase * turn
            for pair, (node, other) in enumerate(zip(self.first.nodes, opposite, strict=True)):
                rows = slice(place[node], place[node] + 3)
                shapes[rows, 3 * pair : 3 * pair + 3] = frames[pair].T
                shapes[rows, start[other] : start[other] + 3] = phase * turn
            shapes[-self.n_modes :, -self.n_modes :] = np.eye(self.n_modes)
            linear[k] = self._linear(shapes if k not in (0, N / 2) else shapes.real, k)
        n_contact = len(area)
        contact = ContactInterface(
            np.arange(n_relative).reshape(-1, 3), area, np.full(n_contact, -PARAMETERS.interference),
            np.zeros(n_contact), self.mesh.coordinates[self.first.nodes], ("LEADING-TRAILING",) * n_contact,
        )  # fmt: skip
        return ReducedModel(linear, contact, ("tip", "root [MPa]"), N, D)

    def _linear(self, shapes, k):
        parts = [shapes.conj().T @ each @ shapes for each in (self.mass, self.damping, self.stiffness)]
        weights = np.stack([self.tip, self.recovery])
        return LinearModel(
            *(0.5 * (each + each.conj().T) for each in parts),
            (shapes.T @ self.load).real * (k == 0),
            (shapes.conj().T @ self.tip).astype(complex) * (k == D),
            weights @ shapes,
        )

    @property
    def tip(self):
        """Weights (n,) of the mean displacement of the tip."""
        return np.concatenate([self.joint.load.row(self.mesh.n_nodes).reshape(-1, 3)[self.nodes].ravel(),
                               np.zeros(self.n_modes)])  # fmt: skip

    @property
    def recovery(self):
        """Weights (n,) of a quantity, MPa over m."""
        return np.random.default_rng(3).normal(size=len(self.rows)) * 1e5

    def recovery_table(self):
        """They with the labels of their rows, in another order."""
        lines = [
            f"{node},{dof},{weight!r}" for (node, dof), weight in zip(self.rows, self.recovery.tolist(), strict=True)
        ]
        return "\n".join(["node,dof,root [MPa]", *reversed(lines)]) + "\n"
