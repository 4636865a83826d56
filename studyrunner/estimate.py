"""Rough figures of the work in a task: for the order of the tasks, the time left and `--plan`."""

from __future__ import annotations

ITERATIONS_A_STATE = 10
"""Newton iterations for one frequency of a branch, the static state included."""

ITERATIONS_A_STEP = 4
"""Newton iterations for one step on the slow time scale (measured: 2 to 5 from a warm start)."""

_BASE_MEMORY = 250e6
_MATRICES_A_RANK = 6


def seconds_an_iteration(n_unknowns: int) -> float:
    """Time of one Newton iteration with a dense Jacobian, s.

    Fits 9, 31, 115, 340 and 500 ms measured at 432, 1008, 1584, 2160 and 2736 unknowns within 20 %.
    """
    return 1e-4 + 1.5e-5 * n_unknowns + 2.2e-11 * float(n_unknowns) ** 3


def memory_a_rank(n_unknowns: int, result_values: int) -> float:
    """Memory of one rank, bytes: the libraries, a few dense matrices and the arrays of the result."""
    return _BASE_MEMORY + _MATRICES_A_RANK * 8.0 * float(n_unknowns) ** 2 + 8.0 * result_values
