"""Elements of a joint: a law of another kind beside friction, and derivatives from those at the samples."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from solver import backbone, frequency_response
from solver.contact.element import Element
from solver.harmonic_balance.state import state_of
from solver.packing import packable
from solver.settings import SolverSettings
from tests.solver.models import branch_states, march_wear, random_balance, random_model
from tests.solver.test_balance import jacobian_by_differences

SETTINGS = SolverSettings(5, 64)
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

    def element(self, *of_pairs):
        return self.kind(*of_pairs)


def with_springs(model, *pairs, kind=Springs):
    return replace(model, contact=replace(model.contact, laws=(OnSprings(pairs, kind),)))


def test_derivatives_of_a_joint_with_a_law_of_another_kind_are_differences():
    model = with_springs(random_model(4, ("3d", "3d", "one_tangent")), 1)
    balance, predicted = random_balance(model, SETTINGS, 104, wear=False)
    tangent = balance.linearise(balance.evaluate(predicted)).dense(np.arange(3))
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    assert (np.abs(tangent - differences).max(axis=1) < 1e-7 * np.abs(differences).max(axis=1)).all()


def test_derivatives_of_friction_are_those_from_its_samples():
    balance, predicted = random_balance(random_model(4, ("3d",) * 3), SETTINGS, 104, wear=False)
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
    (start,) = branch_states(model, 0.4, 60.0, [omega], SETTINGS)
    history = march_wear(model, 0.4, start, 1e-11, 1.0, "adaptive", np.array([0.0, 1e4]), SETTINGS)
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
    balance, predicted = random_balance(with_springs(model, 1), SETTINGS, 104, wear=False)
    longer, _ = random_balance(with_springs(model, 1, kind=Remembering), SETTINGS, 104, wear=False)
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


def test_modes_refuse_another_law():
    with pytest.raises(ValueError, match=r"^model: "):
        backbone(with_springs(random_model(4, ("3d", "3d")), 1), [1e-6], 0.4)
