"""Exact references, in less than a minute: what is told is true, on the last commit.

Motions of friction oscillators whose friction excites a higher mode, integrated event by event with matrix exponentials
(steady to 1e-9); the bending beam with friction at its tip, the same way; worn volumes of the dovetail by nonsmooth
time integration (BDF2 fitted to the frequency, set-valued contact, 500 steps a period), which shares no code with the
solver. `tests/solver/test_accuracy.py` has more motions, with stops and impacts.
"""

import numpy as np
import pytest

from solver import Outcome, SolverSettings, build_model, frequency_response
from tests.solver.exact_scenes import tip_errors
from tests.solver.models import branch_states, march_wear, scene

# seed, rad/s, first harmonic of the response, largest response of a period
SUPERHARMONIC = [
    (0, 129.19, 0.28651108, 0.28805337),
    (1, 161.34, 0.12050249, 0.12074899),
    (1, 196.56, 0.13811712, 0.1422046),
    (1, 231.78, 0.11280361, 0.11189358),
    (2, 211.29, 0.13187788, 0.13388283),
    (3, 175.76, 0.13002884, 0.13027313),
    (4, 122.25, 0.053596305, 0.049980665),
    (4, 150.91, 0.069755435, 0.064601198),
    (4, 179.57, 0.051423254, 0.044262831),
    (5, 188.99, 0.044948486, 0.045725648),
    (5, 237.3, 0.04574764, 0.044849489),
    (5, 285.6, 0.028875885, 0.028040462),
    (6, 223.34, 0.026042053, 0.026040046),
    (6, 264.15, 0.029247224, 0.031889783),
    (7, 185.79, 0.027919694, 0.029397699),
    (7, 217.17, 0.033917253, 0.035700506),
]

# mesh, Hz, worn volume, mm3, and its own relative error; of mesh 1 pairs slide or stick again on the way
INTEGRATED = [(1, 212.6, 1.810, 0.005), (2, 211.5, 2.261, 0.005), (2, 212.0, 0.492, 0.01)]


def superharmonic(seed):
    """Five modes, damping proportional to the mass, and a massless point with 1500 N of rigid friction on a spring."""
    random = np.random.default_rng(900 + seed)
    first = random.uniform(80.0, 160.0)
    spread = [random.uniform(*each) for each in ((5.5, 7.0), (15.0, 19.0), (30.0, 37.0), (50.0, 62.0))]
    shape = np.array([0.6, -1.9, 1.8, 0.4, -2.0]) * random.uniform(0.8, 1.2, 5)
    spring = float(random.uniform(1.5e7, 4e7))
    load = np.concatenate([[0.0], random.uniform(200.0, 1000.0, 5)])
    response = np.concatenate([[0.0], random.uniform(1.0, 5.0, 5) * random.choice([-1.0, 1.0], 5)])
    mass, damping = np.diag([0.0, 1.0, 1.0, 1.0, 1.0, 1.0]), float(random.uniform(15.0, 30.0))
    stiffness = np.zeros((6, 6))
    stiffness[0, 0], stiffness[0, 1:], stiffness[1:, 0] = spring, -spring * shape, -spring * shape
    stiffness[1:, 1:] = np.diag((first * np.array([1.0, *spread])) ** 2) + spring * np.outer(shape, shape)
    given = {"load_harmonic": load, "response": response[None], "normal_load": 1500.0}
    return build_model(mass, damping * mass, stiffness, [[-1, 0, -1]], 1.0, **given)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rtol", "seed", "omega", "amplitude", "peak"),
    [(1e-2, *each) for each in SUPERHARMONIC] + [(1e-3, *each) for each in SUPERHARMONIC[1:5]],
)
def test_a_motion_whose_friction_excites_a_higher_mode_is_as_exact_as_it_is_told(rtol, seed, omega, amplitude, peak):
    found = frequency_response(
        superharmonic(seed), [omega / (2.0 * np.pi)], 1.0, 1.0, settings=SolverSettings(rtol=rtol)
    )
    told, first = found.response_error[0], abs(abs(found.response[0, 0]) / amplitude - 1.0)
    largest = abs(found.response_peak[0, 0] / peak - 1.0)
    assert found.outcome == (Outcome.CONVERGED,)
    assert first <= max(told, 0.1 * rtol)
    assert max(first, 0.5 * largest, told) <= rtol


@pytest.mark.slow
def test_a_beam_with_rigid_friction_at_its_tip():
    settings = SolverSettings()
    start, errors = tip_errors("rigid", 3.0, 0.96, settings)
    assert 0.5 * max(errors) < start.response_error <= settings.rtol
    assert max(errors) < settings.rtol


@pytest.mark.slow
@pytest.mark.parametrize(("mesh", "frequency", "volume", "own"), INTEGRATED)
def test_a_worn_volume_is_that_of_a_time_integration(mesh, frequency, volume, own):
    model, cycles = scene("dovetail_sector", 13, mesh=mesh), np.linspace(0.0, 1e5, 11)
    (start,) = branch_states(model, 0.5, 0.5, [2.0 * np.pi * frequency], SolverSettings())
    found = march_wear(model, 0.5, start, 1.1e-11, 1000.0, "adaptive", cycles, SolverSettings())
    apart = abs(found.worn_volume[-1] * 1e9 / volume - 1.0)
    assert found.outcome is Outcome.CONVERGED
    assert apart <= found.error_estimate + own
    assert apart <= 0.015
