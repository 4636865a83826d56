"""Structured blocks of hexahedra, joined where their nodes coincide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from solver.model import FloatArray, IntArray


@dataclass(frozen=True)
class HexMesh:
    """Nodes and elements.

    nodes (n_nodes, 3): m. elements (n_elements, 8): corner nodes in the order of `elements.hex_element.CORNERS`.
    """

    nodes: FloatArray
    elements: IntArray


# Points closer than this, in m, are one node.
_SAME_NODE = 1e-9


def join_blocks(blocks: Sequence[FloatArray]) -> tuple[HexMesh, tuple[IntArray, ...]]:
    """One mesh of several blocks, and for each block the node numbers (n_i, n_j, n_k) of its grid.

    A block is a grid of points (n_i, n_j, n_k, 3), m, whose three directions are right-handed. Points of the blocks
    that coincide become one node.
    """
    points = np.concatenate([block.reshape(-1, 3) for block in blocks])
    pairs = cKDTree(points).query_pairs(_SAME_NODE, output_type="ndarray")
    touching = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, node_of_point = connected_components(touching, directed=False)
    _, first = np.unique(node_of_point, return_index=True)
    ends = np.cumsum([0] + [block[..., 0].size for block in blocks])
    grids = tuple(
        node_of_point[start:end].reshape(block.shape[:3]).astype(np.int64)
        for block, (start, end) in zip(blocks, pairwise(ends), strict=True)
    )
    return HexMesh(nodes=points[first], elements=np.concatenate([_cells(grid) for grid in grids])), grids


def graded(stations: Sequence[float], divisions: Sequence[int]) -> FloatArray:
    """Values through all stations, with so many equal divisions from each station to the next."""
    spans = zip(pairwise(stations), divisions, strict=True)
    parts = [np.linspace(start, end, n, endpoint=False) for (start, end), n in spans]
    return np.append(np.concatenate(parts), stations[-1])


def _cells(grid: IntArray) -> IntArray:
    """Corner nodes (n_cells, 8) of the cells of a grid of node numbers."""
    n_i, n_j, n_k = (size - 1 for size in grid.shape)
    corners = [grid[i : i + n_i, j : j + n_j, k : k + n_k] for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return np.stack(corners, axis=-1).reshape(-1, 8)
