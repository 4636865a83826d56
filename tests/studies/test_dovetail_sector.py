"""The bundled scene `dovetail_sector`."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from solver.model import needed_nodal_diameters
from studies.finite_element.solid_mesh import assemble_mass, centrifugal_load
from studies.scenes.dovetail_sector import Parameters
from tests.random_decks import static_forces

# Glued, nodal diameter 0, Hz, of 20-node elements.
AT_REST = np.array([190.5, 377.9, 777.0, 1288.1, 1620.2, 2054.0])
N_PAIRS = 48
N_RELATIVE = 3 * N_PAIRS


@pytest.fixture(scope="module")
def at_rest():
    return Parameters(stress_stiffening=False).build(5)


def frequencies(linear, n_relative=N_RELATIVE):
    return np.sqrt(np.diag(linear.stiffness).real[n_relative:]) / (2.0 * np.pi)


def test_frequencies_of_the_glued_sector_at_rest(at_rest):
    assert np.abs(frequencies(at_rest.linear[0])[:6] / AT_REST - 1.0).max() < 0.03


def test_contact_pairs(at_rest):
    contact = at_rest.contact
    assert np.array_equal(contact.dofs, np.arange(N_RELATIVE).reshape(N_PAIRS, 3))
    assert contact.surface == ("intrados",) * 24 + ("extrados",) * 24
    assert contact.area.reshape(2, 24).sum(axis=1) == pytest.approx([280e-6, 280e-6], rel=1e-9, abs=0)
    assert np.all(contact.gap == 0.0)
    intrados, extrados = contact.position.reshape(2, 8, 3, 3)
    assert np.all(intrados[..., 1] > 0.0)
    assert np.allclose(intrados * [1.0, -1.0, 1.0], extrados, atol=1e-12)
    assert np.all(np.diff(intrados[..., 2], axis=0) > 0.0)
    assert np.all(np.diff(intrados[..., 0], axis=1) > 0.0)
    assert intrados[:, -1, 0] == pytest.approx(0.245)


def test_axial_sliding_is_the_only_motion_that_closed_flanks_leave_free(at_rest):
    linear, dofs = at_rest.linear[0], at_rest.contact.dofs
    kept = np.setdiff1d(np.arange(len(linear.mass)), dofs[:, 0])
    values, vectors = linalg.eigh(linear.stiffness[np.ix_(kept, kept)], linear.mass[np.ix_(kept, kept)])
    assert abs(values[0]) < 1e-6 * values[1]
    sliding = np.zeros(len(linear.mass))
    sliding[kept] = vectors[:, 0]
    axial, radial = sliding[dofs[:, 1]], sliding[dofs[:, 2]]
    assert np.allclose(axial, axial[0], rtol=1e-6)
    assert np.abs(radial).max() < 1e-6 * abs(axial[0])


def test_flanks_carry_the_centrifugal_force_of_the_blade(at_rest):
    model, _ = Parameters(stress_stiffening=False).define_sector()
    # the blade with the nodes of the disk, which move nothing
    blade = tuple(group for group in model.mesh.groups if group.part == "blade")
    mass = assemble_mass(replace(model.mesh, groups=blade))
    pull = centrifugal_load(mass, model.mesh.coordinates, model.rotation).reshape(-1, 3).sum(axis=0)[0]
    for friction_coefficient in (0.5, 1e-6, 1000.0):
        force = static_forces(at_rest, friction_coefficient).reshape(2, 24, 3).sum(axis=1)
        assert np.all(force[:, 0] > 0.0)
        assert np.sqrt(0.5) * (force[:, 0] + force[:, 2]).sum() == pytest.approx(pull, rel=1e-6)


def test_stiffening_grows_with_the_square_of_speed_and_softening_shows():
    speeds = (1e-3, 2000.0, 4000.0)
    models = (Parameters(mesh=1, rotation_speed=rpm).build(0) for rpm in speeds)
    squares = [frequencies(model.linear[0], 48)[0] ** 2 for model in models]
    assert (squares[2] - squares[0]) / (squares[1] - squares[0]) == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize(("nodal_diameter", "n_sectors"), [(1, 47), (23, 47), (23, 46)])
def test_travelling_wave_has_the_nodal_diameters_it_needs(nodal_diameter, n_sectors):
    """Half the number of the sectors is a real one, as 0 is."""
    model = Parameters(mesh=1, nodal_diameter=nodal_diameter, n_sectors=n_sectors).build(5)
    assert tuple(model.linear) == needed_nodal_diameters(nodal_diameter, n_sectors, 5)
    assert n_sectors == 47 or tuple(model.linear) == (0, 23)
    assert (model.n_sectors, model.nodal_diameter) == (n_sectors, nodal_diameter)
    for k, linear in model.linear.items():
        for matrix in (linear.mass, linear.damping, linear.stiffness):
            assert np.iscomplexobj(matrix) == (k not in (0, n_sectors / 2))
            assert np.array_equal(matrix, matrix.conj().T)
        assert linalg.eigvalsh(linear.mass)[0] > 0.0
        damping = linalg.eigvalsh(linear.damping)
        assert damping[0] > -1e-10 * damping[-1]
        assert np.any(linear.load_static != 0.0) == (k == 0)
        assert np.any(linear.load_harmonic != 0.0) == (k == nodal_diameter)
    excited = model.linear[nodal_diameter]
    # Force and response are one and the same point and direction.
    assert np.allclose(excited.load_harmonic, excited.response[0].conj())


def test_loss_factor_is_exact_at_the_first_frequency(at_rest):
    linear = at_rest.linear[0]
    omega = 2.0 * np.pi * frequencies(linear)[0]
    assert np.allclose(omega * linear.damping, 1e-3 * linear.stiffness, rtol=1e-9, atol=1e-6)
