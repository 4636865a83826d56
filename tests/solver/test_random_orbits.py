"""Automatic states of random scenes against their exact motions: as accurate as asked for, errors not played down."""

import numpy as np
import pytest

from solver.accuracy.harmonic_levels import shortest_contact
from solver.contact.coulomb import SEPARATED, SLIP, STICK
from solver.outcome import Outcome
from tests.references import coulomb_orbit, vibro_impact_orbit
from tests.solver.random_orbits import KINDS, behind_spring, drawn, find, wall

ROUND_OFF = 1e-10


def barely_slipping(tangential, damping, omega, over):
    """Elastic dry friction whose limit is exceeded by a share `over` if it sticks."""
    stuck = tangential / abs(1.0 + tangential - omega**2 + 1j * omega * damping)
    return behind_spring(tangential, damping, stuck * (1.0 - over), omega, np.exp(0.7j))


HARD = {
    # in contact for 2 % of the period: up to nine harmonics, each next one changes less than a tenth of the error
    "short contact": wall(0.39251, 1.17792, 0.04593, 85.95555),
    # with three harmonics there is a state that no exact motion is like, but the one with a single harmonic is
    "spurious state": wall(1.67268, 0.52004, 0.19517, 84.16794),
    # the wall is touched, or the friction limit is exceeded, between two of 64 samples only
    "touch between samples": wall(0.30277, 1.09583, 0.13481, 24.17409),
    "slip between samples": barely_slipping(3.15541, 0.09326, 1.2, 1.3e-4),
    "slip in one sample": barely_slipping(0.27652, 0.055, 0.8, 2.6e-4),
    # what is next to the turns among some samples is so among twice as many
    "nested samples": barely_slipping(0.36178, 0.032, 0.9, 3e-5),
}


UNSTABLE = {("grazing", 2): Outcome.PERIOD_DOUBLED}
"""Motions with a multiplier of -1.33, exactly (`test_floquet`): no mass stays at them."""


def check(scene, rtol, sweep):
    found = find(scene, rtol, sweep)
    assert found.outcome is Outcome.CONVERGED
    assert max(found.response, found.wear_rate) <= rtol, found
    assert found.response_estimate >= 0.5 * found.response - ROUND_OFF, found
    assert found.wear_rate_estimate >= 0.5 * found.wear_rate - ROUND_OFF, found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "rtol"), [(kind, *((2, 1e-2), (4, 1e-3))[n % 2]) for n, kind in enumerate(KINDS)]
)
def test_a_random_state_is_accurate_and_its_error_not_played_down(kind, seed, rtol):
    sweep = "up" if seed % 4 else "down"
    if (kind, seed) in UNSTABLE:
        assert find(drawn(kind, seed), rtol, sweep).outcome is UNSTABLE[kind, seed]
    else:
        check(drawn(kind, seed), rtol, sweep)


@pytest.mark.parametrize("name", HARD)
def test_events_shorter_than_a_sample_or_a_harmonic_are_seen(name):
    check(HARD[name], 1e-2, "up")


@pytest.mark.parametrize("kind", ["slider", "stopping slider", "two masses"])
def test_the_pair_moves_like_the_mass_on_a_slider(kind):
    scene = drawn(kind, 2)
    at = scene.tangent
    masses = np.diag(scene.mass) > 0.0
    parts = (part[np.ix_(masses, masses)] for part in (scene.mass, scene.damping, scene.stiffness))
    normal = scene.normal_load or scene.load_static[scene.normal]
    load, place = scene.load_harmonic[masses], int(masses[:at].sum())
    twin = coulomb_orbit(*parts, load, place, scene.friction * normal, scene.omega)
    orbit = scene.orbit_near(np.zeros(masses.size), np.zeros(masses.size))
    expected = [twin.harmonic(index) for index in range(len(load))]
    assert scene.response(orbit) == pytest.approx(np.array(expected), rel=1e-8)
    slid = twin.path(place, [name for name in twin.system.phases if name != "stick"])
    assert scene.slip_work(orbit) == pytest.approx(normal * slid, rel=1e-8)


def test_the_pair_moves_like_the_mass_at_a_wall():
    scene = wall(0.9, 1.5, 0.05, 50.0)
    orbit = scene.orbit_near(np.zeros(2), np.zeros(2))
    twin = vibro_impact_orbit(1.0, 0.1, 1.0, 1.0, 50.0, 1.5, 0.9, sweep_start=0.85)
    assert scene.response(orbit) == pytest.approx(np.array([twin.harmonic(0)]), rel=1e-8)


def test_the_shortest_contact_is_counted_around_the_period():
    status, force = np.full((3, 16), STICK), np.ones((3, 16))
    assert shortest_contact(status, force, 0.1) == 1.0
    status[1, 3:13] = SEPARATED
    assert shortest_contact(status, force, 0.1) == 6.0 / 16.0
    status[2, :9] = status[2, 11:] = SEPARATED
    status[2, 9] = SLIP
    assert shortest_contact(status, force, 0.1) == 2.0 / 16.0
    status[0] = SEPARATED
    assert shortest_contact(status, force, 0.1) == 2.0 / 16.0
