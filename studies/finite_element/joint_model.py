"""A finite-element model of a joint, in arrays: what its files and a study say of it, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.elements.solid_mesh import Rotation, SolidMesh
from studies.finite_element.joint.cut_faces import CutFaces
from studies.finite_element.joint.pairing import ContactPairs, ContactSurfaces


@dataclass(frozen=True)
class MeshModel:
    """A model whose matrices are assembled here.

    rotation: None where it stands still. prestress: whether the stress and the displacements of the glued structure
    under the centrifugal load, and spin softening, are part of its stiffness. preload (3 n_nodes,): constant forces
    beside the centrifugal ones, N; they are no part of the prestress, as what presses on gaps and flanks does so
    otherwise on a glued structure. layers (n_nodes, n_directions): place of each node in a structured grid, by which
    the order of elimination is chosen; by the coordinates if None.
    """

    mesh: SolidMesh
    rotation: Rotation | None = None
    prestress: bool = True
    preload: FloatArray | None = None
    layers: IntArray | None = None

    @property
    def coordinates(self) -> FloatArray:
        """Nodes (n_nodes, 3), m."""
        return self.mesh.coordinates

    @property
    def numbers(self) -> IntArray:
        """Numbers (n_nodes,) of the nodes in the file."""
        return self.mesh.numbers


@dataclass(frozen=True)
class MatrixModel:
    """A model whose matrices come from another program.

    coordinates (n_nodes, 3): m, NaN for nodes that have no place (inner ones of an element). numbers (n_nodes,): of the
    nodes in the file. stiffness, mass (3 n_nodes, 3 n_nodes): N/m, kg, symmetric and unconstrained, displacements node
    by node in x, y, z; whatever the other program has put in of prestress and spin softening stays in. rotation: for
    the centrifugal load, which is made of the mass; None where it stands still.
    """

    coordinates: FloatArray
    numbers: IntArray
    stiffness: sparse.csr_matrix
    mass: sparse.csr_matrix
    rotation: Rotation | None = None
    preload: FloatArray | None = None


@dataclass(frozen=True)
class SetMotion:
    """Mean displacement of nodes (n,), rows of the coordinates, along a direction (3,) of any length.

    As a load: a force of 1 N along the direction, shared evenly.
    """

    nodes: IntArray
    direction: FloatArray

    def row(self, n_nodes: int) -> FloatArray:
        """Row (3 n_nodes,) that gives it from the nodal displacements."""
        row = np.zeros((n_nodes, 3))
        np.add.at(row, self.nodes, self.direction / (np.linalg.norm(self.direction) * len(self.nodes)))
        return row.ravel()


@dataclass(frozen=True)
class Retainer:
    """A spring on the mean relative displacement of all pairs, weighted by area, along a direction (3,).

    It keeps a joint that friction alone holds from walking; without it there may be no periodic state. stiffness: N/m.
    """

    stiffness: float
    direction: FloatArray


@dataclass(frozen=True)
class JointDefinition:
    """What is done with a model.

    contacts: at least one. held (n_nodes, 3): displacements that are 0. load: of 1 N. responses: by name. cut: cut
    faces, None where the structure is no cyclic sector. along (3,): direction near the first tangents; the axis of
    rotation or of the cyclic structure if None, else z. retainer: None for none. ties: surfaces glued for good. pairs:
    the pairs of the contacts in an order and with frames of one's own; as `build_contact_pairs` finds them if None.
    """

    contacts: tuple[ContactSurfaces, ...]
    held: BoolArray
    load: SetMotion
    responses: Mapping[str, SetMotion]
    cut: CutFaces | None = None
    along: FloatArray | None = None
    retainer: Retainer | None = None
    ties: tuple[ContactSurfaces, ...] = ()
    pairs: ContactPairs | None = None


@dataclass(frozen=True)
class ReductionOptions:
    """nodal_diameter: of the travelling wave that excites. n_modes: stuck modes kept. loss_factor: exact at the first
    glued frequency of that nodal diameter.
    """

    nodal_diameter: int = 0
    n_modes: int = 20
    loss_factor: float = 1e-3


@dataclass(frozen=True)
class ModelSummary:
    """What a user checks. mass: kg. centre (3,), extent (3,): m. n_dofs: displacements that are not held."""

    mass: float
    centre: FloatArray
    extent: FloatArray
    n_dofs: int
    glued_frequencies: Mapping[int, FloatArray] = field(default_factory=dict)
