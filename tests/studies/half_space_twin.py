"""Two half-spaces in contact, apart from the solver: pressures by an active set, and the profile worn in the end."""

import numpy as np

from solver.model import FloatArray, ReducedModel


def compliances(model: ReducedModel) -> tuple[FloatArray, FloatArray]:
    """Normal and tangential compliance of the pairs, (n, n), m/N, from the stiffness of the model."""
    n, stiffness = model.contact.n_contact, model.linear[0].stiffness
    return np.linalg.inv(stiffness[:n, :n]), np.linalg.inv(stiffness[n : 2 * n, n : 2 * n])


def solve_pressed(
    compliance: FloatArray, gap: FloatArray, load: float, among: np.ndarray | None = None
) -> tuple[FloatArray, float]:
    """Normal forces (n,), N, and approach, m, of a body pressed on pairs with these gaps, m.

    Pairs come and go until none is wrong. among: those that may touch, all of them if not given.
    """
    allowed = np.ones(len(gap), bool) if among is None else among
    touching = allowed
    while True:
        m = int(touching.sum())
        matrix = np.ones((m + 1, m + 1))
        matrix[:m, :m], matrix[m, m] = -compliance[np.ix_(touching, touching)], 0.0
        force, approach = np.zeros(len(gap)), 0.0
        *force[touching], approach = np.linalg.solve(matrix, np.append(gap[touching], load))
        again = allowed & np.where(touching, force > 0.0, compliance @ force + gap < approach)
        if (again == touching).all():
            return force, float(approach)
        touching = again


def pressed(model: ReducedModel, load: float, among: np.ndarray | None = None) -> tuple[FloatArray, float]:
    """The same of the pairs of a model."""
    return solve_pressed(compliances(model)[0], model.contact.gap, load, among)


def limit_depth(model: ReducedModel, stuck: np.ndarray) -> FloatArray:
    """Depths (n,), m, at which the stuck pairs carry all of the load and the others just touch no longer."""
    load = float(model.linear[0].load_static[2 * model.contact.n_contact])
    force, approach = pressed(model, load, stuck)
    assert (force[stuck] > 0.0).all()
    overlap = approach - compliances(model)[0] @ force - model.contact.gap
    return np.where(stuck, 0.0, np.maximum(overlap, 0.0))
