"""Run time and time limit are those of computing: a first run compiles for longer than many states take."""

import subprocess
import sys
import time

import numpy as np
import pytest
from numba import njit

from solver.clock import computing_time


def test_compiling_takes_no_computing_time():
    @njit
    def inner(values):
        return values.sum()

    @njit
    def outer(values):
        return inner(values) + inner(values[::-1])

    cpu, computing = time.thread_time(), computing_time()
    outer(np.arange(3.0))
    cpu, computing = time.thread_time() - cpu, computing_time() - computing
    assert cpu > 0.05
    assert 0.0 <= computing < 0.2 * cpu


@pytest.mark.slow
def test_what_is_compiled_is_noticed_and_what_is_there_is_not():
    code = """
from numba import njit
from solver.clock import n_compiled
f = njit(lambda x: x + 1)
print(n_compiled(), f(1), n_compiled(), f(2), n_compiled())
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["0", "2", "1", "3", "1"]
