"""Stability: Floquet multipliers against those of exact motions, and unstable states.

`test_whole_response` has the stability of whole branches.
"""

from dataclasses import replace

import numpy as np
import pytest

from solver import frequency_response
from solver import march_wear as worn_model
from solver.harmonic_balance.dlft import Balance
from solver.loading_history import start_states
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.stability import floquet
from solver.stability.disturbances import build_monodromy, switching_pairs
from solver.stability.floquet import find_instability, multipliers_of
from solver.structure.fourier import from_complex, to_complex
from solver.structure.penalty import Penalty
from tests.rings import ring_of_sectors
from tests.solver.exact_scenes import drawn
from tests.solver.models import case_of, cyclic_model, first_point, random_balance, random_model, state_at
from tests.solver.models import scene as bundled

SETTINGS = SolverSettings()


def largest(multipliers):
    """Largest size of those that are none of a pair that sticks: such a pair neither gains nor loses."""
    sizes = np.abs(multipliers)
    return float(sizes[np.abs(multipliers - 1.0) > 1e-6].max(initial=0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "allowed"),
    [
        ("stopping slider", 5, 0.02),
        ("swinging slider", 5, 0.02),
        ("two masses", 6, 0.05),
        ("impact", 2, 0.04),
        ("grazing", 2, 0.05),
        ("jenkins", 2, 0.01),
        ("inclined", 8, 0.01),
    ],
)
def test_the_largest_multiplier_is_that_of_the_exact_motion(kind, seed, allowed, monkeypatch):
    # unstable states are handed out, to be looked at here
    monkeypatch.setattr(start_states, "find_instability", lambda *_: None)
    scene = drawn(kind, seed)
    _, case, state = state_at(scene.model, scene.friction, scene.excitation, scene.omega, SETTINGS)
    joint, at = state.joint(case), state.evaluation
    exact = largest(scene.orbit_next_to(joint, at).multipliers())
    assert largest(multipliers_of(build_monodromy(joint, at, 512), every=True)[0]) == pytest.approx(exact, abs=allowed)
    assert (find_instability(case, state, Run(SETTINGS.tolerance)) is not None) == (exact > 1.0)


def with_matrices(name, **matrices):
    """A bundled scene with other matrices."""
    model = bundled(name)
    return replace(model, linear={0: replace(model.linear[0], **matrices)})


# the first of the two masses alone: x'' - 0.5 x' + 2 x = 0
DRIVEN = np.array([[-0.5, -0.02], [-0.02, 0.02]])


@pytest.mark.parametrize(
    ("name", "matrices", "asked"),
    [
        ("two_masses", {"damping": DRIVEN}, (0.05, 20.0, 0.5)),
        ("two_masses", {"stiffness": np.array([[-2.0, -1.0], [-1.0, 1.0]])}, (0.05, 20.0, 0.5)),
        ("vibro_impact", {"damping": np.diag([0.0, -0.05])}, (1.2 / (2.0 * np.pi), 0.02, 0.0)),
        ("sdof_slider", {"damping": np.diag([0.0, -5.0])}, (200.0, 10.0, 0.5)),
    ],
    ids=["damping", "stiffness", "wall", "slider"],
)
def test_a_growing_vibration_is_no_result(name, matrices, asked):
    model = with_matrices(name, **matrices)
    found, history = frequency_response(model, *asked), worn_model(model, *asked, 1e-9, 1.0)
    assert (history.outcome,) == found.outcome == (Outcome.UNSTABLE,)
    assert (history.message,) == found.message
    assert np.isnan([*found.response, *history.response]).all()
    assert all(history.message in repr(each) for each in (found, history))


def test_a_state_that_sticks_all_over_is_that_of_its_structure():
    found = frequency_response(with_matrices("two_masses", damping=DRIVEN), 0.05, 20.0, 50.0)
    assert found.outcome == (Outcome.UNSTABLE,)
    # for 20 s
    assert f"{np.exp(0.25 * 20.0):.3g}" in found.message[0]
    assert "linear structure alone" in found.message[0]


def test_the_largest_multiplier_by_products_is_that_of_all():
    balance, predicted = random_balance(random_model(4, ("3d",) * 6, 12), SolverSettings(3, 24), 4, wear=False)
    at = balance.evaluate(predicted)
    assert switching_pairs(at)[0].any()
    monodromy = build_monodromy(balance.joint, at, 64)
    every, some = multipliers_of(monodromy, every=True)[0], multipliers_of(monodromy, every=False)[0]
    assert np.abs(some).max() == pytest.approx(np.abs(every).max(), rel=1e-3)


