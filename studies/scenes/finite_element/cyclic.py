"""From free nodal displacements to the coordinates of a clamped, cyclic sector with contact pairs.

A sector and its neighbour in the sense of +z rotation move alike with the interblade phase `phi = 2 pi k / N`:
`u_right = exp(i phi) R u_left` on the cut faces, R the rotation by one sector, `x(t) = Re(X exp(i w t))`.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import IntArray
from studies.scenes.finite_element.contact_pairs import ContactPairs


@dataclass(frozen=True)
class CyclicSector:
    """What is held and tied.

    n_nodes: of the sector. clamped: nodes that do not move. left, right: nodes of the cut faces, image by image;
    clamped ones may be among them.
    """

    n_nodes: int
    n_sectors: int
    clamped: IntArray
    left: IntArray
    right: IntArray


@dataclass(frozen=True)
class SectorCoordinates:
    """Nodal displacements = relative @ u_rel + glued @ y.

    glued (3 n_nodes, n_glued): the sector with the pairs glued, at one nodal diameter; complex where that is neither 0
    nor n_sectors / 2. relative (3 n_nodes, 3 n_contact): the moving nodes of the pairs, pair by pair (normal, first,
    second tangent).
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix


def build_coordinates(sector: CyclicSector, pairs: ContactPairs, nodal_diameter: int) -> SectorCoordinates:
    """Coordinates of the sector at a nodal diameter in 0..n_sectors // 2."""
    angle = 2.0 * np.pi / sector.n_sectors
    phase: complex | float
    if nodal_diameter == 0:
        phase = 1.0
    elif 2 * nodal_diameter == sector.n_sectors:
        phase = -1.0
    else:
        phase = cmath.exp(1j * angle * nodal_diameter)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    # Every node follows a master: itself, its image on the left cut face, or the fixed node of its pair.
    master = np.arange(sector.n_nodes)
    master[sector.right] = sector.left
    master[pairs.moving] = pairs.fixed
    blocks = np.tile(np.eye(3, dtype=type(phase)), (sector.n_nodes, 1, 1))
    blocks[sector.right] = phase * rotation
    blocks[np.isin(master, sector.clamped)] = 0.0

    free = np.setdiff1d(master, sector.clamped)
    column = np.zeros(sector.n_nodes, dtype=np.int64)
    column[free] = np.arange(len(free))
    starts = np.arange(sector.n_nodes + 1)
    glued = sparse.bsr_matrix((blocks, column[master], starts), shape=(3 * sector.n_nodes, 3 * len(free))).tocsr()
    glued.eliminate_zeros()
    return SectorCoordinates(glued=glued, relative=_relative(pairs, sector.n_nodes))


def _relative(pairs: ContactPairs, n_nodes: int) -> sparse.csr_matrix:
    """Nodal displacements (3 n_nodes, 3 n_contact) from the relative displacements in the local frames."""
    n_contact = len(pairs.moving)
    order = np.argsort(pairs.moving)
    starts = np.searchsorted(pairs.moving[order], np.arange(n_nodes + 1))
    blocks = np.swapaxes(pairs.frames, 1, 2)[order]
    return sparse.bsr_matrix((blocks, order, starts), shape=(3 * n_nodes, 3 * n_contact)).tocsr()
