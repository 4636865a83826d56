"""The dovetail sector against CalculiX, which reads the same mesh from a deck. Needs its command `ccx`."""

import shutil

import numpy as np
import pytest

from studies.scenes.dovetail_mesh import build_dovetail_mesh
from studies.scenes.dovetail_sector import Parameters, build
from tests.studies.calculix_deck import (
    build_calculix_mesh,
    centrifugal_load,
    contact_lines,
    contact_step,
    frequency_step,
    model_lines,
    read_contact_forces,
    read_frequencies,
    run_calculix,
)
from tests.studies.static_contact import solve_static_contact

pytestmark = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")

N_MODES, NODAL_DIAMETER = 6, 3


def glued_frequencies(parameters):
    """Natural frequencies, Hz, of the scene with all pairs glued."""
    model = build(parameters, 1)
    first_mode = 3 * model.contact.n_contact
    stiffness = model.linear[parameters.nodal_diameter].stiffness
    return np.sqrt(np.diag(stiffness).real[first_mode : first_mode + N_MODES]) / (2.0 * np.pi)


def frequency_deck():
    parameters = Parameters(nodal_diameter=NODAL_DIAMETER)
    lines = model_lines(build_calculix_mesh(build_dovetail_mesh(parameters)), parameters)
    lines += ["*STEP", "*STATIC", *centrifugal_load(parameters), "*END STEP"]
    return lines + frequency_step(NODAL_DIAMETER, 2 * N_MODES, perturbation=True)


def contact_deck():
    parameters = Parameters(mesh=1, stress_stiffening=False)
    mesh = build_dovetail_mesh(parameters)
    calculix = build_calculix_mesh(mesh, glued=False)
    return [*model_lines(calculix, parameters), *contact_lines(mesh, calculix, parameters), *contact_step(parameters)]


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """What CalculiX finds, by deck."""
    decks = {"frequencies": frequency_deck(), "contact": contact_deck()}
    return {name: run_calculix(tmp_path_factory.mktemp("deck"), lines) for name, lines in decks.items()}


@pytest.mark.slow
def test_frequencies_agree_with_incompatible_elements(tables):
    own = glued_frequencies(Parameters(nodal_diameter=NODAL_DIAMETER))
    reference = read_frequencies(tables["frequencies"], N_MODES)
    # 2 % is what the first three must reach; the two incompatible elements differ by less.
    assert np.abs(own[:3] / reference[:3] - 1.0).max() < 0.003
    assert np.abs(own / reference - 1.0).max() < 0.01


@pytest.mark.slow
def test_static_frictional_contact_force(tables):
    parameters = Parameters(mesh=1, stress_stiffening=False)
    force = solve_static_contact(build(parameters, 0), parameters.friction_coefficient).reshape(2, -1, 3).sum(axis=1)
    own = np.column_stack([force[:, 0], np.hypot(force[:, 1], force[:, 2])])
    assert own == pytest.approx(read_contact_forces(tables["contact"]), rel=0.005)
