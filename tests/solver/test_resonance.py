"""The resonance of a vibration, and marches that end where it has shifted."""

import numpy as np
import pytest

from solver import build_model, march_wear
from solver.outcome import Outcome
from solver.results.state_report import resonance_frequency
from solver.settings import Resolution, SolverSettings, WearTarget, all_orders
from solver.structure.fourier import to_complex
from tests.solver.models import dovetail, random_balance, random_model
from tests.solver.reconstruction import harmonic_structure

MASS = np.diag([0.05, 0.05, 0.2])
FREQUENCY, AMPLITUDE, FRICTION, WEAR, END = 505.0, 5.0, 0.5, 1.1e-11, 1e5


def foot():
    """A foot pressed by 50 N, and a tip on a spring above it; the response is that of all displacements."""
    return build_model(
        mass=MASS,
        damping=np.diag([0.0, 0.0, 10.0]),
        stiffness=[[1e7, 0.0, 0.0], [0.0, 4e6, -2e6], [0.0, -2e6, 2e6]],
        contact_dofs=[[0, 1, -1]],
        area=1e-4,
        load_static=[50.0, 0.0, 0.0],
        load_harmonic=[0.0, 0.0, 1.0],
        response=[0, 1, 2],
    )


def resonances(response, frequency):
    """Hz, from first harmonics (n, 3) of all displacements of the foot."""
    in_phase = AMPLITUDE * response[:, 2].real
    inertia = np.real(np.sum(response.conj() * (response @ MASS), axis=1))
    return np.sqrt((2.0 * np.pi * frequency) ** 2 + in_phase / inertia) / (2.0 * np.pi)


@pytest.mark.parametrize("nodal_diameter", [None, 0, 3])
def test_it_is_that_of_the_equation_of_motion(nodal_diameter):
    if nodal_diameter is None:
        balance, predicted = random_balance(random_model(3, ("3d",) * 4, 4), SolverSettings(3, 24), 3, wear=False)
    else:
        settings, resolution = SolverSettings(3, 24), Resolution(all_orders(3), 24)
        model = dovetail(3, nodal_diameter)
        balance, predicted = random_balance(model, settings, 3, wear=False, resolution=resolution)
    joint, at = balance.joint, balance.evaluate(predicted)
    linear = harmonic_structure(joint.model, 1)
    mass, damping, stiffness = linear.mass, linear.damping, linear.stiffness
    load = joint.excitation_amplitude * linear.load_harmonic
    relative = joint.model.contact.dofs.ravel()[joint.component_index]
    # the motion of the pairs is given, what holds them is found with it
    n, n_rel = len(load), relative.size
    whole = np.zeros((n + n_rel, n + n_rel), complex)
    whole[:n, :n] = stiffness + 1j * joint.omega * damping - joint.omega**2 * mass
    whole[relative, n + np.arange(n_rel)] = whole[n + np.arange(n_rel), relative] = 1.0
    moved = to_complex(joint.to_relative(at.displacement_h))[:, 0]
    found = np.linalg.solve(whole, np.concatenate([load, moved]))
    x, held = found[:n], np.zeros(n, complex)
    held[relative] = found[n:]
    square = np.real(np.vdot(x, stiffness @ x + held + 1j * joint.omega * damping @ x)) / np.real(np.vdot(x, mass @ x))
    expected = np.sqrt(square) if square > 0.0 else np.nan
    assert resonance_frequency(joint, at)[0] == pytest.approx(expected, rel=1e-9, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit", "adaptive"])
def test_a_march_ends_where_the_resonance_has_shifted(scheme):
    model, counts = foot(), np.linspace(0.0, END, 101)
    arguments = {"friction_coefficient": FRICTION, "wear_coefficient": WEAR, "scheme": scheme, "step": 2000.0}
    whole = march_wear(model, FREQUENCY, AMPLITUDE, cycles=counts, **arguments)
    assert whole.outcome is Outcome.CONVERGED
    found = resonances(whole.response, FREQUENCY)
    shift = np.abs(found / found[0] - 1.0)
    target = 0.5 * float(shift.max())
    assert target > 0.03
    expected = np.interp(target, shift[: shift.argmax() + 1], counts[: shift.argmax() + 1])
    ended = march_wear(
        model, FREQUENCY, AMPLITUDE, cycles=counts, until=WearTarget("frequency_shift", target), **arguments
    )
    assert ended.cycles_to_target == pytest.approx(expected, rel=2e-2)
    assert ended.last_cycle < END
    # one that never comes changes nothing
    far = march_wear(model, FREQUENCY, AMPLITUDE, cycles=counts, until=WearTarget("frequency_shift", 10.0), **arguments)
    assert np.isnan(far.cycles_to_target)
    assert np.array_equal(far.worn_volume, whole.worn_volume)
