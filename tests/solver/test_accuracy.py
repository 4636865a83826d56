"""Automatic states against exact motions: as accurate as was asked for, errors not played down."""

import numpy as np
import pytest

from solver.accuracy.resolved_state import ResolvedState
from solver.harmonic_balance.state import largest_responses
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution, SolverSettings
from tests.cantilever import FRICTION, Cantilever
from tests.references import den_hartog_amplitude
from tests.solver import exact_scenes
from tests.solver.exact_scenes import KINDS, barely_slipping, drawn, find, textbook_scenes, wall
from tests.solver.models import case_of, first_point, scene

SCENES = textbook_scenes()


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


STATES = [(name, (1e-3, 1e-2)[n % 2]) for n, name in enumerate(SCENES)]
# with stops that are few and short
STATES += [("slider 5.5 N 0.6", 1e-3), ("two masses 0.4", 1e-3)]


def check(scene, rtol, sweep):
    found = find(scene, SolverSettings(rtol=rtol), sweep)
    assert found.history.outcome is Outcome.CONVERGED
    assert max(found.response, found.wear_rate) <= rtol, found
    assert found.safe, found
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rtol"), STATES)
def test_a_textbook_state_is_as_accurate_as_was_asked_for(name, rtol):
    found = check(SCENES[name][0], rtol, SCENES[name][1])
    assert max(found.told) <= rtol
    # a test of a state that is trivial would say nothing
    assert "open" in name or found.response > 1e-7


@pytest.mark.slow
@pytest.mark.parametrize(("name", "harmonics"), [("slider 10.0 N 0.9", [1, 3, 5, 9]), ("two masses 0.5", [3, 5, 9])])
def test_states_converge_with_the_square_of_the_harmonics_at_least(name, harmonics):
    found = [find(SCENES[name][0], SolverSettings(harmonics=n, samples=4096)) for n in harmonics]
    for errors in ([each.response for each in found], [each.wear_rate for each in found]):
        assert np.polyfit(np.log(harmonics), np.log(errors), 1)[0] < -2.0
        assert errors == sorted(errors, reverse=True)
    assert found[0].response < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "rtol"), [(kind, *((2, 1e-2), (4, 1e-3))[n % 2]) for n, kind in enumerate(KINDS)]
)
def test_a_random_state_is_accurate_and_its_error_not_played_down(kind, seed, rtol):
    scene, sweep = drawn(kind, seed), "up" if seed % 4 else "down"
    if (kind, seed) == ("grazing", 2):
        # its motion has a multiplier of -1.33, exactly (`test_floquet`): no mass stays at it
        assert find(scene, SolverSettings(rtol=rtol), sweep).history.outcome is Outcome.PERIOD_DOUBLED
    else:
        check(scene, rtol, sweep)


@pytest.mark.parametrize("name", HARD)
def test_events_shorter_than_a_sample_or_a_harmonic_are_seen(name):
    check(HARD[name], 1e-2, "up")


@pytest.mark.slow
def test_a_cantilever_with_friction_behind_a_spring_is_as_accurate_as_was_asked_for():
    """`tests/truth` has rigid friction, `python -m tests.benchmarks.accuracy` more."""
    start, errors = exact_scenes.tip_errors("soft spring", 3.0, 1.0, SolverSettings(rtol=1e-3))
    assert start.outcome is Outcome.CONVERGED
    assert errors[0] > 1e-8
    assert max(errors) < 1e-3
    assert 0.5 * max(errors) < start.response_error <= 1e-3


def test_the_tail_of_the_friction_force_belongs_to_the_peak():
    omega, settings = 0.62 * float(np.sqrt(1.6e6)), SolverSettings(harmonics=9, samples=512)
    model = scene("sdof_slider", normal_stiffness=0.0)
    case = case_of(model, 0.5, omega, settings)
    at = first_point(case, omega, 10.0).evaluation
    joint = case.joint(omega, 10.0)
    exact_peak = den_hartog_amplitude(0.1, 1.6e5, 10.0, 5.0, omega)
    assert largest_responses(joint, at) == pytest.approx([exact_peak], rel=1e-4)


@pytest.mark.slow
def test_a_state_is_found_again_where_its_mass_is_no_longer_marched():
    beam, omega, force = Cantilever(spring=200.0), 0.85, 6.0
    rich, poor = (Resolution(tuple(range(1, highest + 1, 2)), 1024) for highest in (79, 27))
    case = case_of(beam.model(), FRICTION, omega, SolverSettings(), rich)
    level = ResolvedState(case, first_point(case, omega, force))
    other = level.solve_at(poor, Run(case.settings.tolerance))
    assert case.penalty.inertial[0] != other.case.penalty.inertial[0]
    for each in (level, other):
        assert abs(each.response()[0] / exact_scenes.exact_tip("stiff spring", force, omega)[0] - 1.0) < 0.02
