"""Rows of matrices whose entries are labelled by node and dof instead of by row and column."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studies.fe_models.matrices.matrices import LARGEST_DOFS, FloatArray, IntArray, Triplets, wrong

_MOST_NODES = 2**40  # numbers that fit into a label, negative ones as well


@dataclass(frozen=True)
class LabelledMatrices:
    """Stiffness and mass by rows, and node and direction (n_dof,) of the rows, ascending."""

    stiffness: Triplets
    mass: Triplets
    node: IntArray
    direction: IntArray


def from_labels(
    stiffness: IntArray, mass: IntArray, stiffness_values: FloatArray, mass_values: FloatArray, files: tuple[str, ...]
) -> LabelledMatrices:
    """Rows of two matrices with the same dofs.

    Parameters
    ----------
    stiffness, mass
        (m, 4) node and dof (from 1) of the row, node and dof of the column of each entry.
    stiffness_values, mass_values
        (m,)
    files
        Of the stiffness and of the mass, which may be one, for messages.

    Raises
    ------
    SceneError
        Where a dof is none of 1 to 3, or there are too many.
    """
    for labels, file in ((stiffness, files[0]), (mass, files[-1])):
        dofs = labels[:, 1::2]
        if dofs.min() < 1 or dofs.max() > 3:
            entry = int(np.flatnonzero(((dofs < 1) | (dofs > 3)).any(axis=1))[0])
            node, dof = next((n, d) for n, d in labels[entry].reshape(2, 2) if not 1 <= d <= 3)
            wrong(file, f"node {node} has the dof {dof}", "export a model of solid elements: dofs 1 to 3")
        if labels[:, ::2].min() < -_MOST_NODES or labels[:, ::2].max() > _MOST_NODES:
            wrong(file, f"node {abs(labels[:, ::2]).max()}", "give node numbers of at most ten digits")
    # one number for node and dof, ascending with both
    keys = [4 * labels[:, ::2] + labels[:, 1::2] for labels in (stiffness, mass)]
    unique = np.union1d(keys[0], keys[1])
    if unique.size > LARGEST_DOFS:
        wrong(files[0], f"{unique.size} dofs", f"reduce the model to at most {LARGEST_DOFS}")
    triplets = [
        Triplets(np.searchsorted(unique, key[:, 0]), np.searchsorted(unique, key[:, 1]), values)
        for key, values in zip(keys, (stiffness_values, mass_values), strict=True)
    ]
    return LabelledMatrices(triplets[0], triplets[1], unique // 4, unique % 4 - 1)
