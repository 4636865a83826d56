"""A followed resonance of the dovetail root against the responses around its states, and what following costs.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.resonance [states] [cost] [--mesh 1]

For each tenth of 1e5 cycles: frequency of the history with its error, and the frequency that the responses around this
state have in quadrature with the excitation, or where they are largest (`tests.followed_states`). A sweep of its own to
the worn joint would have another friction history than the joint that has worn: after 1e4 cycles both differ by 0.01 Hz
and 1 %, later by more than any error.
Then the CPU time of a history with followed frequency, and of one of its accepted steps, over those at the first
frequency: from the same start, in one process, without start states and reference solutions.
"""

import numpy as np

from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.settings import FOLLOWED, Followed, FollowedFrequency, SolverSettings
from solver.structure.joint import build_case
from solver.wear.integrate import Integration, SlowTime
from solver.wear.step import Adaptive, Given
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure
from tests.followed_states import at_maximum, followed_states, in_quadrature, responses_around

BETWEEN = (205.0, 220.0)  # Hz
LOAD, FRICTION, WEAR = 0.5, 0.5, 1.1e-11  # N, 1, 1/Pa
STEPS = 100  # of 1e5 cycles


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
            runs = [measure(lambda: Integration(case, start, asked).history()) for _ in range(4)]  # noqa: B023
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
