"""Whatever a deck holds: it is read, or refused in one sentence, soon and without much memory."""

import time
import tracemalloc
from pathlib import Path

import pytest

from studies.fe_models.deck.read import read_deck
from studies.fe_models.from_files.model import load_model
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.model_files import ModelFiles
from studies.finite_element.reduced_joint import prepare_model
from studies.scene_error import SceneError
from tests.studies.fe_models.constrained_decks import BLOCKS, FULL_MODEL, SECTORS
from tests.studies.fe_models.decks import CUBES, PART, SECTOR, write
from tests.studies.fe_models.mutations import mutate

LEAST = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n"


CONSTRAINTS = (
    "*EQUATION\n2\n5,3,1.,15,3,1.\n*EQUATION\n3\n15,3,1.,10,3,-.5,3,3,.25\n2\n5,2,1.,3,2,1.\n",
    "*NODE\n900, 45., 5., 0.\n*RIGID BODY, NSET=XE, REF NODE=900\n*BOUNDARY\n900, 4, 5\n*MPC\nBEAM, 3, 8\n",
    "*NODE\n900, 45., 5., 0.\n*COUPLING, REF NODE=900, SURFACE=SE, CONSTRAINT NAME=C\n*KINEMATIC\n1, 2\n",
    "*TRANSFORM, NSET=XM, TYPE=C\n-20., -30., 0., -19., -30., 4.\n*BOUNDARY\nXM, 1\n*EQUATION\n2\n5,2,1.,3,1,1.\n",
)
HELD = "*TRANSFORM, NSET=BORE, TYPE=C\n0, 0, 0, 0, 0, 1\n*BOUNDARY\nBORE, 2, 3\n4, 1, 3\n"


def refused(path, sentence):
    """The deck is refused, with a sentence that names the file, in less than two seconds and 100 MiB."""
    tracemalloc.start()
    began = time.process_time()
    try:
        with pytest.raises(SceneError, match=sentence) as wrong:
            read_deck(path)
        assert tracemalloc.get_traced_memory()[1] < 100 * 2**20
    finally:
        tracemalloc.stop()
    assert time.process_time() - began < 2
    said = str(wrong.value)
    assert said.isprintable()
    assert len(said) < 300


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "model: deck.inp: the file is empty"),
        ('*NODE,"=\n', "deck.inp, line 1: .* is no parameter"),
        ("*NODE\n1,0,0,nan\n", "deck.inp, line 2: 'nan' in place of a number"),
        ("*NODE\n1,0,0,0\n1,0,0,1\n", "deck.inp, line 1: node 1 is defined again at another position"),
        (
            LEAST + "2,1,2,3\n",
            r"deck.inp, line 8: 4 numbers for a C3D4 of 4 nodes with its number, at \*ELEMENT; give 5",
        ),
        (LEAST + "2,1,2,3,4,\n", None),
        (LEAST + "2,1,2,3,9\n", r"deck.inp, line 6: element 2 has the node 9, which does not exist"),
        (
            LEAST + "*ELEMENT,TYPE=XYZ\n5,1,2,3,4\n",
            r"deck.inp, line 8: elements of type XYZ, at \*ELEMENT; mesh the model with C3D4",
        ),
        (LEAST + "*NSET,NSET=A,GENERATE\n1,1000000000,1\n", None),
        (LEAST + "*NSET,NSET=A\nB\n*NSET,NSET=B\n1,C\n*NSET,NSET=C\nA\n", "the set A contains itself"),
        (
            LEAST + "".join(f"*NSET,NSET=A{n}\nA{n + 1}\n" for n in range(5000)) + "*NSET,NSET=A5000\n1\n",
            "more than 100 sets within each other",
        ),
        (LEAST + "*SURFACE,NAME=S\n1,S5\n", r"deck.inp, line 9: elements of 1 have no face S5"),
        (LEAST + "*MATERIAL,NAME=M\n*DENSITY\n0\n", "deck.inp, line 10: a density of 0"),
        (LEAST + "*SURFACE INTERACTION,NAME=I\n*FRICTION\n-0.5\n", "deck.inp, line 10: a friction coefficient of -0.5"),
        (
            LEAST + "*CYCLIC SYMMETRY MODEL,N=1e9\n0,0,0,0,0,1\n",
            r"deck.inp, line 8: N=1e9, at \*CYCLIC SYMMETRY MODEL; give a number of sectors",
        ),
        (PART.replace("*End Assembly", "*Instance,name=B,part=C\n"), r"line 38: \*INSTANCE B of C, which is no part"),
        ("*INCLUDE,INPUT=deck.inp\n", "deck.inp, line 1: deck.inp includes itself"),
        (
            "*INCLUDE,INPUT=none.inp\n",
            r"deck.inp, line 1: there is no file none.inp, at \*INCLUDE; copy it beside the deck",
        ),
        ("*INCLUDE,INPUT=../../etc/passwd\n", "deck.inp, line 1: ../../etc/passwd is outside the deck's folder"),
        ("*NODE,SYSTEM=C\n1,0,0,0\n", r"deck.inp, line 1: \*NODE: nodes in cylindrical"),
    ],
)
def test_hostile_deck(tmp_path, text, sentence):
    path = write(tmp_path, text)
    if sentence is None:
        began = time.process_time()
        assert read_deck(path).node_numbers.tolist() == [1, 2, 3, 4]
        assert time.process_time() - began < 2
    else:
        refused(path, sentence)


def test_no_file(tmp_path):
    refused(tmp_path / "none.inp", "none.inp: there is no such file")
    refused(tmp_path, "there is no such file")
    refused(Path("/dev/zero"), "zero: there is no such file")


@pytest.mark.slow
def test_damaged_decks_of_constrained_models(tmp_path):
    """Up to the matrices: they are built, or the deck is refused in a sentence."""
    goods = (FULL_MODEL.read_text(), *(BLOCKS + text for text in CONSTRAINTS), SECTORS + HELD)
    said: list[str] = []
    for seed in range(200):
        good = goods[seed % len(goods)]
        # what is not the mesh is damaged twice as often
        start = good.index("*SURFACE INTERACTION") if seed % 3 else 0
        path = tmp_path / "deck.inp"
        path.write_bytes(good[:start].encode() + mutate(good[start:].encode(), seed))
        began = time.process_time()
        try:
            load = {"set": "TIP", "direction": (0, 1, 0)}
            loaded = load_model(ModelFiles(path), Parameters(units="mm-t-s", load=load, friction_coefficient=0.3))
            prepare_model(loaded.model, loaded.joint)
        except SceneError as error:
            said.append(str(error))
        assert time.process_time() - began < 2
    assert 50 < len(said) < 190
    assert all(sentence.isprintable() for sentence in said)


def test_damaged_decks(tmp_path):
    """A deck that is damaged anywhere is read, or refused in a sentence: nothing else is ever raised."""
    said: list[str] = []
    for seed in range(300):
        good = (CUBES, PART, SECTOR.read_text())[seed % 3].encode()
        path = tmp_path / "deck.inp"
        path.write_bytes(mutate(good, seed))
        began = time.process_time()
        try:
            read_deck(path)
        except SceneError as error:
            said.append(str(error))
        assert time.process_time() - began < 2
    assert len(said) > 60
    assert all(sentence.isprintable() for sentence in said)
