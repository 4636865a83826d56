"""The dovetail sector against CalculiX, which reads the same mesh from a deck. Needs its command `ccx`."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor

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


def frequency_deck(nodal_diameter, stress_stiffening, quadratic):
    parameters = Parameters(nodal_diameter=nodal_diameter, stress_stiffening=stress_stiffening)
    calculix = build_calculix_mesh(build_dovetail_mesh(parameters), quadratic)
    lines = model_lines(calculix, parameters)
    if parameters.stress_stiffening:
        lines += ["*STEP", "*STATIC", *centrifugal_load(parameters), "*END STEP"]
    return lines + frequency_step(nodal_diameter, 2 * N_MODES, perturbation=stress_stiffening)


def contact_deck():
    parameters = Parameters(stress_stiffening=False)
    mesh = build_dovetail_mesh(parameters)
    calculix = build_calculix_mesh(mesh, quadratic=False, glued=False)
    return [*model_lines(calculix, parameters), *contact_lines(mesh, calculix, parameters), *contact_step(parameters)]


QUADRATIC = [(0, False), (3, False)]
INCOMPATIBLE = [(0, False), (0, True), (3, True)]


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """What CalculiX finds, by deck. It computes on one core: two decks at a time, those that take longest first."""
    decks = {("quadratic", *case): (frequency_deck, *case, True) for case in QUADRATIC}
    decks |= {("incompatible", *case): (frequency_deck, *case, False) for case in INCOMPATIBLE}
    decks |= {"contact": (contact_deck,)}
    with ThreadPoolExecutor(2) as pool:
        yield {
            name: pool.submit(lambda build, *case: run_calculix(tmp_path_factory.mktemp("deck"), build(*case)), *deck)
            for name, deck in decks.items()
        }
        pool.shutdown(cancel_futures=True)


@pytest.mark.slow
@pytest.mark.parametrize(("nodal_diameter", "stress_stiffening"), QUADRATIC)
def test_frequencies_within_3_percent_of_quadratic_elements(nodal_diameter, stress_stiffening, tables):
    own = glued_frequencies(Parameters(nodal_diameter=nodal_diameter, stress_stiffening=stress_stiffening))
    reference = read_frequencies(tables["quadratic", nodal_diameter, stress_stiffening].result(), N_MODES)
    assert np.abs(own / reference - 1.0).max() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize(("nodal_diameter", "stress_stiffening"), INCOMPATIBLE)
def test_frequencies_agree_with_incompatible_elements(nodal_diameter, stress_stiffening, tables):
    own = glued_frequencies(Parameters(nodal_diameter=nodal_diameter, stress_stiffening=stress_stiffening))
    reference = read_frequencies(tables["incompatible", nodal_diameter, stress_stiffening].result(), N_MODES)
    # 2 % is what the first three must reach; the two incompatible elements differ by less.
    assert np.abs(own[:3] / reference[:3] - 1.0).max() < 0.003
    assert np.abs(own / reference - 1.0).max() < 0.01


@pytest.mark.slow
def test_static_frictional_contact_force(tables):
    parameters = Parameters(stress_stiffening=False)
    force = solve_static_contact(build(parameters, 0), parameters.friction_coefficient).reshape(2, -1, 3).sum(axis=1)
    own = np.column_stack([force[:, 0], np.hypot(force[:, 1], force[:, 2])])
    assert own == pytest.approx(read_contact_forces(tables["contact"].result()), rel=0.005)
