"""Meshes for Gmsh's and ANSYS' formats, written after their manuals. A helper of the tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

GMSH_22 = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
2 1 "under"
3 2 "Block"
2 3 "top"
$EndPhysicalNames
$Nodes
13
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 0 0 1
6 1 0 1
7 1 1 1
8 0 1 1
9 0.5 0.5 2
10 9 9 9
11 0 0 3
12 1 0 3
13 0 1 3
$EndNodes
$Elements
6
1 3 2 1 1 1 2 3 4
2 3 2 3 2 5 6 7 8
3 5 2 2 1 1 2 3 4 5 6 7 8
4 4 2 2 1 5 6 7 9
5 4 2 2 1 5 7 8 9
6 15 2 0 1 10
$EndElements
"""

GMSH_41 = """\
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "under"
3 2 "Block"
$EndPhysicalNames
$Entities
0 0 1 1
1 0 0 0 1 1 0 1 1 0
1 0 0 0 1 1 1 1 2 0
$EndEntities
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
2 3 1 3
2 1 2 1
1 1 2 3
3 1 4 2
2 1 2 3 4
3 2 3 4 5
$EndElements
"""

# corners of elements of SOLID185 as ANSYS collapses them: a brick, a wedge and a tetrahedron
BRICKS = {1: (1, 2, 3, 4, 5, 6, 7, 8), 2: (5, 6, 7, 7, 9, 10, 11, 11), 3: (9, 10, 11, 11, 12, 12, 12, 12)}


def write_cdb(folder: Path, elements: dict[int, tuple[int, ...]] = BRICKS, turned: float = 0.0) -> Path:
    """A mesh as CDWRITE writes it, with a set of nodes and a set of elements."""
    corners = np.array(
        [
            *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
            *((0, 0, 2), (1, 0, 2), (1, 1, 2), (0.5, 0.5, 3)),
        ],
        dtype=float,
    )
    lines = ["/PREP7", "ET,        1,185", f"NBLOCK,6,SOLID,{12:10d},{12:10d}", "(3i9,6e21.13e3)"]
    for number, point in enumerate(corners, 1):
        angle = f"{turned:21.13E}" if turned and number == 1 else ""
        lines.append(f"{number:9d}{0:9d}{0:9d}{''.join(f'{x:21.13E}' for x in point)}{angle}")
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{len(elements):10d},{len(elements):10d}", "(19i9)"]
    for number, nodes in elements.items():
        header = (1, 1, 1, 1, 0, 0, 0, 0, len(nodes), 0, number)
        lines.append("".join(f"{value:9d}" for value in (*header, *nodes)))
    lines += [f"{-1:9d}", "CMBLOCK,UNDER   ,NODE,       2", "(8i10)", f"{1:10d}{-4:10d}"]
    lines += ["CMBLOCK,FIRST   ,ELEM,       1", "(8i10)", f"{1:10d}", "FINISH"]
    path = folder / "mesh.cdb"
    path.write_text("\n".join(lines) + "\n")
    return path
