"""A lap joint of two plates as the files of several programs have it, written after their manuals. For the tests."""

import numpy as np

from studies.finite_element.solid_mesh import assemble_mass, assemble_stiffness
from tests.studies.fe_models.solid_meshes import block, deck_lines, joined, node_set

SETS = ("GROUND", "UNDER", "OVER", "TIP")


class Plates:
    """A plate 40 x 20 x 5 mm that is held at one end, and another one on its other end; metres.

    Sets of nodes: GROUND is held, UNDER and OVER are the faces that touch, TIP is the free end of the upper plate.
    """

    def __init__(self, kind="C3D8I", lower=(2, 1, 1), upper=(2, 1, 1)):
        """lower, upper: elements along x, y and z."""
        below, _ = block(kind, lower, lambda points: points * [0.04, 0.02, 0.005], part="LOWER")
        above, _ = block(kind, upper, lambda points: points * [0.04, 0.02, 0.005] + [0.02, 0.0, 0.005], part="UPPER")
        self.mesh = joined(below, above)
        x, _, z = self.mesh.coordinates.T
        is_upper = np.arange(self.mesh.n_nodes) >= below.n_nodes
        touching = (np.abs(z - 0.005) < 1e-9) & (x > 0.02 - 1e-9) & (x < 0.04 + 1e-9)
        self.sets = {
            "GROUND": np.flatnonzero(x < 1e-9),
            "UNDER": np.flatnonzero(~is_upper & touching),
            "OVER": np.flatnonzero(is_upper & touching),
            "TIP": np.flatnonzero(x > 0.06 - 1e-9),
        }

    @property
    def numbers(self):
        """Node numbers of each set."""
        return {name: self.mesh.numbers[rows] for name, rows in self.sets.items()}

    def deck(self):
        """Of CalculiX or Abaqus."""
        sets = [line for name, numbers in self.numbers.items() for line in node_set(name, numbers)]
        return "\n".join([*deck_lines(self.mesh), *sets, "*BOUNDARY", "GROUND, 1, 3"]) + "\n"

    def gmsh(self):
        """Format 2.2: hexahedra in two volumes, and quadrilaterals of the four named faces."""
        elements = []
        for tag, group in enumerate(self.mesh.groups, start=11):
            elements += [(5, tag, *row) for row in group.nodes + 1]
        corners = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
        for tag, name in enumerate(SETS, start=1):
            for group in self.mesh.groups:
                faces = group.nodes[:, corners].reshape(-1, 4)
                chosen = faces[np.isin(faces, self.sets[name]).all(axis=1)]
                elements += [(3, tag, *row) for row in chosen + 1]
        names = [f'2 {tag} "{name.lower()}"' for tag, name in enumerate(SETS, start=1)]
        names += ['3 11 "lower"', '3 12 "upper"']
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names)), *names]
        lines += ["$EndPhysicalNames", "$Nodes", str(self.mesh.n_nodes)]
        lines += [f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(self.mesh.coordinates.tolist(), 1)]
        lines += ["$EndNodes", "$Elements", str(len(elements))]
        for number, (kind, tag, *nodes) in enumerate(elements, 1):
            lines.append(" ".join(map(str, (number, kind, 2, tag, tag, *nodes))))
        return "\n".join([*lines, "$EndElements"]) + "\n"

    def system(self):
        """Stiffness and mass as this project assembles them, dense, by name; node and dof of the rows."""
        n = self.mesh.n_nodes
        stiffness, mass = assemble_stiffness(self.mesh), assemble_mass(self.mesh)
        rows = np.stack([np.repeat(self.mesh.numbers, 3), np.tile([1, 2, 3], n)], axis=1)
        return {"stiffness": stiffness.toarray(), "mass": mass.toarray()}, rows
