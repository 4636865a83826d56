"""Residual and Jacobian of the harmonic balance against differences; laws of other kinds: `test_other_laws`."""

from functools import partial

import numpy as np
import pytest

from solver.contact.coulomb import SLIP
from solver.contact.element import Element
from solver.harmonic_balance.dlft import Balance
from solver.settings import Resolution, SolverSettings
from tests.solver import models
from tests.solver.models import ALL_KINDS, cyclic_model, random_balance, random_model

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


def test_derivatives_of_friction_are_those_from_its_samples():
    balance, predicted = random_balance(random_model(4, ("3d",) * 3), SolverSettings(5, 64), 104, wear=False)
    at, element = balance.evaluate(predicted), balance.joint.law
    assert not at.stuck.any()
    exact = element.tangent(at)
    plain = tuple(np.zeros_like(each) for each in exact)
    Element.switching_tangent(element, at, None, None, plain)
    # the normal force is a mean around its samples
    tangential = exact[0].shape[1] // 3
    assert plain[0][:, tangential:] == pytest.approx(exact[0][:, tangential:], abs=1e-13)
