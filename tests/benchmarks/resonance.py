"""A followed resonance of the dovetail root against the responses around its states, and what following costs.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.resonance [states] [cost] [--mesh 1]

For each tenth of 1e5 cycles: frequency of the history with its error, and the frequency that the responses around this
state have in quadrature with the excitation, or where they are largest: from the state of the history the frequency
moves away in small steps, at constant depth, with the tangential history that each state leaves to the next. A sweep
of its own to the worn joint would have another friction history than the joint that has worn: after 1e4 cycles both
differ by 0.01 Hz and 1 %, later by more than any error.
Then the CPU time of a history with followed frequency, and of one of its accepted steps, over those at the first
frequency: from the same start, in one process, without start states and reference solutions.
"""

from dataclasses import dataclass

import numpy as np

from solver.continuation.phase_lag import excitation_product
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, final_history
from solver.loading_history.start_states import follow_branch
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.newton.run import Run
from solver.settings import FOLLOWED, Followed, FollowedFrequency, SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.wear.check import full_check
from solver.wear.integrate import Integrations, SlowTime
from solver.wear.step import Adaptive, Given, WearLine
from solver.wear.wearing_joint import WearingJoint, WearState
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure

BETWEEN = (205.0, 220.0)  # Hz
LOAD, FRICTION, WEAR = 0.5, 0.5, 1.1e-11  # N, 1, 1/Pa
STEPS = 100  # of 1e5 cycles


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
        errors.append(checked[1]["excitation_frequency_error"])
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
            joint = work.of(state)[0].joint(2.0 * np.pi * frequency, work.excitation_amplitude)
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


def states(word: Followed) -> None:
    """Frequencies of a history beside those of the responses around its states."""
    columns = ("Hz", "error", "in quadrature", "largest at", "amplitude, mm", "largest, mm")
    cycles, table = np.linspace(0.0, 1e5, STEPS + 1), Table(f"{word}, cycles", *columns)
    model, follow = build_scene("dovetail_sector", mesh=1), FollowedFrequency(word, *BETWEEN)
    history = followed_states(model, follow, LOAD, WEAR, cycles)
    counts = np.array([state.cycle for state in history.states])
    # a step whose end is not found is divided: the states at the tenths are not evenly numbered
    for place in (int(np.argmin(abs(counts - tenth))) for tenth in cycles[:: STEPS // 10]):
        state, error = history.states[place], history.errors[place]
        width = 4.0 * error if word == "resonance" else 2.0 * error
        frequencies, (products, responses) = responses_around(history.work, state, width, 6)
        here = state.omega / (2.0 * np.pi)
        amplitudes = 1e3 * abs(responses)
        near = float(amplitudes[np.argmin(abs(frequencies - here))])
        places = (in_quadrature(frequencies, products), at_maximum(frequencies, responses))
        words = (f"{each:.5f}" for each in (here, error, *places))
        table.row(f"{state.cycle:.0f}", *words, near, float(amplitudes.max()))


def cost(name: str, model: ReducedModel, load: float, between: tuple[float, float], cycles: float, step: float) -> None:
    """CPU time of a history with followed frequency, and of a step, over those at the first frequency.

    load: N. between: range of the frequency, Hz. cycles, step: length of the history and of an implicit step.
    """
    settings, resonance = SolverSettings(), FollowedFrequency("resonance", *between)
    ((_, followed),) = follow_branch(model, FRICTION, load, resonance, "up", settings)
    at = np.array([followed.state.omega / (2.0 * np.pi)])
    ((_, fixed),) = follow_branch(model, FRICTION, load, at, "up", settings)
    table = Table(name, "CPU s", "over fixed", "steps", "ms a step", "over fixed", "iterations")
    for rule in (Adaptive(settings.rtol), Given(step)):
        first = None
        for word, start in (("fixed", fixed), *((word, followed) for word in FOLLOWED)):
            follow = None if word == "fixed" else FollowedFrequency(word, *between)
            asked = SlowTime(WEAR, rule, np.array([0.0, cycles]), follow=follow)
            case = build_case(model, FRICTION, start.penalty_omega, settings, start.resolution)
            runs = [measure(lambda: Integrations(case, start).history(asked)) for _ in range(4)]  # noqa: B023
            whole, n_steps = min(run.seconds for run in runs), len(runs[0].result.course.ends) - 1
            each = 1e3 * whole / n_steps
            first = first or (whole, each)
            numbers = (whole, whole / first[0], n_steps, each, each / first[1], runs[0].iterations)
            table.row(f"{rule.scheme}, {word}", *numbers)


def main() -> None:
    """Prints both tables."""
    given = arguments(__doc__, ("states", "cost"), mesh=1)
    if "states" in given.chosen:
        for word in FOLLOWED:
            states(word)
    if "cost" in given.chosen:
        root = build_scene("dovetail_sector", mesh=given.mesh)
        cost(f"dovetail, mesh {given.mesh}", root, LOAD, BETWEEN, 1e4, 250.0)
        cost("slider", build_scene("sdof_slider", damping=20.0), 10.0, (180.0, 230.0), 4e4, 1000.0)


if __name__ == "__main__":
    main()
