"""The gradient of a scalar of a periodic state by all parameters of the joint, with one transposed solve.

With the state R(p, a) = 0 at the parameters a, and a scalar s(p, a),

    ds/da = (ds/da)_p - y . (dR/da)_p,      J^T y = (ds/dp)_a,

where J = dR/dp is the Jacobian of Eq. (16). So one y serves all parameters, however many pairs there are.
"""

from dataclasses import dataclass

import numpy as np

from solver.continuation.phase_lag import frequency_derivative
from solver.harmonic_balance import parameters
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.parameters import PairSlope
from solver.harmonic_balance.state import first_response
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.settings import NEGLIGIBLE
from solver.structure.condensation import build_structure


@dataclass(frozen=True)
class Gradient:
    """A scalar of a periodic state, and its derivatives along the state, at a constant tangential history of the pairs,
    constant wear depths, and a constant penalty of the computation. Where a slider of Iwan's element has come to rest
    at its limit, the derivative has two sides, and this is one of them.

    - value: amplitude of the first harmonic of a response, m, or wear rate of all pairs together, m3 per cycle.
    - by_frequency, by_excitation_amplitude: per Hz, per N.
    - by_friction_coefficient, by_gap, by_contact_stiffness (n_contact,): of each pair, per 1, m, N/m3.
    - by_wear_coefficient: by its logarithm, in the unit of the value.
    """

    value: float
    by_frequency: float
    by_excitation_amplitude: float
    by_friction_coefficient: FloatArray
    by_gap: FloatArray
    by_contact_stiffness: FloatArray
    by_wear_coefficient: float


def gradient_of(
    balance: Balance,
    at: Evaluation,
    response: int = 0,
    wear_coefficient: float | None = None,
    contact_stiffness: FloatArray | float = np.inf,
) -> Gradient:
    """Gradient of the amplitude of a response, by its number, in a state of a balance; or, where a wear coefficient is
    given, 1/Pa, of the wear rate by Archard's law, Eq. (2). contact_stiffness: of the model, N/m3, inf for rigid.

    Raises numpy.linalg.LinAlgError where the Jacobian is singular, as at a fold.
    """
    joint, tangent, frequency = balance.joint, balance.linearise(at), frequency_derivative(balance, at)
    on_motion = np.zeros_like(at.predicted_h)
    if wear_coefficient is None:
        amplitude, per_work = complex(first_response(joint, at)[response]), np.zeros(len(at.slip_work))
        value, turned = abs(amplitude), amplitude.conjugate() / max(abs(amplitude), 1e-300)
        weight = turned * joint.structure.dynamic_response[0, response]
        # a complex amplitude is cosine - i sine
        on_motion[:, 1], on_motion[:, 2] = weight.real, weight.imag
        unit = build_structure(joint.model, joint.omega, 1.0, joint.basis.orders)
        by_omega = (turned * frequency.response[response]).real
        by_amplitude = (turned * unit.harmonic_offset[response]).real
    else:
        per_work = wear_coefficient * joint.model.contact.after(at.energy).wear_factor[0]
        value, by_omega, by_amplitude = float(per_work @ at.slip_work), float(per_work @ frequency.slip_work), 0.0
    worn = joint.to_relative((per_work[:, None] * tangent.work_tangent).reshape(at.force_h.shape))
    right = tangent.by_predicted_force(on_motion, np.zeros_like(on_motion)) + worn
    solution = JacobianSolver().solve_transposed(tangent, right, NEGLIGIBLE)
    moved, forced = joint.to_pairs(on_motion - joint.structure.apply_transposed(solution)), joint.to_pairs(solution)

    def along(slope: PairSlope) -> FloatArray:
        return np.asarray((moved * slope.motion - forced * slope.force).sum(axis=(1, 2)) + per_work * slope.work)

    # the rate itself, and what a step of the depth has worn
    by_wear = float(per_work @ at.slip_work) + along(parameters.by_wear_coefficient(balance, at)).sum()
    return Gradient(
        value=value,
        by_frequency=2.0 * np.pi * float(by_omega - (solution * frequency.force).sum()),
        by_excitation_amplitude=float(by_amplitude - (solution * parameters.by_load(joint)).sum()),
        by_friction_coefficient=along(parameters.by_friction(balance, at, tangent)),
        by_gap=along(parameters.by_gap(at)),
        by_contact_stiffness=along(parameters.by_contact_stiffness(balance, at, contact_stiffness)),
        by_wear_coefficient=float(by_wear),
    )
