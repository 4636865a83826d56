"""How a computation ended. A failure is a value with a sentence; the caller decides whether to raise an exception.

How well its result is known: an error that is not known is inf.
"""

import math
import re
import traceback
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    STATIC_SLIDING = 21
    STATIC_OPEN = 22

    def __str__(self) -> str:
        return self.meaning

    __repr__ = __str__

    @property
    def complete(self) -> bool:
        """Whether the point was computed to the end. Its values are then results, each with an estimated error."""
        return self in (Outcome.CONVERGED, Outcome.INACCURATE, Outcome.SENSITIVE)

    @property
    def static(self) -> bool:
        """Whether there is no static state, so that no vibration was sought."""
        return self in (Outcome.STATIC_FAILED, Outcome.STATIC_SLIDING, Outcome.STATIC_OPEN)

    @property
    def meaning(self) -> str:
        """One word for `flag_meanings` in a result file."""
        return self.name.lower()

    @property
    def sentence(self) -> str:
        """Sentence for the user about what has happened. The remedy depends on settings that are not known here."""
        return _SENTENCES[self]

    @property
    def happened(self) -> str:
        """Of the sentence what has happened, without what stands behind a colon or a full stop."""
        return re.split(r"[:.](?= |$)", self.sentence)[0]


COMPLETE = frozenset(outcome for outcome in Outcome if outcome.complete)
"""Outcomes of points that were computed to the end."""

_SENTENCES = {
    Outcome.CONVERGED: "The point was computed to the end; see the variables of its estimated errors.",
    Outcome.STATIC_FAILED: "The static contact state was not found: check static load, gaps and supports.",
    Outcome.START_FAILED: "No periodic vibration was found where the sweep or the nonlinear mode begins, even with the"
    " excitation raised gradually; see the variable message.",
    Outcome.BRANCH_LOST: "The vibration could not be followed to this frequency or amplitude. A nonlinear mode may"
    " turn back before it (a fold), meet another mode, or end where the whole joint slides.",
    Outcome.MARCH_FAILED: "A step on the slow time scale did not converge, even after the step was divided.",
    Outcome.INACCURATE: "The point was computed to the end, but the error of a worn volume, a vibration, a wear rate,"
    " a natural frequency or a damping ratio is above rtol (see the variables of these errors), or it is not known, or"
    " the stability of a vibration is not (see the variable message).",
    Outcome.SENSITIVE: "The point was computed to the end, but its worn volume is not known: two computations of"
    " nearly the same case, with other steps and another start state, differ by more than half.",
    Outcome.CERTIFICATE_FAILED: "A state was found that violates contact law or energy balance beyond the limits.",
    Outcome.UNSTABLE: "Only an unstable periodic vibration was found. A real joint does not stay in it.",
    Outcome.PERIOD_DOUBLED: "The joint bounces, and its vibration repeats after two or more periods of the excitation."
    " Such vibrations are not computed, and the vibration that repeats after one period is unstable.",
    Outcome.STEP_TOO_LONG: "A step on the slow time scale wears off so much at once that many times the normal forces"
    " of the joint would move. The end of this step is no result; message names the step and how long it may be.",
    Outcome.NO_FINAL_STATE: "Wear does not come to an end, so the point has no final state. message gives its rate.",
    Outcome.CONTACT_CUT_OFF: "The contact goes on beyond the modelled pairs: a pair at their edge carries load or"
    " wears. Give the model pairs farther out: a bundled scene needs a larger half_width, or none, and as many more"
    " strips or patches.",
    Outcome.ADRIFT: "The whole joint slips in every period, and the mean friction does not hold its parts: they drift"
    " along each other, and there is no periodic vibration. Less excitation, more friction or a stop, as"
    " retention_stiffness of a scene, would hold them.",
    Outcome.UNSETTLED: "The vibration does not settle: after some hundred periods it does not repeat, as happens where"
    " the whole joint slips or opens. More static load, friction or damping, or less excitation, would help.",
    Outcome.RESONANCE_LOST: "The excitation follows the resonance, but there was no resonance in the range, or the"
    " resonance left the range: message says where. The values before are valid.",
    Outcome.STATIC_SLIDING: "The joint has no static state: the static load pushes a part along its contacts with more"
    " force than friction can bear. More friction or normal force, less load, or a support would hold it.",
    Outcome.STATIC_OPEN: "The joint has no static state: the static load lifts or tips a part off its contacts. Check"
    " direction and place of the static load, gaps and supports.",
    Outcome.TIME_LIMIT: "The computation took longer than its time limit and was stopped.",
    Outcome.EXCEPTION: "The computation ended with an unexpected error; see the variable message.",
    Outcome.CRASHED: "The process that computed this point crashed; see the variable message.",
    Outcome.NOT_COMPUTED: "The run ended before this point was computed. The same command continues.",
    Outcome.SINGULAR: "The structure with its joint held is singular at a harmonic of this frequency: give the"
    " structure damping or a support.",
}


