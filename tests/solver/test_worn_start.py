"""Responses and marches that begin with a worn joint."""

import numpy as np
import pytest

from solver import Outcome, SolverSettings, frequency_response, march_wear
from solver.contact.wear_law import WearLaw, WearTable
from tests.solver.models import scene

SETTINGS = SolverSettings(harmonics=3, samples=128)
WEAR, END = 1.1e-11, 4e4  # 1/Pa, cycles


def test_a_response_at_a_depth_is_that_of_less_normal_force():
    """The spring of the slider presses by 10 N less 1e5 N/m times the depth."""
    worn = frequency_response(scene("sdof_slider"), 150.0, 10.0, 0.5, settings=SETTINGS, wear_depth=[4e-5])
    less = frequency_response(scene("sdof_slider", normal_load=6.0), 150.0, 10.0, 0.5, settings=SETTINGS)
    np.testing.assert_allclose(worn.response, less.response, rtol=1e-7)
    assert set(worn.outcome) == {Outcome.CONVERGED}


def test_a_march_goes_on_from_a_depth():
    model = scene("sdof_slider")
    whole = march_wear(model, 160.0, 10.0, 0.5, WEAR, [0.0, END / 2, END], settings=SETTINGS)
    rest = march_wear(model, 160.0, 10.0, 0.5, WEAR, [END / 2], settings=SETTINGS, wear_depth=whole.wear_depth[1])
    assert rest.outcome is Outcome.CONVERGED
    depth = whole.wear_depth[1, 0] + rest.wear_depth[-1, 0]
    error = whole.wear_depth_error[-1, 0] + rest.wear_depth_error[-1, 0]
    assert depth == pytest.approx(whole.wear_depth[-1, 0], abs=error)
    assert error < 1e-2 * depth


def test_a_law_that_depends_on_the_depth_is_refused():
    law = WearLaw("table", table=WearTable((0.0, 1e6), (0.0, 1e-5), ((1.0, 1.0), (1.0, 1.0))))
    with pytest.raises(ValueError, match="wear_depth: give another law"):
        march_wear(scene("sdof_slider"), 160.0, 10.0, 0.5, WEAR, [END], law=law, wear_depth=0.0)
    with pytest.raises(ValueError, match="wear_depth: give a depth, m, for each of 1 pairs, not 2"):
        march_wear(scene("sdof_slider"), 160.0, 10.0, 0.5, WEAR, [END], wear_depth=[0.0, 0.0])
