"""Transposed solves, and derivatives of states by parameters, against differences of states that are solved again."""

from dataclasses import replace

import numpy as np
import pytest

import solver
from solver.compliant_contact import with_contact_stiffness
from solver.contact.wear_law import WearLaw, WearTable, wearing_work
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.parameters import by_friction, by_gap, by_wear_coefficient
from solver.harmonic_balance.state import first_response
from solver.newton import linear_solver
from solver.newton.linear_solver import JacobianSolver
from solver.newton.run import Run
from solver.results.gradient import gradient_of
from solver.settings import SolverSettings
from solver.structure import condensation
from solver.structure.condensation import build_structure
from solver.structure.harmonic_stiffness import SharedStiffness
from studies import build_scene
from tests.solver.models import (
    ALL_KINDS,
    OMEGA,
    case_of,
    cyclic_model,
    first_point,
    random_balance,
    random_model,
    with_free_masses,
)
from tests.solver.test_other_laws import with_all_laws

SETTINGS, TOLERANCE = SolverSettings(3, 64), 1e-12
LOAD, FRICTION, STIFFNESS, WEAR = 60.0, 0.4, 2e12, 1e-11
PAIRS = ("3d", "constant_load", "normal_only", "3d")


def random(*shape):
    return np.random.default_rng(0).normal(size=shape)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("wave", [0, 2])
def test_a_transposed_product_with_a_structure_is_that_of_its_transpose(wave, shared, monkeypatch):
    monkeypatch.setattr(condensation, "DENSE_BYTES", 0.0 if shared else np.inf)
    model = cyclic_model(3, PAIRS, 7, wave) if wave else random_model(3, PAIRS)
    structure = build_structure(model, OMEGA, 3.0, (1, 2, 3))
    assert isinstance(structure.moving, SharedStiffness) == (shared and not wave)
    x, y = random(2, *structure.force_h.shape)
    assert (structure.apply_transposed(y) * x).sum() == pytest.approx((y * structure.apply(x)).sum(), rel=1e-12)


@pytest.mark.parametrize("largest", [linear_solver.LARGEST_DENSE, 40], ids=["dense", "GMRES"])
@pytest.mark.parametrize("wear", [False, True])
def test_a_transposed_solve_exchanges_both_sides_of_a_product(largest, wear, monkeypatch):
    """y . b = c . x, where J x = b and J^T y = c; pairs that stick all the time included."""
    monkeypatch.setattr(linear_solver, "LARGEST_DENSE", largest)
    balance, predicted = random_balance(random_model(2, ALL_KINDS), SolverSettings(3, 24), 5, wear=wear)
    predicted[balance.joint.component_index == 0, 0] += 1e6
    tangent = balance.linearise(balance.evaluate(predicted))
    assert 0 < tangent.passive_rows.size < tangent.active_rows.size
    matrix = tangent.dense(np.arange(balance.joint.contact.n_contact))
    b, c = random(2, *predicted.shape)
    assert tangent.apply_transposed(c).ravel() == pytest.approx(matrix.T @ c.ravel(), abs=1e-10 * np.abs(matrix).max())
    x, y = np.linalg.solve(matrix, b.ravel()), JacobianSolver().solve_transposed(tangent, c, 1e-12)
    assert (y * b).sum() == pytest.approx(c.ravel() @ x, rel=1e-8)


def test_a_singular_jacobian_has_no_transposed_solution():
    balance, predicted = random_balance(random_model(2, PAIRS), SolverSettings(3, 24), 5, wear=False)
    tangent = balance.linearise(balance.evaluate(predicted))
    nothing = replace(tangent, force_tangent=np.full_like(tangent.force_tangent, np.nan))
    with pytest.raises(np.linalg.LinAlgError):
        JacobianSolver().solve_transposed(nothing, predicted)


# --- of the residual, in an implicit step ---

