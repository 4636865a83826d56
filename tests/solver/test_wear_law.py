"""Wear laws: rate and gain, the work that wears, its derivatives, and histories against differential equations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import brentq

from solver.contact.wear_law import (
    ARCHARDS_WORK,
    PairFactors,
    PowerTerms,
    WearingWork,
    WearLaw,
    WearTable,
    wearing_work,
)
from solver.settings import SolverSettings
from tests.solver.models import random_balance, random_model
from tests.solver.test_elements import jacobian_by_differences
from tests.solver.worn_slider import AREA, END, FRICTION, OMEGA, WEAR, exact_depths, march

# of the slider, whose pressure falls from 1e5 Pa to nothing while 1e-4 m wear off
TABLE = WearTable((2e4, 5e4, 9e4), (0.0, 1e-5, 6e-5), ((0.8, 0.2, 0.5), (1.0, 0.6, 0.4), (0.4, 0.8, 0.9)))
THRESHOLD = 20.0  # J/m2: the slider begins with about 45 of them
POWER = PowerTerms(0.12 * WEAR, 3e-4)  # of the slider, which begins with 3600 W/m2


def random_work(seed, n_contact, n_pressures=4, n_depths=5):
    """All that a law can have, for forces of about 100 N on 1e-4 m2 and depths of micrometres."""
    random = np.random.default_rng(seed)
    factor, least = random.uniform(0.5, 2.0, n_contact), random.uniform(0.0, 1e-4, n_contact)
    pressure, depth = np.sort(random.uniform(0.1e6, 2e6, n_pressures)), np.sort(random.uniform(0.0, 5e-6, n_depths))
    values = random.uniform(0.0, 2.0, (n_pressures, n_depths))
    return WearingWork(factor, least, PairFactors(pressure, depth, values, random.uniform(0.5e-4, 2e-4, n_contact)))


def test_a_table_is_bilinear_and_constant_beyond_its_ends():
    table, random = random_work(0, 200).table, np.random.default_rng(1)
    law = WearingWork(table=table)
    force, depth = random.uniform(0.0, 400.0, 200), random.uniform(-1e-6, 6e-6, 200)
    reference = RegularGridInterpolator((table.pressure, table.depth), table.factor)
    inside = np.clip(force / table.area, *table.pressure[[0, -1]]), np.clip(depth, *table.depth[[0, -1]])
    assert law.work(np.ones(200), force, depth) == pytest.approx(reference(np.stack(inside, axis=1)), rel=1e-12)
    assert law.largest_factor == np.max(table.factor)


def test_a_step_grows_by_the_least_root_of_its_own_equation():
    law, random = random_work(0, 60), np.random.default_rng(10)
    work, force = random.uniform(0.0, 3e-4, 60), random.uniform(0.0, 300.0, 60)
    before, gain = random.uniform(0.0, 6e-6, 60), 10.0 ** random.uniform(-5.0, -1.0, 60)
    grown = law.growth(gain, work, force, before)
    scan = np.concatenate([[0.0], np.geomspace(1e-13, 1e-2, 4000)])
    excess = np.array([y - gain * law.work(work, force, before + y) for y in scan])
    for pair in range(60):
        last = int(np.argmax(excess[:, pair] >= 0.0))

        def left(y, pair=pair):
            return y - float((gain * law.work(work, force, before + y))[pair])

        expected = brentq(left, scan[last - 1], scan[last], xtol=1e-20) if last else 0.0
        assert grown[pair] == pytest.approx(expected, rel=1e-9, abs=1e-18)
    assert (grown == 0.0).any()
    assert np.count_nonzero(grown) > 20


LAWS = {
    "energy": WearLaw("energy", surfaces=(("plane", 1.7),)),
    "threshold": WearLaw("threshold"),
    "power": WearLaw("power", table=PowerTerms(0.2 * WEAR, 0.0), surfaces=(("plane", 1.7),)),
    "table": WearLaw("table", table=WearTable((2e5, 1e6, 3e6), (0.0, 1e-6, 2e-6), ((1, 2, 1), (0.5, 1, 2), (2, 1, 3)))),
}


@pytest.mark.parametrize("name", LAWS)
def test_the_jacobian_of_an_implicit_step_is_that_of_central_differences(name):
    model = random_model(2, ("3d", "constant_load", "one_tangent"))
    balance, predicted = random_balance(model, SolverSettings(3, 24), 102, wear=True)
    joint = balance.joint
    # the table bends with the depth at growths of about a micrometre
    gain = balance.wear_gain if name != "table" else 1e-2 * balance.wear_gain
    density = balance.evaluate(predicted).slip_work / joint.contact.area
    # one pair above it, one below
    chosen = replace(LAWS[name], threshold=float(density[[0, 2]].mean()))
    if name == "power":
        # one pair far beyond the power at which it wears most
        chosen = replace(chosen, table=PowerTerms(0.2 * WEAR, 0.02 / float(density.max())))
    law = wearing_work(chosen, joint.contact, WEAR).at(250.0)
    balance = replace(balance, wearing=law, wear_gain=gain)
    at = balance.evaluate(predicted)
    by_work, by_force, by_depth = law.slopes(at.slip_work, at.force_h[:, 0, 0], at.wear_depth)
    assert by_work.any()
    assert name != "table" or (by_force.any() and np.abs(gain * by_depth).max() > 0.01)
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    dense = balance.linearise(at).dense(np.arange(joint.contact.n_contact))
    assert np.abs(dense - differences).max() < 1e-7 * np.abs(differences).max()
    plain = replace(balance, wearing=ARCHARDS_WORK).linearise(at).dense(np.arange(joint.contact.n_contact))
    assert np.abs(plain - differences).max() > 1e-4 * np.abs(differences).max()


def exact_depth(law):
    """Depth of the slider at the end, by the differential equation."""
    table = law.table if law.name == "table" else None
    look = table and RegularGridInterpolator((table.pressure, table.depth), np.array(table.factor))

    def wearing(work, pressure, depth):
        if law.name == "power":
            phi, rest = FRICTION * work * OMEGA / (2.0 * np.pi) / AREA, law.table.adhesive / WEAR
            return FRICTION * work * (rest + (1.0 - rest) * np.exp(-law.table.decay * phi))
        if table is None:
            return max(work - law.threshold * AREA, 0.0)
        at = np.clip(pressure, table.pressure[0], table.pressure[-1]), np.clip(depth, 0.0, table.depth[-1])
        return work * float(look(at)[()])

    return exact_depths(np.array([END]), wearing)[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [WearLaw("threshold", THRESHOLD), WearLaw("table", table=TABLE), WearLaw("power", table=POWER)],
    ids=lambda x: x.name,
)
def test_histories_are_those_of_the_differential_equation(law):
    exact = exact_depth(law)
    assert abs(exact / exact_depths(np.array([END]))[0] - 1.0) > 0.1
    assert march(1.0, "adaptive", rtol=1e-3, law=law).wear_depth[-1, 0] == pytest.approx(exact, rel=1e-3)
    errors = [
        [march(step, scheme, law=law).wear_depth[-1, 0] - exact for step in (2000.0, 1000.0)]
        for scheme in ("explicit", "implicit")
    ]
    for coarse, fine in errors:
        assert coarse / fine == pytest.approx(2.0, rel=0.1)
        assert abs(fine) < 0.02 * exact
    # their leading errors are opposite
    assert errors[0][1] / errors[1][1] == pytest.approx(-1.0, rel=0.15)


def test_the_sides_of_a_pair_add_up_and_every_surface_has_a_factor():
    model = random_model(1)
    sides = replace(model.contact, surface=("flat/cylinder", "flat/cylinder", "flat"))
    law = WearLaw(surfaces=(("flat", 1.0), ("cylinder", 0.5)))
    found = wearing_work(law, sides, WEAR).work(np.ones(3), np.ones(3), np.ones(3))
    assert found.tolist() == [1.5, 1.5, 1.0]
    for wrong in ((("flat", 1.0),), (("flat", 1.0), ("cylinder", 0.5), ("disk", 1.0))):
        with pytest.raises(ValueError, match=r"cylinder|disk"):
            wearing_work(WearLaw(surfaces=wrong), sides, WEAR)


@pytest.mark.parametrize(
    "given",
    [{"name": "reye"}, {"name": "table"}, {"table": TABLE}, {"name": "power"}, {"name": "power", "table": TABLE}],
    ids=str,
)
def test_a_law_without_its_numbers_is_none(given):
    with pytest.raises(ValueError, match=r"^law: "):
        WearLaw(**given)
