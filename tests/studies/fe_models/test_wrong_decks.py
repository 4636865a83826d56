"""Whatever a deck holds: it is read, or refused in one sentence that names its line."""

import re

import pytest

from studies.fe_models.deck.read import read_deck
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import BLOCKS, CUBES, PART, SECTOR, prepared_deck, write
from tests.studies.fe_models.mutations import mutate

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
    (BLOCKS + "*NONSENSE\n", "110: *NONSENSE"),
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