LAWS = {
    "archard": WearLaw(),
    "energy": WearLaw("energy"),
    "table": WearLaw("table", table=WearTable((0.0, 4e6), (0.0, 1e-4), ((1.0, 2.0), (3.0, 0.5)))),
}


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_of_a_step_by_parameters_of_a_pair_are_those_of_differences(law):
    """At a fixed predicted force: the residual, and the slip work."""
    rubs = random_model(2, ALL_KINDS)
    balance, predicted = random_balance(rubs, SolverSettings(3, 24), 5, wear=True)
    joint = balance.joint
    balance = replace(balance, wearing=wearing_work(LAWS[law], joint.contact, WEAR))
    at = balance.evaluate(predicted)
    tangent = balance.linearise(at)

    def changed(name, pair, step):
        one = np.arange(joint.contact.n_contact) == pair
        if name == "wear":
            return replace(balance, wear_gain=balance.wear_gain * np.exp(step * one))
        values = {"friction": "friction_coefficient", "gap": "gap"}[name]
        contact = replace(joint.contact, **{values: getattr(joint.contact, values) + step * one})
        return replace(balance, joint=replace(joint, model=replace(joint.model, contact=contact), contact=contact))

    slopes = {
        "friction": (by_friction(balance, at, tangent), 1e-6),
        "gap": (by_gap(at), 1e-9),
        "wear": (by_wear_coefficient(balance, at), 1e-6),
    }
    shapes = at.force_h.shape, at.slip_work.shape
    for name, (slope, step) in slopes.items():
        found, exact = [], []
        for pair in range(joint.contact.n_contact):
            ahead, behind = (changed(name, pair, side * step).evaluate(predicted) for side in (1.0, -1.0))
            work = (ahead.slip_work - behind.slip_work)[pair]
            found.append(np.append((ahead.residual - behind.residual).ravel(), work) / (2.0 * step))
            one = (np.arange(joint.contact.n_contact) == pair)[:, None, None]
            # what a parameter does not change is one 0
            forces, works = (
                np.broadcast_to(each, shape) for each, shape in zip((slope.force, slope.work), shapes, strict=True)
            )
            motion, force = joint.to_relative(slope.motion * one), joint.to_relative(forces * one)
            exact.append(np.append((joint.structure.apply(motion) + force).ravel(), works[pair]))
        sizes = np.abs(found).max(axis=0)
        assert sizes.max() > 0.0
        for part in (slice(0, -1), slice(-1, None)):
            size = np.abs(np.array(found)[:, part]).max()
            assert np.array(exact)[:, part] == pytest.approx(np.array(found)[:, part], abs=1e-6 * size), name


# --- of a state ---


def state_of(model):
    """Case, balance and evaluation of a state whose pairs stick, slip and open."""
    case = case_of(model, FRICTION, OMEGA, SETTINGS)
    state = first_point(case, OMEGA, LOAD)
    balance = Balance(state.joint(case), state.evaluation.start_history)
    again = Run(TOLERANCE).state(balance, state.evaluation.predicted_h)
    assert again is not None
    return case, balance, again.evaluation


def values_of(case, omega, load, balance, start):
    """Amplitudes of both responses, and the wear rate, with the history of a balance."""
    joint = case.joint(omega, load)
    found = Run(TOLERANCE).state(replace(balance, joint=joint), start)
    assert found is not None
    slip = WEAR * found.evaluation.slip_work.sum()
    return np.append(np.abs(first_response(joint, found.evaluation)), slip)


def differences(case, balance, at, changed, step):
    """Changes of these values by a change of the case, or of frequency and load."""
    ends = []
    for side in (1.0, -1.0):
        other, omega, load = changed(side * step)
        ends.append(values_of(other, omega, load, balance, at.predicted_h))
    return (ends[0] - ends[1]) / (2.0 * step)


def rough(pairs, seed):
    return with_contact_stiffness(random_model(seed, pairs), STIFFNESS)


