"""A passage: the frequency runs through a range, and the joint wears at each frequency as in steady vibration there.

At df/dt Hz/s a passage has f df / |df/dt| cycles between f and f + df. So with the wear rate g(f) of the steady states,
m per cycle, of a sweep with its own tangential history, a passage wears

    W = integral of g(f) f / |df/dt| df

by the trapezoidal rule over frequencies that are added where the integrand bends, and on both sides of a jump. The
depth is that before the passage; its error falls with the wear of one step over missions. The reference solution has
fewer frequencies, and the mean of the wear rates before and after its wear.

A slow passage finds the steady states: it has to be slow against the decay of the vibration within the half-power width
2 zeta f. The number |df/dt| / (zeta f)^2 says how slow it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.error_estimate import NOTHING
from solver.accuracy.reference import RTOL_RATIO
from solver.clock import computing_time
from solver.harmonic_balance.response_peak import largest_responses
from solver.loading_history.start_states import follow_branch
from solver.missions.block_run import BlockCase, BlockRun, not_flown
from solver.missions.blocks import Passage, worn
from solver.missions.options import MISSIONS
from solver.model import ComplexArray, FloatArray
from solver.options import COMMON
from solver.outcome import Outcome
from solver.packing import in_rows
from solver.results.history import StartState
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.wear.solutions import Like
from solver.wear.state import Failure
from solver.wear.wearing_joint import WearingJoint


@dataclass(frozen=True)
class SweptState:
    """The state at a frequency of a passage.

    frequency: Hz.
    start: the state.
    density (n_contact,): wear in one passage over frequency, m/Hz.
    response (n_response,): complex first harmonic, m.
    peak (n_response,): largest magnitude over a period, m.
    """

    frequency: float
    start: StartState
    density: FloatArray
    response: ComplexArray
    peak: FloatArray


@dataclass(frozen=True)
class Swept:
    """The wear of one passage.

    states: in the order of their frequencies.
    wear (n_contact,): m.
    error: estimated error by the number of frequencies, m3.
    iterations: Newton iterations.
    """

    states: tuple[SweptState, ...]
    wear: FloatArray
    error: float
    iterations: int


def run_passage(case: BlockCase, like: Like | None = None) -> BlockRun:
    """Fly a passage, or its reference solution, as `block_run.run_block`."""
    passage = case.block.frequency
    assert isinstance(passage, Passage)
    first = _swept(case, passage, case.depth, MISSIONS.frequency_error * (1.0 if like is None else RTOL_RATIO))
    if isinstance(first, Failure):
        return not_flown(case, first, 0)
    wear, iterations = first.wear, first.iterations
    if like is not None:
        after = _swept(case, passage, case.depth + case.missions[-1] * wear, MISSIONS.frequency_error * RTOL_RATIO)
        if isinstance(after, Failure):
            return not_flown(case, after, iterations)
        wear, iterations = 0.5 * (wear + after.wear), iterations + after.iterations
    order = 1 if passage.stop > passage.start else -1
    states = first.states[::order]
    area, volume = case.mission.area, float(first.wear @ case.mission.area)
    by_states = sum(
        _part(first.states, place) @ area * state.start.wear_rate_error for place, state in enumerate(first.states)
    )
    ends = [states[0], *(states[-1] for _ in case.missions[1:])]
    found = BlockRun(
        missions=case.missions,
        growth=np.array(case.missions, np.float64)[:, None] * wear,
        response=np.array([state.response for state in ends]),
        peak=np.array([state.peak for state in ends]),
        response_error=np.array([state.start.response_error for state in ends]),
        failure=Failure(Outcome.CONVERGED),
        start_rate=first.wear / passage.cycles,
        start_error=float(by_states + first.error) / volume if volume > 0.0 else 0.0,
        inaccurate=max(
            (max(state.start.response_error, state.start.wear_rate_error) for state in states if _inaccurate(state)),
            default=0.0,
        ),
        like=Like((), float("nan"), iterations),
        last=states[-1].start if case.mission.continued_by(case.place) else None,
        iterations=iterations,
        begins_alike=True,
        sweep_rate=sweep_rate(passage, first.states),
    )
    return in_rows(found)


def _inaccurate(state: SweptState) -> bool:
    return state.start.outcome is Outcome.INACCURATE


def _part(states: tuple[SweptState, ...], place: int) -> FloatArray:
    """Wear (n_contact,), m, that belongs to a frequency."""
    low, high = states[max(place - 1, 0)].frequency, states[min(place + 1, len(states) - 1)].frequency
    return 0.5 * (high - low) * states[place].density


def _swept(case: BlockCase, passage: Passage, depth: FloatArray, aim: float) -> Swept | Failure:
    """The wear of one passage at depths (n_contact,), m; aim: error by the frequencies over the volume, over rtol."""
    low, high = sorted((passage.start, passage.stop))
    wanted = list(np.linspace(low, high, MISSIONS.first_frequencies))
    states: list[SweptState] = []
    iterations, error, area = 0, np.inf, case.mission.area
    while wanted:
        found = _states(case, passage, depth, np.array(sorted(wanted)))
        if isinstance(found, Failure):
            return found
        iterations += max((state.start.newton_iterations for state in found), default=0)
        states = sorted([*states, *found], key=lambda state: state.frequency)
        errors = interval_errors(states, area)
        volume = float(sum(_part(tuple(states), place) @ area for place in range(len(states))))
        allowed, error = aim * case.settings.rtol * volume, float(errors.sum())
        if error <= allowed or len(states) >= MISSIONS.most_frequencies:
            break
        wanted = []
        for place in np.flatnonzero(errors > allowed / len(errors)):
            wanted.extend(_between(states[place], states[place + 1]))
    wear = np.sum([_part(tuple(states), place) for place in range(len(states))], axis=0)
    return Swept(tuple(states), wear, error, iterations)


def _between(one: SweptState, other: SweptState) -> list[float]:
    """Further frequencies between two, Hz: both sides of a jump, or the middle."""
    low, high = one.frequency, other.frequency
    near = COMMON.negligible * low
    folds = {
        state.start.fold_frequency for state in (one, other) if low + near < state.start.fold_frequency < high - near
    }
    if one.start.branch != other.start.branch and folds:
        return [side for fold in folds for side in (fold - near, fold + near)]
    return [0.5 * (low + high)] if high - low > 2.0 * near else []


def interval_errors(states: list[SweptState], area: FloatArray) -> FloatArray:
    """Estimated errors (n - 1,) of the trapezoidal rule between neighbouring frequencies, m3, pair by pair.

    h^3 / 12 times the larger second derivative of the integrand at both ends, from three neighbours on one branch. An
    interval with a jump, or without a third state on its branch, may be wrong by half of the difference of its ends.
    """
    at, density = np.array([state.frequency for state in states]), np.array([state.density for state in states])
    branch = np.array([state.start.branch for state in states])
    width, rise = np.diff(at), np.diff(density, axis=0)
    slope = rise / width[:, None]
    # divided differences of three states (n - 2, n_contact), NaN across a jump
    bent = np.abs(np.diff(slope, axis=0)) / (at[2:] - at[:-2])[:, None]
    bent[(branch[2:] != branch[1:-1]) | (branch[1:-1] != branch[:-2])] = np.nan
    padded = np.vstack([np.full((1, area.size), np.nan), bent, np.full((1, area.size), np.nan)])
    second = np.fmax(padded[:-1], padded[1:])
    errors = np.where(np.isnan(second), 0.5 * width[:, None] * np.abs(rise), second * width[:, None] ** 3 / 6.0)
    return np.asarray(errors @ area)


def _states(
    case: BlockCase, passage: Passage, depth: FloatArray, frequencies: FloatArray
) -> list[SweptState] | Failure:
    """States of the sweep through the range at given frequencies, ascending, Hz."""
    began, block = computing_time(), case.block
    model, sweep = worn(block.model, depth), passage.sweep
    found = []
    branch = follow_branch(
        model, block.friction_coefficient, block.excitation_amplitude, frequencies, sweep, case.settings
    )
    for index, start in branch:
        if start.state is None:
            return Failure(start.outcome, start.message)
        if computing_time() - began > case.settings.time_limit:
            return Failure(Outcome.TIME_LIMIT)
        of_state = build_case(model, block.friction_coefficient, start.penalty_omega, case.settings, start.resolution)
        work = WearingJoint.of(of_state, start.state, case.mission.wear_coefficient, case.law)
        # the limit of the explicit step is not asked for
        begun = work.begin(start.state, start.resolution, NOTHING, accurate=True, step_limit=np.inf)
        at = begun.point.evaluation
        frequency = float(frequencies[index])
        density = work.rate(at) * frequency / abs(passage.rate)
        joint = work.at(begun)
        response = to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0]
        found.append(SweptState(frequency, start, density, response, largest_responses(joint, at)))
    return found


def sweep_rate(passage: Passage, states: tuple[SweptState, ...]) -> float:
    """|df/dt| / (zeta f)^2 at the largest response, with the half-power width 2 zeta f; 0 where no peak is passed."""
    at = np.array([state.frequency for state in states])
    size = np.array([np.abs(state.response).max() for state in states])
    top = int(np.argmax(size))
    if top in (0, len(states) - 1):
        return 0.0
    sides = []
    for way in (-1, 1):
        places = np.arange(top, len(states)) if way > 0 else np.arange(top, -1, -1)
        below = np.flatnonzero(size[places] < size[top] / np.sqrt(2.0))
        if below.size:
            one, other = places[below[0] - 1], places[below[0]]
            share = (size[one] - size[top] / np.sqrt(2.0)) / (size[one] - size[other])
            sides.append(abs(at[one] + share * (at[other] - at[one]) - at[top]))
    if not sides:
        return 0.0
    # of a bent peak the steeper side is a jump: the width is that of the wider side
    return float(abs(passage.rate) / max(sides) ** 2)
