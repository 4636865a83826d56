"""A bolted lap joint as decks have it: ties that join some of their nodes, bodies of several parts, a mean motion."""

import re

import numpy as np
import pytest

from studies.fe_models.from_files.check import describe_model
from studies.fe_models.from_files.model import reduce_model
from studies.scene_error import SceneError
from tests.studies.fe_models.bolted_beam import DECK, Beam
from tests.studies.fe_models.decks import BLOCKS, listed_frequencies, prepared_deck, run_tied
from tests.studies.fe_models.solid_meshes import needs_ccx

SUSPENSION = 3.0
FREE = BLOCKS.partition("*BOUNDARY")[0]


@pytest.fixture(scope="module")
def text():
    return "\n".join(Beam().lines()) + "\n"


def test_the_deck_of_the_study_is_the_one_that_is_made(text):
    assert DECK.read_text(encoding="ascii") == text


@needs_ccx
@pytest.mark.slow
def test_frequencies_of_the_free_beam_as_calculix(text, tmp_path):
    """Where the elements are those of both programs: CalculiX gives the incompatible modes of C3D8I a mass."""
    found = {}
    for kind in ("C3D8", "C3D8I"):
        (folder := tmp_path / kind).mkdir()
        deck = text.replace("C3D8I", kind)
        own = prepared_deck(folder, deck, suspension=SUSPENSION)[0].frequencies(0, 14)
        assert own[:6] == pytest.approx(SUSPENSION, rel=1e-5)
        job = run_tied(folder, deck.partition("*STEP")[0], "*STEP\n*FREQUENCY\n14\n*END STEP\n")
        found[kind] = np.sqrt(own[6:] ** 2 - SUSPENSION**2) / listed_frequencies(job)[6:] - 1.0
    assert np.abs(found["C3D8"]).max() < 1e-5
    assert np.abs(found["C3D8I"][:2]).max() < 1e-3
    assert np.abs(found["C3D8I"]).max() < 5e-3


@pytest.mark.slow
def test_a_free_beam_is_checked(text, tmp_path):
    """Frequencies above the suspension, bolts that press, and nodes of the ties that stay free."""
    _, loaded = prepared_deck(tmp_path, text, suspension=SUSPENSION)
    scene = reduce_model(loaded, 1)
    rows = describe_model(loaded, scene)
    found = [row for label, row in rows if label == "warning"]
    assert len(found) == 6
    assert "12 of 28 nodes of HEAD1 are farther than 0.0001 m from UPPER_SIDE and are not tied" in found[0]
    sliding = float(re.search(r"sliding freely ([\d.]+)", dict(rows)["reduction"])[1])
    pressed = float(re.search(r"sum (\S+) N", dict(rows)["static"])[1])
    assert 100.0 < sliding < scene.glued_frequencies[0][6]
    assert 20e3 < pressed < 36e3
    # the loss factor is that of the first elastic mode, and of none of the suspension
    linear, own = scene.model.linear[0], scene.model.contact.dofs.size + 6
    ratio = linear.damping[own, own] / (linear.mass[own, own] * 2.0 * np.pi * scene.glued_frequencies[0][6])
    assert ratio == pytest.approx(loaded.parameters.loss_factor, rel=1e-6)


def parts(upper):
    """`FREE` with one block, the lower or the upper one, in two parts, tied end to end; what stands for it whole."""
    add, first = (200, 100) if upper else (300, 0)
    middle, right = range(first + 3, first + 31, 5), [first + element for element in (3, 4, 7, 8)]

    def element(found):
        number, *nodes = map(int, found[0].split(","))
        moved = [node + add if number in right and node in middle else node for node in nodes]
        return ", ".join(map(str, (number, *moved)))

    own = re.sub(r"^\d+(, \d+){8}$", element, FREE, flags=re.MULTILINE)
    own = re.sub(
        r"^(\d+)(, 20, .*)$",
        lambda each: f"{each[0]}\n{int(each[1]) + add}{each[2]}" if int(each[1]) in middle else each[0],
        own,
        flags=re.MULTILINE,
    )
    ends = [
        f"*SURFACE, NAME=TL\n{first + 2}, S4\n{first + 6}, S4",
        f"*SURFACE, NAME=TR\n{first + 3}, S6\n{first + 7}, S6",
    ]
    return "\n".join([own.rstrip(), *ends, "*TIE\nTR, TL", ""])


@pytest.mark.parametrize("upper", [True, False])
def test_a_body_in_contact_may_be_several_parts(upper, tmp_path):
    """Tied nodes at the joint of two parts are no pairs of their own: areas and frequencies are those of one part."""
    both = []
    for name, deck in (("whole", FREE), ("parts", parts(upper))):
        (tmp_path / name).mkdir()
        prepared, loaded = prepared_deck(tmp_path / name, deck, suspension=SUSPENSION, friction_coefficient=0.3)
        linear, dofs = reduce_model(loaded, 1).model.linear[0], prepared.pairs.n_contact
        assert prepared.structure.notes == ()
        both.append((prepared.frequencies(0, 12), np.sort(prepared.pairs.area), np.diag(linear.stiffness)[: 3 * dofs]))
    for whole, own in zip(*both, strict=True):
        np.testing.assert_allclose(own, whole, rtol=1e-5)


def test_a_tied_node_that_moves_in_a_contact_is_told(tmp_path):
    """Where the part to which it is tied is in no contact."""
    alone = parts(True).replace("*SURFACE, NAME=SUP\nEUP, S1", "*SURFACE, NAME=SUP\n103, S1\n104, S1\n107, S1\n108, S1")
    prepared, _ = prepared_deck(tmp_path, alone, suspension=SUSPENSION)
    (note,) = prepared.structure.notes
    assert note.startswith("3 nodes that are tied, as node 303, move in contact pairs")


def test_a_tie_that_joins_nothing_is_refused(tmp_path):
    apart = parts(False).replace("*TIE\n", "*TIE, POSITION TOLERANCE=0.1\n")
    apart = re.sub(r"^(3\d\d), 20, ", r"\1, 20.2, ", apart, flags=re.MULTILINE)
    with pytest.raises(SceneError, match=r"6 of 6 nodes of TR are farther than 0\.0001 m from TL"):
        prepared_deck(tmp_path, apart, suspension=SUSPENSION)
