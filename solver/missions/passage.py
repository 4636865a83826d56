"""A passage: the frequency runs through a range, and the joint wears at each frequency as in steady vibration there.

At df/dt Hz/s a passage has f df / |df/dt| cycles between f and f + df. So with the wear rate g(f) of the steady states,
m per cycle, of a sweep with its own tangential history, a passage wears

    W = integral of g(f) f / |df/dt| df

by the trapezoidal rule over frequencies that are added where the integrand bends, and on both sides of a jump. Wear at
the first frequencies acts back on the later ones: the depth y since the start of the passage follows from

    dy/df = (g + dg/dW y) f / |df/dt|,

with the implicit trapezoidal rule in the order of the passage. The square of this correction, relative to the wear, is
a part of the error, and falls with the wear of one passage.

The vibration follows the frequency with a delay: its difference to the steady state dies out as exp(-zeta omega t), so
that it belongs to a frequency passed before, by the lag |df/dt| / (2 pi zeta f). A passage wears less or more than its
steady states by at most the lag times the largest wear over frequency: a part of the error. The damping ratio zeta is
that of the structure with its closed pairs sticking; friction damps more where pairs slip. The sweep rate
|df/dt| / (zeta f)^2 says how fast a passage is. Without damping the wear is not known.

A vibration does not tell apart frequencies that are closer than the inverse of the time between them: an interval far
below sqrt(|df/dt|) is not divided. At a resonance without damping or friction the integral is infinite.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.state import Failure, first_response, largest_responses
from solver.missions.block_run import BlockInput, BlockResult
from solver.model import ComplexArray, FloatArray
from solver.modes.modal_model import linear_mode
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, absolute
from solver.results.history import StartState, first_cut_off
from solver.settings import NEGLIGIBLE, ROUND_OFF, SHARE_OF_CAUSE
from solver.wear.slow_time import MOST_NODES, RTOL_RATIO, Guide
from solver.wear.step import rate_slope

FIRST_FREQUENCIES = 17
"""Frequencies before those that are added. With 9 and 33, and half and twice `FINEST_INTERVAL`, a passage of the slider
wears as much within 1e-3, with 20 % fewer and 36 % more iterations."""

FINEST_INTERVAL = 0.1
"""Longest interval of frequencies that is never divided, over sqrt(|df/dt|): a tenth of zeta f where the sweep rate is
1. Slider without damping, 1 to 10 000 Hz at 10 Hz/s: 89 CPU seconds; without this limit not finished after 100."""

LARGEST_SWEEP_RATE = 1.0
"""|df/dt| / (zeta f)^2 above which a message says how fast a passage is. Wear, integrated in time, over that of the
steady states, and the estimated error: slider 0.999 and 3.4 % at 1, 0.995 and 9 % at 3, 0.97 and 29 % at 10; dovetail
(mesh 1) 0.983 and 5 % at 1.9, 0.95 and 15 % at 6.3, 0.91 and 45 % at 19, 0.95 and 100 % at 63."""


@dataclass(frozen=True)
class SweptState:
    """The state at a frequency, Hz, of a passage.

    density, heat (n_contact,): wear and dissipated energy in one passage over frequency, m/Hz and J/m2/Hz.
    response, peak (n_response,): complex first harmonic and largest magnitude over a period, m.
    """

    frequency: float
    start: StartState
    density: FloatArray
    heat: FloatArray
    response: ComplexArray
    peak: FloatArray


@dataclass(frozen=True)
class Swept:
    """The states of one passage, ascending in frequency.

    error: estimated error of the wear by the number of frequencies, m3. iterations: of Newton's method.
    needed: frequencies without which the error would be too large, Hz.
    """

    states: tuple[SweptState, ...]
    error: float
    iterations: int
    needed: tuple[float, ...]


def run_passage(given: BlockInput) -> BlockResult | Failure:
    """Compute a passage, as `block_run.run_block`."""
    swept = find_states(given)
    if isinstance(swept, Failure):
        return swept
    ascending, area = swept.states, given.mission.area
    states = ascending[:: 1 if given.passage.sweep == "up" else -1]
    starts, parts = [state.start for state in ascending], parts_of(ascending)
    volume = float(parts.sum(axis=0) @ area)
    growth, slope = wear_in_order(states, (_slope_of(given, state) for state in states))
    sweep_rate, lag = delay_of(given, ascending)
    error = swept.error + float(absolute(np.array([start.wear_rate_error for start in starts]), parts @ area).sum())
    error += float(np.abs(growth - parts.sum(axis=0)) @ area) ** 2 / volume if volume > 0.0 else 0.0
    error += min(lag * max(float(state.density @ area) for state in states), volume)
    ends, largest = (states[0], states[-1]), [max(each.response_error, each.wear_rate_error) for each in starts]
    # given harmonics are accurate enough, unless there was no state with others for a comparison
    bad = [of for each, of in zip(starts, largest, strict=True) if each.outcome is Outcome.INACCURATE or math.isinf(of)]
    return BlockResult(
        growth=growth,
        dissipated=_by_trapezoids(ascending, [state.heat for state in ascending]).sum(axis=0),
        response=np.array([state.response for state in ends]),
        response_peak=np.array([state.peak for state in ends]),
        slope=slope if given.with_slope else None,
        response_error=max(state.start.response_error for state in ends),
        growth_error=error / volume if volume > 0.0 else 0.0,
        inaccurate=math.inf if any(start.unjudged for start in starts) else max(bad, default=0.0),
        cut_off=_is_cut_off(given, ascending),
        guide=Guide(tuple((state.frequency, state.start.resolution) for state in ascending), math.nan),
        last=ends[-1].start,
        sweep=swept.needed,
        iterations=swept.iterations,
        sweep_rate=sweep_rate if volume > 0.0 else 0.0,
    )


def _is_cut_off(given: BlockInput, states: Sequence[SweptState]) -> bool:
    """Whether a pair at an edge of the modelled contact carries load, or wears, at a frequency."""
    contact, frequencies = given.block.model.contact, np.array([state.frequency for state in states])
    vibrating = [state.start.state for state in states if state.start.state is not None]
    pressure = np.array([each.contact_force_h[:, 0, 0] for each in vibrating]) / contact.area
    density = np.array([state.density for state in states])
    return not math.isnan(first_cut_off(contact, frequencies, pressure, density))


def _slope_of(given: BlockInput, state: SweptState) -> FloatArray:
    """Derivative (n_contact, n_contact) of the density of a state with respect to the depths, 1/Hz."""
    if not state.density.any():
        return np.zeros((state.density.size, state.density.size))
    slope = rate_slope(*given.wearing_joint(state.start), (state.density > 0.0) | (given.depth > 0.0))
    return np.asarray(slope * state.frequency / given.passage.rate)


def wear_in_order(states: Sequence[SweptState], slopes: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Wear (n_contact,), m, of a passage through states in this order, and its derivative by the depth before, from the
    derivatives `slopes` (n_contact, n_contact) of their densities by the depth, 1/Hz.
    """
    unit = np.eye(states[0].density.size)
    # columns: the wear, and the change of the depth after the passage
    grown: FloatArray = np.zeros((len(unit), len(unit) + 1))
    before, rise = states[0].frequency, np.zeros_like(grown)
    for state, slope in zip(states, slopes, strict=True):
        half, source = 0.5 * abs(state.frequency - before), np.column_stack([state.density, slope])
        grown = np.asarray(np.linalg.solve(unit - half * slope, grown + half * (rise + source)))
        before, rise = state.frequency, source + slope @ grown
    return np.maximum(grown[:, 0], 0.0), grown[:, 1:]


