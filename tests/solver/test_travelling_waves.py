"""Travelling waves: one sector against all sectors of the ring in time, Griffin's closed form, and steps in time."""

import numpy as np
import pytest

from solver import SolverSettings, build_model, frequency_response, march_wear
from solver.continuation.first_state import solve_first_state
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.run import Run
from solver.structure.joint import build_case
from tests.benchmarks.ring import FRICTION, WEAR, ring_in_time
from tests.rings import one_sector
from tests.solver.models import dovetail


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "frequency", "amplitude"), [(3, 320.0, 12.0), (5, 280.0, 3.3)])
def test_a_wave_of_the_sector_is_that_of_the_ring_in_time(diameter, frequency, amplitude):
    cycles = 300.0
    tips, volumes = ring_in_time(diameter, frequency, amplitude, (360,), cycles)
    waves = np.fft.fft(tips[0]) / tips[0].size
    assert np.abs(np.delete(waves, diameter)).max() < 1e-3 * abs(waves[diameter])
    sector = one_sector(diameter)
    tip = frequency_response(sector, [frequency], amplitude, FRICTION).response[0, 0]
    assert tip == pytest.approx(waves[diameter], rel=1e-2)
    worn = march_wear(sector, frequency, amplitude, FRICTION, WEAR, cycles)
    volume = worn.worn_volume[-1]
    # the steps in time are known to 1 %
    assert abs(volume - volumes.mean()) < (worn.worn_volume_error[-1] + 1e-2) * volume
    assert volume > 0.0


def damped_blade(limit, spring, ratio):
    """A blade, and the slip of a damper of a friction limit, N, behind a spring, N/m, against the next blade.

    ratio: relative amplitude of neighbours over that of a blade, at nodal diameter 3 of 24.
    """
    stiffness = {}
    for k in range(13):
        apart = 1.0 - np.exp(2j * np.pi * k / 24)
        stiffness[k] = np.array([[spring, -spring * apart], [-spring * np.conj(apart), 1e5 + spring * abs(apart) ** 2]])
    assert abs(1.0 - np.exp(2j * np.pi * 3 / 24)) == pytest.approx(ratio)
    loads = {"load_harmonic": [0.0, 1.0], "response": dict.fromkeys(stiffness, np.array([[0.0, 1.0]]))}
    loads |= {"normal_load": limit / 0.5, "n_sectors": 24, "nodal_diameter": 3}
    return build_model(dict.fromkeys(stiffness, np.diag([0.0, 0.1])), None, stiffness, [[-1, 0, -1]], 1e-4, **loads)


@pytest.mark.slow
@pytest.mark.parametrize(("harmonics", "within"), [(1, 2e-3), (9, 1e-2)])
@pytest.mark.parametrize("over_optimum", [0.8, 1.0, 2.0])
def test_the_resonance_of_a_blade_with_friction_dampers_is_griffins(harmonics, within, over_optimum):
    """In phase resonance the excitation feeds in pi F A a period; a slider behind a spring k takes 4 S (r A - S / k),
    with its friction limit S and the relative amplitude r A. So A = 4 S^2 / (k (4 r S - pi F)), and smallest, pi F /
    (r^2 k), with S = pi F / (2 r). It holds where the blade has one harmonic; here the slider has one, too. (J. H.
    Griffin, J. Eng. Power 102 (1980) 329, for a blade with a damper to the ground, r = 1.)
    """
    force, spring, ratio = 1.0, 2e4, 2.0 * np.sin(np.pi * 3 / 24)
    limit = over_optimum * np.pi * force / (2.0 * ratio)
    amplitude = 4.0 * limit**2 / (spring * (4.0 * ratio * limit - np.pi * force))
    assert amplitude >= np.pi * force / (ratio**2 * spring) * (1.0 - 1e-12)
    model, settings = damped_blade(limit, spring, ratio), SolverSettings(harmonics=harmonics, samples=1024)
    found = march_wear(model, "resonance", force, 0.5, 0.0, 1.0, between=(150.0, 200.0), settings=settings)
    assert abs(found.response[0, 0]) == pytest.approx(amplitude, rel=within)


@pytest.mark.slow
def test_the_dovetail_sector_settles_to_the_state_that_the_balance_has():
    """Steps in time know nothing of the balance of a travelling wave but its matrices: from rest they lead to a state
    whose motion differs from that raised gradually by the friction history alone.
    """
    settings, unworn, omega = SolverSettings(harmonics=3, samples=64), np.zeros(16), 2.0 * np.pi * 214.338
    case = build_case(dovetail(3, 3), 0.5, omega, settings)
    point, rest = (solve_first_state(case, omega, size, unworn, Run(settings.tolerance)) for size in (0.5, 1e-6))
    assert isinstance(point, State)
    assert point.evaluation.slip_work.sum() > 1e-9
    assert isinstance(rest, State)
    joint, quiet = case.joint(omega, 0.5), case.joint(omega, 0.0)
    settled = relax_to_periodic(joint, unworn, rest, quiet, Run(settings.tolerance))
    assert isinstance(settled, State)
    one, other = (
        joint.structure.response_h(joint.to_relative(at.evaluation.displacement_h))[0, 1:3] for at in (point, settled)
    )
    assert np.linalg.norm(one - other) < 0.05 * np.linalg.norm(one)
    again = Balance(joint, settled.evaluation.history, unworn).evaluate(settled.evaluation.predicted_h)
    assert again.scaled_residual() < 2.0 * settings.tolerance
