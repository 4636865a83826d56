"""The same wear with every system solved densely: fast solves change nothing but the time."""

import numpy as np
import pytest

from solver.loading_history.start_states import follow_branch
from solver.newton.linear_solver import DENSE_UNKNOWNS, JacobianSolver
from solver.outcome import Outcome
from solver.settings import SolverSettings
from studies.scenes import build_scene, scene_parameters
from tests.solver.models import march_wear

SETTINGS = SolverSettings(harmonics=5, samples=64, tolerance=1e-10)
# one: what a joint keeps of its slip from one frequency to the next depends on the steps between them
FREQUENCIES = np.array([212.86])
CYCLES = np.linspace(0.0, 6000.0, 4)
WEAR = 1.1e-11


def dense_solve(self, tangent, rights, rtol=0.0):
    """The whole Jacobian, all pairs, all harmonics."""
    matrix = tangent.dense(np.arange(tangent.joint.contact.n_contact))
    return np.array([np.linalg.solve(matrix, right.ravel()).reshape(right.shape) for right in rights])


def sector():
    """The dovetail sector with a coarse mesh: 264 unknowns, above the size that is always solved densely."""
    model = build_scene("dovetail_sector", scene_parameters("dovetail_sector")(mesh=1), 5)
    n_rel = 3 * model.contact.n_contact
    assert 11 * n_rel > DENSE_UNKNOWNS
    return model


def worn(model, starts, scheme):
    return [march_wear(model, 0.5, start, WEAR, 2000.0, scheme, CYCLES, SETTINGS) for start in starts]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit", "adaptive"])
def test_wear_is_that_of_dense_solves(scheme, monkeypatch):
    model = sector()
    # the same start: a sweep chooses its steps by what happens, and by every digit of that
    starts = [start for _, start in follow_branch(model, 0.5, 0.5, FREQUENCIES, "up", SETTINGS)]
    assert all(start.outcome is Outcome.CONVERGED for start in starts)
    histories = worn(model, starts, scheme)
    monkeypatch.setattr(JacobianSolver, "solve", dense_solve)
    dense_histories = worn(model, starts, scheme)
    assert any(history.wear_depth[-1].max() > 1e-9 for history in histories)
    for history, wanted in zip(histories, dense_histories, strict=True):
        assert history.outcome is wanted.outcome is Outcome.CONVERGED
        for name in ("wear_depth", "wear_rate", "response"):
            one, other = getattr(history, name), getattr(wanted, name)
            assert np.linalg.norm(one - other) <= 1e-9 * np.linalg.norm(other)
