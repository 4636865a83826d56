"""A clamped, cyclic sector: which nodes move freely, and which follow others.

A sector and its neighbour in the sense of +z rotation move alike with the interblade phase `phi = 2 pi k / N`:
`u_right = exp(i phi) R u_left` on the cut faces, R the rotation by one sector, `x(t) = Re(X exp(i w t))`.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray


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

    @property
    def master(self) -> IntArray:
        """Node (n_nodes,) that each node follows: its image on the left cut face, or itself; -1 where it is held."""
        master = np.arange(self.n_nodes)
        master[self.right] = self.left
        master[np.isin(master, self.clamped)] = -1
        return master

    @property
    def turned(self) -> BoolArray:
        """Nodes (n_nodes,) of the right cut face, which move as `phase * rotation` times their masters."""
        turned = np.zeros(self.n_nodes, dtype=np.bool_)
        turned[self.right] = True
        return turned

    @property
    def rotation(self) -> FloatArray:
        """R (3, 3): rotation by one sector about z."""
        angle = 2.0 * np.pi / self.n_sectors
        return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    def phase(self, nodal_diameter: int) -> complex | float:
        """`exp(i phi)` of a nodal diameter in 0..n_sectors // 2, real at both ends."""
        if nodal_diameter == 0:
            return 1.0
        if 2 * nodal_diameter == self.n_sectors:
            return -1.0
        return cmath.exp(2j * np.pi * nodal_diameter / self.n_sectors)

    def followers(self, place: IntArray, n_places: int, nodal_diameter: int) -> sparse.csr_matrix:
        """Displacements (3 n_nodes, 3 n_places) of all nodes from those of the free ones.

        place (n_nodes,): of the displacement of a free node, or of the master of one that follows, -1 for a held one.
        """
        phase = self.phase(nodal_diameter)
        blocks = np.tile(np.eye(3, dtype=type(phase)), (self.n_nodes, 1, 1))
        blocks[self.right] = phase * self.rotation
        moving = place >= 0
        starts = np.concatenate([[0], np.cumsum(moving)])
        shape = (3 * self.n_nodes, 3 * n_places)
        return sparse.bsr_matrix((blocks[moving], place[moving], starts), shape=shape).tocsr()
