"""The deck of the study `bolted_beam`: two halves of a beam, lapped and held together by three bolts. Free; mm, t, s.

    python -m tests.studies.fe_models.bolted_beam

writes `studies/bolted_beam.inp`. A beam as those of Brake and Reuss, 720 mm long, of 25 by 25 mm, lapped over 120 mm;
its bolts and holes are square. Heads and nuts are tied to the halves, whose meshes do not match; their surfaces go on
up their sides, where the nodes stay untied.
"""

from collections import Counter
from itertools import pairwise, product
from pathlib import Path

import numpy as np

DECK = Path(__file__).parents[3] / "studies" / "bolted_beam.inp"
ENDS, LAP, SIDE, THICK = 360.0, 60.0, 12.5, 5.0  # mm, halves of lengths; of a head
HOLES, HOLE, HEAD, FORCE = (-30.0, 0.0, 30.0), 4.0, 7.0, 12e3  # places, half widths, mm; N
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]  # S1 to S6


class Beam:
    """Bodies of boxes. nodes: places. elements: their nodes, from 1. bodies: rows of elements. surfaces: by name."""

    def __init__(self):
        self.nodes, self.elements, self.bodies, self.surfaces = [], [], {}, {}
        between = [0.5 * (one + other) for one, other in pairwise(HOLES)]
        lap = [-LAP, -47.0, *between, 47.0, LAP, *(hole + side for hole in HOLES for side in (-HOLE, HOLE))]
        y, z = np.array([-SIDE, -8.0, -HOLE, HOLE, 8.0, SIDE]), np.linspace(-SIDE, SIDE, 5)
        for name, side in (("LOWER", -1.0), ("UPPER", 1.0)):
            x = np.unique([*np.linspace(side * LAP, side * ENDS, 21), *lap])
            self._body(name, (x, y, z), lambda x, y, z, side=side: _of_half(side * x, x, y, side * z))
            self._surface(f"{name}_FACE", name, lambda p: (p[:, 2] == 0.0).all() and (abs(p[:, 0]) <= LAP).all())
            outside = side * SIDE
            self._surface(f"{name}_SIDE", name, lambda p, z=outside: (p[:, 2] == z).all() and abs(p[:, 0]).max() <= LAP)
        self._surface("END", "UPPER", lambda p: (p[:, 0] == ENDS).all())
        across = np.array([-HEAD, -HOLE, HOLE, HEAD])
        for number, hole in enumerate(HOLES, 1):
            grid = hole + across, across, np.array([-SIDE - THICK, *z, SIDE + THICK])
            self._body(f"BOLT{number}", grid, lambda x, y, z, hole=hole: abs(z) > SIDE or _in_hole(x - hole, y))
            for name, side in (("HEAD", 1.0), ("NUT", -1.0)):
                self._surface(f"{name}{number}", f"BOLT{number}", lambda p, side=side: (side * p[:, 2]).min() == SIDE)

    def _body(self, name, grid, inside):
        """All cells of a grid whose middle is inside, with nodes of their own."""
        rows, first = {}, len(self.elements)
        for cell in product(*(range(len(line) - 1) for line in grid)):
            if inside(*(0.5 * (line[at] + line[at + 1]) for line, at in zip(grid, cell, strict=True))):
                self.elements.append([])
                for corner in CORNERS:
                    place = tuple(float(line[a + b]) for line, a, b in zip(grid, cell, corner, strict=True))
                    if place not in rows:
                        self.nodes.append(place)
                        rows[place] = len(self.nodes)
                    self.elements[-1].append(rows[place])
        self.bodies[name] = range(first, len(self.elements))

    def _surface(self, name, body, chosen):
        """Outer faces of a body, by the places (4, 3) of their nodes."""
        faces = [
            (row, n, [self.elements[row][k] for k in face])
            for row in self.bodies[body]
            for n, face in enumerate(FACES, 1)
        ]
        count = Counter(frozenset(nodes) for _, _, nodes in faces)
        outer = [each for each in faces if count[frozenset(each[2])] == 1]
        places = np.array(self.nodes)
        self.surfaces[name] = [f"{row + 1}, S{n}" for row, n, nodes in outer if chosen(places[np.array(nodes) - 1])]

    def lines(self):
        """Of the deck."""
        last = len(self.nodes) + 1
        yield from ("** Two halves of a beam, lapped and bolted; free. mm, t, s, MPa.", "*NODE, NSET=NALL")
        yield from (f"{number}, {x:g}, {y:g}, {z:g}" for number, (x, y, z) in enumerate(self.nodes, 1))
        yield from ("*NODE, NSET=TIP", f"{last}, {ENDS:g}, 0, 0")
        for name, rows in self.bodies.items():
            yield f"*ELEMENT, TYPE=C3D8I, ELSET={name}"
            yield from (", ".join(map(str, [row + 1, *self.elements[row]])) for row in rows)
        yield from ("*ELSET, ELSET=ALL", ", ".join(self.bodies), "*MATERIAL, NAME=STEEL", "*ELASTIC", "210000, 0.3")
        yield from ("*DENSITY", "7.85E-9", "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL")
        for name, side in (("HEADS", 1.0), ("NUTS", -1.0)):
            ends = product(HOLES, (-HOLE, HOLE), (-HOLE, HOLE))
            places = {(hole + x, y, side * SIDE) for hole, x, y in ends}
            of_bolts = {
                node
                for each in self.bodies
                if "BOLT" in each
                for row in self.bodies[each]
                for node in self.elements[row]
            }
            yield from (f"*NSET, NSET={name}", *(f"{n}," for n in sorted(of_bolts) if self.nodes[n - 1] in places))
        for name, faces in self.surfaces.items():
            yield from (f"*SURFACE, NAME={name}", *faces)
        yield from (f"*COUPLING, CONSTRAINT NAME=C, SURFACE=END, REF NODE={last}", "*DISTRIBUTING", "1, 3")
        for number, (end, half) in product(range(1, len(HOLES) + 1), (("HEAD", "UPPER"), ("NUT", "LOWER"))):
            yield from (f"*TIE, NAME={end}{number}, POSITION TOLERANCE=0.1", f"{end}{number}, {half}_SIDE")
        yield from ("*SURFACE INTERACTION, NAME=DRY", "*FRICTION", "0.3", "*CONTACT PAIR, INTERACTION=DRY")
        yield from ("UPPER_FACE, LOWER_FACE", "*STEP", "*STATIC", "*CLOAD")
        yield from (f"HEADS, 3, {-FORCE / 4.0:g}", f"NUTS, 3, {FORCE / 4.0:g}", "*END STEP")


def _in_hole(x, y):
    """Whether a place is in a hole at 0."""
    return max(abs(x), abs(y)) < HOLE


def _of_half(outwards, x, y, up):
    """Whether a place is in a half: the full section outside of the lap, the half of it inside."""
    return (outwards > LAP or up > 0.0) and not any(_in_hole(x - hole, y) for hole in HOLES)


if __name__ == "__main__":
    DECK.write_text("\n".join(Beam().lines()) + "\n", encoding="ascii")
