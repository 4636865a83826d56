"""The virtual friction beam of nonlinear modal testing.

A clamped steel beam with an elastic friction element (a spring of 1.3e6 N/m that slips at 1 N): Scheel, Peter, Leine
and Krack, "A phase resonance approach for modal testing of structures with nonlinear dissipation", Journal of Sound and
Vibration 435 (2018); the parameters are those of scripts that their authors and others have published with NLvib.
"""

import numpy as np
import scipy.linalg

from solver import build_model

SPRING, LIMIT = 1.3e6, 1.0  # N/m, N


def matrices(n_elements=7, at=3):
    """Mass, damping, stiffness without the friction element, and the index of its place.

    at: number of elements from the clamp to the element. The damping is 0.8 and 0.2 % of the first two stuck modes.
    """
    length, bending, line = 0.7 / n_elements, 185e9 * 0.03**4 / 12.0, 7830.0 * 0.03**2
    x = length
    stiff = [[12, 6 * x, -12, 6 * x], [6 * x, 4 * x * x, -6 * x, 2 * x * x]]
    stiff += [[-12, -6 * x, 12, -6 * x], [6 * x, 2 * x * x, -6 * x, 4 * x * x]]
    heavy = [[156, 22 * x, 54, -13 * x], [22 * x, 4 * x * x, 13 * x, -3 * x * x]]
    heavy += [[54, 13 * x, 156, -22 * x], [-13 * x, -3 * x * x, -22 * x, 4 * x * x]]
    mass, stiffness = np.zeros((2, 2 * n_elements + 2, 2 * n_elements + 2))
    for first in range(0, 2 * n_elements, 2):
        own = slice(first, first + 4)
        stiffness[own, own] += bending / x**3 * np.array(stiff)
        mass[own, own] += line * x / 420.0 * np.array(heavy)
    mass, stiffness, place = mass[2:, 2:], stiffness[2:, 2:], 2 * at - 2
    stuck = stiffness.copy()
    stuck[place, place] += SPRING
    omega = np.sqrt(scipy.linalg.eigh(stuck, mass, eigvals_only=True)[:2])
    by_mass, by_stiffness = np.linalg.solve(np.stack([1.0 / omega, omega], axis=1), [0.016, 0.004])
    return mass, by_mass * mass + by_stiffness * stuck, stiffness, place


def friction_beam(**place):
    """The beam as a model: the end of the spring, without mass, rubs on the ground."""
    mass, damping, stiffness, at = matrices(**place)
    grown = [np.pad(part, (0, 1)) for part in (mass, damping, stiffness)]
    grown[2][[at, at, -1, -1], [at, -1, at, -1]] += SPRING * np.array([1.0, -1.0, -1.0, 1.0])
    load = np.eye(len(grown[0]))[-3]
    return build_model(
        *grown, [[-1, len(load) - 1, -1]], 1e-4, load_harmonic=load, normal_load=LIMIT, response=[len(load) - 3]
    )
