"""A finite-element model of a joint, and what is done with it, as arrays in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.constraints import Constraints
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.pairing import ContactPairs, ContactSurfaces
from studies.finite_element.solid_mesh import Rotation, SolidMesh


@dataclass(frozen=True)
class FeModel:
    """A model, whose nodes are those of a mesh.

    forms: "stiffness", N/m, "mass", kg, and where there is one "damping", N s/m, of another program, with their
    prestress and spin softening, (3 n_nodes, 3 n_nodes), symmetric and unconstrained; None where they are assembled
    here. prestress: whether the stiffness that is assembled contains the stress and the displacements of the glued
    structure under the centrifugal load, and spin softening. preload (3 n_nodes,): constant forces, N, and gravity
    (3,): acceleration of all mass, m/s2; no part of the prestress, as forces on gaps and flanks act otherwise on a
    glued structure.
    """

    mesh: SolidMesh
    rotation: Rotation | None = None
    prestress: bool = True
    preload: FloatArray | None = None
    gravity: FloatArray | None = None
    forms: Mapping[str, sparse.csr_matrix] | None = None


def mean_motion(nodes: IntArray, direction: FloatArray, n_nodes: int) -> FloatArray:
    """Row (3 n_nodes,) that gives the mean displacement of nodes (n,) along a direction (3,) of any length.

    As a load: a force of 1 N along the direction, shared evenly.
    """
    row = np.zeros((n_nodes, 3))
    np.add.at(row, nodes, direction / (np.linalg.norm(direction) * len(nodes)))
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

    held (n_nodes, 3): displacements that are 0, or follow others by the constraints. load (3 n_nodes,): harmonic load,
    N per unit of excitation amplitude. responses: rows (3 n_nodes,) by name. cut: None where the structure is no cyclic
    sector. ties: surfaces that are always glued. pairs: those of the contacts in another order or with other frames
    than `build_contact_pairs` gives them.
    """

    contacts: tuple[ContactSurfaces, ...]
    held: BoolArray
    load: FloatArray
    responses: Mapping[str, FloatArray]
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
