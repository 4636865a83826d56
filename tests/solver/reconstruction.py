"""The structures and the contact law of the solver once more, slow and plain.

Nothing here passes through the condensed structure, the kernels or the penalty of the solver. The law is written from
Eqs. (11)-(15) in the convention of the project.
"""

import numpy as np

from solver.model import FloatArray, LinearModel, ReducedModel


def harmonic_structure(model: ReducedModel, harmonic: int) -> LinearModel:
    """Structure that a harmonic sees, conjugated where its nodal diameter is folded: matrices, not `Z`."""
    if model.n_sectors == 0:
        return model.linear[0]
    wrapped = harmonic * model.nodal_diameter % model.n_sectors
    if 2 * wrapped <= model.n_sectors:
        return model.linear[wrapped]
    folded = model.linear[model.n_sectors - wrapped]
    turned = (each.conj() for each in (folded.mass, folded.damping, folded.stiffness))
    return LinearModel(*turned, folded.load_static, folded.load_harmonic.conj(), folded.response.conj())


def project(force: FloatArray, radius: float) -> FloatArray:
    """Point of the Coulomb disc nearest to a tangential force (2,)."""
    size = float(np.hypot(*force))
    return force if size <= radius else force * (radius / size)


def pair_period(predicted: FloatArray, friction: float, slip: FloatArray, passes: int) -> tuple[FloatArray, FloatArray]:
    """Contact force (3, N) and slip at the N + 1 ends of the samples (2, N + 1) of the last of some passes.

    predicted (3, N), N. slip (2,): at the start, in force units. A spring of unit stiffness ties the slider to the
    predicted force: what it pulls beyond the disc moves the slider.
    """
    force = np.zeros_like(predicted)
    trace = [np.array(slip, float)]
    for _ in range(passes):
        trace = [trace[-1]]
        for n in range(predicted.shape[1]):
            pull = predicted[1:, n] - trace[-1]
            force[0, n] = max(predicted[0, n], 0.0)
            force[1:, n] = project(pull, friction * force[0, n])
            trace.append(trace[-1] + (pull - force[1:, n]))
        if np.array_equal(trace[-1], trace[0]):
            break  # all further passes are the same
    return force, np.array(trace).T


def status(predicted: FloatArray, friction: float, slip: FloatArray) -> FloatArray:
    """0 separated, 1 stick, 2 slip, by the states before each sample (2, N); N integers."""
    pull = np.hypot(*(predicted[1:] - slip))
    return np.where(predicted[0] <= 0, 0, np.where(pull < friction * predicted[0], 1, 2))


def mass_period(
    predicted: FloatArray, limit: FloatArray, mass: float, drag: float, step: float, passes: int = 4
) -> tuple[FloatArray, FloatArray]:
    """Friction force and velocity (2, N) of `m v' + c v = p(t) - lambda`, |lambda| <= limit(t), in the last of some
    periods from rest, by implicit Euler steps, s.

    predicted (2, N), N, and limit (N,), N, at the middles of the steps. The force is the one on the disc that is
    nearest to what would stop the mass.
    """
    force, moved, velocity = np.zeros((2, limit.size)), np.zeros((2, limit.size)), np.zeros(2)
    for _ in range(passes):
        for n in range(limit.size):
            stopping = predicted[:, n] + mass / step * velocity
            force[:, n] = project(stopping, limit[n])
            velocity = (stopping - force[:, n]) / (mass / step + drag)
            moved[:, n] = velocity
    return force, moved
