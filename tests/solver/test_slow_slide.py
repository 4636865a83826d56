"""Anchors along a path between two periodic states against closed forms, a general optimiser, and differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from solver.contact.slow_slide import INSIDE, PARTS, Path, slide_along, slide_tangent
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.fourier import build_basis
from tests.solver.models import branch_states, dovetail, march_wear, random_balance, random_model
from tests.solver.test_elements import MODELS, jacobian_by_differences

FRICTION, ORDERS = 0.5, tuple(range(1, 10))
BASIS = build_basis(ORDERS, 128)


def slid(first, last, state):
    out = np.array([state], float)
    slide_along(np.array([0]), Path(first[None], last[None], np.array([FRICTION]), out.copy()), out)
    return out[0]


def random_path(seed):
    """Harmonics of both ends of a path of a pressed pair, and an anchor within its first discs; None where none is."""
    random = np.random.default_rng(seed)
    size = 1.0 / np.arange(1, 2 * len(ORDERS) + 2)
    first = 0.2 * random.normal(size=(3, size.size)) * size
    first[0, 0] = 3.0
    last = first + 0.15 * random.normal(size=first.shape) * size
    state = nearest(random.normal(size=2), first @ BASIS.synthesis, 1e-9)
    return None if state is None else (first, last, state)


def nearest(state, force, inside):
    """The nearest place in the discs of all samples, by a general optimiser; None where they have none in common."""
    centres, radii = force[1:].T, (1.0 - inside) * FRICTION * force[0]
    room = {"type": "ineq", "fun": lambda x: radii**2 - ((x - centres) ** 2).sum(axis=1)}
    found = minimize(
        lambda x: ((x - state) ** 2).sum(), state, constraints=room, method="SLSQP", options={"ftol": 1e-15}
    )
    return found.x if found.success and room["fun"](found.x).min() > -1e-9 else None


def test_a_disc_that_moves_on_pulls_a_pair_along_a_tractrix():
    """With the angle between the pull and the way, tan(angle / 2) falls as exp(-way / radius)."""
    radius, way, angle = 1.5, 1.2, 1.2
    first = np.repeat([[radius / FRICTION], [0.0], [0.0]], 4, axis=1)
    last = first + np.array([[0.0], [way], [0.0]])
    behind = slid(first, last, -radius * np.array([np.cos(angle), np.sin(angle)])) - [way, 0.0]
    after = 2.0 * np.arctan(np.tan(0.5 * angle) * np.exp(-way / radius))
    assert behind == pytest.approx(-radius * np.array([np.cos(after), np.sin(after)]), abs=0.5 * way / PARTS)
    assert np.hypot(*behind) == pytest.approx(radius, rel=2.0 * INSIDE)


def test_a_pair_that_no_disc_reaches_stays_and_one_that_slips_in_each_period_stays_undetermined():
    first = np.repeat([[4.0], [0.0], [0.0]], 4, axis=1)
    assert slid(first, first + 0.1, [0.3, 0.2]).tolist() == [0.3, 0.2]
    apart = first + np.array([[0.0] * 4, [-3.0, 3.0, -3.0, 3.0], [0.0] * 4])
    assert slid(apart, apart + 0.1, [0.3, 0.2]).tolist() == [0.3, 0.2]
    # it comes to stick in the middle of its slip, wherever it was before
    assert slid(apart, first, [-1.2, 0.7]) == pytest.approx([0.0, 0.0], abs=1e-5)


def test_projections_are_those_of_a_general_optimiser():
    compared = 0
    for first, last, state in (path for seed in range(60) if (path := random_path(seed)) is not None):
        place = state
        for part in range(1, PARTS + 1):
            if place is not None:
                place = nearest(place, (first + part / PARTS * (last - first)) @ BASIS.synthesis, INSIDE)
        found = slid(first @ BASIS.synthesis, last @ BASIS.synthesis, state)
        # the discs of some have no common point on the way
        if place is not None and (found != state).any():
            assert found == pytest.approx(place, abs=1e-6)
            compared += 1
    assert compared >= 5


def test_the_derivative_is_that_of_differences():
    agreed = others = 0
    for first, last, state in (path for seed in range(60) if (path := random_path(seed)) is not None):
        path = Path(*((part @ BASIS.synthesis)[None] for part in (first, last)), np.array([FRICTION]), state[None])
        exact = np.zeros((1, 2, 3 * first.shape[1] + 1))
        slide_tangent(np.array([0]), path, BASIS.synthesis, exact)
        for index in np.random.default_rng(0).integers(last.size, size=8):
            change = np.zeros_like(last)
            change.flat[index] = 1e-6
            sides = [slid(path.first[0], (last + sign * change) @ BASIS.synthesis, state) for sign in (1.0, -1.0)]
            if exact.any():
                error = np.abs((sides[0] - sides[1]) / 2e-6 - exact[0, :, index]).max()
                agreed, others = agreed + (error < 1e-4), others + (error >= 1e-4)
    # a difference may go over a corner of the path
    assert agreed >= 50
    assert others <= 0.02 * agreed


@pytest.mark.slow
@pytest.mark.parametrize("wear", [False, True])
def test_jacobian_with_the_way_to_a_state_is_that_of_central_differences(wear):
    """Pairs that slide on the way and stick at its end are coupled as those that slip."""
    joined = 0
    for seed in range(12):
        balance, predicted = random_balance(random_model(seed, MODELS["3d"]), SolverSettings(3, 24), seed, wear=wear)
        predicted[balance.joint.component_index % 3 == 0, 0] *= 3.0
        before = balance.evaluate(0.7 * predicted)
        balance = replace(balance, history=before.start_history, before_t=before.predicted_t)
        at = balance.evaluate(predicted)
        if not (at.slid & (at.periods == 1)).any():
            continue
        try:
            differences = jacobian_by_differences(balance, predicted, 1e-5)
        except AssertionError:
            continue
        joined += 1
        dense = balance.linearise(at).dense(np.arange(balance.joint.contact.n_contact))
        assert np.abs(dense - differences).max() < 1e-5 * np.abs(differences).max()
    assert joined >= 2


@pytest.mark.slow
def test_a_root_whose_position_nothing_determines_stays_in_its_slot():
    """Every pair slips in the first 1300 cycles: Newton's method came to 31 m."""
    model, settings, mu = dovetail(39), SolverSettings(rtol=0.1), 0.6184272339579265
    (start,) = branch_states(model, mu, 1.1941769464308571, [2.0 * np.pi * 212.42951760611248], settings, "ramp")
    asked = 4.580559825081128e-12, 1.0, "adaptive", np.array([0.0, 275967.85]), settings
    found = march_wear(model, mu, start, *asked, loops=(0,))
    assert found.outcome is Outcome.CONVERGED
    assert np.abs(found.loop_displacement).max() < 1e-3
    assert found.worn_volume[-1] == pytest.approx(18.543e-9, rel=found.error_estimate)
