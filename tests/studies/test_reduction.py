"""The elimination front by front in both of its ways, and modes of a singular mass against a dense solution."""

import numpy as np
import pytest
from scipy import linalg

from studies.finite_element.condensation import projection
from studies.finite_element.condensation.extend_add import add_lower
from studies.finite_element.condensation.modes import lowest_modes
from studies.scenes.dovetail_sector import Parameters, build


@pytest.mark.slow
def test_combined_shapes_give_what_condensed_forms_give(monkeypatch):
    nodal_diameter = 3
    parameters = Parameters(mesh=2, nodal_diameter=nodal_diameter)
    condensed = build(parameters, 1).linear[nodal_diameter]
    # As if every boundary were a large one.
    monkeypatch.setattr(projection, "_LARGE", 0)
    monkeypatch.setattr(projection, "_LARGE_FOR_EACH", 0.0)
    combined = build(parameters, 1).linear[nodal_diameter]
    for name in ("mass", "damping"):
        own, reference = getattr(combined, name), getattr(condensed, name)
        assert np.abs(own - reference).max() <= 1e-11 * np.abs(reference).max()


@pytest.mark.parametrize("n_modes", [5, 45, 65])
def test_modes_of_a_mass_of_rank_45(n_modes):
    """Against a dense solution; of more than there are, those that there are."""
    n, rng = 600, np.random.default_rng(1)
    stiffness = rng.standard_normal((2, n, n))
    stiffness = stiffness[0] + 1j * stiffness[1]
    stiffness = 1e6 * (stiffness @ stiffness.conj().T) + 1e7 * np.eye(n)
    moved = rng.standard_normal((n, 45))
    mass = (moved * np.logspace(0.0, -4.0, 45)) @ moved.T
    inverse = np.linalg.inv(stiffness)
    start = inverse @ (mass @ rng.standard_normal((n, 8)))
    squares, modes = lowest_modes(lambda forces: inverse @ forces, lambda vectors: mass @ vectors, start, n_modes)
    expected = 1.0 / linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][: min(n_modes, 45)]
    assert squares == pytest.approx(expected, rel=1e-9)
    assert np.abs(modes.conj().T @ mass @ modes - np.eye(len(squares))).max() < 1e-10


@pytest.mark.parametrize("unit", [1.0, 1.0 + 0.5j])
def test_what_a_front_leaves_is_added_as_one_dense_matrix_would_be(unit):
    """Three nodes of a child within a front of four nodes, two on its boundary of three; real and complex."""
    rng = np.random.default_rng(2)
    whole, part = (unit * rng.standard_normal((n, n)) for n in (21, 15))
    own, below, update = (np.asfortranarray(each) for each in (whole[:12, :12], whole[12:, :12], whole[12:, 12:]))
    places = np.array([0, 2, 3, 4, 6])
    add_lower(own, below, update, np.asfortranarray(part), places)
    found = np.block([[own, whole[:12, 12:]], [below, update]])
    dofs = (3 * places[:, None] + np.arange(3)).ravel()
    whole[np.ix_(dofs, dofs)] += np.tril(part)
    assert np.array_equal(found, whole)
