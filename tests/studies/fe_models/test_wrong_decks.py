"""Whatever a deck holds: it is read, or refused in one sentence that names its line."""

import pytest

from studies.fe_models.deck.read import read_deck
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import BLOCKS, CUBES, PART, SECTOR, prepared_deck, write
from tests.studies.fe_models.mutations import mutate

LEAST = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n"
MANY_SETS = "".join(f"*NSET,NSET=A{n}\nA{n + 1}\n" for n in range(5000)) + "*NSET,NSET=A5000\n1\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "model: deck.inp has 0 bytes"),
        ('*NODE,"=\n', "deck.inp, line 1: "),
        ("*NODE\n1,0,0,nan\n", "deck.inp, line 2: "),
        ("*NODE\n1,0,0,0\n1,0,0,1\n", "deck.inp, line 1: .*node 1 is defined again"),
        (LEAST + "2,1,2,3\n", "deck.inp, line 8: .*4 numbers for a C3D4"),
        (LEAST + "2,1,2,3,9\n", "deck.inp, line 6: .*element 2 has the node 9"),
        (LEAST + "*ELEMENT,TYPE=XYZ\n5,1,2,3,4\n", "deck.inp, line 8: .*elements of type XYZ"),
        (LEAST + "*NSET,NSET=A\nB\n*NSET,NSET=B\n1,C\n*NSET,NSET=C\nA\n", "the set A contains itself"),
        (LEAST + MANY_SETS, "is more than 100 sets deep"),
        (LEAST + "*SURFACE,NAME=S\n1,S5\n", "deck.inp, line 9: .*elements of 1 have no face S5"),
        (LEAST + "*SOLID SECTION,ELSET=E,MATERIAL=M\n", "deck.inp, line 8: .*there is no material M"),
        (LEAST + "*MATERIAL,NAME=M\n*DENSITY\n0\n", "deck.inp, line 9: .*a density of 0"),
        (LEAST + "*CYCLIC SYMMETRY MODEL,N=1e9\n0,0,0,0,0,1\n", "deck.inp, line 8: .*N=1e9"),
        (PART.replace("*End Assembly", "*Instance,name=B,part=C\n"), r"line 38: \*INSTANCE: B of C"),
        ("*INCLUDE,INPUT=deck.inp\n", "deck.inp, line 1: .*deck.inp includes itself"),
        ("*INCLUDE,INPUT=none.inp\n", "deck.inp, line 1: .*there is no file none.inp"),
        ("*INCLUDE,INPUT=../../etc/passwd\n", "deck.inp, line 1: .*../../etc/passwd is outside the deck's folder"),
        ("*NODE,SYSTEM=C\n1,0,0,0\n", r"deck.inp, line 1: \*NODE: nodes in cylindrical"),
    ],
)  # fmt: skip
def test_wrong_decks(tmp_path, text, sentence):
    with pytest.raises(SceneError, match=sentence) as wrong:
        read_deck(write(tmp_path, text))
    assert str(wrong.value).isprintable()


def with_friction(lines):
    return BLOCKS.replace("*FRICTION\n0.4", lines)


NO_FRICTION = [with_friction("*FRICTION, TAUMAX=100.\n0.4"), with_friction("*FRICTION\n0.4, 0.\n0.3, 1.")]


MEAN = BLOCKS + "*SURFACE, NAME=SN, TYPE=NODE\nXE\n*NODE\n900, 45., 5., 0.\n"
MEAN += "*COUPLING, REF NODE=900, SURFACE=SE\n*DISTRIBUTING\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (BLOCKS + "*CONTACT\n", r"\*CONTACT: .* may change the model; give \*CONTACT PAIR for"),
        (BLOCKS + "*COUPLING, REF NODE=5, SURFACE=SUP\n", r"\*COUPLING: no \*KINEMATIC or \*DISTRIBUTING below it"),
        (BLOCKS + "*NONSENSE\n", r"\*NONSENSE: .* may change the model; remove it"),
        (BLOCKS + "*MATERIAL, NAME=STEEL\n*ELASTIC\n7e4, 0.3\n", r"\*ELASTIC: one material again \(before: deck.inp"),
        (BLOCKS + "*INITIAL CONDITIONS, TYPE=STRESS\n", r"\*INITIAL CONDITIONS: TYPE=STRESS is not read"),
        (NO_FRICTION[0], r"\*FRICTION with TAUMAX is not read; give one coefficient"),
        (NO_FRICTION[1], r"\*FRICTION of several coefficients is not read; give one coefficient"),
        (BLOCKS + "*EQUATION\n2\n5,1,1.,15,1,-1.\n2\n5,1,1.,10,1,-1.\n", "displacement 1 of node 5 depends on others"),
        (BLOCKS + "*EQUATION\n2\n1,1,1.,15,1,-1.\n", "displacement 1 of node 1 depends on others and is held"),
        (BLOCKS + "*EQUATION\n2\n105,1,1.,15,1,-1.\n2\n20,1,1.,15,1,-1.\n", "node 105 depends on others and moves in"),
        (BLOCKS + "*TRANSFORM, NSET=XM, TYPE=C\n40,0,0,40,0,1\n*BOUNDARY\nXM,1\n", r"\*TRANSFORM: node 5 is on the"),
        (MEAN + "*BOUNDARY\n900, 4, 6\n", r"\*DISTRIBUTING: the rotations of node 900 are held; hold"),
        (MEAN + "*BOUNDARY\n900, 1\n", r"\*DISTRIBUTING: displacement 1 of node 900 depends on others and is held"),
        (MEAN + "*TRANSFORM, NSET=XE\n0,1,0,-1,0,0\n", r"\*DISTRIBUTING: node 5 has \*TRANSFORM; leave"),
        (MEAN + "*STEP\n*STATIC\n*CLOAD\n900, 5, 1.\n", r"\*CLOAD: a load along dof 5; give forces"),
        (MEAN.replace("TING\n", "TING, WEIGHTING METHOD=CUBIC\n"), r"\*DISTRIBUTING: WEIGHTINGMETHOD=CUBIC is not"),
        (MEAN.replace("SE\n*D", "SN\n*D"), r"\*COUPLING: a surface of nodes; give one of element faces"),
        (MEAN.replace("NODE=900", "NODE=5"), r"\*DISTRIBUTING: the reference node 5 is on the surface"),
        (BLOCKS + "*DISTRIBUTING COUPLING, ELSET=E\n", r"\*DISTRIBUTING COUPLING: .*; write \*COUPLING with \*DIST"),
        (BLOCKS + "*BOUNDARY\nXM, 1, 1, 0.1\n", r"\*BOUNDARY moves nodes by 0.1"),
        (BLOCKS + "*STEP\n*STATIC\n*DLOAD\nELOW, BX, 1.\n*END STEP\n", r"\*DLOAD: a load of type BX is not read"),
    ],
)  # fmt: skip
def test_what_may_change_the_model_is_refused(tmp_path, text, sentence):
    with pytest.raises(SceneError, match=sentence) as wrong:
        prepared_deck(tmp_path, text)
    assert "deck.inp, line " in str(wrong.value)


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
