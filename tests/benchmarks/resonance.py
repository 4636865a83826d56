"""A followed resonance of the dovetail root against the responses around its states, and what following costs.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.resonance [states | cost] [--mesh 1]

For each tenth of 1e5 cycles: frequency of the history with its error, and the frequency that the responses around this
state have in quadrature with the excitation, or where they are largest (`tests.followed_states`). A sweep of its own to
the worn joint would have another friction history than the joint that has worn: after 1e4 cycles both differ by 0.01 Hz
and 1 %, later by more than any error. At a given frequency they differ by as much.
Then the CPU time of a history with followed frequency, and of one of its accepted steps, over those at the first
frequency: from the same start, in one process, without start states and reference solutions. A history that follows the
resonance wears more and takes steps of another number.
"""

import argparse
from dataclasses import dataclass

import numpy as np

from solver.clock import computing_time
from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.results.history import StartState
from solver.settings import FOLLOWED, Followed, FollowedFrequency, Scheme, SolverSettings
from solver.structure.joint import build_case
from solver.wear.control import steps_of
from solver.wear.integrate import Ended
from solver.wear.solutions import SlowTime, Solutions
from solver.wear.wearing_joint import Fixed, Following
from studies import build_scene
from tests.followed_states import at_maximum, followed_states, in_quadrature, responses_around

BETWEEN = (205.0, 220.0)  # Hz
LOAD, FRICTION, WEAR = 0.5, 0.5, 1.1e-11  # N, 1, 1/Pa
STEPS = 100  # of 1e5 cycles


@dataclass(frozen=True)
class Measured:
    """A joint whose cost is measured: load, N, range of the frequency, Hz, cycles and length of an implicit step."""

    name: str
    model: ReducedModel
    load: float
    between: tuple[float, float]
    cycles: float
    step: float


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="?", choices=("states", "cost"), help="one of both tables; default: both")
    parser.add_argument("--mesh", type=int, default=1, help="of the dovetail root whose cost is measured")
    given = parser.parse_args()
    if given.what != "cost":
        for word in FOLLOWED:
            print_brute_force(build_scene("dovetail_sector", mesh=1), word)
    if given.what != "states":
        root = build_scene("dovetail_sector", mesh=given.mesh)
        for joint in (
            Measured(f"dovetail, mesh {given.mesh}", root, LOAD, BETWEEN, 1e4, 250.0),
            Measured("slider", build_scene("sdof_slider", damping=20.0), 10.0, (180.0, 230.0), 4e4, 1000.0),
        ):
            for scheme in ("adaptive", "implicit"):
                print_cost(joint, scheme)


def print_brute_force(model: ReducedModel, word: Followed) -> None:
    """Frequencies of a history beside those of the responses around its states."""
    cycles = np.linspace(0.0, 1e5, STEPS + 1)
    history = followed_states(model, FollowedFrequency(word, *BETWEEN), LOAD, WEAR, cycles)
    counts = np.array([state.cycle for state in history.states])
    # a step whose end is not found is divided: the states at the tenths are not evenly numbered
    for place in (int(np.argmin(abs(counts - tenth))) for tenth in cycles[:: STEPS // 10]):
        state, error = history.states[place], history.errors[place]
        width = 4.0 * error if word == "resonance" else 2.0 * error
        frequencies, (products, responses) = responses_around(history.work, state, width, 6)
        quadrature, largest = in_quadrature(frequencies, products), at_maximum(frequencies, responses)
        here = state.omega / (2.0 * np.pi)
        amplitude = abs(responses[np.argmin(abs(frequencies - here))])
        print(
            f"{word} {state.cycle:8.0f} cycles: {here:.5f} +- {error:.5f} Hz, in quadrature {quadrature:.5f},"
            f" largest {largest:.5f} Hz; {1e3 * amplitude:.4f} mm, largest {1e3 * abs(responses).max():.4f} mm"
            f" from {frequencies[0]:.4f} to {frequencies[-1]:.4f} Hz",
            flush=True,
        )


def print_cost(joint: Measured, scheme: Scheme) -> None:
    """CPU time of a history with followed frequency, and of a step, over those at the first frequency."""
    settings, resonance = SolverSettings(), FollowedFrequency("resonance", *joint.between)
    ((_, followed),) = follow_branch(joint.model, FRICTION, joint.load, resonance, "up", settings)
    at = np.array([followed.state.omega / (2.0 * np.pi)])
    ((_, fixed),) = follow_branch(joint.model, FRICTION, joint.load, at, "up", settings)
    given: list[tuple[str, StartState, FollowedFrequency | None]] = [("fixed", fixed, None)]
    given += [(word, followed, FollowedFrequency(word, *joint.between)) for word in FOLLOWED]
    first = None
    for word, start, follow in given:
        spent, ended = zip(*(_spent(joint, start, scheme, follow) for _ in range(4)), strict=True)
        # the first run compiles
        whole, n_steps = min(spent[1:]), len(ended[0].course.ends) - 1
        step = whole / n_steps
        first = first or (whole, step)
        print(
            f"{joint.name}, {scheme}, {word}: {whole:.2f} s, {whole / first[0]:.2f} of fixed; {n_steps} steps of"
            f" {1e3 * step:.1f} ms, {step / first[1]:.2f} of fixed; {ended[0].iterations} iterations",
            flush=True,
        )


def _spent(joint: Measured, start: StartState, scheme: Scheme, follow: FollowedFrequency | None) -> tuple[float, Ended]:
    """CPU time of a history, s, and the history."""
    case = build_case(joint.model, FRICTION, start.penalty_omega, SolverSettings(), start.resolution)
    where = Fixed() if follow is None else Following(follow)
    steps = steps_of(scheme, joint.step, SolverSettings().rtol)
    asked = SlowTime(WEAR, steps, np.array([0.0, joint.cycles]), where=where)
    began = computing_time()
    ended = Solutions(case, start, asked).history()
    return computing_time() - began, ended


if __name__ == "__main__":
    main()
