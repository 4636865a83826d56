"""A periodic state whose vibration lags behind its excitation by a given phase: the frequency is an unknown.

With the first harmonics x of all displacements and F of the excitation, `F^H x = |F^H x| exp(-i lag)`. The lag rises
from 0 below a resonance to pi above; the excitation does most work in phase resonance, at the lag pi/2. The frequency
is the further unknown of a bordered balance (`solver.newton.run`), in an implicit step with the wear depth that
grows with the motion, and the further equation is

    sin(arg(F^H x) + lag) = 0.

The wear depth is eliminated in the Jacobian, so that its change with the frequency is part of the step.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.model import ComplexArray, FloatArray
from solver.newton.run import Bordered, Run
from solver.settings import DIFFERENCE, ROUND_OFF
from solver.structure.condensation import frequency_slope
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint

LARGEST_FREQUENCY_CHANGE = 0.02
"""Largest change of the frequency in an iteration, over the frequency."""


def excitation_product(joint: Joint, displacement_h: FloatArray) -> complex:
    """`F^H x`, N m, of excitation and displacements in the first harmonic, from the motion (n_contact, 3, 2H+1), m."""
    structure = joint.structure
    return complex(structure.drive @ _first(joint, displacement_h) + structure.drive_offset)


def phase_lag(joint: Joint, at: Evaluation) -> float:
    """Lag of the vibration behind the excitation, rad, from -pi/2 to 3 pi/2; 0 where nothing moves."""
    product = excitation_product(joint, at.displacement_h)
    free = np.abs(to_complex(at.predicted_h)[:, 0]) / joint.relative_penalty
    if abs(product) <= ROUND_OFF * float(np.abs(joint.structure.drive) @ free):
        return 0.0
    return (-cmath.phase(product) + 0.5 * math.pi) % (2 * math.pi) - 0.5 * math.pi


@dataclass(frozen=True)
class AtLag:
    """The problem: a balance, with fixed or with growing wear depths, whose frequency follows from its lag.

    case: of the joint of the balance. balance: at some frequency. lag: rad, between 0 and pi. `Bordered.reduced` is the
    change of the lag with the frequency along the states, s/rad.
    """

    case: Case
    balance: Balance
    lag: float

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        """As in BorderedProblem; the value is the frequency, rad/s."""
        joint = self.case.joint(float(values[0]), self.balance.joint.excitation_amplitude)
        balance = replace(self.balance, joint=joint)
        at = balance.evaluate(predicted_h)
        product = excitation_product(joint, at.displacement_h)
        return Bordered(balance, at, values, self._errors(product, product), extra=product)

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        """As in BorderedProblem."""
        by_frequency = frequency_derivative(here.balance, here.at)
        return [by_frequency.residual], self._errors(by_frequency.product, here.extra)[:, None]

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        """As in BorderedProblem: of the equation times |F^H x|, whose derivative is linear in the motion."""
        return self._errors(product_change(here.balance.joint, tangent.transmit(step)[0]), here.extra)

    def fraction(self, here: Bordered, _: FloatArray, change: FloatArray) -> float:
        """The frequency changes by a small fraction of itself at most."""
        return min(1.0, LARGEST_FREQUENCY_CHANGE * float(here.values[0] / max(abs(change[0]), 1e-300)))

    def _errors(self, part: complex, product: complex) -> FloatArray:
        """-Im(exp(i lag) part) / |product| (1,)."""
        return np.array([-(cmath.exp(1j * self.lag) * part).imag / max(abs(product), 1e-300)])


def solve_at_lag(
    case: Case, balance: Balance, start: FloatArray, lag: float, run: Run, most: int | None = None
) -> Bordered | None:
    """The state with a given lag, as `AtLag`; None where Newton's method fails.

    start (n_rel, 2H+1): first predicted force, N, at the frequency of the balance. most: iterations.
    """
    return run.solve_bordered(AtLag(case, balance, lag), start, np.array([balance.joint.omega]), most)


@dataclass(frozen=True)
class FrequencyDerivative:
    """Derivatives with respect to the frequency at a fixed predicted force: of the residual (n_rel, 2H+1), N s/rad, of
    `F^H x`, N m s/rad, and of the first response in the first harmonic, m s/rad.
    """

    residual: FloatArray
    product: complex
    response: complex


def frequency_derivative(balance: Balance, at: Evaluation) -> FrequencyDerivative:
    """Derivatives at a state; those of masses on rigid ground by differences."""
    joint = balance.joint
    amplitude, orders, u = joint.excitation_amplitude, joint.basis.orders, joint.to_relative(at.displacement_h)
    slope = frequency_slope(joint.model, joint.omega, amplitude, orders, u)
    residual, product, response = slope.force, slope.product, complex(slope.response[0])
    if joint.law.rate_dependent:
        # longer than usual: the round-off of the static forces is small against the change of all others
        length = 10.0 * DIFFERENCE * joint.omega
        ahead = replace(balance, joint=replace(joint, omega=joint.omega + length)).evaluate(at.predicted_h)
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
