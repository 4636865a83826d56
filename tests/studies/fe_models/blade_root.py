"""The bundled deck `studies/blade_root.inp`: a blade with a dovetail root in a sector of its disk, in mm, t and s.

`python -m tests.studies.fe_models.blade_root` writes it anew. A helper of the tests, which also refine it.
"""

from pathlib import Path

import numpy as np

from studies.finite_element.elements.kinds import ELEMENT_KINDS
from tests.studies.fe_models.solid_meshes import block

DECK = Path(__file__).parents[3] / "studies" / "blade_root.inp"
N_SECTORS = 24
RPM = 6000.0
WIDTH = 24.0  # along the axis
KIND = "C3D20R"

_HALF = np.pi / N_SECTORS


def _cut(x):
    return x, x * np.tan(_HALF)


def _bore(angle):
    return 80.0 * np.cos(angle), 80.0 * np.sin(angle)


# Quadrilaterals of the half y > 0 of the section across the axis, x radial: corners (inner and outer on the side of
# y = 0, then outer and inner on the other side), and elements along x and y. The flanks lie on x + y = 150: that of
# the blade from (137.5, 12.5) to (143.5, 6.5), that of the disk reaches a little beyond both ends.
_DISK = (
    ((_bore(0.0), (129.0, 0.0), (129.0, 11.5), _bore(0.6 * _HALF)), (3, 2)),
    ((_bore(0.6 * _HALF), (129.0, 11.5), _cut(129.0), _bore(_HALF)), (3, 1)),
    (((129.0, 11.5), (137.0, 13.0), _cut(137.0), _cut(129.0)), (1, 1)),
    (((137.0, 13.0), (143.7, 6.3), _cut(144.5), _cut(137.0)), (1, 1)),
)
_ROOT = (
    (((131.0, 0.0), (137.5, 0.0), (137.5, 12.5), (131.0, 10.5)), (1, 1)),
    (((137.5, 0.0), (143.5, 0.0), (143.5, 6.5), (137.5, 12.5)), (1, 1)),
    (((143.5, 0.0), (146.0, 0.0), (146.0, 5.0), (143.5, 6.5)), (1, 1)),
)
_BLADE = (146.0, 230.0), (5.0, 1.2), 0.7, (4, 1)  # begin and end, half thickness there, twist, elements


def _section(corners, points):
    """Bilinear in the section; edges at the bore become arcs."""
    u, v = points[:, 0], points[:, 1]
    a, b, c, d = (np.array(corner)[:, None] for corner in corners)
    x, y = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    if np.hypot(*corners[0]) < 81.0:
        inner = np.arctan2(corners[0][1], corners[0][0]), np.arctan2(corners[3][1], corners[3][0])
        angle = (1 - v) * inner[0] + v * inner[1]
        chord = (1 - v) * a[:, 0][:, None] + v * d[:, 0][:, None]
        x, y = x + (1 - u) * (80.0 * np.cos(angle) - chord[0]), y + (1 - u) * (80.0 * np.sin(angle) - chord[1])
    return x, y


def _airfoil(points):
    (begin, end), (thick, thin), twist, _ = _BLADE
    u = points[:, 0]
    y, z = (thick + (thin - thick) * u) * points[:, 1], WIDTH * (points[:, 2] - 0.5)
    angle = twist * u**2
    turned = y * np.cos(angle) - z * np.sin(angle), z * np.cos(angle) + y * np.sin(angle)
    return np.stack([begin + (end - begin) * u, turned[0], turned[1] + 0.5 * WIDTH], axis=1)


def _parts(refine):
    """Blocks of (nodes, elements) of the disk, then of the blade."""

    def one(shape, divisions, layers):
        divisions = tuple(refine * n for n in (*divisions, layers))
        for side in (1.0, -1.0):

            def mirrored(points, side=side):
                # the half y < 0 is run through backwards, so that no element is turned inside out
                across = points[:, 1] if side > 0 else 1.0 - points[:, 1]
                return shape(np.stack([points[:, 0], across, points[:, 2]], axis=1), side)

            mesh, _ = block(KIND, divisions, mirrored, straight=False)
            yield mesh.coordinates, mesh.groups[0].nodes

    def prism(corners):
        def shape(points, side):
            x, y = _section(corners, points)
            return np.stack([x, side * y, WIDTH * points[:, 2]], axis=1)

        return shape

    def airfoil(points, side):
        return _airfoil(points * [1.0, side, 1.0])

    disk = [part for corners, divisions in _DISK for part in one(prism(corners), divisions, 2)]
    blade = [part for corners, divisions in _ROOT for part in one(prism(corners), divisions, 3)]
    return disk, [*blade, *one(airfoil, _BLADE[3], 3)]


def _merged(parts, first_node):
    """Coordinates (n, 3) and elements of blocks whose common nodes become one; numbers begin with first_node."""
    points = np.round(np.concatenate([nodes for nodes, _ in parts]), 6) + 0.0
    unique, number = np.unique(points, axis=0, return_inverse=True)
    starts = np.cumsum([0, *(len(nodes) for nodes, _ in parts)])
    elements = [number.ravel()[each + start] for start, (_, each) in zip(starts, parts, strict=False)]
    return unique, np.concatenate(elements) + first_node


