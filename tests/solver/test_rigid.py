"""Rigid friction at the tip of a cantilever, and the peak of a response, against exact motions."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.accuracy.resolved_state import ResolvedState
from solver.harmonic_balance.state import carried_history, largest_responses, tail_orders
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution, SolverSettings
from solver.structure.fourier import synthesis
from solver.structure.joint import build_case
from solver.structure.penalty import build_penalty
from tests.cantilever import FRICTION, Cantilever
from tests.references import den_hartog_amplitude
from tests.solver.exact import NATURAL
from tests.solver.models import branch_states, first_point, march_wear, scene

SPRINGS = {"rigid": np.inf, "soft spring": 20.0, "stiff spring": 200.0}  # N/m
CASES = [  # spring, force, N, frequency, rad/s, rtol; `python -m tests.benchmarks.accuracy` has more
    ("rigid", 3.0, 0.7, 1e-2),
    ("soft spring", 3.0, 1.0, 1e-3),
    ("stiff spring", 6.0, 1.2, 1e-2),
]


@lru_cache
def exact(name, force, omega):
    """First harmonic and largest displacement of the tip, m."""
    beam = Cantilever(spring=SPRINGS[name])
    orbit, tip = beam.orbit(force, omega), beam.tip_of_orbit()
    first = sum(share * orbit.harmonic(dof) for dof, share in enumerate(tip))
    return complex(first), float(np.abs(tip @ orbit.sample(4096)[: tip.size]).max())


def reported(model, friction, start, settings):
    """First harmonic and largest value, m, that are reported of the response of an unworn state."""
    history = march_wear(model, friction, start, 0.0, 1.0, "explicit", np.zeros(1), settings)
    return complex(history.response[0, 0]), float(history.response_peak[0, 0])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "force", "omega", "rtol"), CASES)
def test_a_cantilever_with_rigid_friction_is_as_accurate_as_was_asked_for(name, force, omega, rtol):
    model, settings = Cantilever(spring=SPRINGS[name]).model(), SolverSettings(rtol=rtol)
    (start,) = branch_states(model, FRICTION, force, [omega], settings)
    assert start.outcome is Outcome.CONVERGED
    first, peak = exact(name, force, omega)
    found, largest = reported(model, FRICTION, start, settings)
    error, peak_error = abs(found / first - 1.0), abs(largest / peak - 1.0)
    assert 1e-8 < error < rtol
    assert peak_error < rtol
    assert 0.5 * max(error, peak_error) < start.response_error <= rtol


def test_a_mass_behind_a_spring_is_marched_as_long_as_it_is_seen():
    # the spring of 200 N/m and the tip's 0.05 kg are in resonance at 63 rad/s
    sprung, rigid = Cantilever(spring=200.0).model(), Cantilever().model()
    assert [bool(build_penalty(sprung, 1.0, highest).inertial[0]) for highest in (3, 27, 79, 165)] == [1, 1, 0, 0]
    assert all(build_penalty(rigid, 1.0, highest).inertial[0] for highest in (3, 27, 79, 165))
    # from there on the penalty is the spring
    assert build_penalty(sprung, 1.0, 1000).tangential[0] == pytest.approx(200.0, rel=1e-2)


def test_the_tail_of_the_friction_force_belongs_to_the_peak():
    omega, settings = 0.62 * NATURAL, SolverSettings(harmonics=9, samples=512)
    model = scene("sdof_slider", normal_stiffness=0.0)
    case = build_case(model, 0.5, omega, settings)
    at = first_point(case, omega, 10.0, np.zeros(1)).evaluation
    joint = case.joint(omega, 10.0)
    exact_peak = den_hartog_amplitude(0.1, 1.6e5, 10.0, 5.0, omega)
    series = np.abs(at.displacement_h[0, 1] @ synthesis(joint.basis.orders, np.linspace(0.0, 2.0 * np.pi, 1025))).max()
    assert abs(series / exact_peak - 1.0) > 1e-3
    assert largest_responses(joint, at) == pytest.approx([exact_peak], rel=1e-4)
    # odd ones go on odd
    odd = case.at(Resolution((1, 3, 5, 7, 9), 512)).joint(omega, 10.0)
    assert tail_orders(odd) == tuple(range(11, 28, 2))
    assert tail_orders(joint) == tuple(range(10, 28))


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), [(79, 27)])
def test_a_state_is_found_again_where_its_mass_is_no_longer_marched(first, second):
    beam, omega, force = Cantilever(spring=200.0), 0.85, 6.0
    rich, poor = (Resolution(tuple(range(1, highest + 1, 2)), 1024) for highest in (first, second))
    case = build_case(beam.model(), FRICTION, omega, SolverSettings(), rich)
    point = first_point(case, omega, force, np.zeros(1))
    other = ResolvedState(case, case.joint(omega, force), point).solve_at(poor, Run(case.settings.tolerance))
    assert case.penalty.inertial[0] != other.case.penalty.inertial[0]
    # both are within their errors of the exact motion
    level = ResolvedState(case, case.joint(omega, force), point)
    for each in (level, other):
        assert abs(each.response()[0] / exact("stiff spring", force, omega)[0] - 1.0) < 0.02


def test_what_a_state_carries_into_the_terms_of_another_penalty():
    omega, force = 0.85, 6.0
    case = build_case(Cantilever(spring=200.0).model(), FRICTION, omega, SolverSettings(), Resolution((1, 3, 5), 64))
    joint = case.joint(omega, force)
    at = first_point(case, omega, force, np.zeros(1)).evaluation
    marched = case.penalty.inertial
    assert marched.tolist() == [True]
    assert np.array_equal(carried_history(case, joint, at), at.history)
    elastic = replace(case, penalty=replace(case.penalty, inertial=~marched))
    carried = carried_history(case, elastic.joint(omega, force), at)
    last = at.displacement_h[0, 1:] @ synthesis((1, 3, 5), np.array([2.0 * np.pi * 63 / 64]))
    assert carried[0] == pytest.approx(last[:, 0], rel=1e-12)
    back = carried_history(elastic, joint, at)
    assert np.array_equal(back, at.displacement_h[:, 1:, 0])
