"""Estimated work of a task, for the order of the tasks, the time left and `--plan`: within a factor of two for the
bundled studies on one core. A joint that jumps takes longer; one in which nothing slips takes no step.

Numbers of Newton iterations have in brackets what was measured.
"""

import math
from pathlib import Path

_AT_FIRST = 560  # to the first state of a sweep (dovetail 270, deck `blade_root` with up to 13 harmonics 1180)
_OF_RAMP = 180  # to the only state of a ramp (1 and 48 pairs: 221 and 146)
A_STATE = 50  # each further frequency of a sweep (slider 70, dovetail 65, 130 to 260 at a wall, 3 where nothing slips)

AUTOMATIC_HARMONICS = 5
"""Harmonics of a state on average where their number is automatic: 1 where nothing slips, 13 in the worst case."""

_AUTOMATIC_HARMONICS_AT_MOST = 9  # for which the memory is estimated

COMPILE_SECONDS = 7  # for the functions of the solver, once on a machine

_BASE_MEMORY = 250e6
_RING_UNKNOWN = 5e4  # bytes, of states, derivatives, and inverses in waves
_NOTICED_MEMORY = 1e8  # what building a small scene takes is in the libraries' and differs from run to run


def seconds_of(n_unknowns: int, iterations: float, n_sectors: int = 1) -> float:
    """Time of Newton iterations, s: few of them factorise the Jacobian anew.

    Fits 1.5, 4, 6.5, 8, 35, 45 and 140 ms measured at 20, 660, 1144, 1584, 3360, 5280 and 7056 unknowns within a factor
    of 1.5. A ring takes as long as its sectors one by one: 12 dovetail sectors with 16 pairs 10 times one of them.
    """
    each = n_unknowns / n_sectors
    return n_sectors * iterations * (1.5e-3 + 4.4e-6 * each + 2.8e-13 * each**3)


def iterations_of_sweep(sweep: str, n_frequencies: int) -> int:
    """Newton iterations of a sweep through so many frequencies, or of a ramp."""
    return (_OF_RAMP if sweep == "ramp" else _AT_FIRST) + A_STATE * (n_frequencies - 1)


def memory_a_rank(n_unknowns: int, result_values: int, automatic: bool, built_with: float, n_sectors: int = 1) -> float:
    """Memory of one rank, bytes: the libraries, the dense matrix, and the arrays of the result.

    Measured 0.37, 1.10 and 2.72 GB at 48, 160 and 336 pairs with automatic harmonics: within a factor of 1.2. So are
    0.91 and 1.2 GB of rings, 12 sectors of 16 pairs and 47 of 8, which have no dense matrix of all their unknowns.

    n_unknowns: of the largest state. result_values: numbers in the result. automatic: whether the state has
    `AUTOMATIC_HARMONICS`. built_with: memory that building the scene takes beside the libraries, bytes. n_sectors: of a
    ring.
    """
    grown = (2.0 * _AUTOMATIC_HARMONICS_AT_MOST + 1.0) / (2.0 * AUTOMATIC_HARMONICS + 1.0) if automatic else 1.0
    built = _NOTICED_MEMORY * math.floor(built_with / _NOTICED_MEMORY)
    unknowns = grown * n_unknowns
    solving = 8.0 * unknowns**2 if n_sectors == 1 else _RING_UNKNOWN * unknowns
    return _BASE_MEMORY + max(solving, built) + 8.0 * result_values


def largest_memory() -> float:
    """Largest memory of this process so far, bytes; 0 where the system does not say. That of `getrusage` includes the
    memory of the process that has started this one.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return next((1024.0 * float(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0.0)
