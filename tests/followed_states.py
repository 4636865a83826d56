"""States of a history with followed frequency, and the responses around one of them: brute force for the frequency.

From the state of the history (depth, tangential history, motion) the frequency moves away in small steps, up and down,
at constant depth. Each state leaves its tangential history to the next one by the rule of the wear history. Nothing of
the equations for the frequency is used.
"""

from dataclasses import dataclass

import numpy as np

from solver.continuation.phase_lag import excitation_product
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, final_history
from solver.loading_history.start_states import follow_branch
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.newton.run import Run
from solver.settings import FollowedFrequency, SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.wear.check import full_check
from solver.wear.step import Given, WearLine
from solver.wear.wearing_joint import WearingJoint, WearState


@dataclass(frozen=True)
class FollowedStates:
    """States of a history and their errors.

    work: the joint. states: first state and the ends of all steps. errors: of the frequency, Hz.
    """

    work: WearingJoint
    states: tuple[WearState, ...]
    errors: tuple[float, ...]


def followed_states(
    model: ReducedModel,
    follow: FollowedFrequency,
    load: float,
    wear_coefficient: float,
    cycles: FloatArray,
    settings: SolverSettings | None = None,
) -> FollowedStates:
    """States of implicit steps at ascending cycle counts (n,) with equal distances, the first 0; friction 0.5."""
    settings = settings or SolverSettings()
    ((_, start),) = follow_branch(model, 0.5, load, follow, "up", settings)
    assert start.state is not None, start.message
    case = build_case(model, 0.5, start.penalty_omega, settings, start.resolution)
    work = WearingJoint(case, start, wear_coefficient, follow=follow)
    states, errors = list[WearState](), list[float]()
    line, after = WearLine(work, Given(float(cycles[1] - cycles[0])), float(cycles[-1])), work.at_followed(work.begin())
    while True:
        assert isinstance(after, WearState)
        checked = full_check(work, after)
        assert not isinstance(checked, Failure)
        states.append(checked[0])
        errors.append(checked[1].excitation_frequency_error)
        if states[-1].cycle >= cycles[-1] * (1.0 - 1e-12):
            break
        step = line.step(states[-1])
        assert not isinstance(step, Failure)
        after = step.state
    return FollowedStates(work, tuple(states), tuple(errors))


def responses_around(work: WearingJoint, state: WearState, width: float, n: int) -> tuple[FloatArray, ComplexArray]:
    """Responses within a width, Hz, around a state, at n frequencies on each side, as far as the branch goes.

    Returns
    -------
    frequencies : array (k,)
        Hz, ascending.
    responses : array (2, k)
        `F^H x` of excitation and motion, N m, and the first response, m, both in the first harmonic.
    """
    found = {}
    for sign in (-1.0, 1.0):
        place, step, history, predicted = 0.0, 0.0, state.point.history, state.point.evaluation.predicted_h
        while place + step <= width * (1.0 + 1e-9):
            frequency = state.omega / (2.0 * np.pi) + sign * (place + step)
            joint = work.joint(state.resolution, state.hold, 2.0 * np.pi * frequency)
            balance = Balance(joint, history, state.depth)
            end = Run(work.case.settings.tolerance).solve(balance, predicted)
            if not end.converged:
                step *= 0.5
                if step < 0.1 * width / n:
                    break
                continue
            place, step, predicted = place + step, width / n, end.unknown
            history = final_history(balance, end.evaluation)
            motion = end.evaluation.displacement_h
            response = to_complex(joint.structure.response_h(joint.to_relative(motion)))[0, 0]
            found[frequency] = excitation_product(joint, motion), response
    frequencies = np.array(sorted(found))
    return frequencies, np.array([found[frequency] for frequency in frequencies]).T


def in_quadrature(frequencies: FloatArray, products: ComplexArray) -> float:
    """Frequency, Hz, at which the real part of `F^H x` (n,), N m, passes zero; NaN where it does not."""
    parts = products.real
    passes = np.flatnonzero((parts[:-1] > 0.0) & (parts[1:] <= 0.0))
    if passes.size != 1:
        return float("nan")
    near = slice(max(passes[0] - 1, 0), passes[0] + 3)
    curve = np.polynomial.Polynomial.fit(parts[near], frequencies[near], len(parts[near]) - 1)
    return float(curve(0.0))


def at_maximum(frequencies: FloatArray, responses: ComplexArray) -> float:
    """Frequency, Hz, of the largest amplitude of responses (n,), m."""
    curve = np.polynomial.Polynomial.fit(frequencies, np.abs(responses), 4)
    fine = np.linspace(frequencies[0], frequencies[-1], 4001)
    return float(fine[np.argmax(curve(fine))])
