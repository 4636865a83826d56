"""Products of three digits, against those with the matrices themselves."""

from dataclasses import replace

import numpy as np
import pytest

from solver.structure import condensation
from solver.structure import rough_forms as room
from solver.structure.condensation import build_structure
from solver.structure.harmonic_stiffness import SharedStiffness
from solver.structure.rough_forms import ROUGH
from tests.solver.models import scene

OMEGA = 2.0 * np.pi * 210.0
ORDERS = tuple(range(1, 14))


@pytest.fixture
def shared(monkeypatch):
    """Even small structures share their matrices."""
    monkeypatch.setattr(condensation, "DENSE_BYTES", 0.0)


def structure_of(linear):
    structure = build_structure(replace(scene("dovetail_sector", 13, mesh=1), linear={0: linear}), OMEGA, 0.5, ORDERS)
    assert isinstance(structure.moving, SharedStiffness)
    return structure


def error(structure):
    """Largest error of a force over the largest force."""
    motion = np.random.default_rng(1).normal(size=(structure.static_force.size, 2 * len(ORDERS) + 1))
    exact = structure.apply(motion)
    return float(np.abs(structure.apply_roughly(motion) - exact).max() / np.abs(exact).max())


@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize(("directions", "least", "most"), [(6, 1e-5, 1e-3), (48, 0.0, 1e-6)])
def test_few_motions_carry_the_mass(monkeypatch, directions, least, most):
    monkeypatch.setattr(room, "ROUGH_DIRECTIONS", directions)
    # one of its own: forms are kept by structure
    structure = structure_of(replace(scene("dovetail_sector", 13, mesh=1).linear[0]))
    rough = structure.moving.rough
    assert rough.each.size == 0
    assert least <= error(structure) < most
    # the mass matters at the highest harmonic
    moving = replace(structure.moving)
    # the cached value
    vars(moving)["rough"] = rough._replace(core=0.0 * rough.core)
    still = replace(structure, moving=moving)
    assert error(still) > 10.0 * ROUGH


@pytest.mark.usefixtures("shared")
def test_where_many_motions_are_damped_in_their_own_way_each_harmonic_has_its_matrix(monkeypatch):
    monkeypatch.setattr(room, "ROUGH_DIRECTIONS", 4)
    model = scene("dovetail_sector", 13, mesh=1)
    relative = model.contact.dofs.ravel()
    root = np.random.default_rng(2).normal(size=(relative.size, relative.size))
    damping = np.array(model.linear[0].damping)
    damping[np.ix_(relative, relative)] = root @ root.T * np.abs(damping).max() / relative.size
    structure = structure_of(replace(model.linear[0], damping=damping))
    assert structure.moving.rough.each.shape == (13, relative.size, relative.size)
    assert error(structure) < 1e-6
