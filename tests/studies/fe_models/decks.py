"""Decks that the tests write, after the manuals of CalculiX and Abaqus."""

from pathlib import Path

SECTOR = Path(__file__).parent / "calculix_sector.inp"
"""A deck of 12 sectors that CalculiX runs: a root that is tied, a centrifugal prestress, and the export of matrices."""

CUBES = """\
** two cubes of different kinds, with all that a deck may hold
*HEADING
Two cubes, see the manual
*NODE, NSET=NALL
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
** the second one begins here
11, 0., 0., 1.
12, 1.0D+00, 0., 1.
13, 1., 1., 1.,
14, , 1., 1.
15, 0., 0., 2.
16, 1., 0., 2.
17, 1., 1., 2.
18, 0., 1., 2.
*Element, type=C3D8I, elset=Lower
1, 1,2,3,4,5,
6,7,8
*ELEMENT, TYPE=C3D8, ELSET=UPPER
2, 11,12,13,14,15,16,17,18
*NSET, NSET=BOTTOM, GENERATE
1, 4, 1
*NSET, NSET=TOP
15, 16, 17, 18,
*NSET, NSET=BOTH
BOTTOM, top, 7
*NSET, NSET=EVEN, GENERATE
2, 1000000000, 2
*NSET, NSET=OF_UPPER, ELSET=UPPER
*ELSET, ELSET=ALL
LOWER, Upper
*SURFACE, NAME=UNDER
LOWER, S2
*SURFACE, NAME=ABOVE
2, S1
*SURFACE, NAME=POINTS, TYPE=NODE
TOP,
5, 1.0
*MATERIAL, NAME=STEEL
*DENSITY
7800., 20.
7700., 200.
*ELASTIC, TYPE=ISO
2.1e11, 0.3, 20.
2.0e11, 0.3, 200.
*SOLID SECTION, ELSET=ALL, MATERIAL=Steel
*INITIAL CONDITIONS, TYPE=TEMPERATURE
NALL, 20.
*SURFACE INTERACTION, NAME=RUB
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD
*FRICTION
0.4, 1e6
*CONTACT PAIR, INTERACTION=RUB, TYPE=SURFACE TO SURFACE
ABOVE, UNDER
*BOUNDARY
BOTTOM, 1, 3
7, 2
TOP, XSYMM
*STEP, NLGEOM
*STATIC
*DLOAD
ALL, CENTRIF, 1e4, 0., 0., 0., 0., 0., 2.
ALL, GRAV, 9810., 0., 0., -2.
*CLOAD
TOP, 3, -5.
*NODE PRINT, NSET=TOP
U
*END STEP
*STEP, PERTURBATION
*BOUNDARY, OP=NEW
*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE
ABOVE, UNDER
*EQUATION, REMOVE ALL
*FREQUENCY, SOLVER=MATRIXSTORAGE
*END STEP
"""

PART = """\
*Heading
*Part, name=Block
*Node
1, 0., 0., 0.
2, 1., 0., 0.
3, 0., 1., 0.
4, 0., 0., 1.
5, 1., 1., 1.
*Element, type=C3D4
1, 1, 2, 3, 4
2, 2, 3, 4, 5
*Nset, nset=Set-1, generate
1, 5, 1
*Elset, elset=Set-1, generate
1, 2, 1
*Solid Section, elset=Set-1, material="Grey iron"
,
*End Part
*Assembly, name=Assembly
*Instance, name=Block-1, part=Block
10., 0., 0.
10., 0., 0., 10., 0., 1., 90.
*End Instance
*Node
1, 5., 5., 5.
*Nset, nset=Reference
1,
*Nset, nset=Set-1, instance=Block-1
1, 3
*Elset, elset=_Face_S1, internal, instance=Block-1
1,
*Surface, type=ELEMENT, name=Face
_Face_S1, S1
*Surface, type=ELEMENT, name=Other
Block-1.2, S3
*Tie, name=Glue, adjust=yes, position tolerance=0.01
Face, Other
*End Assembly
*Material, name="Grey iron"
*Elastic
1e5, 0.25
*Boundary
Set-1, ENCASTRE
Block-1.2, 1, 1
Block-1.Set-1, 3, 3
"""


def write(folder: Path, text: str, name: str = "deck.inp") -> Path:
    """A deck in a folder."""
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    return path
