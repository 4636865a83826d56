"""Two half-spaces in contact, apart from the solver: pressures by an active set, and the profile worn in the end."""

import numpy as np

from solver.model import FloatArray, ReducedModel


def compliances(model: ReducedModel) -> tuple[FloatArray, FloatArray]:
    """Normal and tangential compliance of the pairs, (n, n), m/N, from the stiffness of the model."""
    n, stiffness = model.contact.n_contact, model.linear[0].stiffness
    return np.linalg.inv(stiffness[:n, :n]), np.linalg.inv(stiffness[n : 2 * n, n : 2 * n])


def pressed(model: ReducedModel, load: float, among: np.ndarray | None = None) -> tuple[FloatArray, float]:
    """Normal forces (n,), N, and approach, m, under a load, N, of pairs that take compression alone.

    among: pairs that may touch, all of them if not given.
    """
    compliance, _ = compliances(model)
    gap, n = model.contact.gap, model.contact.n_contact
    touching = np.ones(n, bool) if among is None else among.copy()
    while True:
        m = int(touching.sum())
        matrix = np.ones((m + 1, m + 1))
        matrix[:m, :m], matrix[m, m] = -compliance[np.ix_(touching, touching)], 0.0
        found = np.linalg.solve(matrix, np.append(gap[touching], load))
        force = np.zeros(n)
        force[touching] = found[:-1]
        if (force >= 0.0).all():
            return force, float(found[-1])
        touching &= force > 0.0


def limit_depth(model: ReducedModel, stuck: np.ndarray) -> FloatArray:
    """Depths (n,), m, at which the stuck pairs carry all of the load and the others just touch no longer."""
    load = float(model.linear[0].load_static[2 * model.contact.n_contact])
    force, approach = pressed(model, load, stuck)
    assert (force[stuck] > 0.0).all()
    overlap = approach - compliances(model)[0] @ force - model.contact.gap
    return np.where(stuck, 0.0, np.maximum(overlap, 0.0))
