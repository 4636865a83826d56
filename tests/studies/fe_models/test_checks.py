"""What users get wrong when they export a model is found in the files; what is wrong in a deck is named by its line."""

import re
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
from tests.studies.fe_models.decks import BLOCKS, CUBES, PART, SECTOR, mutate, prepared_deck, write
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
    with pytest.raises(SceneError, match=r"BLADES: 9 of 9 nodes .* sector.dof"):
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
    with pytest.raises(SceneError, match=r" 100 rad/s, .* 0;"):
        imported.check_speed(deck, matrices, rotation_of_deck(deck, SI))
    turning = replace(matrices, stiffness=sp.csr_array(matrices.stiffness - 1e4 * matrices.mass))
    assert imported.omega_squared_of(deck, turning, AXIS) == pytest.approx(1e4, rel=1e-6)
    assert imported.check_speed(deck, turning, rotation_of_deck(deck, SI)) == pytest.approx(1e4, rel=1e-6)
    assert rotation_of_deck(replace(deck, centrifugal=()), SI) is None


def test_units(tmp_path):
    deck = read_deck(SECTOR)
    check_units(deck, 3.8, SI)
    check_units(deck, None, SI)
    with pytest.raises(SceneError, match=r"^units: mass 3.8 t, extent 0.203 mm"):
        check_units(deck, 3.8, MM)
    in_mm = replace(deck, coordinates=1000 * deck.coordinates)
    check_units(in_mm, 3.8e-3, MM)
    with pytest.raises(SceneError, match=r"^units: mass 0.0038 kg, extent 203 m"):
        check_units(in_mm, 3.8e-3, SI)


# --- decks ---

LEAST = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n"
MANY_SETS = "".join(f"*NSET,NSET=A{n}\nA{n + 1}\n" for n in range(5000)) + "*NSET,NSET=A5000\n1\n"


def with_friction(lines):
    return BLOCKS.replace("*FRICTION\n0.4", lines)


NO_FRICTION = [with_friction("*FRICTION, TAUMAX=100.\n0.4"), with_friction("*FRICTION\n0.4, 0.\n0.3, 1.")]


MEAN = BLOCKS + "*SURFACE, NAME=SN, TYPE=NODE\nXE\n*NODE\n900, 45., 5., 0.\n"
MEAN += "*COUPLING, REF NODE=900, SURFACE=SE\n*DISTRIBUTING\n"


