"""Period doubling of a mass at a wall, against the multipliers of its exact motion, and what becomes of it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.loading_history import start_states
from solver.loading_history.start_states import follow_branch
from solver.model import FloatArray
from solver.newton.solve_balance import Effort
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.settings import SolverSettings
from solver.stability.period_doubling import doubles_period, linearise_over_two, odd_part, two_periods
from solver.structure.fourier import synthesis, to_complex
from solver.structure.joint import Case, Joint, build_case
from solver.wear.march import march_wear
from tests.solver.models import cyclic_model, random_balance, random_model, with_free_masses
from tests.solver.models import scene as bundled
from tests.solver.random_orbits import Scene, drawn

SETTINGS = SolverSettings(27, 512)


@pytest.fixture(autouse=True)
def _presented(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """States that double their period are handed out, to be looked at here."""
    if "outcome" not in request.function.__name__:
        monkeypatch.setattr(start_states, "doubles_period", lambda *_: False)


@lru_cache
def presented(seed: int) -> tuple[Scene, Case, Joint, Evaluation]:
    """A drawn scene with its state, whether it doubles its period or not."""
    scene = drawn("impact", seed)
    return (scene, *state_of(scene, start_of(scene)))


def start_of(scene: Scene) -> StartState:
    frequency = np.array([scene.omega / (2.0 * np.pi)])
    ((_, start),) = follow_branch(scene.model, scene.friction, scene.excitation, frequency, "up", SETTINGS)
    return start


def state_of(drawn: Scene, start: StartState) -> tuple[Case, Joint, Evaluation]:
    assert start.state is not None
    case = build_case(drawn.model, drawn.friction, start.penalty_omega, SETTINGS, start.resolution)
    joint = case.joint(drawn.omega, drawn.excitation)
    balance = Balance.frozen(joint, start.state.start_history, start.state.wear_depth)
    return case, joint, balance.evaluate(balance.predict(start.state.displacement_h, start.state.contact_force_h))


def multipliers(scene: Scene, _: Case, joint: Joint, at: Evaluation) -> FloatArray:
    """Of the exact motion through a period from where the mass is at its beginning, by differences."""
    orders = joint.basis.orders
    motion = joint.structure.response_h(joint.to_relative(at.displacement_h))
    displacement = (motion @ synthesis(orders, np.zeros(1)))[:, 0]
    velocity = (1j * scene.omega * np.array(orders) * to_complex(motion)).sum(axis=1).real
    system = scene.pair.system
    y = system.extended(displacement, velocity)
    name = scene.pair._likely_phase(y)
    columns = []
    for place in range(2 * system.n):
        step = 1e-5 * np.abs(y[: 2 * system.n]).max() * np.eye(y.size)[place]
        ends = [system.advance(system.phase_at(name, y + s), y + s, system.period)[1] for s in (step, -step)]
        columns.append((ends[0] - ends[1])[: 2 * system.n] / (2.0 * step[place]))
    return np.linalg.eigvals(np.array(columns).T)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 5, 6, 17, 26, 29, 32, 41, 54, 57])
def test_it_is_a_multiplier_beyond_minus_one(seed: int) -> None:
    scene, case, joint, at = presented(seed)
    found = multipliers(scene, case, joint, at)
    beyond = np.count_nonzero((np.abs(found.imag) < 1e-9) & (found.real < -1.0))
    assert doubles_period(case, joint, at, Effort()) == bool(beyond)


@pytest.mark.slow
def test_the_draws_are_of_both_kinds() -> None:
    """Else the test above would show nothing."""
    found = [multipliers(*presented(seed)) for seed in (1, 17)]
    assert np.abs(found[0]).max() < 1.0
    assert found[1].real.min() < -2.0


@pytest.mark.parametrize("free_masses", [False, True])
def test_a_shift_by_a_period_keeps_even_and_odd_harmonics_apart(free_masses: bool) -> None:
    model = random_model(4, ("3d", "3d"), 3)
    model = with_free_masses(model, [1]) if free_masses else model
    balance, predicted = random_balance(model, SolverSettings(3, 24), 4, wear=False)
    at = balance.evaluate(predicted)
    longer = linearise_over_two(model, balance.joint, at)
    orders = np.array(longer.joint.basis.orders)
    matrix = longer.dense(longer.active())
    odd = np.tile(np.concatenate([[False], np.repeat(orders % 2 == 1, 2)]), matrix.shape[0] // (2 * orders.size + 1))
    size = np.abs(matrix).max()
    assert np.abs(matrix[np.ix_(odd, ~odd)]).max() < 1e-9 * size
    assert np.abs(matrix[np.ix_(~odd, odd)]).max() < 1e-9 * size
    assert odd_part(longer).shape == (odd.sum(), odd.sum())


def test_harmonics_of_two_periods() -> None:
    assert two_periods((1, 3)) == (1, 2, 3, 5, 6)
    assert two_periods((1, 2, 3)) == (1, 2, 3, 4, 5, 6)


@pytest.mark.slow
@pytest.mark.parametrize("n_harmonics", [3, 5, 9, 13])
@pytest.mark.parametrize("omega", [1.0, 1.2, 1.5])
def test_a_stable_mass_at_a_wall_is_not_rejected_with_few_harmonics(omega: float, n_harmonics: int) -> None:
    """Its multipliers lie within the unit circle: the mass comes to this motion by itself, see `tests.event_driven`."""
    model, settings = bundled("vibro_impact"), SolverSettings(n_harmonics, 128)
    ((_, start),) = follow_branch(model, 0.0, 0.02, np.array([omega / (2.0 * np.pi)]), "up", settings)
    assert start.state is not None
    case = build_case(model, 0.0, start.penalty_omega, settings, start.resolution)
    joint = case.joint(omega, 0.02)
    balance = Balance.frozen(joint, start.state.start_history, start.state.wear_depth)
    at = balance.evaluate(balance.predict(start.state.displacement_h, start.state.contact_force_h))
    assert (at.status_t == SEPARATED).any()
    assert not (at.status_t == SEPARATED).all()
    assert not doubles_period(case, joint, at, Effort())


def test_it_is_not_looked_for_in_a_travelling_wave_or_without_bouncing() -> None:
    for model in (cyclic_model(3, ("3d",), 7, 1), random_model(3, ("3d",))):
        balance, predicted = random_balance(model, SolverSettings(3, 24), 3, wear=False)
        if not model.n_sectors:
            predicted[:, 0] += 1e9
        case = build_case(model, balance.joint.friction_coefficient, 1.0, SolverSettings(3, 24))
        assert not doubles_period(case, balance.joint, balance.evaluate(predicted), Effort())


@pytest.mark.slow
def test_the_outcome_says_so() -> None:
    scene = drawn("impact", 17)
    start = start_of(scene)
    assert start.outcome is Outcome.PERIOD_DOUBLED
    assert start.state is None
    history = march_wear(scene.model, 0.0, start, 1.0, 1.0, "implicit", np.zeros(1), SETTINGS)
    assert history.outcome is Outcome.PERIOD_DOUBLED
    assert np.isnan(history.response).all()


@pytest.mark.slow
def test_the_outcome_of_a_march_that_comes_to_such_a_state(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = drawn("impact", 17)
    with monkeypatch.context() as presented:
        presented.setattr(start_states, "doubles_period", lambda *_: False)
        start = start_of(scene)
    assert start.outcome is Outcome.CONVERGED
    history = march_wear(scene.model, 0.0, start, 1.0, 1.0, "implicit", np.zeros(1), SETTINGS)
    assert history.outcome is Outcome.PERIOD_DOUBLED
