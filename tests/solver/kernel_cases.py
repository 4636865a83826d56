"""Inputs of the kernel tests, and the results that are compared with and without compilation."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from solver.harmonics import build_basis
from solver.kernels import march_period, march_tangent, mean_normal_force, wear_integral
from solver.model import BoolArray, FloatArray

FRICTION = 0.4
PERIODS = 3
BASIS = build_basis(3, 20)


@dataclass(frozen=True)
class KernelCase:
    """Pairs that stick, slip and open within the period; the last one has a constant normal force."""

    predicted_h: FloatArray
    predicted_t: FloatArray
    start: FloatArray
    at_velocity: BoolArray
    has_normal: BoolArray


def kernel_case(n_contact: int, n_samples: int, seed: int, at_velocity: bool) -> KernelCase:
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(n_contact, 3, 7)) * 10.0
    predicted_h[:, 0, 0] = 15.0
    has_normal = np.ones(n_contact, bool)
    has_normal[-1] = False
    predicted_h[-1, 0, 1:] = 0.0
    return KernelCase(
        predicted_h=predicted_h,
        predicted_t=predicted_h @ build_basis(3, n_samples).synthesis,
        start=random.normal(size=(n_contact, 2)) * 5.0,
        at_velocity=np.full(n_contact, at_velocity),
        has_normal=has_normal,
    )


def kernel_results() -> dict[str, FloatArray]:
    results: dict[str, FloatArray] = {}
    for at_velocity in (False, True):
        case = kernel_case(3, BASIS.n_samples, seed=20, at_velocity=at_velocity)
        force_t, state_t, status_t, passes, drift = march_period(
            case.predicted_t, FRICTION, case.start, case.at_velocity, 1e-9, 6
        )
        force_tangent, wear_tangent = march_tangent(
            case.predicted_t,
            FRICTION,
            case.start,
            case.at_velocity,
            passes,
            BASIS.synthesis,
            BASIS.analysis,
            case.has_normal,
        )
        level = "velocity" if at_velocity else "displacement"
        results |= {
            f"{level}_{name}": np.asarray(values, float)
            for name, values in (
                ("force", force_t),
                ("state", state_t),
                ("status", status_t),
                ("passes", passes),
                ("drift", drift),
                ("wear", wear_integral(force_t, state_t, case.at_velocity)),
                ("mean_normal", mean_normal_force(case.predicted_t)),
                ("force_tangent", force_tangent),
                ("wear_tangent", wear_tangent),
            )
        }
    return results


def save_results(path: str) -> None:
    np.savez(path, disabled=np.array(bool(numba.config.DISABLE_JIT)), **kernel_results())
