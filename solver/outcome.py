"""How a computation ended. Failure is a value with a sentence; raising is the caller's choice."""

from __future__ import annotations

import traceback
from enum import IntEnum
from pathlib import Path

SENSITIVE_ERROR = 0.5
"""Relative error of the last worn volume from which on one number says too little."""


class Outcome(IntEnum):
    """End of a computation; the number is stored in result files, so numbers are never used again for others."""

    CONVERGED = 0
    STATIC_FAILED = 1
    START_FAILED = 2
    BRANCH_LOST = 3
    MARCH_FAILED = 4
    SINGULAR = 5
    INACCURATE = 6
    CERTIFICATE_FAILED = 7
    UNSTABLE = 8
    ADRIFT = 9
    TIME_LIMIT = 10
    EXCEPTION = 11
    CRASHED = 12
    NOT_COMPUTED = 13
    PERIOD_DOUBLED = 14
    SENSITIVE = 15
    STEP_TOO_LONG = 16
    NO_FINAL_STATE = 17
    UNSETTLED = 19

    @property
    def complete(self) -> bool:
        """Whether the point was computed to its last cycle: its values are results, each with its error."""
        return self in (Outcome.CONVERGED, Outcome.INACCURATE, Outcome.SENSITIVE)

    @property
    def meaning(self) -> str:
        """One word for `flag_meanings` in a result file."""
        return self.name.lower()

    @property
    def sentence(self) -> str:
        """What a user reads."""
        return _SENTENCES[self]


COMPLETE = frozenset(outcome for outcome in Outcome if outcome.complete)
"""Outcomes of points that were computed to their last cycle."""

_SENTENCES = {
    Outcome.CONVERGED: "The point was computed to tolerance.",
    Outcome.STATIC_FAILED: "The static contact state was not found: check static load, gaps and supports.",
    Outcome.START_FAILED: "No periodic state was found at the start of the sweep, not even with the excitation raised"
    " gradually: use more harmonics or start elsewhere.",
    Outcome.BRANCH_LOST: "The branch could not be followed to this frequency: use more harmonics or another sweep.",
    Outcome.MARCH_FAILED: "A step on the slow time scale did not converge, even after it was divided: use a smaller"
    " step or more harmonics.",
    Outcome.INACCURATE: "Computed to the end, but the estimated error of response or wear rate stays above rtol for"
    " some of the cycles, with as many harmonics as may be used: response_error and wear_rate_error say by how much.",
    Outcome.SENSITIVE: "The worn volume depends so much on the step or on the start state that one number says little:"
    ' two computations of nearly the same case differ by more than half; use scheme = "adaptive" or a smaller step.',
    Outcome.CERTIFICATE_FAILED: "A state was found that violates contact law or energy balance beyond the limits:"
    " use more samples or a smaller tolerance.",
    Outcome.UNSTABLE: "Only an unstable periodic state was found, in which no machine stays: sweep in the other"
    " direction or raise the excitation at fixed frequency.",
    Outcome.PERIOD_DOUBLED: "The joint bounces, and its vibration repeats after two periods of the excitation or more,"
    " which is not computed: the state that repeats after one is unstable.",
    Outcome.STEP_TOO_LONG: "A step on the slow time scale wears off so much at once that many times the normal forces"
    " of the joint would move: its end is no result. The variable message says which step, and how long it may be.",
    Outcome.NO_FINAL_STATE: "Wear goes on without end: the point has no final state, and message says at which rate it"
    " wears. Give slow_time.cycles or slow_time.until an end.",
    Outcome.ADRIFT: "The whole joint slips in every period and its mean friction does not hold its parts: they drift"
    " along each other and there is no periodic state. Less excitation, more friction or a stop would hold them.",
    Outcome.UNSETTLED: "The vibration does not settle: left to itself for some hundred periods it comes to none that"
    " repeats, as where the joint slips or opens all over. More static load, friction or damping, or less excitation,"
    " would give it grip.",
    Outcome.TIME_LIMIT: "The computation took longer than solver.time_limit and was given up.",
    Outcome.EXCEPTION: "The computation broke off with an error that it should not have; see the variable message.",
    Outcome.CRASHED: "The process that computed this point crashed; see the variable message.",
    Outcome.NOT_COMPUTED: "The run ended before this point was computed: the same command goes on from here.",
    Outcome.SINGULAR: "The structure with its joint held is singular at a harmonic of this frequency: give it damping"
    " or a support.",
}


def describe_error(error: Exception) -> str:
    """What an unexpected error says, and where it came from: one line for the result file."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({Path(frame.filename).name}, line {frame.lineno})" for frame in last)
    return " ".join(f"{type(error).__name__}: {error}{place}".split())
