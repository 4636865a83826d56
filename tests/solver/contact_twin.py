"""The contact law once more, slow and plain, in displacements of a slider instead of force-like states.

Written from Eqs. (11)-(15) in the convention of the project; shares nothing with the kernels of the solver.
"""

import numpy as np

FloatArray = np.ndarray


def project(force: FloatArray, radius: float) -> FloatArray:
    """Point of the Coulomb disc nearest to a tangential force (2,)."""
    size = float(np.linalg.norm(force))
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
            normal = max(predicted[0, n], 0.0)
            pull = predicted[1:, n] - trace[-1]
            force[0, n] = normal
            force[1:, n] = project(pull, friction * normal)
            trace.append(trace[-1] + (pull - force[1:, n]))
        if np.array_equal(trace[-1], trace[0]):
            break  # all further passes are the same
    return force, np.array(trace).T


def status(predicted: FloatArray, friction: float, slip: FloatArray) -> FloatArray:
    """0 separated, 1 stick, 2 slip, by the states before each sample (2, N); N integers."""
    pull = np.hypot(*(predicted[1:] - slip))
    return np.where(predicted[0] <= 0, 0, np.where(pull < friction * predicted[0], 1, 2))
