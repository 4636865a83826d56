"""Stability: signs of determinants, Floquet multipliers against those of exact motions, and unstable states."""

from dataclasses import replace
from functools import lru_cache
from itertools import islice

import numpy as np
import pytest

from solver.contact.coulomb import SEPARATED
from solver.continuation.arc_length import Arc
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.loading_history import frequency_sweep
from solver.loading_history.start_states import follow_branch
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.results.state_report import evaluated
from solver.settings import SolverSettings
from solver.stability.disturbances import build_monodromy, switching_pairs
from solver.stability.floquet import find_instability, multipliers_of
from solver.structure.fourier import synthesis, to_complex
from solver.structure.joint import build_case
from tests.solver.models import converged_state, crossings, cyclic_model, march_wear, random_balance, random_model
from tests.solver.models import scene as bundled
from tests.solver.random_orbits import drawn


@pytest.fixture
def presented(monkeypatch):
    """Unstable states are handed out, to be looked at here."""
    monkeypatch.setattr(frequency_sweep, "find_instability", lambda *_: None)


def start_of(model, friction, excitation, frequency, settings):
    ((_, start),) = follow_branch(model, friction, excitation, np.array([frequency]), "up", settings)
    return start


def state_at(model, friction, excitation, frequency, settings=None):
    """The state that a sweep up comes to."""
    settings = settings or SolverSettings()
    start = start_of(model, friction, excitation, frequency, settings)
    case = build_case(model, friction, start.penalty_omega, settings, start.resolution)
    joint = case.joint(2.0 * np.pi * frequency, excitation)
    return case, joint, evaluated(joint, start.state)[1]


@lru_cache
def state_of(kind, seed, damping=1.0):
    """A drawn scene, its damping times a factor, and its state."""
    scene = drawn(kind, seed)
    scene = replace(scene, damping=damping * scene.damping)
    case, joint, at = state_at(scene.model, scene.friction, scene.excitation, scene.omega / (2.0 * np.pi))
    return scene, case, joint, at


def exact_multipliers(scene, joint, at):
    """Of the exact periodic motion next to a state, by differences of its period map."""
    orders, masses = joint.basis.orders, np.diag(scene.mass) > 0.0
    motion = np.zeros((masses.size, 2 * len(orders) + 1))
    motion[masses] = joint.structure.response_h(joint.to_relative(at.displacement_h))
    if scene.tangent is not None and not masses[scene.tangent]:
        motion[scene.tangent] = at.displacement_h[0, 1]
    displacement = (motion @ synthesis(orders, np.zeros(1)))[:, 0]
    velocity = (1j * scene.omega * np.array(orders) * to_complex(motion)).sum(axis=1).real
    return scene.orbit_near(displacement, velocity).multipliers()


def marched(joint, at, n_samples):
    return multipliers_of(build_monodromy(joint, joint.model.linear[0], at, n_samples), every=True)


def largest(multipliers):
    """Largest size of those that are none of a pair that sticks: such a pair neither gains nor loses."""
    sizes = np.abs(multipliers)
    return float(sizes[np.abs(multipliers - 1.0) > 1e-6].max(initial=0.0))


@pytest.mark.slow
@pytest.mark.usefixtures("presented")
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
def test_the_largest_multiplier_is_that_of_the_exact_motion(kind, seed, allowed):
    scene, _, joint, at = state_of(kind, seed)
    assert largest(marched(joint, at, 512)) == pytest.approx(largest(exact_multipliers(scene, joint, at)), abs=allowed)


@pytest.mark.slow
@pytest.mark.usefixtures("presented")
@pytest.mark.parametrize(("kind", "damping"), [("slider", -3.0), ("two masses", -0.3), ("jenkins", -3.0)])
def test_with_negative_damping_as_well(kind, damping):
    """Friction holds some of these vibrations, and some not."""
    seen = 0
    for seed in (1, 4, 6):
        try:
            scene, case, joint, at = state_of(kind, seed, damping)
            exact = largest(exact_multipliers(scene, joint, at))
        except (AssertionError, RuntimeError):
            # no state, or none that is a motion of the exact scene
            continue
        if abs(exact - 1.0) > 0.05:
            seen += 1
            assert (find_instability(case, joint, at, Run(case.settings.tolerance)) is not None) == (exact > 1.0), (
                seed,
                exact,
            )
    assert seen > 0


@pytest.mark.slow
@pytest.mark.usefixtures("presented")
@pytest.mark.parametrize("seed", [1, 17, 29])
def test_a_multiplier_beyond_minus_one_doubles_the_period(seed):
    scene, case, joint, at = state_of("impact", seed)
    exact = exact_multipliers(scene, joint, at)
    beyond = bool(((np.abs(exact.imag) < 1e-9) & (exact.real < -1.0)).any())
    unstable = find_instability(case, joint, at, Run(case.settings.tolerance))
    assert (unstable is not None and unstable.outcome is Outcome.PERIOD_DOUBLED) == beyond


@pytest.mark.slow
@pytest.mark.parametrize(("omega", "n_harmonics", "n_samples"), [(1.0, 3, 128), (1.5, 9, 128)])
def test_a_stable_mass_at_a_wall_is_not_rejected_with_few_harmonics(omega, n_harmonics, n_samples):
    """Its multipliers lie within the unit circle: the mass comes to this motion by itself, see `tests.event_driven`."""
    case, joint, at = state_at(
        bundled("vibro_impact"), 0.0, 0.02, omega / (2.0 * np.pi), SolverSettings(n_harmonics, n_samples)
    )
    assert (at.status_t == SEPARATED).any()
    assert not (at.status_t == SEPARATED).all()
    assert find_instability(case, joint, at, Run(case.settings.tolerance)) is None


