"""Inputs of the kernel tests, and the results that are compared with and without compilation."""

from dataclasses import dataclass

import numba
import numpy as np

from solver.contact.coulomb import mean_normal_force, mean_normal_tangent
from solver.contact.elastic_pairs import Period, march_period, march_tangent, new_period
from solver.contact.sliding_masses import Masses, march_masses, mass_tangent
from solver.model import FloatArray, IntArray
from solver.structure.fourier import FourierBasis, build_basis

FRICTION = 0.4
ORDERS = (1, 2, 3)
BASIS = build_basis(ORDERS, 20)
MASS_BASIS = build_basis(ORDERS, 32)


@dataclass(frozen=True)
class KernelCase:
    """Pairs that stick, slip and open within the period; the last one has a constant normal force."""

    predicted_h: FloatArray
    predicted_t: FloatArray
    start: FloatArray


def kernel_case(n_contact: int, n_samples: int, seed: int) -> KernelCase:
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(n_contact, 3, 7)) * 10.0
    predicted_h[:, 0, 0] = 15.0
    predicted_h[-1, 0, 1:] = 0.0
    synthesis = build_basis(ORDERS, n_samples).synthesis
    return KernelCase(predicted_h, predicted_h @ synthesis, random.normal(size=(n_contact, 2)) * 5.0)


@dataclass(frozen=True)
class MassCase:
    """Masses on sliders, of which one in three has the first tangent only and one the second only."""

    predicted_h: FloatArray
    mass: FloatArray
    drag: FloatArray
    line: IntArray
    basis: FourierBasis
    omega: float

    @property
    def step(self) -> float:
        return 2.0 * np.pi / self.omega / self.basis.n_samples

    def predicted_t(self, predicted_h: FloatArray) -> FloatArray:
        values = predicted_h @ self.basis.synthesis
        values[:, 1:] = (predicted_h[:, 1:] * self.basis.step_mean) @ self.basis.synthesis
        return values

    @property
    def masses(self) -> Masses:
        return Masses(self.mass, self.drag, self.line, self.step)


def mass_case(n_contact: int, seed: int, basis: FourierBasis = MASS_BASIS) -> MassCase:
    """Masses that stick, turn at once, slip and open; the last one has a constant normal force."""
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(n_contact, 3, basis.synthesis.shape[0])) * 4.0
    predicted_h[:, 1:, 0] *= 0.1
    predicted_h[:, 0] *= 2.0
    predicted_h[:, 0, 0] = 15.0
    predicted_h[-1, 0, 1:] = 0.0
    line = np.arange(n_contact) % 3 - 1
    predicted_h[line == 0, 2] = 0.0
    predicted_h[line == 1, 1] = 0.0
    mass, omega = random.uniform(0.5, 2.0, n_contact), 3.0
    return MassCase(predicted_h, mass, 0.1 * mass * omega, line, basis, omega)


def run_masses(case: MassCase, predicted_h: FloatArray) -> Period:
    n_contact = len(predicted_h)
    period = new_period(case.predicted_t(predicted_h), np.full(n_contact, FRICTION), np.zeros((n_contact, 2)))
    march_masses(np.arange(n_contact), period, case.masses)
    return period


def run_pairs(predicted_t: FloatArray, start: FloatArray, periodicity: float, most_periods: int) -> Period:
    period = new_period(predicted_t, np.full(len(start), FRICTION), start)
    march_period(np.arange(len(start)), period, periodicity, most_periods)
    return period


def kernel_results() -> dict[str, FloatArray]:
    """Results of all kernels, by name."""
    case, masses = kernel_case(3, BASIS.n_samples, seed=20), mass_case(6, seed=21)
    periods = run_pairs(case.predicted_t, case.start, 1e-9, 6), run_masses(masses, masses.predicted_h)
    out, mass_out = ((np.zeros((n, 21, 21)), np.zeros((n, 21))) for n in (3, 6))
    march_tangent(np.arange(3), periods[0], BASIS.synthesis, BASIS.analysis, out)
    mean_normal_tangent(np.arange(2), case.predicted_t, BASIS.synthesis, BASIS.analysis, out[0])
    series = MASS_BASIS.synthesis, MASS_BASIS.step_mean, MASS_BASIS.analysis
    mass_tangent(np.arange(6), periods[1], masses.masses, *series, mass_out)
    results = {f"{name} {kind}": value for kind in (0, 1) for name, value in periods[kind]._asdict().items()}
    tangents = dict(zip(("force", "work", "mass force", "mass work"), (*out, *mass_out), strict=True))
    results |= tangents | {"mean_normal": mean_normal_force(case.predicted_t)}
    return {name: np.asarray(values, float) for name, values in results.items()}


def save_results(path: str) -> None:
    np.savez(path, disabled=np.array(bool(numba.config.DISABLE_JIT)), **kernel_results())
