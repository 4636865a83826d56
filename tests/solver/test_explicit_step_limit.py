"""The limit of the explicit step against a closed form, and oscillation beyond it."""

from functools import lru_cache

import numpy as np
import pytest

from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.settings import SolverSettings
from tests.solver.models import branch_states, march_wear

STIFFNESS = 1e6  # N/m, of each pair towards the block
SETTINGS = SolverSettings(3, 128)
WEAR = 1e-10  # 1/Pa
AREA = 1e-4
SLIDE = 1e-4  # m, amplitude of the sliding


def seesaw():
    """A block pressed with 100 N on two springs with a pair at the end of each: what one pair loses the other takes.

    The pairs slide with an amplitude of `SLIDE` whatever presses them: the friction is next to nothing. Displacements:
    closing and sliding of the first pair, of the second pair, and the block.
    """
    stiffness = np.diag([STIFFNESS, 1e5, STIFFNESS, 1e5, 2.001 * STIFFNESS])
    stiffness[[0, 2, 4, 4], [4, 4, 0, 2]] = -STIFFNESS
    linear = LinearModel(
        mass=np.diag([0.0, 0.0, 0.0, 0.0, 1.0]),
        damping=1e-6 * stiffness,
        stiffness=stiffness,
        load_static=np.array([0.0, 0.0, 0.0, 0.0, 100.0]),
        load_harmonic=np.array([0.0, 1e5 * SLIDE, 0.0, 1e5 * SLIDE, 0.0], complex),
        response=np.array([[0.0, 1.0, 0.0, 0.0, 0.0]]),
    )
    contact = ContactInterface(
        dofs=np.array([[0, 1, -1], [2, 3, -1]]),
        area=np.full(2, AREA),
        gap=np.array([0.0, 1e-6]),
        normal_load=np.zeros(2),
        position=np.full((2, 3), np.nan),
        surface=("left", "right"),
    )
    return ReducedModel({0: linear}, contact, ("slide",))


def exact_limit():
    """N_1 - N_2 falls by k (W_1 - W_2), and each depth grows by k_w / alpha N 4 X a cycle: 2 over k_w / alpha 4 X k."""
    return 2.0 / (WEAR / AREA * 4.0 * SLIDE * STIFFNESS)


@lru_cache
def history(share, scheme):
    model = seesaw()
    (start,) = branch_states(model, 1e-4, 1.0, [100.0], SETTINGS)
    step = share * exact_limit()
    return march_wear(model, 1e-4, start, WEAR, step, scheme, np.linspace(0.0, 20 * step, 21), SETTINGS)


def test_the_limit_of_the_explicit_step_is_that_of_the_closed_form():
    assert history(0.5, "explicit").step_limit == pytest.approx(exact_limit(), rel=0.01, abs=0.0)
    # a property of the state and not of the scheme
    assert history(0.5, "implicit").step_limit == history(0.5, "explicit").step_limit


@pytest.mark.parametrize(
    ("share", "scheme", "oscillates"),
    [(0.4, "explicit", False), (1.3, "explicit", True), (1.3, "implicit", False), (10.0, "implicit", False)],
)
def test_beyond_the_limit_the_explicit_scheme_oscillates(share, scheme, oscillates):
    found = history(share, scheme)
    assert (np.diff(found.wear_depth, axis=0) >= 0.0).all()
    # both pairs wear as much in the end where the scheme is stable
    last = np.diff(found.wear_depth[-2:], axis=0)[0]
    assert (abs(last[0] - last[1]) < 0.02 * last.sum()) is not oscillates
    # the error bar says so
    assert not oscillates or found.error_estimate > SETTINGS.rtol
