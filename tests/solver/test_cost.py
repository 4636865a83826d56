"""Choice among dense solves, factorisations in the slip space and marches, by their predicted costs."""

import numpy as np
import pytest

from solver.newton import cost
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import PeriodFactor
from solver.newton.preconditioner import build_factor
from solver.newton.slip_preconditioner import SlipFactor
from solver.settings import SolverSettings
from tests.solver.models import random_balance, random_model, with_free_masses


def tangent_of(n_pairs, harmonics, samples, masses=False):
    model = random_model(3, ("3d",) * n_pairs, 4)
    settings = SolverSettings(harmonics, samples)
    balance, predicted = random_balance(with_free_masses(model, [0]) if masses else model, settings, 3, wear=False)
    return balance.linearise(balance.evaluate(predicted))


def test_small_systems_are_dense_and_large_ones_are_not():
    # measured on one core: 0.9 ms for 243 unknowns of one pair, 118 ms for 1584 of 48 pairs, 0.1 ms a product
    assert cost.is_dense_cheapest(123, 3)
    assert not cost.is_dense_cheapest(1584, 144)
    sizes = [cost.is_dense_cheapest(7 * n_rel, n_rel) for n_rel in range(3, 150)]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize(("n_pairs", "kind"), [(2, SlipFactor), (40, PeriodFactor)])
def test_the_cheaper_factorisation_is_built(n_pairs, kind):
    found = build_factor(tangent_of(n_pairs, 5, 64))
    assert isinstance(found, kind)


def test_a_larger_factorisation_is_kept_for_more_products():
    products = [cost.worthwhile_products(48, 11, k) for k in (0, 300, 600, 1500, 2500)]
    assert products == sorted(products)
    assert products[0] >= NEWTON.usual_products
    assert products[-1] <= NEWTON.products
    assert np.ptp(products) > 0
