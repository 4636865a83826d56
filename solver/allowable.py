"""The allowable excitation: the amplitude at which the wear just meets its target at the last cycle count.

Each amplitude has a history of its own, from a sweep of its own. Between an amplitude that wears less and one that
wears more, Brent's method finds where wear over target is 1. Nothing wears below the amplitude at which slip begins;
above it the wear grows steeply.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from solver.histories import march_wear
from solver.model import ReducedModel
from solver.outcome import Ended, Outcome, check, in_digits, known_to
from solver.packing import packable
from solver.results.history import WearHistory
from solver.settings import TARGETS, Followed, SolverSettings, WearTarget

FIRST_AMPLITUDE = 1.0
"""The first amplitude, N."""

STRIDE = 4.0
"""Ratio of two amplitudes on the way to one that wears less and one that wears more."""

MOST_TRIED = 30
"""Most amplitudes on this way: up to 1e18 N, or down to 1e-18 N."""

SHARE_OF_RTOL = 0.25
"""Part of `rtol` that is left: of the amplitude, and of the wear."""

BEYOND = 1.5
"""Wear over target at which a history ends: those near the target have values at all counts."""

JUMP = 1.2
"""Ratio of the wear of two such amplitudes from which on it is a jump."""


@packable
@dataclass(frozen=True)
class Tried:
    """A history at an amplitude, N.

    wear: over the target at the last cycle count, or, where the history ends at `BEYOND` times the target, this ratio
    times that of the last count and the one reached; NaN where the history failed. error: of it.
    """

    amplitude: float
    wear: float
    error: float


@dataclass(frozen=True, repr=False)
class Allowable(Ended):
    """The amplitude at which the wear meets its target at the last cycle count.

    - amplitude, error: N. Where the wear is steep or jumps past the target, the amplitude before. inf: none wears
      so much. NaN: a history that is needed failed.
    - history: at this amplitude, or the last one that was tried.
    - tried: all amplitudes, ascending.
    - outcome, message: whether the amplitude is known within `rtol`, or why there is none.
    """

    outcome: Outcome
    amplitude: float
    error: float
    history: WearHistory
    tried: tuple[Tried, ...]
    message: str = ""


def allowable_amplitude(
    model: ReducedModel,
    frequency: float | Followed,
    friction_coefficient: ArrayLike | None,
    wear_coefficient: float,
    cycles: ArrayLike,
    until: WearTarget,
    *,
    settings: SolverSettings | None = None,
    **options: Any,
) -> Allowable:
    """The excitation amplitude at which the wear meets its target at the last of some cycle counts.

    until: "wear_depth" of the deepest pair or "worn_volume". options, and all others: as in `march_wear`, which also
    has the errors that are raised. Raises ValueError as well where nothing can wear, and for another target.
    """
    settings = SolverSettings() if settings is None else settings
    check("until", until.quantity in TARGETS[:2], f'give "{TARGETS[0]}" or "{TARGETS[1]}"')
    check("wear_coefficient", wear_coefficient > 0.0, "give one above 0: nothing wears")
    check("cycles", 0.0 < np.max(cycles) < math.inf, "give a last count above 0, not inf")
    more = {**options, "settings": settings, "until": stopping_at(until)}

    def history_at(amplitude: float) -> WearHistory:
        return march_wear(model, frequency, amplitude, friction_coefficient, wear_coefficient, cycles, **more)

    return find_allowable(history_at, until, settings.rtol)


def stopping_at(until: WearTarget) -> WearTarget:
    """The target at which histories of a search for another target end."""
    return replace(until, value=BEYOND * until.value)


def find_allowable(
    history_at: Callable[[float], WearHistory],
    until: WearTarget,
    rtol: float,
    known: tuple[Tried, ...] = (),
    keep: Callable[[tuple[Tried, ...]], None] = lambda _: None,
) -> Allowable:
    """As `allowable_amplitude`, of a function from the amplitude, N, to the history, which may end where `stopping_at`
    says. Calls it last with the amplitude of the result.

    known, keep: what an earlier search has given to `keep`, after each history; the result is equal to the last bit.
    """
    search = _Search(history_at, until, keep, {each.amplitude: each for each in known})
    below, above = _bracket(search)
    if math.isnan(above):
        return search.found(math.nan, math.nan, below)
    if math.isinf(above):
        said = f"no amplitude up to {in_digits(below, 3)} N wears as much as the target"
        return search.found(math.inf, math.inf, below, said)
    left = SHARE_OF_RTOL * rtol

    def excess(amplitude: float) -> float:
        tried = search.at(amplitude)
        if math.isnan(tried.wear):
            raise _FailedError(amplitude)
        # a wear within what is left is the target: the search ends there
        return tried.wear - 1.0 if abs(tried.wear - 1.0) > left else 0.0

    try:
        root = brentq(excess, below, above, xtol=left * below, rtol=4.0 * np.finfo(float).eps)
    except _FailedError as failed:
        return search.found(math.nan, math.nan, failed.amplitude)
    return _judged(search, root, rtol)


class _FailedError(Exception):
    """A history that is needed between two others failed."""

    def __init__(self, amplitude: float) -> None:
        super().__init__(amplitude)
        self.amplitude = amplitude


@dataclass
class _Search:
    """The histories so far, by amplitude, N; and the last one, which the result takes where it is the right one."""

    history_at: Callable[[float], WearHistory]
    until: WearTarget
    keep: Callable[[tuple[Tried, ...]], None]
    tried: dict[float, Tried]
    last: tuple[float, WearHistory] | None = field(default=None)

    @property
    def all(self) -> tuple[Tried, ...]:
        """All that was tried, by ascending amplitude."""
        return tuple(self.tried[amplitude] for amplitude in sorted(self.tried))

    def history(self, amplitude: float) -> WearHistory:
        """History at an amplitude."""
        if self.last is None or self.last[0] != amplitude:
            self.last = amplitude, self.history_at(amplitude)
        return self.last[1]

    def at(self, amplitude: float) -> Tried:
        """What a history at an amplitude says."""
        if amplitude not in self.tried:
            self.tried[amplitude] = _compared(amplitude, self.history(amplitude), self.until)
            self.keep(self.all)
        return self.tried[amplitude]

    def found(self, amplitude: float, error: float, of: float, said: str = "") -> Allowable:
        """The result with the history of an amplitude. said: why it is not known, or "" where the history says it."""
        history = self.history(of)
        outcome = Outcome.INACCURATE if history.outcome.complete else history.outcome
        message = said or f"at {in_digits(of, 3)} N: {history.message}"
        return Allowable(outcome, amplitude, error, history, self.all, message)


def _compared(amplitude: float, history: WearHistory, until: WearTarget) -> Tried:
    """What a history says about its amplitude."""
    if not math.isnan(count := history.cycles_to_target):
        wear = BEYOND * float(history.cycles[-1]) / count
        return Tried(amplitude, wear, wear * history.cycles_to_target_error / count)
    if not history.outcome.complete:
        return Tried(amplitude, math.nan, math.inf)
    if until.quantity == "worn_volume":
        wear = float(history.worn_volume[-1]) / until.value
        return Tried(amplitude, wear, wear * float(history.worn_volume_error[-1]) if wear > 0.0 else 0.0)
    deepest = int(np.argmax(history.wear_depth[-1]))
    values = history.wear_depth[-1, deepest], history.wear_depth_error[-1, deepest]
    return Tried(amplitude, *(float(value) / until.value for value in values))


def _bracket(search: _Search) -> tuple[float, float]:
    """An amplitude, N, that wears less than the target, and one that wears more; inf in place of the second where none
    does, NaN where histories fail before; then in place of the first the one that failed.
    """
    below, above, failed, amplitude = 0.0, math.inf, math.inf, FIRST_AMPLITUDE
    for _ in range(MOST_TRIED):
        wear = search.at(amplitude).wear
        if math.isnan(wear):
            failed = amplitude
        elif wear > 1.0:
            above = amplitude
        else:
            below = amplitude
        if 0.0 < below < above < math.inf:
            return below, above
        if below == 0.0:
            amplitude /= STRIDE
        elif failed > STRIDE**0.125 * below:
            amplitude = min(below * STRIDE, math.sqrt(below * failed))
        else:
            break
    return (below, math.inf) if math.isinf(failed) else (failed, math.nan)


def _judged(search: _Search, root: float, rtol: float) -> Allowable:
    """The amplitude with its error: that of the wear over its slope, and what the search has left."""
    known = [each for each in search.all if not math.isnan(each.wear)]
    above = min((each for each in known if each.wear > 1.0), key=lambda each: each.amplitude)
    # a larger amplitude may wear less again
    less = (each for each in known if each.wear <= 1.0 and each.amplitude < above.amplitude)
    below = max(less, key=lambda each: each.amplitude)
    here, width, note, least = search.at(root), above.amplitude - below.amplitude, "", 0.0
    if here.wear > 1.0 + SHARE_OF_RTOL * rtol or here.amplitude > above.amplitude:
        # where the wear is steep, the amplitude on the safe side
        here, least = below, width
    error = max((abs(here.wear - 1.0) + here.error) * width / max(above.wear - below.wear, 1e-300), least)
    if above.wear > JUMP * below.wear and width <= 2.0 * SHARE_OF_RTOL * rtol * root:
        here, error = below, width
        note = f"the wear jumps from {below.wear:.3g} to {above.wear:.3g} times the target there"
    relative = error / here.amplitude
    outcome, said = Outcome.CONVERGED, ""
    if not relative <= rtol:
        outcome, said = Outcome.INACCURATE, f"the allowable amplitude is {known_to(relative, rtol)}"
    found = search.found(here.amplitude, error, here.amplitude, "known")
    return replace(found, outcome=outcome, message="; ".join(filter(None, (said, note))))