# a text, and line and keyword of what is wrong in it
WRONG = [
    ('*NODE,"=\n', "1: *NODE"),
    ("*NODE\n1,0,0,nan\n", "2: *NODE"),
    ("*NODE\n1,0,0,0\n1,0,0,1\n", "1: *NODE"),
    ("*NODE,SYSTEM=C\n1,0,0,0\n", "1: *NODE"),
    (LEAST + "2,1,2,3\n", "8: *ELEMENT"),
    (LEAST + "2,1,2,3,9\n", "6: *ELEMENT"),
    (LEAST + "*ELEMENT,TYPE=XYZ\n5,1,2,3,4\n", "8: *ELEMENT"),
    (LEAST + "*NSET,NSET=A\nB\n*NSET,NSET=B\n1,C\n*NSET,NSET=C\nA\n", "13: *NSET"),
    (LEAST + MANY_SETS, "207: *NSET"),
    (LEAST + "*SURFACE,NAME=S\n1,S5\n", "9: *SURFACE"),
    (LEAST + "*SOLID SECTION,ELSET=E,MATERIAL=M\n", "8: *SOLID SECTION"),
    (LEAST + "*MATERIAL,NAME=M\n*DENSITY\n0\n", "9: *DENSITY"),
    (LEAST + "*CYCLIC SYMMETRY MODEL,N=1e9\n0,0,0,0,0,1\n", "8: *CYCLIC SYMMETRY MODEL"),
    (PART.replace("*End Assembly", "*Instance,name=B,part=C\n"), "38: *INSTANCE"),
    *((f"*INCLUDE,INPUT={name}\n", "1: *INCLUDE") for name in ("deck.inp", "none.inp", "../../etc/passwd")),
    # what is not read and may change the model
    (BLOCKS + "*CONTACT\n", "110: *CONTACT"),
    *((f"{BLOCKS}*{word}\n", f"110: *{word}") for word in ("NONSENSE", "ELCOPY")),
    ("*NODE\n1,0,0,0\n*NGEN\n1,4\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n", "3: *NGEN"),
    (BLOCKS + "*COUPLING, REF NODE=5, SURFACE=SUP\n", "110: *COUPLING"),
    (BLOCKS + "*DISTRIBUTING COUPLING, ELSET=E\n", "110: *DISTRIBUTING COUPLING"),
    (BLOCKS + "*INITIAL CONDITIONS, TYPE=STRESS\n", "110: *INITIAL CONDITIONS"),
    (BLOCKS + "*MATERIAL, NAME=STEEL\n*ELASTIC\n7e4, 0.3\n", "111: *ELASTIC"),
    *((text, "104: *FRICTION") for text in NO_FRICTION),
    (BLOCKS + "*EQUATION\n2\n5,1,1.,15,1,-1.\n2\n5,1,1.,10,1,-1.\n", "113: *EQUATION"),
    (BLOCKS + "*EQUATION\n2\n1,1,1.,15,1,-1.\n", "111: *EQUATION"),
    (BLOCKS + "*EQUATION\n2\n105,1,1.,15,1,-1.\n2\n20,1,1.,15,1,-1.\n", "111: *EQUATION"),
    (BLOCKS + "*TRANSFORM, NSET=XM, TYPE=C\n40,0,0,40,0,1\n*BOUNDARY\nXM,1\n", "110: *TRANSFORM"),
    (BLOCKS + "*BOUNDARY\nXM, 1, 1, 0.1\n", "111: *BOUNDARY"),
    (BLOCKS + "*STEP\n*STATIC\n*DLOAD\nELOW, BX, 1.\n*END STEP\n", "113: *DLOAD"),
    *((f"{MEAN}*BOUNDARY\n900, {dofs}\n", "115: *DISTRIBUTING") for dofs in ("4, 6", "1")),
    (MEAN + "*TRANSFORM, NSET=XE\n0,1,0,-1,0,0\n", "115: *DISTRIBUTING"),
    (MEAN + "*STEP\n*STATIC\n*CLOAD\n900, 5, 1.\n", "119: *CLOAD"),
    (MEAN.replace("TING\n", "TING, WEIGHTING METHOD=CUBIC\n"), "115: *DISTRIBUTING"),
    (MEAN.replace("SE\n*D", "SN\n*D"), "114: *COUPLING"),
    (MEAN.replace("NODE=900", "NODE=5"), "115: *DISTRIBUTING"),
]
KEYS = {"*FRICTION": "friction_coefficient", "*BOUNDARY": "clamp"}
"""Keys of a study, with which it may be put right; else that of the deck."""


@pytest.mark.parametrize(("text", "place"), WRONG)
def test_wrong_decks(tmp_path, text, place):
    key = KEYS.get(place.partition(" ")[2], "model")
    with pytest.raises(SceneError, match=rf"^{key}: deck.inp, line {re.escape(place)}\b") as wrong:
        prepared_deck(tmp_path, text)
    assert str(wrong.value).isprintable()


def test_an_empty_deck(tmp_path):
    with pytest.raises(SceneError, match=r"^model: deck.inp has 0 bytes"):
        read_deck(write(tmp_path, ""))


@pytest.mark.parametrize("text", NO_FRICTION)
def test_the_study_gives_a_coefficient_in_place_of_a_law_of_friction(tmp_path, text):
    assert prepared_deck(tmp_path, text, friction_coefficient=0.3)[0].pairs.n_contact == 15


@pytest.mark.parametrize("more", ["2,1,2,3,4,\n", "*NSET,NSET=A,GENERATE\n1,1000000000,1\n"])
def test_what_looks_wrong_and_is_not(tmp_path, more):
    assert read_deck(write(tmp_path, LEAST + more)).node_numbers.tolist() == [1, 2, 3, 4]


def test_damaged_decks(tmp_path):
    """A deck that is damaged anywhere is read, or refused in a sentence: nothing else is ever raised."""
    said: list[str] = []
    for seed in range(120):
        path = tmp_path / "deck.inp"
        path.write_bytes(mutate((CUBES, PART, SECTOR.read_text())[seed % 3].encode(), seed))
        try:
            read_deck(path)
        except SceneError as error:
            said.append(str(error))
    assert len(said) > 20
    assert all(sentence.isprintable() for sentence in said)
