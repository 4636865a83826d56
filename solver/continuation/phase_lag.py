"""Periodic states at a given phase lag, or at the largest amplitude: the frequency is an unknown.

With the first harmonics x of all displacements and F of the excitation, `F^H x = |F^H x| exp(-i lag)`. The lag rises
from 0 below a resonance to pi above; the excitation does most work in phase resonance, at the lag pi/2. The frequency
is the further unknown of a bordered balance, and `sin(arg(F^H x) + lag) = 0` the further equation. At the largest
amplitude of the first response, in its first harmonic, the rise of the amplitude with the lag is zero; a secant finds
this lag. Of a ring it is the first response of the blade that moves most.
"""

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from solver.continuation.natural import ATTEMPTS, SMALL_CHANGE, SMOOTH_CHANGE
from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.harmonic_balance.state import first_response
from solver.model import ComplexArray, FloatArray
from solver.newton.linear_solver import FORCING
from solver.newton.run import MOST_ITERATIONS, Bordered, Run
from solver.settings import DIFFERENCE, NEGLIGIBLE, ROUND_OFF
from solver.structure.condensation import FrequencySlope, frequency_slope
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint

PEAK_RISE = 2.0
"""Largest rise of the logarithm of the response with the phase lag, 1/rad, over rtol, at which an amplitude counts as
the largest one: its frequency is then within 2 rtol of half the width of the resonance. The rise is rough, as single
samples change their state with the frequency: by 0.005 for the dovetail with rtol 0.01. With half the value the
frequency of a worn slider differs by 0.3 %, within its error of 1.3 %."""


def phase_lag(joint: Joint, at: Evaluation) -> float:
    """Lag of the vibration behind the excitation, rad, from -pi/2 to 3 pi/2; 0 where nothing moves."""
    product = excitation_product(joint, at)
    free = np.abs(to_complex(at.predicted_h)[:, 0]) / joint.relative_penalty
    if abs(product) <= ROUND_OFF * float(np.abs(joint.structure.drive) @ free):
        return 0.0
    return (-cmath.phase(product) + 0.5 * math.pi) % (2 * math.pi) - 0.5 * math.pi


def excitation_product(joint: Joint, at: Evaluation) -> complex:
    """`F^H x`, N m, of excitation and displacements in the first harmonic."""
    return _changes(joint, joint.motion(at))[0] + joint.structure.drive_offset


@dataclass(frozen=True)
class _AtLag:
    """As BorderedProblem: a balance, given at some frequency, whose frequency, rad/s, follows from its lag, rad."""

    case: Case
    balance: Balance
    lag: float

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        before = self.balance.joint
        joint = self.case.joint(float(values[0]), before.excitation_amplitude).with_contact(before.contact)
        balance = replace(self.balance, joint=joint)
        at = balance.evaluate(predicted_h)
        product = excitation_product(joint, at)
        return Bordered(balance, at, values, self._errors(product, product), extra=product)

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        by_frequency = frequency_derivative(here.balance, here.at)
        return [by_frequency.force], self._errors(by_frequency.product, here.extra)[:, None]

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        # of the equation times |F^H x|, whose derivative is linear in the motion
        return self._errors(_changes(here.balance.joint, tangent.rest_and_motion(step)[1])[0], here.extra)

    def fraction(self, here: Bordered, change: FloatArray) -> float:
        return min(1.0, SMALL_CHANGE * float(here.values[0] / max(abs(change[0]), 1e-300)))

    def _errors(self, part: complex, product: complex) -> FloatArray:
        """-Im(exp(i lag) part) / |product| (1,)."""
        return np.array([-(cmath.exp(1j * self.lag) * part).imag / max(abs(product), 1e-300)])


def solve_at_lag(
    case: Case, balance: Balance, start: FloatArray, lag: float, run: Run, most: int = MOST_ITERATIONS
) -> Bordered | None:
    """The state of a balance, with fixed or with growing wear depths, at a phase lag, rad; None where it is not found.

    start (n_rel, 2H+1): first predicted force, N. `Bordered.reduced` of the state: change of the lag with the frequency
    along the states, s/rad.
    """
    return run.solve_bordered(_AtLag(case, balance, lag), start, np.array([balance.joint.omega]), most)


