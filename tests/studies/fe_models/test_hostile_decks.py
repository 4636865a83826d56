"""Whatever a deck holds: it is read, or refused in one sentence that names its line."""

import pytest

from studies.fe_models.deck.read import read_deck
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import CUBES, PART, SECTOR, write
from tests.studies.fe_models.mutations import mutate

LEAST = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n"
MANY_SETS = "".join(f"*NSET,NSET=A{n}\nA{n + 1}\n" for n in range(5000)) + "*NSET,NSET=A5000\n1\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "model: deck.inp: the file is empty"),
        ('*NODE,"=\n', "deck.inp, line 1: "),
        ("*NODE\n1,0,0,nan\n", "deck.inp, line 2: "),
        ("*NODE\n1,0,0,0\n1,0,0,1\n", "deck.inp, line 1: node 1 is defined again"),
        (LEAST + "2,1,2,3\n", "deck.inp, line 8: 4 numbers for a C3D4"),
        (LEAST + "2,1,2,3,9\n", "deck.inp, line 6: element 2 has the node 9"),
        (LEAST + "*ELEMENT,TYPE=XYZ\n5,1,2,3,4\n", "deck.inp, line 8: elements of type XYZ"),
        (LEAST + "*NSET,NSET=A\nB\n*NSET,NSET=B\n1,C\n*NSET,NSET=C\nA\n", "the set A contains itself"),
        (LEAST + MANY_SETS, "more than 100 sets within each other"),
        (LEAST + "*SURFACE,NAME=S\n1,S5\n", "deck.inp, line 9: elements of 1 have no face S5"),
        (LEAST + "*MATERIAL,NAME=M\n*DENSITY\n0\n", "deck.inp, line 10: a density of 0"),
        (LEAST + "*CYCLIC SYMMETRY MODEL,N=1e9\n0,0,0,0,0,1\n", "deck.inp, line 8: N=1e9"),
        (PART.replace("*End Assembly", "*Instance,name=B,part=C\n"), r"line 38: \*INSTANCE B of C"),
        ("*INCLUDE,INPUT=deck.inp\n", "deck.inp, line 1: deck.inp includes itself"),
        ("*INCLUDE,INPUT=none.inp\n", "deck.inp, line 1: there is no file none.inp"),
        ("*INCLUDE,INPUT=../../etc/passwd\n", "deck.inp, line 1: ../../etc/passwd is outside the deck's folder"),
        ("*NODE,SYSTEM=C\n1,0,0,0\n", r"deck.inp, line 1: \*NODE: nodes in cylindrical"),
    ],
)  # fmt: skip
def test_wrong_decks(tmp_path, text, sentence):
    with pytest.raises(SceneError, match=sentence) as wrong:
        read_deck(write(tmp_path, text))
    assert str(wrong.value).isprintable()


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