def _faces(points, elements, first_node, inside):
    """(element, face) of the faces whose nodes are all inside."""
    for row, nodes in enumerate(elements):
        for face, local in enumerate(ELEMENT_KINDS[KIND].faces, start=1):
            if inside[nodes[list(local)] - first_node].all():
                yield row, face


def _lines(numbers, per_line=12):
    for start in range(0, len(numbers), per_line):
        yield ",".join(map(str, numbers[start : start + per_line])) + ","


def blade_root_deck(refine=1):
    """Text of the deck, with `refine` times as many elements along each edge."""
    parts = _parts(refine)
    disk, disk_elements = _merged(parts[0], 1)
    blade, blade_elements = _merged(parts[1], len(disk) + 1)
    lines = [
        "** A blade with a dovetail root in a sector of its disk, 24 of them: mm, t, s, MPa.",
        "*NODE,NSET=NALL",
        *(f"{n},{x:.6f},{y:.6f},{z:.6f}" for n, (x, y, z) in enumerate(np.concatenate([disk, blade]), 1)),
    ]
    for name, elements, first in (("DISK", disk_elements, 1), ("BLADE", blade_elements, len(disk_elements) + 1)):
        lines.append(f"*ELEMENT,TYPE={KIND},ELSET={name}")
        for number, nodes in enumerate(elements, first):
            lines += [",".join(map(str, (number, *nodes[:10]))) + ",", ",".join(map(str, nodes[10:]))]
    x, y, _ = disk.T
    cut = x * np.tan(_HALF)
    on_flank = np.abs(x + np.abs(y) - 150.0) < 1e-4
    bore = np.abs(np.hypot(x, y) - 80.0) < 1e-4
    on_cut = np.abs(np.abs(y) - cut) < 1e-4
    for name, members in (("BORE", bore & (y > -cut + 1e-4)), ("LOW", on_cut & (y < 0)), ("HIGH", on_cut & (y > 0))):
        lines += [f"*NSET,NSET={name}", *_lines(np.flatnonzero(members) + 1)]
    tip = np.flatnonzero(np.abs(blade[:, 0] - 230.0) < 1e-4) + len(disk) + 1
    lines += ["*NSET,NSET=TIP", *_lines(tip)]
    root = np.abs(blade[:, 0] + np.abs(blade[:, 1]) - 150.0) < 1e-4
    root &= blade[:, 0] < 144.0
    bodies = (
        ("ROOT", blade, blade_elements, len(disk) + 1, len(disk_elements) + 1, root),
        ("SLOT", disk, disk_elements, 1, 1, on_flank),
    )
    for body, points, elements, first_node, first, inside in bodies:
        for side, sign in (("A", 1.0), ("B", -1.0)):
            chosen = _faces(points, elements, first_node, inside & (sign * points[:, 1] > 0.0))
            lines += [f"*SURFACE,NAME={body}_{side}", *(f"{first + row},S{face}" for row, face in chosen)]
    omega_squared = (np.pi * RPM / 30.0) ** 2
    lines += [
        *("*SURFACE,NAME=LOWS,TYPE=NODE", "LOW", "*SURFACE,NAME=HIGHS,TYPE=NODE", "HIGH"),
        *("*MATERIAL,NAME=TI64", "*ELASTIC", "114000.,0.32", "*DENSITY", "4.43e-9"),
        *("*SOLID SECTION,ELSET=DISK,MATERIAL=TI64", "*SOLID SECTION,ELSET=BLADE,MATERIAL=TI64"),
        *("*SURFACE INTERACTION,NAME=FLANKS", "*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", "1e7,0.01"),
        *("*FRICTION", "0.4,1e5"),
        "*CONTACT PAIR,INTERACTION=FLANKS,TYPE=SURFACE TO SURFACE",
        "ROOT_A,SLOT_A",
        "*CONTACT PAIR,INTERACTION=FLANKS,TYPE=SURFACE TO SURFACE",
        "ROOT_B,SLOT_B",
        *("*TIE,CYCLIC SYMMETRY,NAME=SECTOR,POSITION TOLERANCE=1e-3", "LOWS,HIGHS"),
        f"*CYCLIC SYMMETRY MODEL,N={N_SECTORS},NGRAPH=1,TIE=SECTOR",
        "0.,0.,0.,0.,0.,1.",
        *("*BOUNDARY", "BORE,1,3"),
        "** Static equilibrium under the centrifugal load: the prestress.",
        *("*STEP,NLGEOM", "*STATIC", "*DLOAD"),
        f"DISK,CENTRIF,{omega_squared:.4f},0.,0.,0.,0.,0.,1.",
        f"BLADE,CENTRIF,{omega_squared:.4f},0.,0.,0.,0.,0.,1.",
        "*END STEP",
        "** Stiffness and mass with this prestress, all contact and boundary conditions taken away.",
        *("*STEP,PERTURBATION", "*BOUNDARY,OP=NEW", "*MODEL CHANGE,TYPE=CONTACT PAIR,REMOVE"),
        *("ROOT_A,SLOT_A", "*MODEL CHANGE,TYPE=CONTACT PAIR,REMOVE", "ROOT_B,SLOT_B"),
        *("*EQUATION,REMOVE ALL", "*FREQUENCY,SOLVER=MATRIXSTORAGE,CYCMPC=INACTIVE", "*END STEP"),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    DECK.write_text(blade_root_deck(), encoding="ascii")
