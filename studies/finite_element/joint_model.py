"""A finite-element model of a joint, and what is done with it, as arrays in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.constraints import Constraints
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.pairing import ContactPairs, ContactSurfaces
from studies.finite_element.solid_mesh import Rotation, SolidMesh


@dataclass(frozen=True)
class MeshModel:
    """A model whose matrices are assembled here.

    prestress: whether the stiffness contains the stress and the displacements of the glued structure under the
    centrifugal load, and spin softening. preload (3 n_nodes,): constant forces, N, and gravity (3,): acceleration of
    all mass, m/s2; no part of the prestress, as forces on gaps and flanks act otherwise on a glued structure. extra
    (m,): numbers of nodes without elements, behind those of the mesh: others follow them.
    """

    mesh: SolidMesh
    rotation: Rotation | None = None
    prestress: bool = True
    preload: FloatArray | None = None
    gravity: FloatArray | None = None
    extra: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def coordinates(self) -> FloatArray:
        """Nodes (n_nodes, 3), m; NaN for those without elements."""
        return np.vstack([self.mesh.coordinates, np.full((len(self.extra), 3), np.nan)])

    @property
    def numbers(self) -> IntArray:
        """Numbers (n_nodes,) of the nodes in the file."""
        return np.concatenate([self.mesh.numbers, self.extra])

    def padded(self, form: sparse.csr_matrix) -> sparse.csr_matrix:
        """A form of the mesh with empty rows for nodes without elements."""
        form.resize((3 * len(self.numbers), 3 * len(self.numbers)))
        return form


@dataclass(frozen=True)
class MatrixModel:
    """A model with matrices of another program, with their prestress and spin softening.

    coordinates (n_nodes, 3): m; NaN for nodes without a place, such as inner nodes of an element. stiffness, mass,
    damping (3 n_nodes, 3 n_nodes): N/m, kg, N s/m, symmetric, unconstrained, displacements node by node in x, y, z;
    damping None for that of a loss factor. rotation: for the centrifugal load. preload, gravity: as in `MeshModel`.
    """

    coordinates: FloatArray
    numbers: IntArray
    stiffness: sparse.csr_matrix
    mass: sparse.csr_matrix
    rotation: Rotation | None = None
    preload: FloatArray | None = None
    gravity: FloatArray | None = None
    damping: sparse.csr_matrix | None = None

    @property
    def forms(self) -> dict[str, sparse.csr_matrix]:
        """Stiffness, mass and, where there is one, damping by name."""
        found = {"stiffness": self.stiffness, "mass": self.mass}
        return found if self.damping is None else {**found, "damping": self.damping}

    def with_nodes(self, numbers: IntArray) -> MatrixModel:
        """The same with further nodes (m,) that have no place and no matrices."""
        size = 3 * (len(self.numbers) + len(numbers))
        forms = {name: form.copy() for name, form in self.forms.items()}
        for form in forms.values():
            form.resize((size, size))
        coordinates = np.vstack([self.coordinates, np.full((len(numbers), 3), np.nan)])
        return replace(self, coordinates=coordinates, numbers=np.concatenate([self.numbers, numbers]), **forms)


@dataclass(frozen=True)
class RowMotion:
    """A sum over displacements. weights (n,): of the first n displacements, node by node in x, y, z."""

    weights: FloatArray

    def row(self, n_nodes: int) -> FloatArray:
        """Row (3 n_nodes,) that gives it from the nodal displacements."""
        return np.pad(self.weights, (0, 3 * n_nodes - len(self.weights)))


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
    """A spring, N/m, on the mean relative displacement of all pairs, weighted by area, along a direction (3,).

    It keeps a joint from walking that friction alone holds; without it there may be no periodic state.
    """

    stiffness: float
    direction: FloatArray


@dataclass(frozen=True)
class JointDefinition:
    """What is done with a model.

    held (n_nodes, 3): displacements that are 0, or follow others by the constraints. load: harmonic load of 1 N. cut:
    None where the structure is no cyclic sector. ties: surfaces that are always glued. pairs: those of the contacts in
    another order or with other frames than `build_contact_pairs` gives them.
    """

    contacts: tuple[ContactSurfaces, ...]
    held: BoolArray
    load: SetMotion
    responses: Mapping[str, SetMotion | RowMotion]
    cut: CutFaces | None = None
    retainer: Retainer | None = None
    ties: tuple[ContactSurfaces, ...] = ()
    constraints: Constraints | None = None
    pairs: ContactPairs | None = None


@dataclass(frozen=True)
class ReductionOptions:
    """nodal_diameter: of the travelling wave that excites. n_modes: stuck modes. loss_factor: see `build_fe_scene`."""

    nodal_diameter: int = 0
    n_modes: int = 20
    loss_factor: float = 1e-3
