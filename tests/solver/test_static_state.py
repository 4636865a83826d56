"""Static states, found under any friction, or the reason why there is none; first periodic states from there."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.first_state import solve_first_state, solve_static_state
from solver.harmonic_balance.state import State
from solver.loading_history.start_states import follow_branch
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.condensation import condense
from solver.structure.joint import build_case
from studies.finite_element.element_matrices import Material
from studies.finite_element.joint_model import JointDefinition, MeshModel, ReductionOptions, SetMotion
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene
from studies.finite_element.surfaces import surface_of_faces
from tests.random_decks import equilibrium_possible, law_errors, random_deck, run_deck
from tests.solver.models import dovetail, scene
from tests.studies.fe_models.sectors import faces_where
from tests.studies.fe_models.solid_meshes import block, joined

SETTINGS = SolverSettings(harmonics=3, samples=64)
OMEGA = 2.0 * np.pi * 211.5
PAIRS = 16
PRESS = 200.0  # N on each pair: with it the glued dovetail pulls nowhere


@lru_cache
def pressed_dovetail():
    """The coarse dovetail with so much more load on its flanks that all pairs of the glued structure are pressed."""
    model = dovetail()
    linear = model.linear[0]
    load = linear.load_static.copy()
    load[model.contact.dofs[:, 0]] += PRESS
    return replace(model, linear={0: replace(linear, load_static=load)})


def glued_force(model):
    """Contact force (n_contact, 3), N, of the static load with all relative displacements held."""
    linear = model.linear[0]
    condensed = condense(np.real(linear.stiffness), model.contact.dofs.ravel(), linear.load_static)
    return np.real(condensed.force).reshape(-1, 3)


def static_point(model, friction):
    case = build_case(model, friction, OMEGA, SETTINGS)
    point = solve_static_state(case.joint(OMEGA, 0.0), np.zeros(model.contact.n_contact), Run(1e-9))
    assert not isinstance(point, Outcome), f"no static state at a friction coefficient of {friction}"
    return point


def check_laws(model, friction):
    """All laws of contact hold in the static state; returns the contact forces (n_contact, 3), N."""
    point = static_point(model, friction)
    errors = law_errors(build_case(model, friction, OMEGA, SETTINGS).joint(OMEGA, 0.0), point)
    assert max(errors.values()) < 1e-7, errors
    return point.evaluation.force_h[:, :, 0]


def stacked(force, direction=(0.0, 0.0, -1.0), interference=None, edge=False):
    """A block of steel, 40 x 10 x 5 mm, that is held at one end, and a second one on top of it.

    force: N, on the top, or with `edge` on one of its long edges, along a direction. With an interference, m, bottom
    and top are held instead, and the material does not bulge.
    """
    steel = Material(210e9, 0.3 if interference is None else 0.0, 7850.0)
    size, above = np.array([0.04, 0.01, 0.005]), 0.005 - (interference or 0.0)
    divisions = (4, 2, 1 if interference is None else 2)
    low, _ = block("C3D8", divisions, lambda points: points * size, steel)
    up, _ = block("C3D8", divisions, lambda points: points * size + [0.0, 0.0, above], steel)
    mesh = joined(low, up)
    x, y, z = mesh.coordinates.T
    upper = np.arange(mesh.n_nodes) >= low.n_nodes
    inside = (upper & (np.abs(z - above) < 1e-9), ~upper & (np.abs(z - 0.005) < 1e-9))
    faces = [surface_of_faces(mesh, name, *faces_where(mesh, one)) for name, one in zip("UL", inside, strict=True)]
    held, top = np.zeros((mesh.n_nodes, 3), bool), upper & (z > above + 0.0049)
    held[(z < 1e-9) | top if interference is not None else ~upper & (x < 1e-9)] = True
    pressed = SetMotion(np.flatnonzero(top & (y < 1e-9) if edge else top), np.array(direction))
    tip = SetMotion(np.flatnonzero(upper & (x > 0.0399)), np.array([0.0, 1.0, 0.0]))
    contact = ContactSurfaces(*faces, tolerance=1e-3, with_gaps=interference is not None)
    joint = JointDefinition((contact,), held, tip, {"tip": tip})
    model = MeshModel(mesh, preload=pressed.row(mesh.n_nodes) * force)
    return build_fe_scene(model, joint, ReductionOptions(n_modes=10), 1).model


def test_beyond_the_friction_that_holds_all_pairs_the_static_state_is_the_glued_one():
    model = pressed_dovetail()
    force = glued_force(model)
    # from this friction coefficient on the glued structure slips nowhere
    needed = float((np.hypot(force[:, 1], force[:, 2]) / force[:, 0]).max())
    assert 1.5 < needed < 100.0, "the test means nothing"
    for friction in (1.01 * needed, 5.0 * needed, 1000.0):
        evaluation = static_point(model, friction).evaluation
        assert np.abs(evaluation.force_h[:, :, 0] - force).max() < 1e-7 * force.max()
    assert np.abs(static_point(model, 0.7 * needed).evaluation.force_h[:, :, 0] - force).max() > 1e-3 * force.max()


@pytest.mark.parametrize("friction", [0.3, 0.5, 1.0, 2.0, 5.0, 30.0, 1000.0])
def test_the_dovetail_has_a_static_state_under_any_friction(friction):
    check_laws(dovetail(), friction)


@pytest.mark.parametrize("force", [1.0, 1000.0])
@pytest.mark.parametrize("friction", [0.0, 0.01, 0.1, 0.4, 1.0])
def test_a_free_block_on_a_cantilever_has_a_static_state(friction, force):
    forces = check_laws(stacked(force), friction)
    assert forces[:, 0].sum() == pytest.approx(force, rel=1e-6)


def test_interference_presses_as_the_closed_form_says():
    interference = 1e-6
    # two bars in a row, 5 mm each, between rigid walls
    pressure = 210e9 * interference / (0.01 - interference)
    forces = check_laws(stacked(0.0, interference=interference), 0.1)
    assert forces[:, 0].sum() == pytest.approx(pressure * 0.04 * 0.01, rel=1e-4)


@pytest.mark.parametrize(
    ("direction", "edge", "expected"),
    [
        ((0.0, 0.12, -1.0), False, Outcome.STATIC_SLIDING),
        ((0.0, 0.08, -1.0), False, None),
        ((0.0, 0.0, 1.0), False, Outcome.STATIC_OPEN),
        ((0.0, -0.05, -1.0), True, Outcome.STATIC_OPEN),
    ],
)
def test_a_joint_without_a_static_state_says_why(direction, edge, expected):
    model = stacked(100.0, direction, edge=edge)
    joint = build_case(model, 0.1, OMEGA, SETTINGS).joint(OMEGA, 0.0)
    exists = equilibrium_possible(joint.structure.static_stiffness, joint.structure.static_force, 0.1)
    assert exists is (expected is None)
    found = solve_static_state(joint, np.zeros(joint.contact.n_contact), Run(1e-9))
    assert (found if isinstance(found, Outcome) else None) is expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_decks_have_a_static_state_where_the_forces_can_balance(seed):
    exists, outcome, errors = run_deck(random_deck(seed))
    assert (outcome is Outcome.CONVERGED) is (exists == "possible")
    assert max(errors.values(), default=0.0) < 1e-7


@pytest.mark.slow
def test_with_more_friction_the_vibration_comes_to_that_of_the_glued_structure():
    model = pressed_dovetail()
    glued = None
    away = []
    for friction in (0.06, 0.08, 0.1, 5.0, 1000.0):
        case = build_case(model, friction, OMEGA, SETTINGS)
        point = solve_first_state(case, OMEGA, 0.5, np.zeros(PAIRS), Run(case.settings.tolerance))
        assert isinstance(point, State), f"friction {friction}"
        joint = case.joint(OMEGA, 0.5)
        glued = complex(joint.structure.harmonic_offset[0])
        cosine, sine = joint.structure.response_h(joint.to_relative(point.evaluation.displacement_h))[0, 1:3]
        away.append(abs(complex(cosine, -sine) - glued))
    assert glued is not None
    assert away[0] > away[1] > away[2] > 0.01 * abs(glued)
    assert max(away[3:]) < 1e-6 * abs(glued)


@pytest.mark.parametrize("frequency", [89.6, 150.0, 240.0])
def test_a_mass_that_friction_cannot_hold_begins_to_slide_at_once(frequency):
    case = build_case(scene("sdof_slider"), 0.5, 2.0 * np.pi * frequency, SolverSettings())
    run = Run(case.settings.tolerance)
    assert isinstance(solve_first_state(case, 2.0 * np.pi * frequency, 10.0, np.zeros(1), run), State)
    # from rest, with the excitation raised in steps: 30 to 90
    assert run.budget.iterations <= 8


def test_a_mass_that_slides_all_the_time_needs_no_reference_sweep():
    ((_, start),) = follow_branch(scene("sdof_slider"), 0.5, 10.0, np.array([160.0]), "up", SolverSettings())
    assert start.reference is None
    assert 0.0 < start.response_error < 1e-2
    assert start.newton_iterations < 60
