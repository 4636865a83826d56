"""A passage: the frequency runs through a range, and the joint wears at each frequency as in steady vibration there.

At df/dt Hz/s a passage has f df / |df/dt| cycles between f and f + df. So with the wear rate g(f) of the steady states,
m per cycle, of a sweep with its own tangential history, a passage wears

    W = integral of g(f) f / |df/dt| df

by the trapezoidal rule over frequencies that are added where the integrand bends, and on both sides of a jump. The
frequencies pass one after the other: where wear at the first ones takes load off a pair, the pair wears less at the
later ones. So the depth y since the start of the passage follows from the linearised rate,

    dy/df = (g + dg/dW y) f / |df/dt|,

with the implicit trapezoidal rule in the order of the passage. The square of this correction, relative to the wear, is
a part of the error, and falls with the wear of one passage.

A slow passage finds the steady states. What a faster one may wear more or less is a part of its error, see
`solver.missions.delay`. A vibration passes df in the time df / |df/dt|, in which it does not tell apart frequencies
that are closer than 1 / time: an interval far below sqrt(|df/dt|) is not divided. Without this limit no number of
frequencies suffices at the resonance of a structure without damping that friction does not limit: its integral is
infinite.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from solver.accuracy.error_estimate import NOTHING
from solver.accuracy.reference import RTOL_RATIO
from solver.clock import computing_time
from solver.harmonic_balance.response_peak import largest_responses
from solver.harmonic_balance.state import Failure
from solver.loading_history.start_states import follow_line
from solver.missions.block_run import BlockCase, BlockRun, not_computed
from solver.missions.blocks import Passage, worn
from solver.missions.delay import Delay, delay_of
from solver.missions.options import MISSIONS
from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.packing import in_rows
from solver.results.history import StartState
from solver.settings import NEGLIGIBLE, ROUND_OFF
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from solver.wear.rate_slope import rate_slope
from solver.wear.solutions import Like
from solver.wear.state import WearState
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
    needed: frequencies without which the error would be too large, Hz.
    """

    states: tuple[SweptState, ...]
    wear: FloatArray
    error: float
    iterations: int
    needed: tuple[float, ...]


def run_passage(case: BlockCase, like: Like | None = None) -> BlockRun:
    """Compute a passage, or its reference solution, as `block_run.run_block`."""
    passage = case.block.frequency
    assert isinstance(passage, Passage)
    first = _swept(case, passage, like)
    if isinstance(first, Failure):
        return not_computed(case, first, 0)
    order = 1 if passage.stop > passage.start else -1
    states = first.states[::order]
    area, volume = case.mission.area, float(first.wear @ case.mission.area)
    by_states = sum(
        _part(first.states, place) @ area * state.start.wear_rate_error for place, state in enumerate(first.states)
    )
    growth, slope = in_order(states, (_slope(case, passage, state) for state in states))
    by_depth = float(np.abs(growth - first.wear) @ area) ** 2 / volume if volume > 0.0 else 0.0
    delay = _delay(case, passage, first.states)
    by_rate = min(delay.lag * max(float(state.density @ area) for state in states), volume)
    ends = states[0], states[-1]
    found = BlockRun(
        failure=Failure(Outcome.CONVERGED),
        growth=growth,
        slope=slope if case.with_slope else None,
        response=np.array([state.response for state in ends]),
        peak=np.array([state.peak for state in ends]),
        response_error=max(state.start.response_error for state in ends),
        growth_error=float(by_states + first.error + by_depth + by_rate) / volume if volume > 0.0 else 0.0,
        inaccurate=max(
            (max(state.start.response_error, state.start.wear_rate_error) for state in states if _inaccurate(state)),
            default=0.0,
        ),
        like=Like(
            tuple((state.frequency, state.start.resolution) for state in first.states), float("nan"), first.iterations
        ),
        last=states[-1].start if case.mission.continued_by(case.place) else None,
        iterations=first.iterations,
        sweep_rate=delay.sweep_rate if volume > 0.0 else 0.0,
        frequencies=first.needed,
    )
    return in_rows(found)


def _delay(case: BlockCase, passage: Passage, states: tuple[SweptState, ...]) -> Delay:
    """The delay of a passage with these states."""
    frequencies, responses = np.array([state.frequency for state in states]), [state.response for state in states]
    periodic = [state.start.state for state in states if state.start.state is not None]
    return delay_of(case.block, passage, frequencies, np.array(responses), periodic)


