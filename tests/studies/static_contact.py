"""Static frictional contact of a reduced model by a plain alternating projection, apart from the solver."""

import numpy as np

from solver.model import FloatArray, ReducedModel


def solve_static_contact(model: ReducedModel, friction_coefficient: float, n_increments: int = 10) -> FloatArray:
    """Contact forces (n_contact, 3), N: normal (compression positive), first and second tangent.

    The static load is raised in equal increments. In each, u and its copy, which obeys the contact law together with
    the force, are brought together by augmented Lagrangian iterations until both stand still to 1e-10. For a model
    whose relative displacements come first and without gaps. Raises RuntimeError where the iterations do not end.
    """
    linear, n = model.linear[0], 3 * model.contact.n_contact
    inner = linear.stiffness[n:, n:]
    stiffness = linear.stiffness[:n, :n] - linear.stiffness[:n, n:] @ np.linalg.solve(inner, linear.stiffness[n:, :n])
    load = linear.load_static[:n] - linear.stiffness[:n, n:] @ np.linalg.solve(inner, linear.load_static[n:])
    values = np.linalg.eigvalsh(stiffness)
    penalty = 0.3 * np.sqrt(values[-1] * np.median(values))
    inverse = np.linalg.inv(stiffness + penalty * np.eye(n))
    force, copy = np.zeros(n), np.zeros(n)
    for share in np.linspace(0.0, 1.0, n_increments + 1)[1:]:
        start = copy.copy()
        start[0::3] = 0.0
        for _ in range(20000):
            displacement = inverse @ (share * load - force + penalty * copy)
            trial = (force + penalty * (displacement - start)).reshape(-1, 3)
            normal = np.maximum(trial[:, 0], 0.0)
            size = np.hypot(trial[:, 1], trial[:, 2])
            scale = np.minimum(1.0, friction_coefficient * normal / np.maximum(size, 1e-300))
            new = np.column_stack([normal, scale * trial[:, 1], scale * trial[:, 2]]).ravel()
            new_copy = displacement + (force - new) / penalty
            change = max(
                np.abs(new - force).max() / np.abs(new).max(), np.abs(new_copy - copy).max() / np.abs(new_copy).max()
            )
            force, copy = new, new_copy
            if change < 1e-10:
                break
        else:
            raise RuntimeError("the static contact iterations do not end")
    return force.reshape(-1, 3)
