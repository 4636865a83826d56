"""Nonlinear modes against closed forms, the linear limits, energy, published values and forced responses."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import scipy.linalg

from solver import Outcome, SolverSettings, backbone, build_model, frequency_response, modal_response
from solver.loading_history import sweep as sweep_module
from solver.model import with_friction
from solver.modes.points import follow_mode
from solver.results.state_report import periodic_motion
from tests.solver.models import cyclic_model, dovetail, glued_frequency, scene

MASS, STIFFNESS, LIMIT = 0.1, 1.6e5, 5.0  # kg, N/m, N
SIZE = LIMIT / STIFFNESS  # m
NATURAL = float(np.sqrt(STIFFNESS / MASS))  # rad/s
# peak amplitude and first harmonic of a mass on a rigid slider, both over the friction limit over the stiffness
PEAKS = np.array([1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0])
FIRST = np.array([1.23322403, 1.51974485, 2.01257092, 3.00760511, 5.00436220, 10.00214181, 30.00071016])
DAMPING = np.log((PEAKS + 1.0) / (PEAKS - 1.0)) / np.pi


def slider(damping=0.0):
    """A mass on a rigid slider. damping: N s/m."""
    return scene("sdof_slider", normal_stiffness=0.0, damping=damping)


def foot():
    """A pressed foot with a tip on a spring above it; damping: 1e-5 times stiffness."""
    stiffness = np.array([[1e7, 0.0, 0.0], [0.0, 4e6, -2e6], [0.0, -2e6, 2e6]])
    load = {"load_static": [50.0, 0.0, 0.0], "load_harmonic": [0.0, 0.0, 1.0], "response": [2]}
    return build_model(np.diag([1e-3, 1e-3, 0.2]), 1e-5 * stiffness, stiffness, [[0, 1, -1]], 1e-4, **load)


FOOT_AMPLITUDES = np.array([1e-8, 8e-6, 2e-5, 1e-4, 3e-3])
# automatic harmonics are those of the other joints: a foot is compared with hundreds of them
FIXED = SolverSettings(harmonics=9, samples=256)


@lru_cache
def foot_modes():
    return backbone(foot(), FOOT_AMPLITUDES, 0.5, settings=FIXED)


@pytest.mark.slow
def test_a_mass_on_a_rigid_slider_has_the_closed_form():
    asked = {"sweep": "down", "settings": SolverSettings(rtol=1e-3)}
    found = backbone(slider(), FIRST * SIZE * np.sqrt(MASS), 0.5, **asked)
    assert set(found.outcome) == {Outcome.CONVERGED}
    exact = NATURAL / np.sqrt(1.0 + DAMPING**2) / (2.0 * np.pi)
    np.testing.assert_allclose(found.damping_ratio, DAMPING, rtol=1e-3)
    np.testing.assert_allclose(found.frequency, exact, rtol=1e-3)
    np.testing.assert_allclose(abs(found.response[:, 0]), FIRST * SIZE, rtol=1e-6)
    assert (found.damping_error >= 0.5 * abs(found.damping_ratio - DAMPING)).all()
    assert (found.frequency_error >= 0.5 * abs(found.frequency - exact)).all()


@pytest.mark.slow
def test_small_and_large_amplitudes_have_the_linear_modes_and_their_damping():
    found, model = foot_modes(), foot().linear[0]
    glued = np.sqrt(2e6 / 0.2)
    assert found.frequency[0] == pytest.approx(glued / (2.0 * np.pi), rel=1e-9)
    assert found.damping_ratio[0] == pytest.approx(0.5e-5 * glued, rel=1e-9)
    assert found.slip_fraction[0, 0] == 0.0
    sliding = np.sqrt(np.linalg.eigvals(np.linalg.solve(model.mass[1:, 1:], model.stiffness[1:, 1:])).min())
    assert found.frequency[-1] == pytest.approx(sliding / (2.0 * np.pi), rel=1e-3)
    assert found.slip_fraction[-1, 0] > 0.95
    # friction adds its work: 4 mu N times the amplitude of the foot in a period
    omega, foot_motion = 2.0 * np.pi * found.frequency[-1], abs(found.shape[-1, 1])
    friction = 4.0 * 25.0 * foot_motion / (2.0 * np.pi * (omega * FOOT_AMPLITUDES[-1]) ** 2)
    assert found.damping_ratio[-1] == pytest.approx(0.5e-5 * sliding + friction, rel=1e-3)
    assert found.damping_ratio[2] > 3.0 * found.damping_ratio[0]
    # the amplitude is that of the shape, to which the response belongs
    modal = np.sqrt(np.einsum("ai,ij,aj->a", found.shape.conj(), model.mass, found.shape).real)
    np.testing.assert_allclose(modal, FOOT_AMPLITUDES, rtol=1e-6)
    np.testing.assert_allclose(found.response[:, 0], found.shape[:, 2], rtol=1e-6)


@pytest.mark.slow
def test_an_oscillator_with_a_wall_has_the_period_of_its_two_springs():
    """Without damping the mode is the free motion: a spring of 1 N/m, and from the gap on one of 100 N/m beside it."""
    gap, stiff = 0.1, 101.0
    speed = np.array([0.15, 0.2])  # m/s at the wall
    free, centre = np.hypot(gap, speed), 100.0 * gap / stiff
    pressed = np.hypot(gap - centre, speed / np.sqrt(stiff))
    half_closed = np.arccos((gap - centre) / pressed) / np.sqrt(stiff)
    half = half_closed + np.pi - np.arccos(gap / free)
    # from the deepest point in the wall to the farthest one from the wall
    time, omega = np.linspace(0.0, half, 200_001), np.pi / half
    inside, outside = centre + pressed * np.cos(np.sqrt(stiff) * time), -free * np.cos(half - time)
    moved = np.where(time < half_closed, inside, outside)
    first = 2.0 / half * np.trapezoid(moved * np.cos(omega * time), time, axis=0)
    found = backbone(scene("vibro_impact", damping=0.0), first, 0.0)
    np.testing.assert_allclose(2.0 * np.pi * found.frequency, omega, rtol=1e-2)
    assert (abs(2.0 * np.pi * found.frequency - omega) <= 2.0 * 2.0 * np.pi * found.frequency_error).all()
    assert (abs(found.damping_ratio) < 1e-9).all()
    np.testing.assert_allclose(1.0 - found.open_fraction[:, 0], half_closed / half, atol=0.03)


def energies(problem, state):
    """Energy fed in by the negative damping, and dissipated by damping and contact, J in a period."""
    joint, at, fed, taken = problem.joint_of(state), state.evaluation, 0.0, 0.0
    motion = periodic_motion(joint, at)
    for order, x in zip(motion.orders.tolist(), motion.displacement.T, strict=True):
        linear, size = problem.model.harmonic_structure(order), np.pi * order**2 * state.omega
        fed += size * 2.0 * state.damping_ratio * state.omega * float(np.vdot(x, linear.mass @ x).real)
        taken += size * float(np.vdot(x, linear.damping @ x).real)
    contact = np.pi * float((np.imag(motion.relative_displacement.conj() * motion.contact_force) * motion.orders).sum())
    # the slip of the samples takes what the series of the balance does
    friction = float(joint.law.friction_work(at).sum())
    assert friction == pytest.approx(contact, rel=1e-2, abs=1e-9 * taken)
    return fed, taken + contact


@pytest.mark.slow
def test_the_reference_of_a_mode_does_not_go_backwards():
    """Its long steps predict a frequency below 0, at which there is the mode once more."""
    found = backbone(foot(), [3e-3], 0.5)
    assert found.outcome == (Outcome.CONVERGED,)
    assert found.frequency_error[0] < 1e-3 * found.frequency[0]


def test_a_mode_whose_reference_is_lost_has_an_unknown_error(monkeypatch):
    monkeypatch.setattr(sweep_module, "follow", lambda *_, **__: ())
    found = backbone(foot(), FOOT_AMPLITUDES[:2], 0.5, settings=FIXED)
    assert found.outcome[1] is Outcome.INACCURATE
    assert np.isinf([found.frequency_error[1], found.damping_error[1]]).all()


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["foot", "slider", "wave"])
def test_the_negative_damping_feeds_in_what_damping_and_friction_take(joint):
    model, amplitudes, way, settings = {
        "foot": (foot(), FOOT_AMPLITUDES[2:4], "up", FIXED),
        "slider": (slider(0.3), SIZE * np.sqrt(MASS) * np.array([1.3, 4.0]), "down", SolverSettings()),
        "wave": (cyclic_model(3, ("3d", "3d"), 7, 2), np.array([1e-4, 1e-3]), "up", SolverSettings(harmonics=3)),
    }[joint]
    for _, point in follow_mode(with_friction(model, 0.5), amplitudes, 1, way, settings):
        assert point.found is not None
        fed, taken = energies(*point.found)
        assert fed == pytest.approx(taken, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_point_does_not_depend_on_the_others(direction):
    up = direction == "up"
    amplitudes = FOOT_AMPLITUDES if up else FOOT_AMPLITUDES[2:]
    together = foot_modes() if up else backbone(foot(), amplitudes, 0.5, sweep="down", settings=FIXED)
    index = 3 if up else 1
    alone = backbone(foot(), amplitudes[index], 0.5, sweep=direction, settings=FIXED)
    for name in ("frequency", "damping_ratio", "frequency_error", "damping_error", "response", "shape"):
        np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[index])


@pytest.mark.parametrize("nodal_diameter", [2, 5])
def test_a_small_travelling_wave_has_the_mode_of_the_glued_sector(nodal_diameter):
    model = cyclic_model(3, ("3d", "3d"), 7, nodal_diameter)
    frequency, found = glued_frequency(model), backbone(model, [1e-7], 0.4, settings=SolverSettings(harmonics=3))
    assert found.frequency[0] == pytest.approx(frequency, rel=1e-9)
    # damping is proportional to stiffness
    assert found.damping_ratio[0] == pytest.approx(5e-5 * np.pi * frequency, rel=1e-9)


def test_what_has_no_mode_says_so():
    for model, asked, said in ((foot(), {"mode": 4}, "fewer linear modes"), (slider(), {}, 'sweep = "down"')):
        found = backbone(model, 1e-3, 0.5, **asked)
        assert found.outcome == (Outcome.START_FAILED,)
        assert said in found.message[0]
        assert np.isnan(found.frequency).all()
    # a mode that is lost says where, and keeps its other points
    found = backbone(slider(), SIZE * np.sqrt(MASS) * np.array([0.5, 2.0]), 0.5, sweep="down")
    assert found.outcome == (Outcome.BRANCH_LOST, Outcome.CONVERGED)
    assert np.isnan(found.frequency).tolist() == [True, False]


@pytest.mark.slow
def test_the_dovetail_softens_and_damps_and_its_forced_resonance_agrees():
    model = dovetail(21)
    amplitudes = np.array([1e-6, 7e-4])
    found = backbone(model, amplitudes, 0.5)
    assert set(found.outcome) == {Outcome.CONVERGED}
    assert found.frequency[0] == pytest.approx(212.856, abs=1e-3)
    assert (np.diff(found.frequency) < 0.0).all()
    assert (np.diff(found.damping_ratio) > 0.0).all()
    # at phase resonance the excitation feeds in what the mode dissipates: |phi^H F| = 2 zeta omega^2 a
    at, linear = 1, model.linear[0]
    omega = 2.0 * np.pi * found.frequency[at]
    share = np.vdot(found.shape[at], linear.load_harmonic) / amplitudes[at]
    force = 2.0 * found.damping_ratio[at] * omega**2 * amplitudes[at] / abs(share)
    forced = frequency_response(model, found.frequency[at], force, 0.5)
    # the response in quadrature with the modal force, within the errors of both and of single-mode theory
    expected = -1j * share / abs(share) * found.response[at, 0]
    assert abs(forced.response[0, 0] - expected) < 0.01 * abs(expected)


# --- the virtual friction beam of nonlinear modal testing ---

# A clamped steel beam with an elastic friction element (a spring that slips): Scheel, Peter, Leine and Krack, "A phase
# resonance approach for modal testing of structures with nonlinear dissipation", Journal of Sound and Vibration 435
# (2018); the parameters are those of scripts that their authors and others have published with NLvib.
SPRING, SLIPS_AT = 1.3e6, 1.0  # N/m, N


def beam_matrices(n_elements=7, at=3):
    """Mass, damping, stiffness without the friction element, and the index of its place.

    at: number of elements from the clamp to the element. The damping is 0.8 and 0.2 % of the first two stuck modes.
    """
    x, bending, line = 0.7 / n_elements, 185e9 * 0.03**4 / 12.0, 7830.0 * 0.03**2
    stiff = [[12, 6 * x, -12, 6 * x], [6 * x, 4 * x * x, -6 * x, 2 * x * x]]
    stiff += [[-12, -6 * x, 12, -6 * x], [6 * x, 2 * x * x, -6 * x, 4 * x * x]]
    heavy = [[156, 22 * x, 54, -13 * x], [22 * x, 4 * x * x, 13 * x, -3 * x * x]]
    heavy += [[54, 13 * x, 156, -22 * x], [-13 * x, -3 * x * x, -22 * x, 4 * x * x]]
    mass, stiffness = np.zeros((2, 2 * n_elements + 2, 2 * n_elements + 2))
    for first in range(0, 2 * n_elements, 2):
        own = slice(first, first + 4)
        stiffness[own, own] += bending / x**3 * np.array(stiff)
        mass[own, own] += line * x / 420.0 * np.array(heavy)
    mass, stiffness, place = mass[2:, 2:], stiffness[2:, 2:], 2 * at - 2
    stuck = stiffness.copy()
    stuck[place, place] += SPRING
    omega = np.sqrt(scipy.linalg.eigh(stuck, mass, eigvals_only=True)[:2])
    by_mass, by_stiffness = np.linalg.solve(np.stack([1.0 / omega, omega], axis=1), [0.016, 0.004])
    return mass, by_mass * mass + by_stiffness * stuck, stiffness, place


def friction_beam(**place):
    """The beam as a model: the end of the spring, without mass, rubs on the ground."""
    mass, damping, stiffness, at = beam_matrices(**place)
    grown = [np.pad(part, (0, 1)) for part in (mass, damping, stiffness)]
    grown[2][[at, at, -1, -1], [at, -1, at, -1]] += SPRING * np.array([1.0, -1.0, -1.0, 1.0])
    load = np.eye(len(grown[0]))[-3]
    return build_model(
        *grown, [[-1, len(load) - 1, -1]], 1e-4, load_harmonic=load, normal_load=SLIPS_AT, response=[len(load) - 3]
    )


# modal amplitude, m sqrt(kg), frequency, Hz, and damping ratio of the first mode by a plain harmonic balance: ten odd
# harmonics of the motion at the friction element, whose force 512 samples give, in finite differences
PLAIN_BALANCE = np.array([
    [3.548133892335753e-06, 62.11968043383963, 0.008],
    [5.011872336272725e-06, 59.75256683755375, 0.05828594672714075],
    [7.079457843841373e-06, 56.365187824881474, 0.0842085845855424],
    [1e-5, 53.33186804675408, 0.09300812621673626],
    [2.818382931264455e-05, 49.40262375603508, 0.0571514017170393],
    [7.943282347242822e-05, 48.35256271382054, 0.0296772814637938],
])  # fmt: skip


@pytest.mark.slow
def test_the_first_mode_is_that_of_a_plain_harmonic_balance():
    """Near log10 a = -5.15 the 15th harmonic meets the third mode: with 13 harmonics the frequency is 0.02 Hz off."""
    amplitudes, frequency, damping = PLAIN_BALANCE.T
    mode = backbone(friction_beam(), amplitudes, 1.0)
    assert set(mode.outcome) == {Outcome.CONVERGED}
    assert mode.harmonics_used[2] > 13
    # the samples of the plain balance give both to 5e-5
    assert (abs(mode.frequency - frequency) < mode.frequency_error + 5e-5 * frequency).all()
    assert (abs(mode.damping_ratio - damping) < mode.damping_error + 5e-5 * damping).all()
    assert (mode.frequency_error < 1e-3 * mode.frequency).all()
    assert (mode.damping_error < 5e-3 * mode.damping_ratio).all()


@pytest.mark.slow
def test_stuck_and_slipping_beam_and_the_published_damping():
    """Published: damping up to 15 % where the frequency falls by 35 %; the place of the element is not known here."""
    mass, _, stiffness, place = beam_matrices(28, 15)
    stuck = stiffness.copy()
    stuck[place, place] += SPRING
    ends = [np.sqrt(scipy.linalg.eigh(part, mass, eigvals_only=True)[0]) / (2.0 * np.pi) for part in (stuck, stiffness)]
    mode = backbone(friction_beam(n_elements=28, at=15), 10.0 ** np.array([-6.0, -5.0, -4.9, -3.0]), 1.0)
    assert mode.frequency[0] == pytest.approx(ends[0], rel=1e-9)
    assert mode.damping_ratio[0] == pytest.approx(0.008, rel=1e-9)
    assert mode.frequency[-1] == pytest.approx(ends[1], rel=1e-3)
    assert 1.0 - ends[1] / ends[0] == pytest.approx(0.35, abs=0.015)
    assert mode.damping_ratio.max() == pytest.approx(0.16, abs=0.01)


def test_without_slip_the_curve_is_that_of_a_linear_oscillator():
    model = foot()
    mode = backbone(model, np.geomspace(1e-9, 1e-6, 4), 0.5)
    force = 0.02  # N
    curve = modal_response(model, mode, force)
    omega, zeta = 2.0 * np.pi * mode.frequency[0], mode.damping_ratio[0]
    shape = mode.shape[0] / mode.amplitude[0]
    excited = 2.0 * np.pi * curve.frequency
    participation = np.vdot(shape, model.linear[0].load_harmonic)
    expected = shape[2] * participation * force / (omega**2 - excited**2 + 2j * zeta * omega * excited)
    np.testing.assert_allclose(curve.response[:, 0], expected, rtol=1e-6)
    # other modes of the full response are far away
    near = np.argmax(np.abs(curve.response[:, 0]))
    full = frequency_response(model, curve.frequency[[near]], force, 0.5)
    np.testing.assert_allclose(curve.response[near], full.response[0], rtol=1e-3)


@pytest.mark.slow
def test_with_slip_the_curve_is_near_the_full_response():
    """A mass on a rigid slider: both sides of the resonance, where friction damps more than the damper."""
    model = slider(damping=2.0)
    mode = backbone(model, np.geomspace(8.0, 25.0, 6) * SIZE * np.sqrt(MASS), 0.5, sweep="down")
    curve = modal_response(model, mode, 8.0)
    assert np.isfinite(curve.frequency).all()
    top = int(np.argmax(curve.amplitude))
    assert curve.damping_ratio[top] > 3.0 * 2.0 / (2.0 * np.sqrt(STIFFNESS * MASS))
    size = np.abs(curve.response[:, 0])
    below, above = (int(np.argmin(np.abs(part - 0.9 * size[top]))) for part in (size[:top], size[top:]))
    rows = [below, top, top + above]
    full = frequency_response(model, curve.frequency[rows], 8.0, 0.5)
    np.testing.assert_allclose(size[rows], np.abs(full.response[:, 0]), rtol=0.04)


def test_a_resonance_beyond_the_mode_leaves_a_gap_and_wrong_arguments_are_named():
    model = foot()
    mode = backbone(model, [1e-9, 1e-8], 0.5)
    assert np.count_nonzero(np.isnan(modal_response(model, mode, 1.0).frequency)) == 1
    unknown, other = replace(mode, frequency=np.full(2, np.nan)), replace(mode, shape=mode.shape[:, :2])
    for given, force, said in (
        (mode, np.nan, "excitation_amplitude"),
        (unknown, 1.0, "amplitudes"),
        (other, 1.0, "of"),
    ):
        with pytest.raises(ValueError, match=said):
            modal_response(model, given, force)
