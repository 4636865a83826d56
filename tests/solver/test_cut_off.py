"""A contact that reaches an edge of its pairs where the bodies go on is told by the outcome, and no other one is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver import march_wear
from solver.outcome import Outcome
from solver.results.verdict import describe_cut_off, first_cut_off
from solver.settings import SolverSettings
from studies import build_scene
from studies.scenes.half_space import composite_modulus
from studies.scenes.hertz import line_half_width, point_radius

A_LINE = line_half_width(1.2e5, 6e-3, composite_modulus(200e9, 0.3))
A_POINT = point_radius(100.0, 10e-3, composite_modulus(200e9, 0.3))
SETTINGS = SolverSettings(harmonics=3, samples=32)


def edge_of(model, edge):
    return replace(model.contact, edge=None if edge is None else np.array(edge))


def test_load_or_wear_at_the_edge_is_found_at_its_first_count():
    contact = edge_of(build_scene("cylinder_on_flat", strips=6), [False, False, True])
    cycles, none = np.array([0.0, 10.0, 20.0, 30.0]), np.zeros((4, 3))
    middle = none + [2.0, 1.0, 0.0]
    at = none.copy()
    at[2:, 2] = 1e-3
    assert math.isnan(first_cut_off(contact, cycles, middle, middle))
    assert first_cut_off(contact, cycles, middle + at, middle) == 20.0
    assert first_cut_off(contact, cycles, middle, middle + at) == 20.0
    assert first_cut_off(contact, cycles, middle + 1.0, middle) == 0.0
    # round-off is no load, and an edge that is none does not count
    assert math.isnan(first_cut_off(contact, cycles, middle + 1e-9 * at, middle))
    for edge in (None, [False, False, False]):
        assert math.isnan(first_cut_off(edge_of(build_scene("sdof_slider"), edge), cycles, middle + at, middle))
    # of counts without a state nothing is known
    gone = middle + at
    gone[2] = np.nan
    assert first_cut_off(contact, cycles, gone, middle) == 30.0
    gone[3] = np.nan
    assert math.isnan(first_cut_off(contact, cycles, gone, middle))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("cylinder_on_flat", {"strips": 12, "half_width": 0.9 * A_LINE}),
        ("sphere_on_flat", {"patches": 4, "half_width": 0.9 * A_POINT}),
    ],
)
def test_pairs_that_do_not_hold_the_unworn_contact_cut_it_off_at_once(name, values):
    found = march_wear(build_scene(name, **values), 20.0, 1.0, 0.6, 1e-13, [0.0], sweep="ramp", settings=SETTINGS)
    assert found.outcome is Outcome.CONTACT_CUT_OFF
    assert found.cut_off_cycle == 0.0
    assert found.message == describe_cut_off(0.0)
    # the state is there, and wrong
    assert found.mean_pressure[0].min() > 0.0


@pytest.mark.slow
def test_a_scar_that_grows_out_of_its_pairs_is_no_result():
    # the same pairs, with and without some farther out
    asked = {"sweep": "ramp", "settings": SETTINGS}
    cut, whole = (
        march_wear(
            build_scene("cylinder_on_flat", stroke=1e-5, strips=strips, half_width=width * A_LINE),
            *(20.0, 1.0, 0.6, 5e-14, np.linspace(0.0, 4000.0, 9)),
            **asked,
        )
        for strips, width in ((12, 1.5), (20, 2.5))
    )
    assert whole.outcome is Outcome.CONVERGED
    assert cut.outcome is Outcome.CONTACT_CUT_OFF
    assert 0.0 < cut.cut_off_cycle < 4000.0
    before = cut.cycles < cut.cut_off_cycle
    assert cut.wear_depth[before].max(axis=1) == pytest.approx(whole.wear_depth[before].max(axis=1), rel=0.02)
    assert cut.wear_depth[-1].max() > 1.02 * whole.wear_depth[-1].max()
    # it was computed to its end, and is kept
    assert cut.last_cycle == 4000.0
    assert np.isfinite(cut.worn_volume).all()