def solve_at_peak(
    case: Case, balance: Balance, start: FloatArray, lag: float, run: Run, most: int = MOST_ITERATIONS
) -> tuple[Bordered, float] | None:
    """The state of the largest amplitude near a phase lag, rad, and its lag; None where it is not found.

    Arguments as in `solve_at_lag`. Along the frequency the wear depth is constant, also in an implicit step.
    """
    below, above, accuracy = 0.0, math.pi, PEAK_RISE * case.settings.rtol
    last, rise_before = lag, 0.0
    for _ in range(ATTEMPTS):
        found = solve_at_lag(case, balance, start, lag, run, most)
        if found is None:
            return None
        rise, turn = rise_of_response(found, run, accuracy)
        # where the lag falls with the frequency there is no resonance
        if not (turn > 0.0 and math.isfinite(rise)):
            return None
        rise /= turn
        below, above = (lag, above) if rise > 0.0 else (below, lag)
        if abs(rise) <= accuracy or above - below <= accuracy:
            return replace(found, reduced=np.array([[turn]])), lag
        # of a linear oscillator with one degree of freedom the rise falls by 1 per rad
        slope = -1.0 if lag == last else (rise - rise_before) / (lag - last)
        step = float(np.clip(-rise / min(slope, -NEGLIGIBLE), -SMOOTH_CHANGE, SMOOTH_CHANGE))
        last, rise_before = lag, rise
        lag = lag + step if below < lag + step < above else 0.5 * (below + above)
        balance, start = found.balance, found.at.predicted_h
    return None


def rise_of_response(state: Bordered, run: Run, accuracy: float) -> tuple[float, float]:
    """Changes along the frequency at fixed wear depth and tangential history, both s/rad: of the logarithm of the
    amplitude of the first response, in the first harmonic, and of the lag.

    accuracy: first change over the second one that does not count.
    """
    joint, at = state.balance.joint, state.at
    fixed = Balance(joint, at.start_history, at.wear_depth, energy=at.energy)
    by_frequency = frequency_derivative(fixed, at)
    (step,) = run.steps(fixed, at, [-by_frequency.force], min(FORCING, 0.1 * accuracy))
    product, response = _changes(joint, fixed.linearise(at).rest_and_motion(step)[1])
    responses = first_response(joint, at)
    each = len(responses) // joint.model.n_repeated
    largest = each * int(np.argmax(np.abs(responses[::each])))
    rise = (by_frequency.response[largest] + response[largest]) / responses[largest]
    turn = (by_frequency.product + product) / excitation_product(joint, at)
    return float(rise.real), -turn.imag


def frequency_derivative(balance: Balance, at: Evaluation) -> FrequencySlope:
    """Derivatives by the frequency at a fixed predicted force: of the residual (n_rel, 2H+1), N s/rad, of `F^H x` and
    of the responses; those of masses on rigid ground by differences.
    """
    joint = balance.joint
    orders, u = joint.basis.orders, joint.motion(at)
    slope = frequency_slope(joint.model, joint.omega, joint.excitation_amplitude, orders, u)
    if not joint.law.rate_dependent:
        return slope
    # longer than usual: the round-off of the static forces is small against the change of all others
    length = 10.0 * DIFFERENCE * joint.omega
    ahead = replace(balance, joint=replace(joint, omega=joint.omega + length)).evaluate(at.predicted_h)
    product, response = _changes(joint, (joint.motion(ahead) - joint.motion(at)) / length)
    force = slope.force + (ahead.residual - at.residual) / length
    work = (ahead.slip_work - at.slip_work) / length
    return FrequencySlope(force, slope.product + product, slope.response + response, work)


def _changes(joint: Joint, motion_h: FloatArray) -> tuple[complex, ComplexArray]:
    """Changes of `F^H x`, N m, and of the responses (n_response,), m, with a motion (n_rel, m), m, in harmonic 1."""
    first = to_complex(motion_h)[:, 0]
    return complex(joint.structure.drive @ first), np.asarray(joint.structure.dynamic_response[0] @ first)
