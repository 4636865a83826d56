"""Contact kernels and the law of a joint against plain twins and closed forms; derivatives: `test_elements`."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import solver
from solver.contact import slow_slide
from solver.contact.coulomb import SEPARATED, SLIP, STICK, mean_normal_force, mean_normal_tangent
from solver.contact.elastic_pairs import march_period, march_tangent, new_period
from solver.contact.law import build_law
from solver.contact.masses import SlidingMasses
from solver.settings import Resolution, SolverSettings
from solver.structure.fourier import build_basis, to_complex
from solver.structure.penalty import Penalty
from tests.contact_pair import ContactPair
from tests.solver.models import OMEGA, PRELOAD, case_of, random_model, with_free_masses
from tests.solver.reconstruction import mass_period, pair_period, status

FRICTION = 0.4
ORDERS = (1, 2, 3)
BASIS = build_basis(ORDERS, 20)

# --- elastic pairs ---


def run_pairs(predicted_t, start, periodicity, most_periods):
    period = new_period(predicted_t, np.full(len(start), FRICTION), start)
    march_period(np.arange(len(start)), period, periodicity, most_periods)
    return period


def assert_that_of_the_twin(predicted_t, found, pair, start, periods, tolerance):
    force, slip = pair_period(predicted_t[pair], FRICTION, start, periods)
    assert found.force_t[pair] == pytest.approx(force, abs=tolerance)
    assert found.state_t[pair] == pytest.approx(slip, abs=tolerance)
    assert np.array_equal(found.status_t[pair], status(predicted_t[pair], FRICTION, slip[:, :-1]))
    return slip


@pytest.mark.parametrize("most_periods", [1, 5])
def test_displacement_level_is_that_of_the_plain_twin(most_periods):
    """Of pairs that stick, slip and open; the last pair has a constant load."""
    random = np.random.default_rng(1)
    predicted_h = random.normal(size=(4, 3, 7)) * 10.0
    predicted_h[:, 0, 0], predicted_h[-1, 0, 1:] = 15.0, 0.0
    predicted_t, start = predicted_h @ BASIS.synthesis, random.normal(size=(4, 2)) * 5.0
    found = run_pairs(predicted_t, start, 0.0, most_periods)
    for pair in range(4):
        slip = assert_that_of_the_twin(predicted_t, found, pair, start[pair], found.periods[pair], 1e-11)
        assert found.change[pair] == pytest.approx(np.linalg.norm(slip[:, -1] - slip[:, 0]), abs=1e-11)
    assert found.periods.max() <= most_periods
    assert {SEPARATED, STICK, SLIP} <= set(found.status_t.ravel())


def test_harmonics_of_a_force_that_opens_converge_with_the_square_of_the_samples():
    # max(cos(t - 1) - 0.3, 0): closed for |t - 1| < a, cos a = 0.3
    a = np.arccos(0.3)
    exact = np.array([(np.sin(a) - 0.3 * a) / np.pi, (a - 0.3 * np.sin(a)) / np.pi * np.cos(1.0)])
    for samples in (32, 64, 128, 256):
        predicted_t = np.zeros((1, 3, samples))
        predicted_t[0, 0] = np.cos(2 * np.pi * np.arange(samples) / samples - 1.0) - 0.3
        force_h = mean_normal_force(predicted_t)[0] @ build_basis((1,), samples).analysis
        # kinks of slope sin a: at most (2 pi / N)^2 sin a, two of them, over the period
        assert np.abs(force_h[:2] - exact).max() < 2 * (2 * np.pi / samples) ** 2 * np.sin(a) / np.pi


@pytest.mark.parametrize("seed", [31, 33])
def test_a_closure_found_by_newtons_method_is_where_plain_passes_lead(seed):
    """Pairs that slip along one direction and are pulled across it: what lies across closes by a little a period."""
    random, n_contact = np.random.default_rng(seed), 6
    predicted_h = random.normal(size=(n_contact, 3, 7))
    predicted_h[:, 0] *= 3.0
    predicted_h[:, 0, 0], predicted_h[-1, 0, 1:] = 20.0, 0.0
    predicted_h[:, 1, 1] = np.linspace(8.4, 10.0, n_contact)
    predicted_t, begin = predicted_h @ BASIS.synthesis, random.normal(size=(n_contact, 2)) * 5.0
    found = run_pairs(predicted_t, begin, 1e-9, 400)
    assert (found.change <= 1e-9).all()
    slowest = 0
    for pair in range(n_contact):
        start, plain, left = begin[pair], 1, 1.0
        while left >= 1e-12:
            _, slip = pair_period(predicted_t[pair], FRICTION, start, 1)
            left, start, plain = np.linalg.norm(slip[:, -1] - start), slip[:, -1], plain + 1
        slowest = max(slowest, plain)
        assert_that_of_the_twin(predicted_t, found, pair, start, 1, 1e-6)
    assert slowest > 40
    assert found.periods.max() < 20


# --- masses on sliders ---


MASS, DRAG, MASS_OMEGA = 0.7, 0.21, 3.0  # kg, N s/m, rad/s


def run_mass(predicted_h, n_samples, both=True):
    """The period of a mass with one tangent or both: friction force (2, m) by harmonics, and slip work."""
    nothing = np.zeros(1)
    penalty = Penalty(nothing + 1.0, nothing, nothing == 0.0, nothing + MASS, nothing + DRAG, nothing)
    of = np.arange(1), penalty, nothing + FRICTION, np.array([[0, 1, 2 if both else -1]])
    found = SlidingMasses(*of, build_basis(ORDERS, n_samples), MASS_OMEGA).march(
        predicted_h[None], np.zeros((1, 2)), None
    )
    return found.force_h[0, 1:], found.slip_work[0]


@pytest.mark.parametrize(("amplitude", "n_phases"), [(8.0, 3), (30.0, 2)])
def test_a_line_is_that_of_the_exact_motion_to_second_order(amplitude, n_phases):
    """A free mass on a slider under a constant normal load and a harmonic force: with stops and without."""
    predicted_h = np.zeros((3, 7))
    predicted_h[0, 0], predicted_h[1, 1] = 15.0, amplitude
    given = [[MASS]], [[DRAG]], [[0.0]], [0.0], [amplitude]
    pair = ContactPair(*given, None, 0, 15.0, 0.0, FRICTION, MASS_OMEGA)
    orbit = pair.orbit_from_rest(20)
    assert len({segment.phase for segment in orbit.segments}) == n_phases
    rates = 1j * MASS_OMEGA * np.array(ORDERS)
    moved = np.array([orbit.harmonic(0, order) for order in ORDERS])
    exact, work = np.array([amplitude, 0.0, 0.0]) - (rates * MASS + DRAG) * rates * moved, pair.slip_work(orbit)
    samples, errors = np.array([32, 64, 128, 256, 512, 1024, 2048]), []
    for n_samples in samples.tolist():
        force_h, slip_work = run_mass(predicted_h, n_samples, both=False)
        errors.append((np.abs(to_complex(force_h[0]) - exact).max() / np.abs(exact).max(), abs(slip_work / work - 1.0)))
    for each in np.array(errors).T:
        # events fall anywhere in their steps, so the errors scatter about their order
        assert np.polyfit(np.log(samples), np.log(each), 1)[0] < -1.6
        assert (each < 80.0 / samples**2).all()


@pytest.mark.parametrize(("seed", "both"), [(1, True), (2, True), (2, False)])
def test_a_mass_moves_as_in_a_plain_twin_with_tiny_steps(seed, both):
    n_steps, random = 8192, np.random.default_rng(seed)
    predicted_h = random.normal(size=(3, 7)) * 4.0
    predicted_h[0, 0], predicted_h[2, :] = 15.0, predicted_h[2] if both else 0.0
    predicted_h[1:, 0] *= 0.1
    basis, step = build_basis(ORDERS, n_steps), 2.0 * np.pi / (MASS_OMEGA * n_steps)
    predicted = predicted_h @ basis.synthesis
    normal = np.maximum(predicted[0], 0.0)
    force, moved = mass_period(predicted[1:], FRICTION * normal, MASS, DRAG, step)
    expected, speed = force @ basis.analysis, np.hypot(*moved)
    assert 0.0 < (speed == 0.0).mean() < 0.9, "sticks and slips"
    force_h, slip_work = run_mass(predicted_h, n_steps // 8, both)
    # the twin is of first order: 2 pi / N of the period, several times over
    assert force_h == pytest.approx(expected, abs=3e-3 * np.abs(expected).max())
    assert slip_work == pytest.approx((normal * speed).sum() * step, rel=3e-3)


def test_no_kernel_assigns_a_slice_to_a_slice():
    """For such an assignment numba compiles the text of an error message, 3 s in each process."""
    kernels = [
        function
        for path in Path(solver.__file__).parent.rglob("*.py")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef) and "jit" in "".join(map(ast.unparse, function.decorator_list))
    ]
    assert len(kernels) > 20
    for node in (node for kernel in kernels for node in ast.walk(kernel) if isinstance(node, ast.Assign)):
        parts = [part for target in node.targets for part in ast.walk(target)]
        assert isinstance(node.value, ast.Constant) or not any(isinstance(part, ast.Slice) for part in parts), (
            ast.unparse(node)
        )


def test_a_kernel_is_compiled_once_for_any_resolution():
    model = random_model(1, ("3d", "3d"))
    for resolution in (Resolution((), 1), Resolution((1, 2, 3), 32)):
        joint = case_of(model, FRICTION, OMEGA, SolverSettings(), resolution).joint(OMEGA, 60.0)
        predicted = PRELOAD * np.ones((2, 3, len(joint.basis.synthesis)))
        history, first = np.zeros((2, 2)), 0.5 * predicted @ joint.basis.synthesis
        joint.law.tangent(joint.law.march(predicted, history, first), history, first)
    sliding = [each for each in vars(slow_slide).values() if hasattr(each, "signatures")]
    for kernel in (march_period, march_tangent, mean_normal_tangent, *sliding):
        assert len(kernel.signatures) == 1, (kernel, kernel.signatures)


MIXED = ("3d", "constant_load", "one_tangent", "second_tangent", "3d", "constant_load_one_tangent")
FREE, ELASTIC = [1, 3, 4], [0, 2, 5]


def of_pairs(joint, pairs):
    """The law of some of the pairs alone."""
    of_them = {name: getattr(joint.contact, name)[pairs] for name in ("dofs", "area", "friction_coefficient")}
    contact = replace(joint.contact, **of_them)
    return build_law(joint.penalty.at(pairs), contact, joint.basis, joint.omega)


def forces_and_history(joint):
    """Predicted force, N, under which the pairs of `MIXED` stick, slip and open, and their history, m."""
    random = np.random.default_rng(2)
    predicted = random.normal(size=(6, 3, len(joint.basis.synthesis))) * PRELOAD * 0.6
    predicted[:, 1:, 0] *= 0.1
    predicted.reshape(18, -1)[np.setdiff1d(np.arange(18), joint.component_index)] = 0.0
    predicted[~joint.contact.has_normal, 0, 1:] = 0.0
    predicted[:, 0, 0] = PRELOAD
    history = random.normal(size=(6, 2)) * 0.1 * PRELOAD / joint.penalty.tangential[:, None]
    return predicted, history


@pytest.mark.parametrize(
    ("resolution", "friction"),
    [(Resolution((1, 2, 3), 32), np.linspace(0.3, 0.55, 6)), (Resolution((1, 3, 5), 64), FRICTION)],
    ids=["of each pair", "odd"],
)
def test_pairs_of_a_mixed_joint_are_as_they_are_alone(resolution, friction):
    model = with_free_masses(random_model(1, MIXED), FREE)
    joint = case_of(model, friction, OMEGA, SolverSettings(), resolution).joint(OMEGA, 60.0)
    assert np.flatnonzero(joint.penalty.inertial).tolist() == FREE
    predicted, history = forces_and_history(joint)
    together = joint.law.march(predicted, history, None)
    assert {SEPARATED, STICK, SLIP} <= set(together.status_t[FREE].ravel())
    assert {STICK, SLIP} <= set(together.status_t[ELASTIC].ravel())
    tangents = joint.law.tangent(together)
    for pairs in (FREE, ELASTIC, *([pair] for pair in range(6))):
        part = of_pairs(joint, pairs)
        alone = part.march(predicted[pairs], history[pairs], None)
        for name in ("status_t", "periods"):
            assert np.array_equal(getattr(together, name)[pairs], getattr(alone, name)), name
        # a product of matrices of another height may differ in its last digit
        for name in ("predicted_t", "force_t", "force_h", "state_t", "start", "slip_work"):
            values = getattr(alone, name)
            assert getattr(together, name)[pairs] == pytest.approx(values, rel=1e-12, abs=1e-12 * np.abs(values).max())
        for whole, own in zip(tangents, part.tangent(alone), strict=True):
            assert whole[pairs] == pytest.approx(own, abs=1e-11 * max(1.0, np.abs(whole).max()))
