"""Residual and Jacobian of the harmonic balance against differences; a law of another kind beside friction."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import eigh

from solver import backbone, frequency_response
from solver.contact.coulomb import SLIP
from solver.contact.element import Element
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import state_of
from solver.packing import packable
from solver.settings import Resolution, SolverSettings
from tests.solver import models
from tests.solver.models import ALL_KINDS, branch_states, cyclic_model, march_wear, random_balance, random_model

SETTINGS = SolverSettings(3, 24)
MODELS = {"3d": ("3d",) * 4, "mixed": ALL_KINDS}


def jacobian_by_differences(balance, predicted, step):
    """Central differences where the differences of both sides agree, that is away from the switches.

    The states of the samples may change by round-off: a pair that has shaken down touches its limit without passing it.
    """
    here, changes = balance.evaluate(predicted).residual, np.eye(predicted.size).reshape(-1, *predicted.shape)
    ahead, behind = (
        np.array([(balance.evaluate(predicted + side * one).residual - here).ravel() / side for one in changes]).T
        for side in (step, -step)
    )
    differences = (ahead + behind) / 2.0
    kink = np.abs(ahead - behind).max()
    assert kink < 1e-3 * np.abs(differences).max(), "a switch within the differences: take another seed"
    return differences


MASSES = {"all": [0, 1, 2, 3, 5], "some": [0, 1], "one_elastic": [0, 2, 3, 5]}  # of MODELS["mixed"]; 4 has no tangent


def with_masses(free, wear, resolution):
    """Elastic pairs and masses on sliders in one joint."""
    model = models.with_free_masses(random_model(4, MODELS["mixed"]), MASSES[free])
    balance, predicted = random_balance(model, SETTINGS, 104, wear=wear, resolution=resolution)
    assert np.flatnonzero(balance.joint.penalty.inertial).tolist() == MASSES[free]
    predicted[balance.joint.component_index % 3 == 0, 1:] *= 2.0  # so that pairs open
    return balance, predicted


ODD, FAR = Resolution((1, 3, 5), 48), Resolution((1, 3, 7), 64)
JACOBIANS = {
    **{name: partial(random_balance, random_model(2, kinds), SETTINGS, 102) for name, kinds in MODELS.items()},
    "wave": partial(random_balance, cyclic_model(3, MODELS["mixed"], 6, 2), SETTINGS, 7),
    "slider": partial(random_balance, models.scene("sdof_slider"), SETTINGS, 7, resolution=FAR),
    "masses": lambda wear: with_masses("all" if wear else "some", wear, Resolution((1, 2, 3), 32) if wear else ODD),
    "one elastic": lambda wear: with_masses("one_elastic", wear, ODD),
}


@pytest.mark.slow
@pytest.mark.parametrize("wear", [False, True])
@pytest.mark.parametrize("name", JACOBIANS)
def test_jacobian_is_that_of_central_differences(name, wear):
    balance, predicted = JACOBIANS[name](wear=wear)
    at = balance.evaluate(predicted)
    assert SLIP in at.status_t
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    tangent = balance.linearise(at)
    dense = tangent.dense(np.arange(balance.joint.contact.n_contact))
    # row by row: those of the normal force are far larger than those of a mass; truncation (step / pull)^2 with pulls
    # above 1 N, round-off 1e-16 * 1e3 N / step
    assert (np.abs(dense - differences).max(axis=1) < 1e-6 * np.abs(differences).max(axis=1)).all()
    step = np.random.default_rng(3).normal(size=predicted.shape)
    expected = dense @ step.ravel()
    assert tangent.apply(step).ravel() == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("wear", [False, True])
@pytest.mark.parametrize("name", JACOBIANS)
def test_predict_is_the_inverse_of_evaluate(name, wear):
    balance, predicted = JACOBIANS[name](wear=wear)
    at = balance.evaluate(predicted)
    # what a state stores is its own depth; from there no wear is left to add
    stored = Balance(balance.joint, balance.history, at.wear_depth)
    back = stored.predict(at.displacement_h, at.force_h)
    assert back == pytest.approx(predicted, abs=1e-11 * np.abs(predicted).max())
    assert np.abs(stored.evaluate(back).residual - at.residual).max() < 1e-10 * np.abs(at.residual).max()


# --- another law ---

FINER = SolverSettings(5, 64)
STIFFNESS = 3e4  # N/m


class Springs(Element):
    """`lambda = k u` in each direction, that is `lambda = k / (k + eps) p`."""

    @property
    def share(self):
        return (STIFFNESS / (STIFFNESS + self.penalty.stiffness))[:, :, None]

    def march(self, predicted_h, _, __):
        predicted_t = predicted_h @ self.basis.synthesis
        return self.marched(predicted_t, self.share * predicted_t)

    def sample_tangents(self, at, stride=1):
        n = at.status_t[:, ::stride].shape[1]
        own = np.broadcast_to(np.eye(3) * (1.0 - self.share), (n, len(self.places), 3, 3))
        return own, np.zeros((n, len(self.places), 2, 2))


class Remembering(Springs):
    @property
    def n_history(self):
        return 3

    def final_history(self, at, _):
        return np.full((len(at.start), 3), 7.0)


@packable
@dataclass(frozen=True)
class OnSprings:
    pairs: tuple[int, ...]
    kind: type = Springs
    rest_stiffness: float = STIFFNESS

    def element(self, *of_pairs):
        return self.kind(*of_pairs)


def with_springs(model, *pairs, kind=Springs):
    return replace(model, contact=replace(model.contact, laws=(OnSprings(pairs, kind),)))


def test_derivatives_of_a_joint_with_a_law_of_another_kind_are_differences():
    model = with_springs(random_model(4, ("3d", "3d", "one_tangent")), 1)
    balance, predicted = random_balance(model, FINER, 104, wear=False)
    tangent = balance.linearise(balance.evaluate(predicted)).dense(np.arange(3))
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    assert (np.abs(tangent - differences).max(axis=1) < 1e-7 * np.abs(differences).max(axis=1)).all()


def test_derivatives_of_friction_are_those_from_its_samples():
    balance, predicted = random_balance(random_model(4, ("3d",) * 3), FINER, 104, wear=False)
    at, element = balance.evaluate(predicted), balance.joint.law
    assert not at.stuck.any()
    exact = element.tangent(at)
    plain = tuple(np.zeros_like(each) for each in exact)
    Element.switching_tangent(element, at, None, None, plain)
    # the normal force is a mean around its samples
    tangential = exact[0].shape[1] // 3
    assert plain[0][:, tangential:] == pytest.approx(exact[0][:, tangential:], abs=1e-13)


def test_a_joint_on_springs_moves_as_its_matrices_say_and_does_not_wear():
    model, omega = with_springs(random_model(4, ("3d", "3d")), 0, 1), 600.0
    (start,) = branch_states(model, 0.4, 60.0, [omega], FINER)
    history = march_wear(model, 0.4, start, 1e-11, 1.0, "adaptive", np.array([0.0, 1e4]), FINER)
    linear, relative = model.linear[0], model.contact.relative
    stiffness = linear.stiffness.copy()
    stiffness[relative, relative] += STIFFNESS
    moved = np.linalg.solve(
        stiffness + 1j * omega * linear.damping - omega**2 * linear.mass, 60.0 * linear.load_harmonic
    )
    assert history.response[0] == pytest.approx(linear.response @ moved, rel=1e-6)
    assert history.outcome.meaning == "converged"
    assert not history.worn_volume.any()


def test_a_law_that_remembers_more_leaves_what_friction_remembers():
    model = random_model(4, ("3d", "3d", "one_tangent"))
    balance, predicted = random_balance(with_springs(model, 1), FINER, 104, wear=False)
    longer, _ = random_balance(with_springs(model, 1, kind=Remembering), FINER, 104, wear=False)
    longer = replace(longer, history=np.pad(balance.history, ((0, 0), (0, 1))))
    short, long = (state_of(each.joint, each.evaluate(predicted)).next_history for each in (balance, longer))
    assert long[1].tolist() == [7.0, 7.0, 7.0]
    assert np.array_equal(long[[0, 2], :2], short[[0, 2]])
    assert not long[[0, 2], 2].any()


def test_a_joint_on_springs_at_rest_needs_one_harmonic():
    model = with_springs(random_model(4, ("3d", "3d")), 0, 1)
    # it would be refined for ever
    response = frequency_response(model, [100.0], 0.0, 0.4, settings=SolverSettings(time_limit=2.0))
    assert response.outcome[0].meaning == "converged"
    assert np.abs(response.response).max() < 1e-15


@pytest.mark.parametrize("pairs", [(1, 0), (0, 0), (0, 2), (-1,)])
def test_pairs_of_a_law_have_to_be_there_in_order(pairs):
    with pytest.raises(ValueError, match="laws"):
        with_springs(random_model(4, ("3d", "3d")), *pairs)


def test_a_mode_of_a_joint_on_springs_is_that_of_its_matrices():
    model = with_springs(random_model(4, ("3d", "3d")), 0, 1)
    linear, relative = model.linear[0], model.contact.relative
    stiffness = linear.stiffness.copy()
    stiffness[relative, relative] += STIFFNESS
    expected = np.sqrt(eigh(stiffness, linear.mass, eigvals_only=True)[:2]) / (2.0 * np.pi)
    found = [backbone(model, 1e-4, 0.4, mode=mode).frequency[0] for mode in (1, 2)]
    assert found == pytest.approx(expected, rel=1e-7)