MODELS = {
    "elastic": lambda: random_model(1, PAIRS),
    "rough": lambda: rough(PAIRS, 1),
    "masses": lambda: with_free_masses(random_model(1, ("3d", "constant_load", "one_tangent")), (1, 2)),
    "wave": lambda: cyclic_model(3, PAIRS, 6, 2),
    # so that no slider of Iwan's element has come to rest exactly at its limit, where a derivative has two sides
    "all laws": lambda: with_all_laws(60.0),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_gradient_of_a_state_is_that_of_states_solved_again(name):
    model = MODELS[name]()
    case, balance, at = state_of(model)
    status = set(at.status_t.ravel())
    assert len(status) > 1
    stiffness = STIFFNESS if name == "rough" else np.inf
    gradients = [gradient_of(balance, at, number, None, stiffness) for number in (0, 1)]
    gradients.append(gradient_of(balance, at, 0, WEAR, stiffness))

    def compare(attribute, changed, step, pair=None):
        exact = np.array([np.atleast_1d(getattr(each, attribute))[pair or 0] for each in gradients])
        found = differences(case, balance, at, changed, step)
        # a pair without influence has a derivative that is round-off
        size = np.abs([getattr(each, attribute) for each in gradients]).reshape(len(gradients), -1).max(axis=1)
        assert exact / size == pytest.approx(found / size, rel=1e-5, abs=1e-6), (attribute, pair)

    assert [each.value for each in gradients] == pytest.approx(
        values_of(case, OMEGA, LOAD, balance, at.predicted_h), rel=1e-9
    )
    hertz = 2.0 * np.pi
    compare("by_frequency", lambda step: (case, OMEGA + hertz * step, LOAD), 1e-6 * OMEGA)
    compare("by_excitation_amplitude", lambda step: (case, OMEGA, LOAD + step), 1e-5 * LOAD)
    assert gradients[0].by_wear_coefficient == 0.0
    assert gradients[2].by_wear_coefficient == gradients[2].value
    for pair in range(model.contact.n_contact):
        one = np.arange(model.contact.n_contact) == pair

        def with_contact(attribute, step, one=one):
            contact = case.model.contact
            contact = replace(contact, **{attribute: getattr(contact, attribute) + step * one})
            return replace(case, model=replace(case.model, contact=contact)), OMEGA, LOAD

        compare("by_friction_coefficient", lambda step: with_contact("friction_coefficient", step), 1e-6, pair)
        compare("by_gap", lambda step: with_contact("gap", step), 1e-10, pair)
        if name == "rough":

            def softer(step, one=one):
                stiff = with_contact_stiffness(random_model(1, PAIRS), STIFFNESS + step * one)
                contact = replace(stiff.contact, friction_coefficient=np.full(one.size, FRICTION))
                return replace(case, model=replace(stiff, contact=contact)), OMEGA, LOAD

            compare("by_contact_stiffness", softer, 1e-5 * STIFFNESS, pair)
    if name != "rough":
        assert not gradients[0].by_contact_stiffness.any()


def test_the_equations_of_a_joint_give_their_gradient():
    model, settings = build_scene("sdof_slider"), SolverSettings(5, 128)
    balance = solver.balance_of(model, 150.0, 10.0, 0.5, settings=settings)
    response = solver.frequency_response(model, 150.0, 10.0, 0.5, settings=settings).response[0, 0]
    assert balance.gradient().value == pytest.approx(abs(response), rel=1e-9)
    wear = balance.gradient(wear_coefficient=WEAR)
    assert wear.value > 0.0
    assert wear.by_excitation_amplitude > 0.0
    with pytest.raises(ValueError, match="response"):
        balance.gradient(1)
    with pytest.raises(ValueError, match="wear_coefficient"):
        balance.gradient(wear_coefficient=-1.0)
    with pytest.raises(ValueError, match="contact_stiffness"):
        balance.gradient(contact_stiffness=[1.0, 2.0])


def test_the_gradient_of_a_step_by_the_wear_coefficient_is_that_of_steps_solved_again():
    case, unworn, at = state_of(random_model(1, PAIRS))
    # so much wear that it takes a tenth of the load off the pairs
    gain = 0.1 / (at.slip_work.max() * unworn.joint.structure.static_stiffness.max()) * at.force_h[:, 0, 0].max()
    balance = replace(unworn, wear_gain=gain)
    run = Run(TOLERANCE)
    state = run.state(balance, at.predicted_h)
    assert state is not None
    exact = gradient_of(balance, state.evaluation, 1).by_wear_coefficient
    start, shares = state.evaluation.predicted_h, (1.0 + 1e-5, 1.0 - 1e-5)
    ends = [values_of(case, OMEGA, LOAD, replace(balance, wear_gain=gain * share), start) for share in shares]
    assert abs(exact) > 1e-4 * ends[0][1]
    assert exact == pytest.approx((ends[0] - ends[1])[1] / 2e-5, rel=1e-5)
