"""Modes of a blade alone, by which the sectors of a ring deviate."""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh

from solver.model import FloatArray
from studies.finite_element.reduction import PreparedModel
from studies.scene_error import SceneError

N_MODES = 3
"""Modes of the blade alone whose frequencies deviate, as fundamental models of mistuning have it. With 1, 3, 6 and 10
of them the first family of a ring of 12 dovetail sectors, one of which is 2 % off, is equal to 3e-5. Families that
other modes of the blade make do not deviate (565.8 Hz with six modes is 562.8 Hz with three)."""


def blade_modes(prepared: PreparedModel, load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Frequencies (m,) of the blade alone, Hz, and nodal forces (3 n_nodes, m), `omega M phi`, of modes of unit mass.

    The blade is the body on which the load (3 n_nodes,) acts. Where it is clamped or has cut faces these hold it, else
    its contact pairs do. Its modes are those of the prestressed stiffness.
    Raises SceneError where the body depends on others, or nothing holds it.
    """
    structure, stiffness, mass = prepared.structure, prepared.forms["stiffness"], prepared.forms["mass"]
    n_nodes = len(structure.held)
    node = sparse.kron(sparse.eye(n_nodes), np.ones((1, 3)), format="csr")
    parts = connected_components(node @ abs(stiffness) @ node.T, directed=False)[1]
    body = np.isin(parts, parts[load.reshape(-1, 3).any(axis=1)])
    held, cut = structure.held & body[:, None], structure.cut
    pairs = structure.pairs
    paired = np.union1d(pairs.moving, np.unique(pairs.opposite.indices))
    bound = np.setdiff1d(structure.followers, np.concatenate([paired] if cut is None else [paired, cut.right]))
    if body[bound].any() or structure.constraints.dependent[body].any():
        remedy = "give a deck whose blade is one body of elements"
        raise SceneError("sectors", "the excited body has ties or constraints: its own modes are not known", remedy)
    if cut is not None:
        held[np.intersect1d(np.concatenate([cut.left, cut.right]), np.flatnonzero(body))] = True
    if not held.any():
        held[paired[body[paired]]] = True
    free = np.flatnonzero(body[:, None] & ~held)
    own, inertia = (form[free][:, free].tocsc() for form in (stiffness, mass))
    if not held.any() or not free.size:
        raise SceneError("sectors", "nothing holds the excited body alone", "give its root contact pairs or a clamp")
    count = min(N_MODES, free.size - 1)
    squares, modes = eigsh(own, count, inertia, sigma=0.0, v0=np.ones(free.size))
    forces = np.zeros((3 * n_nodes, count))
    forces[free] = (inertia @ modes) * np.sqrt(squares)
    return np.sqrt(squares) / (2.0 * np.pi), forces
