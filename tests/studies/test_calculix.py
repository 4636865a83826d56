"""The dovetail sector against CalculiX, which reads the same mesh from a deck. Needs its command `ccx`."""

from __future__ import annotations

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

N_MODES = 6


def glued_frequencies(parameters):
    """Natural frequencies, Hz, of the scene with all pairs glued."""
    model = build(parameters, 1)
    first_mode = 3 * model.contact.n_contact
    stiffness = model.linear[parameters.nodal_diameter].stiffness
    return np.sqrt(np.diag(stiffness).real[first_mode : first_mode + N_MODES]) / (2.0 * np.pi)


def calculix_frequencies(parameters, quadratic, folder):
    calculix = build_calculix_mesh(build_dovetail_mesh(parameters), quadratic)
    lines = model_lines(calculix, parameters)
    if parameters.stress_stiffening:
        lines += ["*STEP", "*STATIC", *centrifugal_load(parameters), "*END STEP"]
    lines += frequency_step(parameters.nodal_diameter, 2 * N_MODES, perturbation=parameters.stress_stiffening)
    return read_frequencies(run_calculix(folder, lines), N_MODES)


@pytest.mark.parametrize("nodal_diameter", [0, 3])
def test_frequencies_within_3_percent_of_quadratic_elements(nodal_diameter, tmp_path):
    parameters = Parameters(nodal_diameter=nodal_diameter, stress_stiffening=False)
    reference = calculix_frequencies(parameters, quadratic=True, folder=tmp_path)
    assert np.abs(glued_frequencies(parameters) / reference - 1.0).max() < 0.03


@pytest.mark.parametrize(("nodal_diameter", "stress_stiffening"), [(0, False), (0, True), (3, True)])
def test_frequencies_agree_with_incompatible_elements(nodal_diameter, stress_stiffening, tmp_path):
    parameters = Parameters(nodal_diameter=nodal_diameter, stress_stiffening=stress_stiffening)
    reference = calculix_frequencies(parameters, quadratic=False, folder=tmp_path)
    own = glued_frequencies(parameters)
    # 2 % is what the first three must reach; the two incompatible elements differ by less.
    assert np.abs(own[:3] / reference[:3] - 1.0).max() < 0.003
    assert np.abs(own / reference - 1.0).max() < 0.01


def test_static_frictional_contact_force(tmp_path):
    parameters = Parameters(stress_stiffening=False)
    mesh = build_dovetail_mesh(parameters)
    calculix = build_calculix_mesh(mesh, quadratic=False, glued=False)
    lines = [*model_lines(calculix, parameters), *contact_lines(mesh, calculix, parameters), *contact_step(parameters)]
    reference = read_contact_forces(run_calculix(tmp_path, lines))

    force = solve_static_contact(build(parameters, 0), parameters.friction_coefficient).reshape(2, -1, 3).sum(axis=1)
    own = np.column_stack([force[:, 0], np.hypot(force[:, 1], force[:, 2])])
    assert own == pytest.approx(reference, rel=0.005)
