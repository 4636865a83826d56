"""How much work wear histories are, and how much of it is done."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from studyrunner.kinds.wear.kind import OWN_STEPS

# Newton iterations, see `estimate`
_A_STEP = 2.5  # in slow time, explicit or implicit (2 to 4 where the joint slips, dovetail 2.2)
_AN_ADAPTIVE_STEP = 10  # with refused steps and the reference solution (36 and 48 pairs near the resonance: 4 to 13)
_ADAPTIVE_STEPS = 40  # of a history
_STEPS_TO_THE_END = 100  # of a history until nothing wears any more, with growing steps (20 pairs: 50 to 110)

_OF_REFERENCE = 0.36
"""Share of the reference solution in the time of an adaptive history (dovetail with 16 pairs: 0.28 to 0.39)."""

_OF_EVOLUTION, _AN_ENERGY = 1.6, 1.0
"""Time of a history whose contact changes between two energies of [wear.evolution], over that of any other, and how
much more each further energy takes: a pair that comes to one has a corner there. Dovetail with 16 pairs at its
resonance: 1.4 and 1.6 with two, and with four 2.0 (`running_in`), 2.4, and 10 where pairs come to them one by one
through the whole history."""


class _Solution(NamedTuple):
    """One of the solutions that histories integrate. iterations: of Newton's method. adaptive: whether steps grow."""

    iterations: float
    adaptive: bool


def _solutions(steps: Sequence[tuple[str, float]], cycles: float) -> list[_Solution]:
    """What is integrated for histories over so many cycles, in this order. steps: scheme and step of each; those with
    given steps are compared with the adaptive history.
    """
    found = list[_Solution]()
    adaptive = _AN_ADAPTIVE_STEP * (_ADAPTIVE_STEPS if cycles < math.inf else _STEPS_TO_THE_END)
    for scheme, step in steps:
        if scheme not in OWN_STEPS:
            found.append(
                _Solution(_A_STEP * (max(1.0, cycles / step) if cycles < math.inf else _STEPS_TO_THE_END), False)
            )
        if not any(each.adaptive for each in found):
            found += [_Solution(share * adaptive, True) for share in (1.0 - _OF_REFERENCE, _OF_REFERENCE)]
    return found


def iterations_of(steps: Sequence[tuple[str, float]], cycles: float, n_energies: int = 0) -> float:
    """Newton iterations of histories over so many cycles where the joint wears, each of usual length. steps: scheme and
    step of each. n_energies: of [wear.evolution], 0 without it.
    """
    longer = _OF_EVOLUTION + _AN_ENERGY * (n_energies - 2) if n_energies else 1.0
    return longer * sum(each.iterations for each in _solutions(steps, cycles)) if cycles > 0.0 else _A_STEP


def share_done(scheme: str, step: float, cycles: float, n_complete: int, share: float) -> float:
    """How much of the work of a history is done, with what it is compared with, 0 to 1; 0 where that is not known.

    scheme, step, cycles: of the history. n_complete, share: as `solver.wear.slow_time.Report` has them. Adaptive steps
    are short at first: half of the time is over after 0.2 to 0.6 of the cycles (dovetail, 16 pairs).
    """
    solutions = _solutions([(scheme, step)], cycles)
    if n_complete >= len(solutions):
        return 0.0
    now, whole = solutions[n_complete], sum(each.iterations for each in solutions)
    done = sum(each.iterations for each in solutions[:n_complete])
    return (done + now.iterations * (math.sqrt(share) if now.adaptive else share)) / whole
