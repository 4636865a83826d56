"""Products of three digits, against the matrices themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.model import FloatArray, LinearModel
from solver.structure import rough_forms as room
from solver.structure.options import STRUCTURE
from solver.structure.rough_forms import rough_forms
from tests.solver.models import scene

RATES = 2.0 * np.pi * 210.0 * np.arange(1.0, 14.0)


def errors(linear: LinearModel, relative: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Largest difference of the forces from K, M and C at the highest rate over the largest elastic one, and forms."""
    motion = np.random.default_rng(1).normal(size=(relative.size, 26))
    found = rough_forms(linear, relative).apply(motion.astype(np.float32), RATES)
    weights = 1.0, RATES[-1] ** 2, RATES[-1]
    exact = [
        np.real(part)[np.ix_(relative, relative)] @ motion for part in (linear.stiffness, linear.mass, linear.damping)
    ]
    size = np.abs(exact[0]).max()
    forces = np.array([np.abs(part * weight).max() for part, weight in zip(exact, weights, strict=True)]) / size
    wrong = [np.abs(theirs - ours).max() * weight for theirs, ours, weight in zip(exact, found, weights, strict=True)]
    return np.array(wrong) / size, forces


@pytest.mark.parametrize("directions", [1, 6, 48])
def test_few_motions_carry_the_mass_and_the_rest_of_the_damping(
    monkeypatch: pytest.MonkeyPatch, directions: int
) -> None:
    model = scene("dovetail_sector", 13, mesh=1)
    # one of its own: forms are kept by structure
    linear = replace(model.linear[0])
    monkeypatch.setattr(room, "STRUCTURE", replace(STRUCTURE, rough_directions=directions))
    relative = model.contact.dofs.ravel()
    forms = rough_forms(linear, relative)
    assert rough_forms(linear, relative) is forms
    assert forms.mass.vectors.shape == (relative.size, directions)
    found, forces = errors(linear, relative)
    assert found.max() < STRUCTURE.rough
    # the mass matters at the highest harmonic, and the fewer directions the more is left out
    assert forces[1] > 10.0 * STRUCTURE.rough
    assert forms.mass.remainder * RATES[-1] ** 2 > (1e-2 if directions == 1 else 0.0) * STRUCTURE.rough * forms.size


def test_damping_of_another_kind_is_taken_as_it_is() -> None:
    model = scene("dovetail_sector", 13, mesh=1)
    relative = model.contact.dofs.ravel()
    root = np.random.default_rng(2).normal(size=(relative.size, relative.size))
    damping = np.array(model.linear[0].damping)
    damping[np.ix_(relative, relative)] = root @ root.T * np.abs(damping).max() / relative.size
    linear = replace(model.linear[0], damping=damping)
    assert rough_forms(linear, relative).drag.remainder == pytest.approx(0.0, abs=1e-9 * np.linalg.norm(damping))
    few = replace(STRUCTURE, rough_directions=4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "STRUCTURE", few)
        linear = replace(linear)
        forms = rough_forms(linear, relative)
        assert forms.drag.remainder * RATES[-1] > STRUCTURE.rough * forms.size
        assert errors(linear, relative)[0].max() < 1e-5