def parts_of(states: Sequence[SweptState]) -> FloatArray:
    """Wear (n, n_contact), m, that belongs to each of the frequencies, ascending, by the trapezoidal rule."""
    return _by_trapezoids(states, [state.density for state in states])


def _by_trapezoids(states: Sequence[SweptState], density: Sequence[FloatArray]) -> FloatArray:
    """Parts (n, n_contact) of the integral of a density (n, n_contact) over the frequencies of states."""
    width = np.diff([state.frequency for state in states])
    return np.asarray(0.5 * (np.append(0.0, width) + np.append(width, 0.0))[:, None] * np.array(density))


def find_states(given: BlockInput) -> Swept | Failure:
    """The states of one passage at the depth before it, as many as its wear needs."""
    passage, area = given.passage, given.mission.area
    # the frequencies have half of what the steps over missions leave to the blocks
    aim = SHARE_OF_CAUSE**2 * (1.0 if given.guide is None else RTOL_RATIO) * given.mission.settings.rtol
    low, high = sorted((passage.start, passage.stop))
    least = np.linspace(low, high, FIRST_FREQUENCIES).tolist()
    # the mission before has found the frequencies that count: a second sweep is then seldom needed
    wanted, iterations = list(given.earlier if isinstance(given.earlier, tuple) else least), 0
    states: list[SweptState] = []
    while wanted:
        more = states_at(given, np.array(sorted(wanted)))
        if isinstance(more, Failure):
            return more
        iterations += max(state.start.newton_iterations for state in more)
        states = sorted([*states, *more], key=lambda state: state.frequency)
        errors, volume = interval_errors(states, area), float((parts_of(states) @ area).sum())
        # wear that is small beside the wear so far, or beside that by all work of the excitation, may be round-off
        size = max(float(np.abs(state.response).max()) for state in states)
        work = np.pi * given.block.excitation_amplitude * size * passage.cycles
        least_wear = max(NEGLIGIBLE * float(given.depth @ area), ROUND_OFF * given.mission.wear_coefficient * work)
        allowed, error = aim * max(volume, least_wear), float(errors.sum())
        wanted = []
        if error > allowed and len(states) < MOST_NODES:
            for place in np.flatnonzero(errors > allowed / len(errors)):
                wanted.extend(_between(states[place], states[place + 1], FINEST_INTERVAL * passage.rate**0.5))
    return Swept(tuple(states), error, iterations, _needed(states, errors, allowed / len(errors), least))


