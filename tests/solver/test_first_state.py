"""First periodic states under much friction: all are found, and their limit is the glued structure."""

import numpy as np
import pytest

from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.state import State
from solver.newton.run import Run
from solver.structure.joint import build_case
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
