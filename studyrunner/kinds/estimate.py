"""Estimated work of a task, for the order of the tasks, the time left and `--plan`: within a factor of two for the
bundled studies on one core. A joint that jumps takes longer; one in which nothing slips takes no step.

Numbers of Newton iterations have in brackets what was measured.
"""

import math
from collections.abc import Sequence
from pathlib import Path

from solver.settings import Passage

_AT_FIRST = 560  # to the first state of a sweep (dovetail 270, deck `blade_root` with up to 13 harmonics 1180)
_OF_RAMP = 180  # to the only state of a ramp (1 and 48 pairs: 221 and 146)
_A_STATE = 50  # each further frequency of a sweep (slider 70, dovetail 65, 130 to 260 at a wall, 3 where nothing slips)
_OF_MODE = 900  # to the first point of a mode; with two more unknowns it takes five times as long as forced vibration
_A_MODE_POINT = 300  # each further amplitude, with errors (study `modes`: 3300 for 9; 30 where nothing slips)
_A_STEP = 2.5  # in slow time, explicit or implicit (2 to 4 where the joint slips, dovetail 2.2)
_AN_ADAPTIVE_STEP = 10  # with refused steps and the reference solution (36 and 48 pairs near the resonance: 4 to 13)
_OF_BLOCK = 20  # of a mission, after its start state (slider: 10 to 35)
_OF_PASSAGE = 900  # (dovetail with 16 pairs, rtol 0.1: 970, 2500 with 40 frequencies, 330 where nothing slips)
_AN_OCTAVE = 350  # of a wide passage (slider from 1 to 10 000 Hz: 5600, and 2700 of its reference solution)
_ADAPTIVE_STEPS = 40  # of a history
_STEPS_TO_THE_END = 100  # of a history until nothing wears any more, with growing steps (20 pairs: 50 to 110)

_MISSIONS_A_DOUBLING = 2.0
"""Missions that are computed for each doubling of their number, by the history and again by its reference solution: 6
of 20 on a slider, 18 to 26 of thousands on a dovetail, 42 of a million on a slider."""

_WAYS = 0.5
"""Iterations of the way to a block in a later mission, over those of the first one (dovetail with 16 pairs: 150 to 190
of 320 to 380; one pair that slips: 2 of 14 missions with 20 missions, 12 of 84 with a million)."""

AUTOMATIC_HARMONICS = 5
"""Harmonics of a state on average where their number is automatic: 1 where nothing slips, 13 in the worst case."""

_AUTOMATIC_HARMONICS_AT_MOST = 9  # for which the memory is estimated

COMPILE_SECONDS = 7  # for the functions of the solver, once on a machine

_BASE_MEMORY = 250e6
_NOTICED_MEMORY = 1e8  # what building a small scene takes is in the libraries' and differs from run to run


def seconds_of(n_unknowns: int, iterations: float) -> float:
    """Time of Newton iterations, s: few of them factorise the Jacobian anew.

    Fits 1.5, 4, 6.5, 8, 35, 45 and 140 ms measured at 20, 660, 1144, 1584, 3360, 5280 and 7056 unknowns within a factor
    of 1.5.
    """
    return iterations * (1.5e-3 + 4.4e-6 * n_unknowns + 2.8e-13 * float(n_unknowns) ** 3)


def iterations_of_sweep(sweep: str, n_frequencies: int) -> int:
    """Newton iterations of a sweep through so many frequencies, or of a ramp."""
    return (_OF_RAMP if sweep == "ramp" else _AT_FIRST) + _A_STATE * (n_frequencies - 1)


def iterations_of_mode(n_amplitudes: int) -> int:
    """Newton iterations of a nonlinear mode at so many amplitudes."""
    return _OF_MODE + _A_MODE_POINT * (n_amplitudes - 1)


def iterations_of_histories(steps: Sequence[tuple[str, float]], cycles: float) -> float:
    """Newton iterations of histories over so many cycles where the joint wears. steps: scheme and step of each; those
    with given steps are compared with the adaptive history.
    """
    if cycles == 0.0:
        return _A_STEP
    given = [step for scheme, step in steps if scheme not in ("adaptive", "final")]
    n_steps = sum(max(1.0, cycles / step) if cycles < math.inf else _STEPS_TO_THE_END for step in given)
    adaptive = _ADAPTIVE_STEPS if cycles < math.inf else _STEPS_TO_THE_END
    return _AN_ADAPTIVE_STEP * adaptive + _A_STEP * n_steps


def missions_computed(missions: float) -> int:
    """Missions that are computed for a number of missions, by the history or by its reference solution."""
    return math.ceil(min(missions, 2.0 + _MISSIONS_A_DOUBLING * math.log2(max(missions, 1.0))))


def iterations_of_missions(blocks: Sequence[tuple[str, float | Passage]], missions: float) -> float:
    """Newton iterations of a mission history. blocks: how each begins, and its frequency."""
    each = 0.0
    for begin, frequency in blocks:
        if isinstance(frequency, Passage):
            each += _OF_PASSAGE + _AN_OCTAVE * abs(math.log2(frequency.stop / frequency.start))
        elif begin == "continue":
            each += 2 * _OF_BLOCK
        else:
            each += _OF_BLOCK + _WAYS * iterations_of_sweep(begin, 1)
    return 2 * missions_computed(missions) * each


def memory_a_rank(n_unknowns: int, result_values: int, automatic: bool, built_with: float) -> float:
    """Memory of one rank, bytes: the libraries, the dense matrix, and the arrays of the result.

    Measured 0.37, 1.10 and 2.72 GB at 48, 160 and 336 pairs with automatic harmonics: within a factor of 1.2.

    n_unknowns: of the largest state. result_values: numbers in the result. automatic: whether the state has
    `AUTOMATIC_HARMONICS`. built_with: memory that building the scene takes beside the libraries, bytes.
    """
    grown = (2.0 * _AUTOMATIC_HARMONICS_AT_MOST + 1.0) / (2.0 * AUTOMATIC_HARMONICS + 1.0) if automatic else 1.0
    built = _NOTICED_MEMORY * math.floor(built_with / _NOTICED_MEMORY)
    return _BASE_MEMORY + max(8.0 * (grown * n_unknowns) ** 2, built) + 8.0 * result_values


def largest_memory() -> float:
    """Largest memory of this process so far, bytes; 0 where the system does not say. That of `getrusage` includes the
    memory of the process that has started this one.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return next((1024.0 * float(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0.0)
