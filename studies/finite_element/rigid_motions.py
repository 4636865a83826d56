"""Whether constraints let a structure move as one body, as they do where bodies that they join touch each other."""

from __future__ import annotations

import numpy as np

from solver.model import FloatArray, Matrix
from studies.finite_element.reduction import PreparedModel

_MASSLESS = 1e-9  # of the mass of a motion beside those of its translations and turns


def rigid_motions(points: FloatArray) -> FloatArray:
    """Motions (n, 3, 6) of points (n, 3), m, as one body: three translations, m, and turns about the axes, rad."""
    turns = np.swapaxes(np.cross(np.eye(3), points[:, None]), 1, 2)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)


def find_resistance(prepared: PreparedModel, motions: FloatArray) -> tuple[float, str]:
    """How much constraints resist a motion as one body, Hz, and which of them resists most.

    Displacements that depend on none are those of the motion r, and the others, u - r away from it, follow them: the
    frequency is that of the strain energy, `omega^2 = (u - r)^H K (u - r) / (r^H M r)`, of the motion for which it is
    largest; 0 where no constraint resists. What is held does not count. Of a cyclic sector the motions across the axis
    are waves of nodal diameter 1. motions (3 n_nodes, 6): see `rigid_motions`.

    Raises SceneError as `Structure.coordinates`.
    """
    structure = prepared.structure
    stiffness, mass = prepared.forms.get("elastic", prepared.forms["stiffness"]), prepared.forms["mass"]
    waves = {0: motions}
    if structure.cut is not None:
        axis = structure.cut.axis
        first = np.linalg.svd(axis.axis[None])[2][1]
        second = np.cross(axis.axis, first)
        about = rigid_motions(axis.point[None])[0]
        moves, turns = motions[:, :3], motions[:, 3:] - motions[:, :3] @ about[:, 3:]
        along, across = axis.axis[:, None], (first + 1j * second)[:, None]
        waves = {k: np.hstack([moves @ way, turns @ way]) for k, way in ((0, along), (1, across))}
    found = [(0.0, np.zeros(len(motions)))]
    for nodal_diameter, motion in waves.items():
        apart, total = structure.deviation(motion @ _of_unit_mass(motion.conj().T @ (mass @ motion)), nodal_diameter)
        if not apart.size:  # no mass
            continue
        away = total @ apart
        forces = stiffness @ away
        squares, vectors = np.linalg.eigh(away.conj().T @ forces)
        # of the energy, where it comes from
        shares = ((total.conj().T @ (forces @ vectors[:, -1])).conj() * (apart @ vectors[:, -1])).real
        found.append((float(squares[-1]), shares))
    square, shares = max(found, key=lambda each: each[0])
    names = {**structure.constraints.origin, **dict(zip(structure.followers.tolist(), structure.labels, strict=True))}
    sums: dict[str, float] = {"": 0.0}
    for node, share in enumerate(shares.reshape(-1, 3).sum(axis=1).tolist()):
        if share:
            sums[names[node]] = sums.get(names[node], 0.0) + share
    return float(np.sqrt(max(square, 0.0)) / (2.0 * np.pi)), max(sums, key=lambda name: sums[name])


def _of_unit_mass(inertia: Matrix) -> Matrix:
    """Sums (n, m) of motions, whose masses are (n, n), that have a mass of 1 each; those without mass are left out."""
    sizes = np.sqrt(np.diag(inertia).real)
    scale = np.divide(1.0, sizes, where=sizes > 0.0, out=np.zeros_like(sizes))
    values, sums = np.linalg.eigh(inertia * scale * scale[:, None])
    heavy = values > _MASSLESS
    return np.asarray(scale[:, None] * sums[:, heavy] / np.sqrt(values[heavy]))
