"""Run time and time limit are those of computing: a first run compiles for longer than many states take."""

import subprocess
import sys
import time

import numpy as np
import pytest
from numba import njit

from solver.clock import computing_time
from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.results import state_report
from solver.settings import SolverSettings
from tests.solver.models import march_wear, scene


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
def test_run_time_leaves_out_compiling(monkeypatch):
    settings = SolverSettings(harmonics=3, samples=64)
    model = scene("sdof_slider", 3)
    _, start = next(follow_branch(model, 0.5, 10.0, np.array([160.0]), "up", settings))

    def march():
        """CPU time of a march and what it says that it took."""
        began = time.thread_time()
        history = march_wear(model, 0.5, start, 1e-11, 1e4, "explicit", np.array([0.0, 1e4]), settings)
        assert history.outcome is Outcome.CONVERGED
        return time.thread_time() - began, history.run_time - start.run_time

    march()
    compiled, says = march()
    assert 0.5 * compiled < says <= compiled
    monkeypatch.setattr(state_report, "largest_distance", njit(state_report.largest_distance.py_func))
    fresh, says = march()
    assert fresh > 0.1 + compiled
    # at most half of what compiling took
    assert says < 0.5 * (compiled + fresh)


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
