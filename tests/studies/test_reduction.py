"""The elimination front by front against its slow twin, one sparse factorisation with a column for each shape."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from studies.finite_element.condensation import projection
from studies.finite_element.condensation.modes import lowest_modes
from studies.model_check import check_model
from studies.scenes.dovetail_sector import Parameters, build, natural_frequencies
from tests.studies.reduction_twin import build_linear

MATRICES = ("mass", "damping", "stiffness")
VECTORS = ("load_static", "load_harmonic", "response")


def response_of(linear, frequency, n_relative):
    """Response to the harmonic load with a joint of springs, which moves the relative displacements."""
    omega = 2.0 * np.pi * frequency
    dynamic = linear.stiffness - omega**2 * linear.mass + 1j * omega * linear.damping
    dynamic[np.arange(n_relative), np.arange(n_relative)] += 1e8
    return linear.response @ np.linalg.solve(dynamic, linear.load_harmonic)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "stress_stiffening", "n_sectors", "nodal_diameter"),
    [(1, False, 47, 0), (1, True, 47, 3), (1, False, 46, 23), (2, True, 47, 0), (2, False, 47, 3)],
)
def test_reduced_model_is_that_of_the_slow_twin(mesh, stress_stiffening, n_sectors, nodal_diameter):
    parameters = Parameters(
        mesh=mesh,
        n_sectors=n_sectors,
        nodal_diameter=nodal_diameter,
        stress_stiffening=stress_stiffening,
        retention_stiffness=0.0,
    )
    model, twin = build(parameters, 1), build_linear(parameters, 1)
    n_relative = 3 * model.contact.n_contact
    assert set(model.linear) <= set(twin)
    for k, linear in model.linear.items():
        for name in (*MATRICES, *VECTORS):
            own, reference = getattr(linear, name), getattr(twin[k], name)
            assert own.dtype == reference.dtype, name
            assert np.abs(own - reference).max() <= 1e-9 * np.abs(reference).max(), name
        own, reference = (
            linalg.eigh(item.stiffness[n_relative:, n_relative:], item.mass[n_relative:, n_relative:])[0]
            for item in (linear, twin[k])
        )
        assert own == pytest.approx(reference, rel=1e-9)
    excited = nodal_diameter
    for frequency in (150.0, 191.0, 400.0):
        own, reference = (response_of(item[excited], frequency, n_relative) for item in (model.linear, twin))
        assert own == pytest.approx(reference, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("nodal_diameter", [0, 3])
def test_combined_shapes_give_what_condensed_forms_give(nodal_diameter, monkeypatch):
    parameters = Parameters(mesh=2, nodal_diameter=nodal_diameter)
    condensed = build(parameters, 1).linear[nodal_diameter]
    # As if every boundary were a large one.
    monkeypatch.setattr(projection, "_LARGE", 0)
    combined = build(parameters, 1).linear[nodal_diameter]
    for name in ("mass", "damping"):
        own, reference = getattr(combined, name), getattr(condensed, name)
        assert np.abs(own - reference).max() <= 1e-11 * np.abs(reference).max()


@pytest.mark.slow
def test_160_pairs():
    model = build(Parameters(mesh=4), 0)
    assert model.contact.n_contact == 2 * 16 * 5
    check_model(model)


@pytest.mark.slow
def test_natural_frequencies_are_those_of_the_reduced_models():
    parameters = Parameters(mesh=1, nodal_diameter=5)
    told = natural_frequencies(parameters)
    model = build(parameters, 4)
    n_relative = 3 * model.contact.n_contact
    for k, linear in model.linear.items():
        stuck = np.sqrt(np.diag(linear.stiffness).real[n_relative : n_relative + 6]) / (2.0 * np.pi)
        assert told.frequencies[k] == pytest.approx(stuck, rel=1e-9)


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