def with_matrices(name, **matrices):
    """A bundled scene with other matrices."""
    model = bundled(name)
    return replace(model, linear={0: replace(model.linear[0], **matrices)})


def scaled_damping(factor):
    return with_matrices("vibro_impact", damping=factor * bundled("vibro_impact").linear[0].damping)


def driven(damping):
    """The two masses, the first one with another damping."""
    changed = bundled("two_masses").linear[0].damping.copy()
    changed[0, 0] = damping
    return with_matrices("two_masses", damping=changed)


@pytest.mark.parametrize(
    ("model", "friction", "excitation", "frequency"),
    [
        (driven(-0.5), 0.5, 20.0, 0.05),
        (with_matrices("two_masses", stiffness=np.array([[-2.0, -1.0], [-1.0, 1.0]])), 0.5, 20.0, 0.05),
        (scaled_damping(-1.0), 0.0, 0.02, 1.2 / (2.0 * np.pi)),
        (with_matrices("sdof_slider", damping=np.diag([0.0, -5.0])), 0.5, 10.0, 200.0),
    ],
    ids=["damping", "stiffness", "wall", "slider"],
)
def test_a_growing_vibration_is_no_result(model, friction, excitation, frequency):
    start = start_of(model, friction, excitation, frequency, SolverSettings())
    assert start.outcome is Outcome.UNSTABLE
    assert start.state is None
    assert "in each period of the excitation" in start.message
    assert start.message.endswith("look for negative damping or stiffness of the structure")
    history = march_wear(model, friction, start, 1e-9, 1.0, "implicit", np.zeros(1), SolverSettings())
    assert (history.outcome, history.message) == (start.outcome, start.message)
    assert np.isnan(history.response).all()


def test_a_state_that_sticks_all_over_is_that_of_its_structure():
    start = start_of(driven(-0.5), 50.0, 20.0, 0.05, SolverSettings())
    assert start.outcome is Outcome.UNSTABLE
    # the first mass alone: x'' - 0.5 x' + 2 x = 0 for 20 s
    assert f"{np.exp(0.25 * 20.0):.3g}" in start.message
    assert "linear structure alone" in start.message


def test_the_largest_multiplier_by_products_is_that_of_all():
    balance, predicted = random_balance(random_model(4, ("3d",) * 6, 12), SolverSettings(3, 24), 4, wear=False)
    at = balance.evaluate(predicted)
    assert switching_pairs(at)[0].any()
    monodromy = build_monodromy(balance.joint, balance.joint.model.linear[0], at, 64)
    every, some = multipliers_of(monodromy, every=True), multipliers_of(monodromy, every=False)
    assert np.abs(some).max() == pytest.approx(np.abs(every).max(), rel=1e-3)


def test_the_march_is_of_second_order_for_the_structure_alone():
    """An open joint, against the exponential of its matrix."""
    model = random_model(3, ("3d",), 2)
    balance, predicted = random_balance(model, SolverSettings(1, 24), 3, wear=False)
    predicted[:, 0] = -1e6 * (balance.joint.component_index % 3 == 0)
    at = balance.evaluate(predicted)
    linear, n = model.linear[0], len(model.linear[0].mass)
    period = 2.0 * np.pi / balance.joint.omega
    flow = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(linear.mass, linear.stiffness), -np.linalg.solve(linear.mass, linear.damping)],
        ]
    )
    exact = np.abs(np.exp(period * np.linalg.eigvals(flow))).max()
    errors = [
        abs(np.abs(multipliers_of(build_monodromy(balance.joint, linear, at, n_samples), every=True)).max() - exact)
        for n_samples in (512, 1024, 2048)
    ]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1]


def test_it_is_not_looked_for_in_a_travelling_wave():
    balance, predicted = random_balance(cyclic_model(3, ("3d",), 7, 1), SolverSettings(3, 24), 3, wear=False)
    at = balance.evaluate(predicted)
    assert switching_pairs(at)[0].any()
    case = build_case(balance.joint.model, 0.5, 1.0, SolverSettings(3, 24))
    assert find_instability(case, balance.joint, at, Run(1e-8)) is None


# --- the sign of the determinant ---


def wall_at(omega, history):
    case = build_case(bundled("vibro_impact"), 0.0, 1.55, SolverSettings(21, 256))
    return Balance(case.joint(omega, 0.02), history, np.zeros(1))


@pytest.mark.slow
def test_the_branches_of_a_mass_at_a_wall_have_alternating_stability():
    """States at 1.55 rad/s of the branch from there through both folds."""
    state = converged_state(bundled("vibro_impact"), 0.0, 0.02, 1.55, SolverSettings(21, 256))
    start = wall_at(1.55, state.start_history)
    at = start.evaluate(start.predict(state.displacement_h, state.contact_force_h))
    upper = State(at, state.start_history, 1.55)
    middle, lower = islice(crossings(Arc(wall_at, upper, 0.08, Run(1e-8)), 1.55, 1.0), 2)
    stable = [Run(1e-8).is_stable(wall_at(1.55, one.history), one.evaluation) for one in (upper, middle, lower)]
    assert stable == [True, False, True]
    sizes = [np.abs(point.evaluation.displacement_h).max() for point in (upper, middle)]
    assert sizes[0] > sizes[1] > 0
    assert not lower.evaluation.force_h.any()


def test_a_joint_that_is_open_or_stuck_all_over_is_stable():
    for seed, level in ((1, -1e6), (2, 1e6)):
        balance, predicted = random_balance(random_model(seed), SolverSettings(3, 24), seed, wear=False)
        predicted[balance.joint.component_index % 3 == 0, 0] = level
        at = balance.evaluate(predicted)
        assert (at.status_t == (0 if level < 0 else 1)).all()
        assert Run(1e-8).is_stable(balance, at)