def absolute(relative: ArrayLike, size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Errors of sizes from relative ones, 0 where a size is not above 0: of nothing also where these are not known."""
    whole = np.zeros(np.broadcast_shapes(np.shape(relative), size.shape))
    return np.multiply(relative, size, out=whole, where=size > 0.0)


def in_whole(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Error (...) of a sum from the errors (..., n) of its parts, with signs: their sum, or that of independent parts
    where it is larger. Pairs of a symmetric joint err in twos: two equal ones count as one.
    """
    most = np.abs(parts).sum(axis=-1)
    known = np.where(np.isinf(most)[..., None], 0.0, parts)
    alone = np.minimum(math.sqrt(2.0) * np.linalg.norm(known, axis=-1), most)
    return np.where(np.isinf(most), np.inf, np.maximum(np.abs(known.sum(axis=-1)), alone))


class Ended:
    """How a computation ended. Raises ValueError where no sentence says why: only the program can make this mistake."""

    outcome: Outcome
    message: str

    def __post_init__(self) -> None:
        if self.outcome is not Outcome.CONVERGED and not self.message:
            raise ValueError(f"{self.outcome.meaning} without a sentence about the reason")


def check(name: str, right: bool | np.bool_, remedy: str) -> None:
    """Raises ValueError with a sentence about an argument that is not right: its name, and what to give."""
    if not right:
        raise ValueError(f"{name}: {remedy}")


def known_to(error: float, rtol: float) -> str:
    """Text of a relative error above `rtol`, as "known to 2.6 % only", with enough digits to show the excess."""
    short = f"{100.0 * error:.2g}"
    return f"known to {short if float(short) > 100.0 * rtol else f'{100.0 * error:.6g}'} % only"


def is_known_to(error: float, rtol: float) -> str:
    """The same of the error of a state, "is known to 2.6 % only"; or why this error, inf, is not known."""
    if math.isinf(error):
        return "cannot be compared with that of more harmonics or samples: its error is not known"
    return f"is {known_to(error, rtol)}"


def in_digits(value: float, digits: int = 6) -> str:
    """Text of a number with so many significant digits, without an exponent below 1e15: 2000 for "2e+03"."""
    return f"{float(f'{value:.{digits}g}'):.15g}"


def is_machine_fault(error: BaseException) -> bool:
    """Whether the machine has failed, its disk, its memory or its cache of kernels, and not the computation."""
    # the last ones by name and words: numba, where its cache is cut off, and Python have no class of their own for them
    return (
        isinstance(error, OSError | EOFError | ImportError | MemoryError)
        or type(error).__name__ == "UnpicklingError"
        or "can't start new thread" in str(error)
    )


def describe_error(error: BaseException) -> str:
    """Text of an unexpected error in one line for the result file, with function, file and line where it was called."""
    frames = traceback.extract_tb(error.__traceback__)
    # libraries say what they were given, not what for
    own = [frame for frame in frames if not {"numpy", "scipy", "numba"} & {*Path(frame.filename).parts}] or frames
    place = "".join(f" ({each.name}, {Path(each.filename).name}, line {each.lineno})" for each in own[-1:])
    return " ".join(f"{type(error).__name__}: {error}{place}".split())