@pytest.mark.parametrize(("n_sectors", "diameter", "apart"), [(5, 2, 5), (6, 2, 3)])
def test_disturbances_of_a_wave_are_those_of_its_ring(n_sectors, diameter, apart):
    model = cyclic_model(3, ("3d", "one_tangent"), n_sectors, diameter, apart)
    balance, predicted = random_balance(model, SolverSettings(3, 24), 4, wear=False)
    joint, at = balance.joint, balance.evaluate(predicted)
    assert switching_pairs(at)[0].any()
    settings = SolverSettings(3, 24)
    case = case_of(ring_of_sectors(model), 0.4, joint.omega, settings)
    case = replace(case, penalty=Penalty(*(np.tile(each, apart) for each in vars(joint.penalty).values())))
    turns = np.exp(2j * np.pi * diameter / n_sectors * np.outer(np.arange(apart), joint.basis.orders))
    moved = np.concatenate([from_complex(predicted[:, 0], to_complex(predicted) * turn) for turn in turns])
    depth, ring = np.tile(balance.wear_depth, apart), case.joint(joint.omega, 60.0)
    whole = Balance(ring, np.tile(balance.history, (apart, 1)), depth).evaluate(moved)
    found, exact = (
        np.sort(np.abs(multipliers_of(build_monodromy(*of, 24 * apart, m), every=True)[0]))[::-1][:8]
        for *of, m in ((joint, at, apart), (ring, whole, 1))
    )
    np.testing.assert_allclose(found, exact, rtol=1e-6)


@pytest.mark.parametrize("times", [0.8, 1.0])
def test_a_wave_of_uncoupled_sectors_is_as_stable_as_one_sector(times):
    alone = with_matrices("two_masses", damping=times * DRIVEN)
    wave = replace(alone, linear=dict.fromkeys(range(13), alone.linear[0]), n_sectors=24, nodal_diameter=3)
    one, other = (frequency_response(each, 0.05, 20.0, 0.5, settings=SolverSettings(5, 64)) for each in (alone, wave))
    assert one.outcome == other.outcome == (Outcome.UNSTABLE,)
    assert one.message[0].split(" and ")[0] == other.message[0].split(" and ")[0]


def test_a_stability_that_is_not_known_is_said(monkeypatch):
    monkeypatch.setattr(floquet, "MOST_ROWS", 2)
    model = bundled("two_masses")
    settings = SolverSettings(5, 64)
    found = frequency_response(model, [0.05], 20.0, 0.5, settings=settings)
    history = worn_model(model, 0.05, 20.0, 0.5, 1e-12, [0.0, 1.0], settings=settings)
    for outcome, message in ((found.outcome[0], found.message[0]), (history.outcome, history.message)):
        assert outcome is Outcome.INACCURATE
        assert "stable is not known: more than 0 pairs" in message
    assert np.isfinite(history.worn_volume).all()


def test_multipliers_of_many_harmonics_have_samples_enough(monkeypatch):
    """A cylinder with 81 harmonics ended in an unexpected error: 128 samples."""
    monkeypatch.setattr(floquet, "SMALL_JOINT", 0)
    case, run = case_of(bundled("vibro_impact"), 0.0, 1.2, SolverSettings(81, 512)), Run(1e-8)
    found = floquet.find_multipliers(case, first_point(case, 1.2, 0.02), run, growing_only=True)
    assert abs(found.values[0]) < 1.0


def test_the_march_is_of_second_order_for_the_structure_alone():
    """An open joint, against the exponential of its matrix."""
    model = random_model(3, ("3d",), 2)
    balance, predicted = random_balance(model, SolverSettings(1, 24), 3, wear=False)
    predicted[:, 0] = -1e6 * (balance.joint.component_index % 3 == 0)
    at, linear = balance.evaluate(predicted), model.linear[0]
    lower = -np.linalg.solve(linear.mass, np.hstack([linear.stiffness, linear.damping]))
    flow = np.vstack([np.eye(len(lower), 2 * len(lower), len(lower)), lower])
    exact = np.abs(np.exp(2.0 * np.pi / balance.joint.omega * np.linalg.eigvals(flow))).max()
    errors = [
        abs(np.abs(multipliers_of(build_monodromy(balance.joint, at, n_samples), every=True)[0]).max() - exact)
        for n_samples in (512, 1024, 2048)
    ]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1]
