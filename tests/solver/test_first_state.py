"""First periodic states: under much friction all are found; a mass that slides all the time needs few iterations."""

import numpy as np
import pytest

from solver.contact.coulomb import SLIP
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.state import State
from solver.loading_history.start_states import follow_branch
from solver.newton.run import Run
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import scene
from tests.solver.test_static_state import OMEGA, PAIRS, SETTINGS, pressed_dovetail


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
    found = solve_first_state(case, 2.0 * np.pi * frequency, 10.0, np.zeros(1), run)
    assert isinstance(found, State)
    assert SLIP in found.evaluation.status_t
    # from rest, with the excitation raised in steps: 30 to 90
    assert run.budget.iterations <= 8


def test_a_mass_that_slides_all_the_time_needs_no_reference_sweep():
    ((_, start),) = follow_branch(scene("sdof_slider"), 0.5, 10.0, np.array([160.0]), "up", SolverSettings())
    assert start.reference is None
    assert 0.0 < start.response_error < 1e-2
    assert start.newton_iterations < 60
