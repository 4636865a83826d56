"""The contents of a deck: frozen dataclasses of arrays, in the units of the file. Nothing is read here.

Node and element numbers are those of the file, not indices of an array. Names of sets, surfaces, materials and
interactions are in capitals, as the programs ignore case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NODES_OF_KIND: Mapping[str, int] = {
    "C3D4": 4,
    "C3D6": 6,
    "C3D8": 8,
    "C3D8I": 8,
    "C3D8R": 8,
    "C3D8H": 8,
    "C3D10": 10,
    "C3D10M": 10,
    "C3D15": 15,
    "C3D20": 20,
    "C3D20R": 20,
}
"""Kinds of elements that a mesh may hold, by their names in CalculiX and Abaqus, and their numbers of nodes.

Nodes stand in the order of these codes. C3D8R, C3D8H and C3D10M are read for their geometry: their matrices come from
the code itself.
"""


_MOST_NAMED = 20  # keywords in one line


@dataclass(frozen=True)
class ElementBlock:
    """Elements of one kind.

    kind: a key of NODES_OF_KIND.
    numbers (m,): element numbers.
    nodes (m, k): node numbers, in the order of the programs.
    """

    kind: str
    numbers: IntArray
    nodes: IntArray


@dataclass(frozen=True)
class Surface:
    """Faces of elements, or nodes; the other of the two is empty.

    elements (f,): element numbers.
    faces (f,): 1 to 6, the faces S1 to S6 of the programs.
    nodes (p,): node numbers, ascending.
    """

    elements: IntArray
    faces: IntArray
    nodes: IntArray

    @property
    def of_nodes(self) -> bool:
        """Whether the surface is one of nodes."""
        return self.nodes.size > 0


@dataclass(frozen=True)
class Tie:
    """Two glued surfaces, or the cut faces of a sector.

    dependent, independent: names of surfaces, slave first, as in the deck.
    tolerance: largest distance of a tied node, in the unit of length of the file; None where the deck gives none, or 0.
    cyclic: whether these are the cut faces of a sector.
    """

    name: str
    dependent: str
    independent: str
    tolerance: float | None
    cyclic: bool


@dataclass(frozen=True)
class ContactPair:
    """Two surfaces in contact.

    dependent, independent: names of surfaces, slave first, as in the deck.
    interaction: name of the interaction.
    friction_coefficient: of the interaction; None where the deck gives none.
    problem: a law that is not read, as "deck.inp, line 7: *FRICTION with TAUMAX"; "" where there is none.
    glued: where the deck says that the surfaces do not part, as "deck.inp, line 7: ..."; "" where they may.
    fitted: where the deck gives a clearance or an interference, as "deck.inp, line 7: ..."; "" where it gives none.
    clearance: distance of the surfaces, negative for an interference; None for the distances in the mesh.
    adjusted: where the deck moves nodes onto the other surface, as "deck.inp, line 7: ..."; "" where it does not.
    """

    dependent: str
    independent: str
    interaction: str
    friction_coefficient: float | None
    problem: str = ""
    glued: str = ""
    fitted: str = ""
    clearance: float | None = None
    adjusted: str = ""


@dataclass(frozen=True)
class CyclicSymmetry:
    """A sector of a cyclic structure.

    n_sectors: number of sectors.
    ties: names of the ties of the cut faces; none where the deck gives none.
    axis (2, 3): two points on the axis.
    """

    n_sectors: int
    ties: tuple[str, ...]
    axis: FloatArray


@dataclass(frozen=True)
class Boundary:
    """Prescribed displacements.

    name: the set, or the node number as text.
    nodes (p,): node numbers.
    first_dof, last_dof: 1 to 3 are displacements along x, y and z, or along the directions of a `Transform`; 4 to 6
        rotations of reference points; larger numbers are possible.
    value: displacement; 0 for held ones.
    place: in the file, for messages.
    """

    name: str
    nodes: IntArray
    first_dof: int
    last_dof: int
    value: float
    place: str = ""


@dataclass(frozen=True)
class Transform:
    """Directions of the displacements 1 to 3 of nodes.

    place: in the file, for messages. nodes (p,): node numbers.
    points (2, 3): cylindrical: on the axis; directions are radial, tangential and axial. Else one vector along the
        first direction, and another in the plane of the first two.
    """

    place: str
    nodes: IntArray
    cylindrical: bool
    points: FloatArray


@dataclass(frozen=True)
class Equation:
    """`sum(coefficients * u) = 0`; the first term depends on the others.

    place: in the file, for messages. nodes, dofs, coefficients (t,): dofs as in `Boundary`.
    """

    place: str
    nodes: IntArray
    dofs: IntArray
    coefficients: FloatArray


@dataclass(frozen=True)
class RigidMotion:
    """Nodes that follow a reference node: `u = u_reference + theta x (x - x_reference)`.

    place: in the file, for messages. nodes (p,): node numbers. dofs: 1 to 3, those that follow.
    rotation: the node whose displacements are theta; 0 where the reference node has dofs 4 to 6 of its own.
    turns: whether there is theta.
    """

    place: str
    nodes: IntArray
    dofs: tuple[int, ...]
    reference: int
    rotation: int = 0
    turns: bool = True


@dataclass(frozen=True)
class NodalForce:
    """A constant force on each of some nodes (p,) along a dof as in `Boundary`. place: in the file, for messages."""

    place: str
    nodes: IntArray
    dof: int
    value: float


@dataclass(frozen=True)
class Pressure:
    """A constant pressure on faces (f,) of elements (f,), positive into the body. place: in the file, for messages."""

    place: str
    elements: IntArray
    faces: IntArray
    value: float


@dataclass(frozen=True)
class Material:
    """An isotropic linear elastic material, in units of the file. None where the deck gives no such value.

    problem: what of the material is not read, as "deck.inp, line 7: *ELASTIC, TYPE=ORTHO"; "" where there is nothing.
    """

    young: float | None
    poisson: float | None
    density: float | None
    problem: str = ""


@dataclass(frozen=True)
class SolidSection:
    """Elements of one material. element_set: name of a set of elements. material: name of a material."""

    element_set: str
    material: str


@dataclass(frozen=True)
class CentrifugalLoad:
    """Centrifugal load.

    name: the set, or the element number as text.
    elements (m,): element numbers.
    omega_squared: square of the speed, rad2/s2.
    point (3,): on the axis.
    axis (3,): unit vector.
    """

    name: str
    elements: IntArray
    omega_squared: float
    point: FloatArray
    axis: FloatArray


@dataclass(frozen=True)
class ContactNodes:
    """Nodes of a table: area (n,), unit normal (n, 3) out of the body, initial gap (n,); NaN where none is given."""

    area: FloatArray
    normals: FloatArray
    gap: FloatArray


@dataclass(frozen=True)
class Deck:
    """All that is read of a model's mesh file: the model as its steps leave it that do not write matrices.

    path: name of the file, for messages.
    node_numbers (n,), coordinates (n, 3): numbers ascending, coordinates in units of the file.
    blocks: elements, one block a kind; no element number is in two of them.
    node_sets, element_sets: ascending numbers by the name of the set; all of them exist.
    surfaces, materials: by name.
    ties, contact_pairs, sections, boundaries, transforms, equations, rigid_motions: in the order of the file.
    cyclic: None where the deck is none of a sector.
    centrifugal: loads of the last step that has some.
    forces, pressures, gravity: constant loads of static steps; the acceleration (3,) acts on all elements.
    unassembled: what has a stiffness or a mass that only matrices of another program hold, as "deck.inp, line 7: ...".
    removed: what *MODEL CHANGE takes away, a sentence each; it is not among the rest.
    n_instances: of parts; where there are several, numbers are not those of the file.
    skipped: keywords that cannot change the model and were not read, each as "sector.inp, line 7: *KEYWORD".
    notes: what was read in a way that may be asked for, a sentence each.
    included: files that the deck includes, relative to its folder.
    contact_nodes: of a table of nodes, which has no elements; None of a mesh.
    """

    path: str
    node_numbers: IntArray
    coordinates: FloatArray
    blocks: tuple[ElementBlock, ...]
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    element_sets: Mapping[str, IntArray] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    ties: tuple[Tie, ...] = ()
    contact_pairs: tuple[ContactPair, ...] = ()
    cyclic: CyclicSymmetry | None = None
    boundaries: tuple[Boundary, ...] = ()
    transforms: tuple[Transform, ...] = ()
    equations: tuple[Equation, ...] = ()
    rigid_motions: tuple[RigidMotion, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    sections: tuple[SolidSection, ...] = ()
    centrifugal: tuple[CentrifugalLoad, ...] = ()
    forces: tuple[NodalForce, ...] = ()
    pressures: tuple[Pressure, ...] = ()
    gravity: FloatArray | None = None
    unassembled: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    n_instances: int = 0
    skipped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    included: tuple[str, ...] = ()
    contact_nodes: ContactNodes | None = None

    @property
    def remarks(self) -> tuple[tuple[str, str], ...]:
        """Label and text of lines for the user: what was skipped, where there is something, and the notes."""
        more = len(self.skipped) - _MOST_NAMED
        skipped = "; ".join(self.skipped[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
        return (
            *((("skipped", skipped),) if skipped else ()),
            *(("note", text) for text in (*self.notes, *self.removed)),
        )

    def rows_of_nodes(self, numbers: IntArray) -> IntArray:
        """Places of nodes in `coordinates`, of the shape of `numbers`; all of them must exist."""
        rows = np.searchsorted(self.node_numbers, numbers)
        assert np.array_equal(self.node_numbers[np.minimum(rows, self.node_numbers.size - 1)], numbers)
        return rows.astype(np.int64)