def _needed(states: list[SweptState], errors: FloatArray, allowed: float, least: Sequence[float]) -> tuple[float, ...]:
    """The frequencies `least`, Hz, and those whose absence makes the error of an interval larger than allowed, m3."""
    needed = [states[0].frequency]
    for place in range(1, len(states) - 1):
        at = states[place].frequency
        # an interval twice as long has eight times the error; of two neighbours one is kept
        dropped = needed[-1] == states[place - 1].frequency and 8.0 * errors[place - 1 : place + 1].sum() < allowed
        if at in least or not dropped:
            needed.append(at)
    return (*needed, states[-1].frequency)


def _between(one: SweptState, other: SweptState, finest: float) -> list[float]:
    """Further frequencies between two, Hz: both sides of a jump, or the middle of an interval above `finest`, Hz."""
    low, high, near = one.frequency, other.frequency, NEGLIGIBLE * one.frequency
    folds = {each.start.fold_frequency for each in (one, other) if low + near < each.start.fold_frequency < high - near}
    if one.start.branch != other.start.branch and folds:
        return [side for fold in folds for side in (fold - near, fold + near)]
    return [0.5 * (low + high)] if high - low > max(2.0 * near, finest) else []


def interval_errors(states: Sequence[SweptState], area: FloatArray) -> FloatArray:
    """Estimated errors (n - 1,) of the trapezoidal rule between neighbouring frequencies, m3, pair by pair.

    h^3 / 12 times the larger second derivative of the integrand at both ends, from three neighbours on one branch. An
    interval with a jump, or without a third state on its branch, may be wrong by half of the difference of its ends.
    """
    at, density = np.array([state.frequency for state in states]), np.array([state.density for state in states])
    branch = np.array([state.start.branch for state in states])
    width, rise = np.diff(at), np.diff(density, axis=0)
    # divided differences of three states (n, n_contact), NaN across a jump and at both ends
    bent = np.full_like(density, np.nan)
    bent[1:-1] = np.abs(np.diff(rise / width[:, None], axis=0)) / (at[2:] - at[:-2])[:, None]
    bent[1:-1][(branch[2:] != branch[1:-1]) | (branch[1:-1] != branch[:-2])] = np.nan
    second = np.fmax(bent[:-1], bent[1:])
    errors = np.where(np.isnan(second), 0.5 * width[:, None] * np.abs(rise), second * width[:, None] ** 3 / 6.0)
    return np.asarray(errors @ area)


def states_at(given: BlockInput, frequencies: FloatArray) -> list[SweptState] | Failure:
    """States of the sweep through the range at given frequencies, ascending, Hz."""
    # errors of a reference solution are not used
    known = () if given.guide is None else given.guide.resolutions
    states, sweeps = list[SweptState](), given.sweeps(given.passage.sweep, given.block.excitation_amplitude, known)
    for index, start in sweeps.states(frequencies):
        if start.state is None:
            return Failure(start.outcome, start.message)
        if computing_time() > given.deadline:
            raise OutOfTimeError
        wearing, state = given.wearing_joint(start)
        joint, frequency = wearing.joint_of(state), float(frequencies[index])
        density, heat = (each * frequency / given.passage.rate for each in (state.rate, state.energy_rate))
        vibration = first_response(joint, state.at), largest_responses(joint, state.at)
        states.append(SweptState(frequency, start, density, heat, *vibration))
    return states


def delay_of(given: BlockInput, states: Sequence[SweptState]) -> tuple[float, float]:
    """Sweep rate `|df/dt| / (zeta f)^2` and lag, Hz, of a passage through states; infinite without damping.

    With the mode nearest to the largest response, of the joint whose closed pairs stick, or slide or are open where the
    joint cannot move otherwise. No delay without mass.
    """
    largest = max(states, key=lambda state: float(np.abs(state.response).max())).start.state
    assert largest is not None
    model, closed = given.model, largest.contact_force_h[:, 0, 0] > 0.0
    joints = ((closed, True), (closed, False), (np.zeros_like(closed), False))
    modes = (linear_mode(model, held, sticking=sticking, near=largest.omega) for held, sticking in joints)
    mode = next((found for found in modes if found is not None), None)
    if mode is None:
        return 0.0, 0.0
    width, rate = mode.damping_ratio * mode.omega / (2.0 * math.pi), given.passage.rate
    return (rate / width**2, rate / (2.0 * math.pi * width)) if width > 0.0 else (math.inf, math.inf)
