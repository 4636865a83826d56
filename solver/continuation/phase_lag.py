"""A periodic state whose vibration lags behind its excitation by a given phase: the frequency is an unknown.

With the first harmonics x of all displacements and F of the excitation, `F^H x = |F^H x| exp(-i lag)`. The lag rises
from 0 below a resonance to pi above; the excitation does most work in phase resonance, at the lag pi/2. The unknowns
are the predicted force p and the frequency omega, the equations are the harmonic balance `R(p, omega) = 0`, in an
implicit step with the wear depth that grows with the motion, and

    sin(arg(F^H x) + lag) = 0.

Newton's method eliminates p: the solver of the Jacobian dR/dp gives the step of p for the residual and for the
frequency, and one equation remains. The wear depth is eliminated in the Jacobian, so that its change with the frequency
is part of the step.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import ComplexArray, FloatArray
from solver.newton.iteration import solve_newton
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget
from solver.options import COMMON
from solver.structure.fourier import to_complex
from solver.structure.frequency_slope import frequency_slope
from solver.structure.joint import Case, Joint


@dataclass(frozen=True)
class LaggingState:
    """Evaluation of the equations.

    balance: harmonic balance at the frequency. at: its evaluation.
    error: sine of the lag above the given one.
    turn: change of the lag with the frequency, s/rad, from the last step of Newton's method; NaN without a step.
    """

    balance: Balance
    at: Evaluation
    error: float
    turn: float = math.nan

    @property
    def omega(self) -> float:
        """Frequency, rad/s."""
        return self.balance.joint.omega

    @property
    def scale(self) -> tuple[float, float]:
        """As in Evaluation."""
        return self.at.scale

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Norm of the residual, dimensionless."""
        return math.hypot(self.at.scaled_residual(scale), self.error)


def excitation_product(joint: Joint, displacement_h: FloatArray) -> complex:
    """`F^H x`, N m, of excitation and displacements in the first harmonic, from the motion (n_contact, 3, 2H+1), m."""
    structure = joint.structure
    return complex(structure.drive @ _first(joint, displacement_h) + structure.drive_offset)


def phase_lag(joint: Joint, at: Evaluation) -> float:
    """Lag of the vibration behind the excitation, rad, from -pi/2 to 3 pi/2."""
    return (-cmath.phase(excitation_product(joint, at.displacement_h)) + 0.5 * math.pi) % (2 * math.pi) - 0.5 * math.pi


def solve_at_lag(
    case: Case,
    balance: Balance,
    start: FloatArray,
    lag: float,
    solver: JacobianSolver,
    budget: Budget,
    most: int | None = None,
) -> LaggingState | None:
    """The state with a given lag; None where Newton's method fails.

    Parameters
    ----------
    case : Case
        The case of the joint of the balance.
    balance : Balance
        The problem at the first frequency, with fixed or with growing wear depths.
    start : array (n_rel, 2H+1)
        First predicted force, N.
    lag : float
        rad, between 0 and pi.
    solver, budget, most
        As in `solve_balance`.
    """
    shape, unit, amplitude = start.shape, cmath.exp(1j * lag), balance.joint.excitation_amplitude
    tolerance = case.settings.tolerance

    def error(product: complex) -> float:
        return -(unit * product).imag / max(abs(product), 1e-300)

    def evaluate(unknown: FloatArray) -> LaggingState:
        here = replace(balance, joint=case.joint(float(unknown[-1]), amplitude))
        at = here.evaluate(unknown[:-1].reshape(shape))
        return LaggingState(here, at, error(excitation_product(here.joint, at.displacement_h)))

    turn = math.nan

    def direction(state: LaggingState) -> FloatArray:
        budget.check_time()
        rtol = max(NEWTON.forcing, 0.1 * tolerance / max(state.scaled_residual(), tolerance))
        tangent, by_frequency = state.balance.linearise(state.at), frequency_derivative(state)
        product = excitation_product(state.balance.joint, state.at.displacement_h)

        def change_of(step: FloatArray, by_omega: FloatArray) -> float:
            nonlocal turn
            own, with_frequency = (
                product_change(state.balance.joint, tangent.transmit(part)[0]) for part in (step, by_omega)
            )
            # the equation times |F^H x|, whose derivative is linear in the motion
            slope = (unit * (with_frequency + by_frequency.product)).imag
            turn = -slope / max(abs(product), 1e-300)
            return -(unit * (product + own)).imag / slope if slope != 0.0 else math.inf

        moved, change = solver.solve_with_parameter(
            tangent, -state.at.residual, -by_frequency.residual, change_of, rtol
        )
        step = np.append(moved.ravel(), change)
        largest = CONTINUATION.largest_frequency_change * state.omega
        return np.asarray(step * min(1.0, largest / max(abs(change), 1e-300)))

    end = solve_newton(evaluate, direction, np.append(start.ravel(), balance.joint.omega), tolerance, most)
    budget.iterations += end.iterations
    return replace(end.evaluation, turn=turn) if end.converged else None


@dataclass(frozen=True)
class FrequencyDerivative:
    """Derivatives with respect to the frequency at a fixed predicted force.

    residual (n_rel, 2H+1): N s/rad. product: of `F^H x`, N m s/rad. response: of the first response in the first
    harmonic, m s/rad.
    """

    residual: FloatArray
    product: complex
    response: complex


def frequency_derivative(state: LaggingState) -> FrequencyDerivative:
    """Derivatives at a state; those of masses on rigid ground by differences."""
    joint, at = state.balance.joint, state.at
    amplitude, orders, u = joint.excitation_amplitude, joint.basis.orders, joint.to_relative(at.displacement_h)
    slope = frequency_slope(joint.model, joint.omega, amplitude, orders, u)
    residual, product, response = slope.force, slope.product, complex(slope.response[0])
    if joint.law.rate_dependent:
        # longer than usual: the round-off of the static forces is small against the change of all others
        length = 10.0 * COMMON.difference * joint.omega
        ahead = replace(state.balance, joint=replace(joint, omega=joint.omega + length)).evaluate(at.predicted_h)
        motion = (ahead.displacement_h - at.displacement_h) / length
        residual = residual + (ahead.residual - at.residual) / length
        product += product_change(joint, motion)
        response += first_response(joint, motion)
    return FrequencyDerivative(residual, product, response)


def first_response(joint: Joint, motion_h: FloatArray) -> complex:
    """First harmonic of the first response, m, to a motion (n_contact, 3, 2H+1), m, alone, without the excitation."""
    return complex(joint.structure.dynamic_response[0, 0] @ _first(joint, motion_h))


def _first(joint: Joint, motion_h: FloatArray) -> ComplexArray:
    return to_complex(joint.to_relative(motion_h))[:, 0]


def product_change(joint: Joint, motion_h: FloatArray) -> complex:
    """Change of `F^H x`, N m, with a change of the motion (n_contact, 3, 2H+1), m."""
    return complex(joint.structure.drive @ _first(joint, motion_h))
