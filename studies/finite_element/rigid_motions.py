"""Whether constraints let a structure move as one body."""

from __future__ import annotations

import numpy as np

from solver.model import FloatArray
from studies.finite_element.reduction import PreparedModel


def rigid_motions(points: FloatArray) -> FloatArray:
    """Motions (n, 3, 6) of points (n, 3), m, as one body: three translations, m, and turns about the axes, rad."""
    turns = np.swapaxes(np.cross(np.eye(3), points[:, None]), 1, 2)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)


def find_resistance(prepared: PreparedModel, motions: FloatArray) -> tuple[float, str]:
    """How much constraints resist a motion as one body, Hz, and which of them resists most; 0 where none does.

    motions (3 n_nodes, 6): three translations and three turns, of a cyclic sector about a point on its axis. Where some
    displacements of a motion r depend on others, all that follow these are e away from it: the frequency is that of the
    strain energy, `omega^2 = e^H K e / (r^H M r)`. What is held does not count. Of a cyclic sector the motions across
    the axis are waves of nodal diameter 1. Raises SceneError as `Structure.coordinates`.
    """
    structure, ways = prepared.structure, {0: np.eye(3)}
    if structure.cut is not None:
        axis = structure.cut.axis.axis
        across = np.linalg.svd(axis[None])[2][1]
        ways = {0: axis[:, None], 1: (across + 1j * np.cross(axis, across))[:, None]}
    worst, shares = 0.0, np.zeros(len(motions))
    for nodal_diameter, way in ways.items():
        for motion in np.hstack([motions[:, :3] @ way, motions[:, 3:] @ way]).T:
            apart, total = structure.deviation(motion, nodal_diameter)
            forces = prepared.forms.get("elastic", prepared.forms["stiffness"]) @ (total @ apart)
            own = ((total.conj().T @ forces).conj() * apart).real
            inertia = np.vdot(motion, prepared.forms["mass"] @ motion).real
            if inertia > 0.0 and own.sum() > worst * inertia:
                worst, shares = own.sum() / inertia, own
    names = {**structure.constraints.origin, **dict(zip(structure.followers.tolist(), structure.labels, strict=True))}
    sums: dict[str, float] = {}
    for node in np.flatnonzero(shares.reshape(-1, 3).any(axis=1)).tolist():
        sums[names[node]] = sums.get(names[node], 0.0) + shares[3 * node : 3 * node + 3].sum()
    return float(np.sqrt(worst) / (2.0 * np.pi)), max(sums, key=lambda name: sums[name], default="")
