"""What users get wrong when they export a model is found in the files, and said in one sentence."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from studies.fe_models.deck.read import read_deck
from studies.fe_models.files import UNITS
from studies.fe_models.from_files import imported
from studies.fe_models.from_files.solid import check_units, rotation_of_deck
from studies.fe_models.matrices.matrices import Matrices
from studies.fe_models.matrices.read import read_matrices
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import CUBES, SECTOR, write
from tests.studies.fe_models.solid_meshes import needs_ccx, run_ccx

SI, MM = UNITS["SI"], UNITS["mm-t-s"]
AXIS = np.array([0.0, 0.0, 1.0])


def changed(old, new, text=None):
    text = SECTOR.read_text() if text is None else text
    assert old in text
    return text.replace(old, new)


def exported(folder, text):
    job = run_ccx(folder, text.splitlines(), "sector")
    return read_deck(folder / "sector.inp"), read_matrices(job)


@needs_ccx
def test_whole_export(tmp_path):
    deck, matrices = exported(tmp_path, SECTOR.read_text())
    blades, disks = deck.node_sets["BLADEC"], deck.node_sets["DISKC"]
    imported.check_nodes_have_dofs(matrices, blades, "BLADES")
    imported.check_contact_removed(deck, matrices, (blades, disks), ("BLADES", "DISKS"), SI)
    mass = imported.mass_of(deck, matrices)
    check_units(deck, mass, SI)
    imported.check_mass(deck, matrices, SI)
    # as where the deck is in SI and the matrices are not
    for factor in (1e-3, 0.97, 1.03):
        words = rf"sector.sti and sector.inp: {factor * mass:.3g} kg in the matrices, {mass:.3g} kg by density and"
        other = replace(matrices, mass=factor * matrices.mass)
        with pytest.raises(SceneError, match=words):
            imported.check_mass(deck, other, SI)
        imported.check_mass(replace(deck, sections=()), other, SI)
    rotation = rotation_of_deck(deck, SI)
    assert (rotation.omega_squared, rotation.axis.tolist()) == (250000.0, [0, 0, 1])
    assert imported.check_speed(deck, matrices, rotation) == pytest.approx(250000, rel=1e-6)
    assert imported.omega_squared_of(deck, matrices, AXIS) == pytest.approx(250000, rel=1e-6)
    # along the axis there is no spin softening
    assert imported.omega_squared_of(deck, matrices, np.array([1.0, 0.0, 0.0])) == pytest.approx(125000, rel=1e-6)


@needs_ccx
def test_dofs_eliminated(tmp_path):
    deck, matrices = exported(tmp_path, changed("*EQUATION,REMOVE ALL\n", ""))
    with pytest.raises(SceneError, match=r"BLADES: 9 of 9 nodes have no dof in sector.dof .*\*EQUATION,REMOVE ALL"):
        imported.check_nodes_have_dofs(matrices, deck.node_sets["BLADEC"], "BLADES")
    imported.check_nodes_have_dofs(matrices, deck.node_sets["DISKC"], "DISKS")
    # ties are no hindrance for a rigid translation
    assert imported.omega_squared_of(deck, matrices, AXIS) == pytest.approx(250000, rel=1e-6)


CONTACT = """\
*SURFACE INTERACTION,NAME=ROOT
*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=TIED
1e13
*FRICTION
0.4,1e13
*CONTACT PAIR,INTERACTION=ROOT,TYPE=SURFACE TO SURFACE
"""


@needs_ccx
def test_contact_still_in_the_stiffness(tmp_path):
    text = changed("*TIE,NAME=GLUE,POSITION TOLERANCE=1e-4\n", CONTACT)
    deck, matrices = exported(tmp_path, text)
    (pair,) = deck.contact_pairs
    assert (pair.dependent, pair.independent, pair.friction_coefficient) == ("BLADES", "DISKS", 0.4)
    nodes = deck.node_sets["BLADEC"], deck.node_sets["DISKC"]
    for units, size in ((SI, r"1.6e\+09"), (MM, r"1.6e\+12")):
        words = rf"the stiffness couples BLADES and DISKS \({size} N/m\); add \*MODEL CHANGE,TYPE=CONTACT PAIR"
        with pytest.raises(SceneError, match=words):
            imported.check_contact_removed(deck, matrices, nodes, ("BLADES", "DISKS"), units)
    removed = "*MODEL CHANGE,TYPE=CONTACT PAIR,REMOVE\nBLADES,DISKS\n*EQUATION,REMOVE ALL"
    deck, matrices = exported(tmp_path, changed("*EQUATION,REMOVE ALL", removed, text))
    assert len(deck.contact_pairs) == 1  # what a step removes that writes matrices belongs to the model
    imported.check_contact_removed(deck, matrices, nodes, ("BLADES", "DISKS"), SI)


def springs(deck, pairs):
    """Springs along x, y and z between nodes of a mesh whose nodes weigh 1."""
    n = deck.node_numbers.size
    stiffness = sp.lil_array((n, n))
    for one, other, value in pairs:
        row, column = deck.rows_of_nodes(np.array([one, other]))
        for a, b, sign in ((row, row, 1), (column, column, 1), (row, column, -1), (column, row, -1)):
            stiffness[a, b] += sign * value
    whole = sp.csr_array(sp.kron(stiffness.tocsr(), sp.eye_array(3)))
    rows = np.repeat(deck.node_numbers, 3), np.tile([0, 1, 2], n)
    return Matrices(whole, sp.csr_array(sp.eye_array(3 * n)), *rows, ("job_STIF1.mtx", "job_MASS1.mtx"), "abaqus")


def test_coupling_through_an_element_is_none_of_contact(tmp_path):
    deck = read_deck(write(tmp_path, CUBES))
    # 1 and 7 belong to the lower cube, 11 and 17 to the upper one
    matrices = springs(deck, [(1, 7, 1e9), (11, 17, 1e9), (2, 12, 1e-3)])
    lower, upper = np.array([1, 2, 7]), np.array([11, 12, 17])
    imported.check_contact_removed(deck, matrices, (np.array([1, 2]), np.array([7])), ("A", "B"), SI)
    imported.check_contact_removed(deck, matrices, (lower, upper), ("A", "B"), SI)
    # the same nodes in both surfaces
    imported.check_contact_removed(deck, matrices, (lower, lower), ("A", "B"), SI)
    matrices = springs(deck, [(1, 7, 1e9), (11, 17, 1e9), (7, 11, 5e8)])
    with pytest.raises(SceneError, match=r"couples A and B \(5.0e\+08 N/m\)"):
        imported.check_contact_removed(deck, matrices, (lower, upper), ("A", "B"), SI)


def test_speed_of_other_codes_and_none(tmp_path):
    deck = read_deck(write(tmp_path, CUBES))
    matrices = springs(deck, [(1, 7, 1e9), (11, 17, 1e9)])
    with pytest.raises(SceneError, match=r"spins at 100 rad/s, the stiffness holds 0; write \*STEP,NLGEOM"):
        imported.check_speed(deck, matrices, rotation_of_deck(deck, SI))
    turning = replace(matrices, stiffness=sp.csr_array(matrices.stiffness - 1e4 * matrices.mass))
    assert imported.omega_squared_of(deck, turning, AXIS) == pytest.approx(1e4, rel=1e-6)
    assert imported.check_speed(deck, turning, rotation_of_deck(deck, SI)) == pytest.approx(1e4, rel=1e-6)
    assert rotation_of_deck(replace(deck, centrifugal=()), SI) is None


def test_units(tmp_path):
    deck = read_deck(SECTOR)
    check_units(deck, 3.8, SI)
    check_units(deck, None, SI)
    with pytest.raises(SceneError, match=r"units: mass 3.8 t, extent 0.203 mm: not mm-t-s; give `units`"):
        check_units(deck, 3.8, MM)
    in_mm = replace(deck, coordinates=1000 * deck.coordinates)
    check_units(in_mm, 3.8e-3, MM)
    with pytest.raises(SceneError, match=r"units: mass 0.0038 kg, extent 203 m: not SI; give `units`"):
        check_units(in_mm, 3.8e-3, SI)
