"""Limits that are changed for a while from Python."""

import numpy as np
import pytest

import solver
from solver.outcome import Outcome
from solver.tuning import TUNABLE
from solver.wear.options import WEAR
from studies import build_scene


def test_a_limit_holds_inside_and_not_behind():
    before = WEAR.history_iterations
    model = build_scene("sdof_slider")
    with pytest.raises(ValueError, match="finite"), solver.tuned(history_iterations=7, change_limits=(0.1, 0.1)):
        solver.march_wear(model, np.nan, 10.0, 0.5, 1.1e-11, 2e4)
    assert WEAR.history_iterations == before
    usual = solver.march_wear(model, 160.0, 10.0, 0.5, 1.1e-11, 2e4)
    with solver.tuned(history_iterations=-100, near_iterations=10):
        given_up = solver.march_wear(model, 160.0, 10.0, 0.5, 1.1e-11, 2e4)
    assert usual.outcome is Outcome.CONVERGED
    assert given_up.outcome is Outcome.MARCH_FAILED


def test_all_names_are_those_of_constants():
    assert all(hasattr(options, name) for name, options in TUNABLE.items())


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"history_iteration": 5}, "history_iteration: give one of arc_correctors, "),
        ({"change_limits": 0.1}, "change_limits: give a value like "),
        ({"near_iterations": "many"}, "near_iterations: give a value like 10 instead of 'many'"),
    ],
)
def test_a_typing_error_is_told(values, said):
    with pytest.raises(ValueError, match=said), solver.tuned(**values):  # type: ignore[arg-type]
        pass