def in_order(states: Sequence[SweptState], slopes: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Wear (n_contact,), m, of a passage through states in this order, and its derivative by the depth before.

    slopes: derivative (n_contact, n_contact) of the density of each state with respect to the depth, 1/Hz.
    """
    unit = np.eye(states[0].density.size)
    # columns: the wear, and the change of the depth behind the passage
    grown: FloatArray = np.zeros((len(unit), len(unit) + 1))
    last: tuple[SweptState, FloatArray, FloatArray] | None = None
    for state, slope in zip(states, slopes, strict=True):
        source = np.column_stack([state.density, slope])
        if last is not None:
            half = 0.5 * abs(state.frequency - last[0].frequency)
            known = grown + half * (last[2] + last[1] @ grown + source)
            grown = np.asarray(np.linalg.solve(unit - half * slope, known))
        last = state, slope, source
    return np.maximum(grown[:, 0], 0.0), grown[:, 1:]


def _slope(case: BlockCase, passage: Passage, state: SweptState) -> FloatArray:
    """Derivative (n_contact, n_contact) of the density of a state with respect to the depths, 1/Hz."""
    pairs = state.density > 0.0
    if not pairs.any():
        return np.zeros((pairs.size, pairs.size))
    work, begun = _joint(case, state.start)
    at = begun.point.evaluation
    slope = rate_slope(work.at(begun), at, work.gain(1.0), work.wearing, pairs | (case.depth > 0.0), work.run)
    return np.asarray(slope * state.frequency / abs(passage.rate))


def _joint(case: BlockCase, start: StartState) -> tuple[WearingJoint, WearState]:
    """The joint at the depth before the passage, and its state at a frequency."""
    assert start.state is not None
    model, friction = worn(case.block.model, case.depth), case.block.friction_coefficient
    of_state = build_case(model, friction, start.penalty_omega, case.settings, start.resolution)
    work = WearingJoint.of(of_state, start.state, case.mission.wear_coefficient, case.law)
    # the limit of the explicit step is not asked for
    return work, work.begin(start.state, start.resolution, NOTHING, accurate=True, step_limit=np.inf)


def _inaccurate(state: SweptState) -> bool:
    return state.start.outcome is Outcome.INACCURATE


def _part(states: tuple[SweptState, ...], place: int) -> FloatArray:
    """Wear (n_contact,), m, that belongs to a frequency."""
    low, high = states[max(place - 1, 0)].frequency, states[min(place + 1, len(states) - 1)].frequency
    return 0.5 * (high - low) * states[place].density


def _swept(case: BlockCase, passage: Passage, like: Like | None) -> Swept | Failure:
    """The wear of one passage at the depth before it; like: of the history, for its reference solution."""
    aim = MISSIONS.frequency_error * (1.0 if like is None else RTOL_RATIO)
    low, high = sorted((passage.start, passage.stop))
    least = np.linspace(low, high, MISSIONS.first_frequencies).tolist()
    # the mission before has found the frequencies that count: a second sweep is then seldom needed
    wanted = list(case.frequencies or least)
    states: list[SweptState] = []
    iterations, error, area = 0, np.inf, case.mission.area
    while wanted:
        found = _states(case, passage, np.array(sorted(wanted)), like)
        if isinstance(found, Failure):
            return found
        iterations += max((state.start.newton_iterations for state in found), default=0)
        states = sorted([*states, *found], key=lambda state: state.frequency)
        errors = interval_errors(states, area)
        volume = float(sum(_part(tuple(states), place) @ area for place in range(len(states))))
        allowed, error = aim * case.settings.rtol * max(volume, _negligible(case, passage, states)), float(errors.sum())
        if error <= allowed or len(states) >= MISSIONS.most_frequencies:
            break
        wanted = []
        for place in np.flatnonzero(errors > allowed / len(errors)):
            wanted.extend(_between(states[place], states[place + 1], MISSIONS.finest_interval * passage.rate**0.5))
    wear = np.sum([_part(tuple(states), place) for place in range(len(states))], axis=0)
    return Swept(tuple(states), wear, error, iterations, _needed(states, errors, allowed / len(errors), least))


def _negligible(case: BlockCase, passage: Passage, states: list[SweptState]) -> float:
    """Worn volume of a passage, m3, that does not matter: beside the wear so far, or as round-off.

    Wear by round-off is compared with the wear if friction took up all work of the excitation.
    """
    size = max(float(np.abs(state.response).max()) for state in states)
    work = np.pi * case.block.excitation_amplitude * size * passage.cycles
    so_far = float(case.depth @ case.mission.area)
    return max(NEGLIGIBLE * so_far, ROUND_OFF * case.mission.wear_coefficient * work)


def _needed(states: list[SweptState], errors: FloatArray, allowed: float, least: Sequence[float]) -> tuple[float, ...]:
    """The frequencies `least`, Hz, and those whose absence makes the error of an interval larger than allowed, m3."""
    found = [states[0].frequency]
    for place in range(1, len(states) - 1):
        at = states[place].frequency
        # an interval twice as long has eight times the error; of two neighbours one is kept
        dropped = found[-1] == states[place - 1].frequency and 8.0 * errors[place - 1 : place + 1].sum() < allowed
        if at in least or not dropped:
            found.append(at)
    return (*found, states[-1].frequency)


def _between(one: SweptState, other: SweptState, finest: float) -> list[float]:
    """Further frequencies between two, Hz: both sides of a jump, or the middle of an interval above `finest`, Hz."""
    low, high = one.frequency, other.frequency
    near = NEGLIGIBLE * low
    folds = {
        state.start.fold_frequency for state in (one, other) if low + near < state.start.fold_frequency < high - near
    }
    if one.start.branch != other.start.branch and folds:
        return [side for fold in folds for side in (fold - near, fold + near)]
    return [0.5 * (low + high)] if high - low > max(2.0 * near, finest) else []


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
    case: BlockCase, passage: Passage, frequencies: FloatArray, like: Like | None
) -> list[SweptState] | Failure:
    """States of the sweep through the range at given frequencies, ascending, Hz."""
    line = case.line(passage.sweep)
    if like is not None:
        # errors of a reference solution are not used
        line.known = like.resolutions
    began, found = computing_time(), []
    for index, start in follow_line(line, frequencies):
        if start.state is None:
            return Failure(start.outcome, start.message)
        if computing_time() - began > case.settings.time_limit:
            return Failure(Outcome.TIME_LIMIT)
        work, begun = _joint(case, start)
        at = begun.point.evaluation
        frequency = float(frequencies[index])
        density = work.rate(at) * frequency / abs(passage.rate)
        joint = work.at(begun)
        response = to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0]
        found.append(SweptState(frequency, start, density, response, largest_responses(joint, at)))
    return found
