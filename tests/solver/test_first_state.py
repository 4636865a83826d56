"""Static states, found under any friction, or the reason why there is none; first periodic states; shakedown."""

from dataclasses import replace

import numpy as np
import pytest

from solver.continuation.first_state import solve_static_state
from solver.continuation.natural import ratchets
from solver.harmonic_balance.state import Failure
from solver.loading_history.start_states import follow_branch
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.results.state_report import evaluated
from solver.settings import SolverSettings
from solver.structure.condensation import condense
from solver.structure.joint import build_case
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene
from studies.finite_element.solid_mesh import Material
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, mean_motion
from studies.finite_element.surfaces import surface_of_faces
from tests.random_decks import equilibrium_possible, random_deck, run_deck, static_forces
from tests.random_scenes import random_scene
from tests.solver.models import branch_states, dovetail, scene
from tests.studies.fe_models.sectors import faces_where
from tests.studies.fe_models.solid_meshes import block, joined

SETTINGS = SolverSettings(harmonics=3, samples=64)
OMEGA = 2.0 * np.pi * 211.5
PRESS = 200.0  # N on each pair: with it the glued dovetail pulls nowhere


def stacked(force, direction=(0.0, 0.0, -1.0), edge=False):
    """A block of steel, 40 x 10 x 5 mm, that is held at one end, and a second one on top of it.

    force: N, on the top, or with `edge` on one of its long edges, along a direction.
    """
    steel, size, height = Material(210e9, 0.3, 7850.0), np.array([0.04, 0.01, 0.005]), 0.005
    low, _ = block("C3D8", (4, 2, 1), lambda points: points * size, steel)
    up, _ = block("C3D8", (4, 2, 1), lambda points: points * size + [0.0, 0.0, height], steel)
    mesh = joined(low, up)
    x, y, z = mesh.coordinates.T
    upper = np.arange(mesh.n_nodes) >= low.n_nodes
    inside = (upper & (np.abs(z - height) < 1e-9), ~upper & (np.abs(z - height) < 1e-9))
    faces = [surface_of_faces(mesh, name, *faces_where(mesh, one)) for name, one in zip("UL", inside, strict=True)]
    held, top = np.zeros((mesh.n_nodes, 3), bool), upper & (z > height + 0.0049)
    held[~upper & (x < 1e-9)] = True
    pressed = mean_motion(np.flatnonzero(top & (y < 1e-9) if edge else top), np.array(direction), mesh.n_nodes)
    tip = mean_motion(np.flatnonzero(upper & (x > 0.0399)), np.array([0.0, 1.0, 0.0]), mesh.n_nodes)
    contact = ContactSurfaces(*faces, tolerance=1e-3)
    joint = JointDefinition((contact,), held, tip, {"tip": tip})
    model = FeModel(mesh, preload=pressed * force)
    return build_fe_scene(model, joint, ReductionOptions(n_modes=10), 1).model


def test_beyond_the_friction_that_holds_all_pairs_the_static_state_is_the_glued_one():
    # so much more load on the flanks that all pairs of the glued structure are pressed
    model = dovetail()
    load = model.linear[0].load_static.copy()
    load[model.contact.dofs[:, 0]] += PRESS
    linear = replace(model.linear[0], load_static=load)
    model = replace(model, linear={0: linear})
    condensed = condense(np.real(linear.stiffness), model.contact.dofs.ravel(), linear.load_static)
    force = np.real(condensed.force).reshape(-1, 3)
    # from this friction coefficient on the glued structure slips nowhere
    needed = float((np.hypot(force[:, 1], force[:, 2]) / force[:, 0]).max())
    assert 1.5 < needed < 100.0, "the test means nothing"
    for friction in (1.01 * needed, 1000.0):
        assert np.abs(static_forces(model, friction) - force).max() < 1e-7 * force.max()
    assert np.abs(static_forces(model, 0.7 * needed) - force).max() > 1e-3 * force.max()


@pytest.mark.parametrize(("friction", "force"), [(0.0, 1.0), (0.01, 1000.0), (0.4, 1.0)])
def test_a_free_block_on_a_cantilever_has_a_static_state(friction, force):
    forces = static_forces(stacked(force), friction)
    assert forces[:, 0].sum() == pytest.approx(force, rel=1e-6)


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
    exists = equilibrium_possible(joint.structure.static_stiffness, joint.structure.force_h[:, 0], 0.1)
    assert exists is (expected is None)
    found = solve_static_state(joint, Run(1e-9))
    assert (found.outcome if isinstance(found, Failure) else None) is expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_decks_have_a_static_state_where_the_forces_can_balance(seed):
    exists, outcome, errors = run_deck(random_deck(seed))
    assert (outcome is Outcome.CONVERGED) is (exists == "possible")
    assert max(errors.values(), default=0.0) < 1e-7


def test_a_mass_that_slides_all_the_time_needs_no_reference_sweep():
    ((_, start),) = follow_branch(scene("sdof_slider"), 0.5, 10.0, np.array([160.0]), "up", SolverSettings())
    assert start.reference is None
    assert 0.0 < start.response_error < 1e-2


# --- ratcheting of marched masses ends in shakedown ---


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "slips"), [(160, False), (178, True), (371, False), (710, False)])
def test_states_whose_slip_was_ratcheting_are_found_and_slip_by_their_vibration_alone(seed, slips):
    scene, settings = random_scene(seed), SolverSettings()
    omega = 2.0 * np.pi * scene.frequency_hz
    (start,) = branch_states(scene.model, scene.friction, scene.amplitude, [omega], settings)
    assert start.outcome is Outcome.CONVERGED
    case = build_case(scene.model, scene.friction, start.penalty_omega, settings, start.resolution)
    joint = case.joint(start.state.omega, scene.amplitude)
    at = evaluated(joint, start.state)[1]
    assert not ratchets(joint, at, 1e-3)
    # shaken down with 3 harmonics scene 710 slips 1e-12 N m on to where 9 have it, a thousand times what is left there
    assert (at.slip_work.sum() > 1e-13) == slips
