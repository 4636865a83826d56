"""Inputs of the kernel tests, and the results that are compared with and without compilation."""

from dataclasses import dataclass

import numba
import numpy as np

from solver.contact.coulomb import mean_normal_force, mean_normal_tangent
from solver.contact.period_march import integrate_slip_work, march_period
from solver.contact.rigid_slider import march_masses
from solver.contact.tangent import march_tangent, mass_tangent
from solver.model import BoolArray, FloatArray, IntArray
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
    has_normal: BoolArray


def kernel_case(n_contact: int, n_samples: int, seed: int) -> KernelCase:
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(n_contact, 3, 7)) * 10.0
    predicted_h[:, 0, 0] = 15.0
    has_normal = np.ones(n_contact, bool)
    has_normal[-1] = False
    predicted_h[-1, 0, 1:] = 0.0
    return KernelCase(
        predicted_h=predicted_h,
        predicted_t=predicted_h @ build_basis(ORDERS, n_samples).synthesis,
        start=random.normal(size=(n_contact, 2)) * 5.0,
        has_normal=has_normal,
    )


@dataclass(frozen=True)
class MassCase:
    """Masses on sliders, of which one in three has the first tangent only and one the second only.

    step_share (m,): harmonics of the mean over a step, over those of the samples.
    """

    predicted_h: FloatArray
    mass: FloatArray
    drag: FloatArray
    line: IntArray
    has_normal: BoolArray
    basis: FourierBasis
    omega: float
    step_share: FloatArray

    @property
    def step(self) -> float:
        return 2.0 * np.pi / self.omega / self.basis.n_samples

    def predicted_t(self, predicted_h: FloatArray) -> FloatArray:
        values = predicted_h @ self.basis.synthesis
        values[:, 1:] = (predicted_h[:, 1:] * self.step_share) @ self.basis.synthesis
        return values


def mass_case(n_contact: int, seed: int, basis: FourierBasis = MASS_BASIS, opens: bool = True) -> MassCase:
    """Masses that stick, turn at once, slip and (with `opens`) open; the last one has a constant normal force."""
    random = np.random.default_rng(seed)
    m = basis.synthesis.shape[0]
    predicted_h = random.normal(size=(n_contact, 3, m)) * 4.0
    predicted_h[:, 1:, 0] *= 0.1
    predicted_h[:, 0] *= 2.0 if opens else 0.5
    predicted_h[:, 0, 0] = 15.0
    has_normal = np.ones(n_contact, bool)
    has_normal[-1] = False
    predicted_h[-1, 0, 1:] = 0.0
    line = np.arange(n_contact) % 3 - 1
    predicted_h[line == 0, 2] = 0.0
    predicted_h[line == 1, 1] = 0.0
    mass = random.uniform(0.5, 2.0, n_contact)
    omega = 3.0
    angle = np.pi * np.array(basis.orders) / basis.n_samples
    share = np.ones(m)
    share[1::2] = share[2::2] = np.sin(angle) / angle
    return MassCase(predicted_h, mass, 0.1 * mass * omega, line, has_normal, basis, omega, share)


def run_masses(
    case: MassCase, predicted_h: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
    masses = case.mass, case.drag, case.line
    return march_masses(case.predicted_t(predicted_h), friction_of(predicted_h), masses, case.step)


def masses_tangent(case: MassCase, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    basis, share = case.basis, case.step_share
    given = case.predicted_t(case.predicted_h), friction_of(case.predicted_h), (case.mass, case.drag, case.line)
    series = basis.synthesis, basis.synthesis * share[:, None], basis.analysis / share
    out = no_tangents(len(start))
    mass_tangent(np.arange(len(start)), *given, case.step, start, case.has_normal, series, out)
    return out


def no_tangents(n_contact: int) -> tuple[FloatArray, FloatArray]:
    """Arrays for the derivatives of forces and slip work."""
    return np.zeros((n_contact, 21, 21)), np.zeros((n_contact, 21))


def friction_of(predicted: FloatArray) -> FloatArray:
    """Friction coefficient (n_contact,) of the pairs of a predicted force (n_contact, ...)."""
    return np.full(len(predicted), FRICTION)


def kernel_results() -> dict[str, FloatArray]:
    case = kernel_case(3, BASIS.n_samples, seed=20)
    friction = friction_of(case.predicted_t)
    force_t, state_t, status_t, periods, error = march_period(case.predicted_t, friction, case.start, 1e-9, 6)
    marched = case.predicted_t, friction, case.start, state_t, periods
    series, (force_tangent, wear_tangent) = (BASIS.synthesis, BASIS.analysis), no_tangents(3)
    march_tangent(np.arange(3), *marched, np.full(3, -1), case.has_normal, series, (force_tangent, wear_tangent))
    mean_normal_tangent(np.arange(2), case.predicted_t, *series, force_tangent)
    masses = mass_case(6, seed=21)
    mass_force_t, velocity_t, place_t, mass_status_t, slip_work, _ = run_masses(masses, masses.predicted_h)
    mass_force_tangent, mass_wear_tangent = masses_tangent(masses, velocity_t[:, :, 0])
    results = {
        "force": force_t,
        "state": state_t,
        "status": status_t,
        "periods": periods,
        "error": error,
        "wear": integrate_slip_work(force_t, state_t),
        "mean_normal": mean_normal_force(case.predicted_t),
        "force_tangent": force_tangent,
        "wear_tangent": wear_tangent,
        "mass_force": mass_force_t,
        "mass_velocity": velocity_t,
        "mass_place": place_t,
        "mass_status": mass_status_t,
        "mass_slip_work": slip_work,
        "mass_force_tangent": mass_force_tangent,
        "mass_wear_tangent": mass_wear_tangent,
    }
    return {name: np.asarray(values, float) for name, values in results.items()}


def save_results(path: str) -> None:
    np.savez(path, disabled=np.array(bool(numba.config.DISABLE_JIT)), **kernel_results())
