"""The virtual friction beam of nonlinear modal testing, and its mode by a plain harmonic balance.

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


def plain_mode(amplitudes, orders=tuple(range(1, 20, 2)), n_samples=512):
    """Frequency, Hz, and damping ratio at ascending modal amplitudes, m sqrt(kg): extended periodic motion concept.

    Unknowns are the odd harmonics of the motion at the friction element, the frequency and the damping ratio.
    """
    mass, damping, stiffness, place = matrices()
    unit, number = np.eye(len(mass))[place], np.array(orders)
    phases = 2.0 * np.pi * np.arange(n_samples) / n_samples
    waves = np.exp(1j * np.outer(number, phases))

    def force_of(moved):
        signal, force, seen = np.real(moved @ waves), 0.0, np.zeros(n_samples)
        # the second period is periodic
        for sample in range(2 * n_samples):
            step = signal[sample % n_samples] - signal[sample % n_samples - 1]
            force = min(max(force + SPRING * step, -LIMIT), LIMIT)
            seen[sample % n_samples] = force
        return 2.0 / n_samples * (waves.conj() @ seen)

    def residual(unknown, amplitude):
        moved = amplitude * (unknown[: number.size] + 1j * unknown[number.size : -2])
        omega, ratio = 300.0 * unknown[-2], 0.01 * unknown[-1]
        force, left = force_of(moved), []
        for place, order in enumerate(orders):
            rate = order * omega
            full = stiffness + 1j * rate * (damping - 2.0 * ratio * omega * mass) - rate**2 * mass
            if order > 1:
                left.append((moved[place] + np.linalg.solve(full, unit)[unit > 0.0][0] * force[place]) / amplitude)
                continue
            # the first harmonic of all displacements follows from that of the element, by all equations but one
            kept = unit == 0.0
            shape = np.zeros(len(unit), complex)
            shape[~kept] = moved[0]
            shape[kept] = -np.linalg.solve(full[np.ix_(kept, kept)], full[np.ix_(kept, ~kept)][:, 0] * moved[0])
            left.append((full[~kept] @ shape + force[0])[0] / (1e6 * amplitude))
            size = np.vdot(shape, mass @ shape).real / amplitude**2
        left = np.array(left)
        return np.concatenate([left.real, left.imag, [size - 1.0, moved[0].imag / amplitude]])

    squares, shapes = scipy.linalg.eigh(stiffness + SPRING * np.outer(unit, unit), mass)
    unknown = np.concatenate(
        [[abs(shapes[place, 0])], np.zeros(2 * number.size - 1), [np.sqrt(squares[0]) / 300.0, 0.8]]
    )
    found = []
    for amplitude in amplitudes:
        for _ in range(20):
            here = residual(unknown, amplitude)
            if np.abs(here).max() < 1e-9:
                break
            moved = unknown + 1e-7 * np.eye(unknown.size)
            slopes = np.array([residual(one, amplitude) - here for one in moved]) / 1e-7
            unknown = unknown - np.linalg.solve(slopes.T, here)
        else:
            raise ArithmeticError(amplitude)
        found.append([300.0 * unknown[-2] / (2.0 * np.pi), 0.01 * unknown[-1]])
    return np.array(found).T
