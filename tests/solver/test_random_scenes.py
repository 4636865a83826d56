"""A few of the random scenes of the benchmark, and that they are what they are said to be."""

import numpy as np
import pytest

from solver.accuracy.resolved_state import ResolvedState
from solver.outcome import Outcome
from solver.settings import SolverSettings
from studies.model_check import check_model
from tests.benchmarks.random_scenes import run_scene, solved
from tests.random_scenes import COMPONENTS, random_scene
from tests.solver.models import branch_states

SCENES = [random_scene(seed) for seed in range(200)]


def test_all_scenes_are_possible_structures():
    for scene in SCENES:
        check_model(scene.model)
        linear = scene.model.linear[0]
        assert np.linalg.eigvalsh(linear.stiffness)[0] > 0.0
        assert np.linalg.eigvalsh(linear.damping)[0] > 0.0
        assert np.linalg.eigvalsh(linear.mass)[0] > -1e-12 * np.abs(linear.mass).max()
        assert scene.amplitude > 0.0
        assert scene.wear_coefficient > 0.0
        assert scene.cycles == pytest.approx(5 * scene.step)


def test_all_kinds_are_there():
    sizes = {scene.model.contact.n_contact for scene in SCENES}
    assert sizes == set(range(1, 9))
    rows = {tuple(row >= 0) for scene in SCENES for row in scene.model.contact.dofs}
    assert len(rows) == len(COMPONENTS)
    for words in (("0 inner", "6 inner"), ("massless", "light", "direct"), ("pressed", "touching", "near", "far")):
        for word in words:
            assert sum(word in scene.facts for scene in SCENES) >= 10, word
    frictions = np.array([scene.friction for scene in SCENES])
    assert (frictions == 0.0).sum() >= 5
    assert frictions.max() > 1.0
    assert frictions.max() <= 2.0
    assert {scene.scheme for scene in SCENES} == {"implicit", "explicit"}
    assert sum(np.abs(scene.model.linear[0].load_harmonic.imag).max() > 0.0 for scene in SCENES) >= 50
    singular = [np.linalg.matrix_rank(scene.model.linear[0].mass) < len(scene.model.linear[0].mass) for scene in SCENES]
    assert sum(singular) >= 50


@pytest.mark.slow
def test_some_scenes_are_solved():
    # the benchmark runs 1000 of them, of which some take minutes
    records = [run_scene(random_scene(seed)) for seed in range(119, 128)]
    assert all(solved(record) for record in records)
    for record in records:
        assert "NaN" not in record["march"]
        assert record["march"] != "wear falls"
    assert sum(record.get("slips", False) for record in records) >= 5
    assert 2 <= sum(record.get("opens", False) for record in records) <= 7


@pytest.mark.slow
def test_an_impact_that_few_harmonics_do_not_show_starts_from_the_force_samples(monkeypatch):
    scene = random_scene(16)
    asked = scene.model, scene.friction, scene.amplitude, [2.0 * np.pi * scene.frequency_hz], SolverSettings()
    assert branch_states(*asked)[0].outcome is Outcome.CONVERGED
    # started from zero, Newton's method diverges
    solve_at = ResolvedState.solve_at

    def from_zero(*given, with_tail=False):
        return None if with_tail else solve_at(*given)

    monkeypatch.setattr(ResolvedState, "solve_at", from_zero)
    assert branch_states(*asked)[0].outcome is Outcome.INACCURATE
