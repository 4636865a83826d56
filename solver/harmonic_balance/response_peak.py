"""The largest magnitude of the responses over a period, including the tail of friction on rigid ground.

The time samples give the harmonics of the friction force on a mass above the highest harmonic of the balance
(`ContactLaw.tail`). The structure answers them by its receptance, `u_n = -lambda_n / Z_n` (tail closure, PHYSICS,
section 5). At the turn of the mass all these harmonics have one sign, so that the truncation error of the peak falls
only with the square of the highest harmonic. Other pairs have no tail: their forces have corners only.
"""

from __future__ import annotations

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray
from solver.settings import FINE_SAMPLES, SAMPLES_PER_HARMONIC
from solver.structure.condensation import build_structure
from solver.structure.fourier import build_basis, from_complex, to_complex
from solver.structure.joint import Joint


def largest_responses(joint: Joint, evaluation: Evaluation) -> FloatArray:
    """Largest magnitudes over a period of the responses (n_response,), m, the static ones included."""
    response_h = joint.structure.response_h(joint.to_relative(evaluation.displacement_h))
    response_t = response_h @ build_basis(joint.basis.orders, FINE_SAMPLES).synthesis
    orders = tail_orders(joint)
    if orders:
        response_t = response_t + tail_h(joint, evaluation, orders) @ build_basis(orders, FINE_SAMPLES).synthesis
    return np.asarray(np.abs(response_t).max(axis=1))


def tail_orders(joint: Joint) -> tuple[int, ...]:
    """Harmonics of the tail, above the highest harmonic of the balance.

    Only odd harmonics where the balance has only odd ones; none where no mass sits on rigid ground.
    """
    orders = joint.basis.orders
    if not orders or not joint.law.rate_dependent:
        return ()
    stride = 2 if orders[-1] > 1 and all(order % 2 for order in orders) else 1
    # three times the highest harmonic: what the usual samples of a harmonic still resolve
    resolved = (SAMPLES_PER_HARMONIC // 2 - 1) * orders[-1]
    last = min(resolved, joint.basis.n_samples // 2 - orders[-1], FINE_SAMPLES // 4)
    return tuple(order for order in range(orders[-1] + stride, last + 1, stride) if joint.model.holds(order))


def tail_h(joint: Joint, evaluation: Evaluation, orders: tuple[int, ...]) -> FloatArray:
    """Responses (n_response, 2k+1), m, to the friction on masses in k harmonics above the highest one."""
    still = np.zeros(joint.structure.static_response.shape[0])
    try:
        # the load acts in the first harmonic alone
        structure = build_structure(joint.model, joint.omega, 0.0, orders)
    except np.linalg.LinAlgError:
        # the structure with its joint held is singular at one of these harmonics
        return np.zeros((still.size, 2 * len(orders) + 1))
    force_h = joint.law.tail(evaluation, build_basis(orders, joint.basis.n_samples))
    force = to_complex(joint.to_relative(force_h)).T[:, :, None]
    moved = -np.linalg.solve(structure.dynamic_stiffness, force)
    return from_complex(still, np.matmul(structure.dynamic_response, moved)[:, :, 0].T)
