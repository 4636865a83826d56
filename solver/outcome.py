"""How a computation ended. A failure is a value with a sentence; the caller decides whether to raise an exception."""

from __future__ import annotations

import math
import traceback
from enum import IntEnum
from pathlib import Path

SENSITIVE_ERROR = 0.5
"""Limit of the relative error of the last worn volume. Above this limit the outcome is SENSITIVE."""


class Outcome(IntEnum):
    """End of a computation. Result files store the number, so that a number never changes its meaning."""

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
    CONTACT_CUT_OFF = 18
    UNSETTLED = 19
    RESONANCE_LOST = 20

    @property
    def complete(self) -> bool:
        """Whether the point was computed to the end. Its values are then results, each with an estimated error."""
        return self in (Outcome.CONVERGED, Outcome.INACCURATE, Outcome.SENSITIVE)

    @property
    def meaning(self) -> str:
        """One word for `flag_meanings` in a result file."""
        return self.name.lower()

    @property
    def sentence(self) -> str:
        """Sentence for the user about what has happened. The remedy depends on settings that are not known here."""
        return _SENTENCES[self]

    @property
    def sentence_of_mode(self) -> str:
        """The same of a point of a nonlinear mode."""
        return _OF_MODES.get(self, _SENTENCES[self])


COMPLETE = frozenset(outcome for outcome in Outcome if outcome.complete)
"""Outcomes of points that were computed to the end."""

_SENTENCES = {
    Outcome.CONVERGED: "The point was computed to the end. How well it is known say error_estimate (worn volume) and"
    " response_error (vibration).",
    Outcome.STATIC_FAILED: "The static contact state was not found: check static load, gaps and supports.",
    Outcome.START_FAILED: "No periodic state was found at the start of the sweep, not even with the excitation raised"
    " gradually.",
    Outcome.BRANCH_LOST: "The branch could not be followed to this frequency.",
    Outcome.MARCH_FAILED: "A step on the slow time scale did not converge, even after it was divided.",
    Outcome.INACCURATE: "The point was computed to the end, but the estimated error of response or wear rate is above"
    " rtol for some of the cycles: response_error and wear_rate_error say by how much.",
    Outcome.SENSITIVE: "The point was computed to the end, but the worn volume depends so much on the step or on the"
    " start state that one number says little: two computations of nearly the same case differ by more than half.",
    Outcome.CERTIFICATE_FAILED: "A state was found that violates contact law or energy balance beyond the limits.",
    Outcome.UNSTABLE: "Only an unstable periodic state was found, in which no machine stays.",
    Outcome.PERIOD_DOUBLED: "The joint bounces, and its vibration repeats after two periods of the excitation or more,"
    " which is not computed: the state that repeats after one is unstable.",
    Outcome.STEP_TOO_LONG: "A step on the slow time scale wears off so much at once that many times the normal forces"
    " of the joint would move: its end is no result. The variable message says which step, and how long it may be.",
    Outcome.NO_FINAL_STATE: "Wear goes on without end: the point has no final state, and message says at which rate it"
    " wears.",
    Outcome.CONTACT_CUT_OFF: "The contact goes on beyond the pairs that model it: a pair at their edge carries load or"
    " wears, so that the scar is cut off, too narrow and too deep. Give the model pairs farther out: of a bundled scene"
    " a larger half_width, or none so that it is chosen, and as many more strips or patches.",
    Outcome.ADRIFT: "The whole joint slips in every period and its mean friction does not hold its parts: they drift"
    " along each other and there is no periodic state. Less excitation, more friction or a stop would hold them.",
    Outcome.UNSETTLED: "The vibration does not settle: left to itself for some hundred periods it comes to none that"
    " repeats, as where the joint slips or opens all over. More static load, friction or damping, or less excitation,"
    " would give it grip.",
    Outcome.RESONANCE_LOST: "No resonance was found, or none any more, in the range in which the excitation follows the"
    " resonance: message says where. The values before hold.",
    Outcome.TIME_LIMIT: "The computation took longer than solver.time_limit and was given up: --retry-failed goes on"
    " with a larger one.",
    Outcome.EXCEPTION: "The computation broke off with an error that it should not have; see the variable message.",
    Outcome.CRASHED: "The process that computed this point crashed; see the variable message.",
    Outcome.NOT_COMPUTED: "The run ended before this point was computed: the same command goes on from here.",
    Outcome.SINGULAR: "The structure with its joint held is singular at a harmonic of this frequency: give it damping"
    " or a support.",
}


_OF_MODES = {
    Outcome.CONVERGED: "The point was computed to the end. How well it is known say natural_frequency_error and"
    " damping_ratio_error.",
    Outcome.START_FAILED: "The mode was not found where its amplitudes begin; see the variable message.",
    Outcome.BRANCH_LOST: "The mode could not be followed to this amplitude: it may turn back there, as folds of the"
    " amplitude are not passed, meet another mode, or end where the whole joint slides.",
    Outcome.INACCURATE: "The point was computed to the end, but the estimated error of natural frequency or damping"
    " ratio is above rtol: natural_frequency_error and damping_ratio_error say by how much.",
}


def known_to(error: float, rtol: float) -> str:
    """Text of a relative error above `rtol`, as "is known to 2.6 % only", with enough digits to show the excess."""
    if math.isinf(error):
        return "is not known"
    short = f"{100.0 * error:.2g}"
    return f"is known to {short if float(short) > 100.0 * rtol else f'{100.0 * error:.6g}'} % only"


def describe_error(error: Exception) -> str:
    """Text of an unexpected error with file and line of its origin, in one line for the result file."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({Path(frame.filename).name}, line {frame.lineno})" for frame in last)
    return " ".join(f"{type(error).__name__}: {error}{place}".split())
