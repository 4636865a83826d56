"""The contents of a deck: frozen dataclasses of arrays, in the units of the file.

Node and element numbers are those of the file, not indices of an array. Names are in capitals, as the programs ignore
case. A `place` is where something stands, for messages, as "deck.inp, line 7: *KEYWORD".
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from studies.fe_models.files import FloatArray, IntArray
from studies.finite_element.elements import ELEMENT_KINDS

NODES_OF_KIND: Mapping[str, int] = {kind: len(each.reference.nodes) for kind, each in ELEMENT_KINDS.items()}
"""Kinds of elements that a mesh may hold, by their names in CalculiX and Abaqus, and their numbers of nodes."""

_MOST_NAMED = 20  # keywords in one line


@dataclass(frozen=True)
class ElementBlock:
    """Elements of one kind, a key of NODES_OF_KIND: their numbers (m,) and node numbers (m, k)."""

    kind: str
    numbers: IntArray
    nodes: IntArray


@dataclass(frozen=True)
class Surface:
    """Faces (f,), 1 to 6 for S1 to S6, of elements (f,); or nodes (p,), ascending. The other of the two is empty."""

    elements: IntArray
    faces: IntArray
    nodes: IntArray


@dataclass(frozen=True)
class SurfacePair:
    """Two surfaces by name, the dependent one first, that are glued (*TIE) or touch (*CONTACT PAIR).

    tolerance: largest distance of a tied node. clearance: distance of the surfaces, negative for an interference; None
    for the distances in the mesh. Places, "" where there is nothing of the kind: problem of a law of friction that is
    not read, glued where surfaces in contact do not part, fitted of a clearance or interference, adjusted where nodes
    are moved. None where the deck gives none.
    """

    dependent: str
    independent: str
    tolerance: float | None = None
    friction_coefficient: float | None = None
    problem: str = ""
    glued: str = ""
    fitted: str = ""
    clearance: float | None = None
    adjusted: str = ""

    @property
    def labels(self) -> tuple[str, str, str]:
        """Names by which a study means the pair, that of both surfaces last."""
        return self.dependent, self.independent, f"{self.dependent}-{self.independent}"


@dataclass(frozen=True)
class NodalValue:
    """A displacement, 0 where it is held, or a force of each of some nodes (p,) along the dofs from first to last.

    Dofs 1 to 3 are along x, y and z, or the directions of a `Transform`; 4 to 6 are rotations of reference points.
    """

    place: str
    nodes: IntArray
    first_dof: int
    last_dof: int
    value: float


@dataclass(frozen=True)
class Transform:
    """Directions of the displacements 1 to 3 of nodes (p,).

    points (2, 3): cylindrical: on the axis, directions are radial, tangential, axial. Else vectors: the first
    direction, and another one in the plane of the first two.
    """

    place: str
    nodes: IntArray
    cylindrical: bool
    points: FloatArray


@dataclass(frozen=True)
class Equation:
    """`sum(coefficients * u) = 0` of nodes and dofs (t,) as in `NodalValue`; the first term depends on the others."""

    place: str
    nodes: IntArray
    dofs: IntArray
    coefficients: FloatArray


@dataclass(frozen=True)
class RigidMotion:
    """Nodes (p,) of which the dofs, 1 to 3, follow a reference node: `u = u_reference + theta x (x - x_reference)`.

    rotation: the node whose displacements are theta; 0 for dofs 4 to 6 of the reference node. turns: whether there is
    theta.
    """

    place: str
    nodes: IntArray
    dofs: tuple[int, ...]
    reference: int
    rotation: int = 0
    turns: bool = True


@dataclass(frozen=True)
class MeanMotion:
    """A reference node that follows the mean motion of a surface of faces.

    turns: which of its rotations, dofs 4 to 6, do so beside its displacements.
    """

    place: str
    surface: str
    reference: int
    turns: tuple[int, ...]


@dataclass(frozen=True)
class Pressure:
    """A constant pressure on faces (f,) of elements (f,), positive into the body."""

    place: str
    elements: IntArray
    faces: IntArray
    value: float


@dataclass(frozen=True)
class Material:
    """An isotropic linear elastic material; None where the deck gives no value. problem: place of what is not read."""

    young: float | None
    poisson: float | None
    density: float | None
    problem: str = ""


@dataclass(frozen=True)
class Section:
    """Elements (m,) and the name of their material. name: of the set of elements."""

    name: str
    elements: IntArray
    material: str


@dataclass(frozen=True)
class CentrifugalLoad:
    """Centrifugal load of elements (m,). omega_squared: rad2/s2. point (3,): on the axis. axis (3,): unit vector."""

    place: str
    elements: IntArray
    omega_squared: float
    point: FloatArray
    axis: FloatArray


@dataclass(frozen=True)
class Deck:
    """All that is read of a model's mesh file: the model as its steps leave it that do not write matrices.

    path: name of the file. node_numbers (n,), ascending, coordinates (n, 3). All numbers in sets exist, each element is
    once in one block. cyclic: number of sectors, and two points (2, 3) on the axis. cut_faces: names of surfaces that
    are images of each other. centrifugal: loads of the last step that has some. gravity (3,): acceleration of all
    elements in static steps. unassembled: places of what only matrices of another program hold. n_instances: where
    there are several, numbers are not those of the file. skipped: places of keywords that cannot change the model.
    notes: what was read in one of two ways, a sentence each. included: files relative to the deck's folder.
    contact_nodes (n, 5): of a table of nodes, which has no elements: area, unit normal out of the body, initial gap,
    NaN where none is given; None of a mesh.
    """

    path: str
    node_numbers: IntArray
    coordinates: FloatArray
    blocks: tuple[ElementBlock, ...]
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    element_sets: Mapping[str, IntArray] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    ties: tuple[SurfacePair, ...] = ()
    contact_pairs: tuple[SurfacePair, ...] = ()
    cyclic: tuple[int, FloatArray] | None = None
    cut_faces: tuple[tuple[str, str], ...] = ()
    boundaries: tuple[NodalValue, ...] = ()
    transforms: tuple[Transform, ...] = ()
    equations: tuple[Equation, ...] = ()
    rigid_motions: tuple[RigidMotion, ...] = ()
    mean_motions: tuple[MeanMotion, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    sections: tuple[Section, ...] = ()
    centrifugal: tuple[CentrifugalLoad, ...] = ()
    forces: tuple[NodalValue, ...] = ()
    pressures: tuple[Pressure, ...] = ()
    gravity: FloatArray | None = None
    unassembled: tuple[str, ...] = ()
    n_instances: int = 0
    skipped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    included: tuple[str, ...] = ()
    contact_nodes: FloatArray | None = None

    @property
    def remarks(self) -> tuple[tuple[str, str], ...]:
        """Label and text of lines for the user: what was skipped, where there is something, and the notes."""
        more = len(self.skipped) - _MOST_NAMED
        skipped = "; ".join(self.skipped[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
        return (*((("skipped", skipped),) if skipped else ()), *(("note", text) for text in self.notes))

    def rows_of_nodes(self, numbers: IntArray) -> IntArray:
        """Places of nodes in `coordinates`, of the shape of `numbers`; all of them must exist."""
        rows = np.searchsorted(self.node_numbers, numbers)
        assert np.array_equal(self.node_numbers[np.minimum(rows, self.node_numbers.size - 1)], numbers)
        return rows.astype(np.int64)
