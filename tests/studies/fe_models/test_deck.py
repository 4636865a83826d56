"""Decks come out as they are written: meshes, sets, instances, contact, loads; and what of a deck is skipped."""

import re
from itertools import product

import numpy as np
import pytest

from studies.fe_models.deck.contents import Material, SurfacePair
from studies.fe_models.deck.read import read_deck
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import BLOCKS, CUBES, PART, prepared_deck, write


def line_of(text):
    """Line of CUBES, counted from 1."""
    return CUBES.split("\n").index(text) + 1


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    return read_deck(write(tmp_path_factory.mktemp("cubes"), CUBES))


def test_mesh(cubes):
    assert cubes.node_numbers.tolist() == [*range(1, 9), *range(11, 19)]
    by_number = dict(zip(cubes.node_numbers.tolist(), cubes.coordinates.tolist(), strict=True))
    assert by_number[3] == [1, 1, 0]
    assert by_number[12] == [1, 0, 1]  # 1.0D+00
    assert by_number[13] == [1, 1, 1]  # a comma at the end
    assert by_number[14] == [0, 1, 1]  # an empty field
    assert [(block.kind, block.numbers.tolist()) for block in cubes.blocks] == [("C3D8I", [1]), ("C3D8", [2])]
    assert cubes.blocks[0].nodes.tolist() == [[1, 2, 3, 4, 5, 6, 7, 8]]
    assert cubes.rows_of_nodes(np.array([[1, 18], [11, 8]])).tolist() == [[0, 15], [8, 7]]


def test_sets(cubes):
    sets = {name: numbers.tolist() for name, numbers in cubes.node_sets.items()}
    assert sets["BOTTOM"] == [1, 2, 3, 4]
    assert sets["BOTH"] == [1, 2, 3, 4, 7, 15, 16, 17, 18]
    assert sets["EVEN"] == [2, 4, 6, 8, 12, 14, 16, 18]
    assert sets["OF_UPPER"] == list(range(11, 19))
    assert sets["NALL"] == cubes.node_numbers.tolist()
    element_sets = {name: numbers.tolist() for name, numbers in cubes.element_sets.items()}
    assert element_sets == {"LOWER": [1], "UPPER": [2], "ALL": [1, 2]}


def test_surfaces_and_contact(cubes):
    under, points = cubes.surfaces["UNDER"], cubes.surfaces["POINTS"]
    assert (under.elements.tolist(), under.faces.tolist(), under.nodes.tolist()) == ([1], [2], [])
    assert (points.nodes.tolist(), points.elements.size) == ([5, 15, 16, 17, 18], 0)
    assert cubes.contact_pairs == (SurfacePair("ABOVE", "UNDER", friction_coefficient=0.4),)
    assert cubes.materials == {"STEEL": Material(2.1e11, 0.3, 7800.0)}
    (section,) = cubes.sections
    assert (section.name, section.elements.tolist(), section.material) == ("ALL", [1, 2], "STEEL")


def held(boundary):
    return boundary.nodes.tolist(), boundary.first_dof, boundary.last_dof, boundary.value


def test_steps(cubes):
    assert [held(item) for item in cubes.boundaries] == [
        ([1, 2, 3, 4], 1, 3, 0.0),
        ([7], 2, 2, 0.0),
        ([15, 16, 17, 18], 1, 1, 0.0),
        ([15, 16, 17, 18], 5, 6, 0.0),
    ]
    (load,) = cubes.centrifugal
    assert (load.elements.tolist(), load.omega_squared) == ([1, 2], 1e4)
    assert load.axis.tolist() == [0, 0, 1]
    assert cubes.gravity.tolist() == [0, 0, -9810]
    (force,) = cubes.forces
    assert (force.nodes.tolist(), force.first_dof, force.value) == ([15, 16, 17, 18], 3, -5.0)


def test_part_and_instance(tmp_path):
    deck = read_deck(write(tmp_path, PART))
    # shifted by 10 along x, then turned by 90 degrees about the line x = 10, y = 0
    expected = [[10, 0, 0], [10, 1, 0], [9, 0, 0], [10, 0, 1], [9, 1, 1]]
    np.testing.assert_allclose(deck.coordinates, [*expected, [5, 5, 5]], atol=1e-12)
    assert deck.node_sets["SET-1"].tolist() == [1, 3]
    assert deck.node_sets["BLOCK-1.SET-1"].tolist() == [1, 2, 3, 4, 5]
    assert deck.node_sets["REFERENCE"].tolist() == [11]  # a point of the assembly, not node 1 of the part
    assert deck.notes == ("Node 1 of the assembly is node 11.",)
    assert [(each.name, each.material) for each in deck.sections] == [("SET-1", "GREY IRON")]
    assert deck.surfaces["FACE"].elements.tolist() == [1]
    assert deck.surfaces["OTHER"].elements.tolist() == [2]
    assert deck.ties == (SurfacePair("FACE", "OTHER", 0.01),)
    assert [held(item)[:2] for item in deck.boundaries] == [([1, 3], 1), ([2], 1), ([1, 2, 3, 4, 5], 3)]


def test_included_files(tmp_path):
    (tmp_path / "parts").mkdir()
    head, _, tail = CUBES.partition("*NODE, NSET=NALL\n")
    nodes, _, tail = tail.partition("*Element")
    write(tmp_path, nodes, "parts/nodes.txt")
    write(tmp_path, "*Element" + tail, "rest.inp")
    whole = read_deck(write(tmp_path, CUBES, "whole.inp"))
    for number, text in enumerate(
        (
            f"{head}*NODE, NSET=NALL\n*INCLUDE, INPUT=parts/nodes.txt\n*include, input=rest.inp\n",
            f"{head}*NODE, NSET=NALL,\nINPUT=parts/nodes.txt\n*INCLUDE,\nINPUT=rest.inp\n",
        )
    ):
        deck = read_deck(write(tmp_path, text, f"main{number}.inp"))
        np.testing.assert_array_equal(deck.coordinates, whole.coordinates)
        assert [held(item) for item in deck.boundaries] == [held(item) for item in whole.boundaries]
        assert deck.node_sets["NALL"].tolist() == whole.node_sets["NALL"].tolist()
        line = line_of("*NODE PRINT, NSET=TOP") - line_of("*Element, type=C3D8I, elset=Lower") + 1
        assert deck.skipped == (f"rest.inp, line {line}: *NODE PRINT",)


OTHERS = {
    "small": CUBES.lower(),
    "Windows": CUBES.replace("\n", "\r\n"),
    "tabs": CUBES.replace(", ", ",\t "),
    "byte order mark": "\xef\xbb\xbf" + CUBES,
}


@pytest.mark.parametrize("name", OTHERS)
def test_case_line_ends_and_blanks_do_not_matter(tmp_path, cubes, name):
    deck = read_deck(write(tmp_path, OTHERS[name]))
    np.testing.assert_array_equal(deck.coordinates, cubes.coordinates)
    assert deck.node_sets.keys() == cubes.node_sets.keys()
    assert deck.contact_pairs == cubes.contact_pairs
    assert len(deck.centrifugal) == len(deck.skipped) == 1


CORNERS = (1, 2, 5, 4, 10, 11, 14, 13)  # of the first of two by two by two hexahedra, x fastest
GRID = "*NODE, NSET=N\n" + "".join(
    f"{n}, {x}, {2 * y}, {0.5 * z}\n" for n, (z, y, x) in enumerate(product(range(3), repeat=3), 1)
)
CELLS = "*ELEMENT, TYPE=C3D8, ELSET=E\n" + "".join(
    ", ".join(map(str, (n, *(x + 3 * y + 9 * z + corner for corner in CORNERS)))) + "\n"
    for n, (z, y, x) in enumerate(product(range(2), repeat=3), 1)
)


def test_coordinates_of_a_system(tmp_path):
    """Origin, first axis, plane of the first two; by the first two points about z; shifted alone."""
    text = "*SYSTEM\n40, 10, 0, 39, 10, 0\n40, 9, 0\n*NODE\n1, 20, 10, 5\n"
    text += "*SYSTEM\n1, 1, 1, 1, 2, 1\n*NODE\n2, 3, 0, 0\n"
    text += "*SYSTEM\n1, 2, 3\n*NODE\n3, 1, 1, 1\n*SYSTEM\n*NODE\n4, 7, 8, 9\n"
    deck = read_deck(write(tmp_path, text))
    np.testing.assert_allclose(deck.coordinates, [[20, 0, 5], [1, 4, 1], [2, 3, 4], [7, 8, 9]], atol=1e-12)


def test_two_instances(tmp_path):
    """Each has its numbers and names: a line may say whose; a name that several have needs that before it."""
    part = f"*PART, NAME=P\n{GRID}{CELLS}*SURFACE, NAME=TOP\nE, S2\n*END PART\n"
    placed = "*INSTANCE, NAME=I1, PART=P\n*END INSTANCE\n*INSTANCE, NAME=I2, PART=P, NSET=ALL2\n0, 0, 1.\n"
    placed += "0, 0, 0, 0, 0, 1, 90.\n*END INSTANCE\n"
    sets = "*NSET, NSET=X, INSTANCE=I2\nN\n*NSET, NSET=Y\nI1.3, I2.3\n*NSET, NSET=Z, INSTANCE=I1, GENERATE\n1, 1000\n"
    head = f"{part}*ASSEMBLY, NAME=A\n{placed}{sets}*NODE\n1, 9, 9, 9\n*NSET, NSET=RP\n1\n*END ASSEMBLY\n"
    deck = read_deck(write(tmp_path, head))
    assert deck.notes == ("Node 1 of I2 is node 101.", "Node 1 of the assembly is node 201.")
    sets = {name: members.tolist() for name, members in deck.node_sets.items()}
    assert sets["Y"] == [3, 103]
    assert sets["RP"] == [201]
    assert sets["X"] == sets["ALL2"] == sets["I2.N"] == [*range(101, 128)]
    assert sets["Z"] == sets["I1.N"] == [*range(1, 28)]
    assert sorted(deck.surfaces) == ["I1.TOP", "I2.TOP"]
    np.testing.assert_allclose(deck.coordinates[28], [0, 1, 1], atol=1e-12)  # 1, 0, 0: shifted, then turned
    with pytest.raises(SceneError, match=r"\*CONTACT PAIR: .* TOP.* I1.TOP or I2.TOP"):
        read_deck(write(tmp_path, head + "*CONTACT PAIR, INTERACTION=I\nTOP, I1.TOP\n"))
    with pytest.raises(SceneError, match=r"^model: deck.inp has no nodes"):
        read_deck(write(tmp_path, part))


def test_materials_at_a_temperature(tmp_path):
    """Interpolated at the temperature that all nodes have; without one, or with another in a step, refused."""
    rows = "210000., 0.3, 20.\n150000., 0.3, 620."
    text = BLOCKS.replace("210000., 0.3", rows)
    at = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\n"
    deck = read_deck(write(tmp_path, f"{text}{at}ALLN, 320.\n"))
    assert (deck.materials["STEEL"].young, deck.materials["STEEL"].problem) == (180000.0, "")
    refused = (
        "",
        f"{at}XE, 320.\n",
        f"{at}ALLN, 320.\nXE, 20.\n",
        f"{at}ALLN, 320.\n*STEP\n*STATIC\n*TEMPERATURE\nALLN, 50.\n",
    )
    for more in refused:
        with pytest.raises(SceneError, match=r"line \d+: \*ELASTIC "):
            prepared_deck(tmp_path, text + more)
    with pytest.raises(SceneError, match=r"line \d+: \*TEMPERATURE: .*\*EXPANSION"):
        read_deck(write(tmp_path, text.replace("*DENSITY", "*EXPANSION\n1e-5\n*DENSITY") + refused[-1]))


def test_glued_contact_pairs(tmp_path):
    """TIED pairs are no contact; where there is no other one, nothing wears."""
    halves = BLOCKS.replace(
        "*SURFACE, NAME=SUP\nEUP, S1", "*SURFACE, NAME=SUP\n101, S1\n105, S1\n*SURFACE, NAME=REST\n103, S1\n107, S1"
    )
    tied = "*SURFACE INTERACTION, NAME=T\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n"
    tied += "*CONTACT PAIR, INTERACTION=T\nREST, SLOW\n"
    prepared, loaded = prepared_deck(tmp_path, halves + tied)
    assert [tie.name for tie in loaded.joint.ties] == ["REST-SLOW"]
    assert prepared.pairs.n_contact == 6
    alone = BLOCKS.replace("*FRICTION\n0.4", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e7")
    with pytest.raises(SceneError, match=r"line \d+: \*SURFACE BEHAVIOR, .*=TIED: all contact pairs are"):
        prepared_deck(tmp_path, alone)
    assert prepared_deck(tmp_path, alone, contact=(("SUP", "SLOW"),), friction_coefficient=0.3)[0].pairs.n_contact == 15


@pytest.mark.parametrize("names", [("SUP", "SLOW"), ("SLOW", "SUP"), ("NU", "NL")])
def test_a_contact_of_the_study_releases_a_tie(names, tmp_path):
    """By whatever names; not where they have some of the facets in common, or the deck has both."""
    both = BLOCKS + "*TIE, NAME=T\nSUP, SLOW\n*NSET, NSET=NU, GENERATE\n101, 115\n*NSET, NSET=NL, GENERATE\n16, 30\n"
    own = {"contact": (names,), "friction_coefficient": 0.3}
    prepared, loaded = prepared_deck(tmp_path, both, **own)
    assert (loaded.joint.ties, prepared.pairs.n_contact) == ((), 15)
    said = [text for text in loaded.deck.notes if text.startswith("*CONTACT PAIR SUP-SLOW is not in `contact` of")]
    assert len(said) == (names[0] == "NU")
    for text, given in ((both, {}), (both.replace("101, 115", "101, 114"), {**own, "contact": (("NU", "NL"),)})):
        with pytest.raises(SceneError, match=r"SUP-SLOW .* \d of its facets"):
            prepared_deck(tmp_path, text, **given)


@pytest.mark.parametrize(
    ("text", "gap"),
    [
        ("*CLEARANCE, MASTER=SLOW, SLAVE=SUP, VALUE=0.01\n", 1e-5),
        ("*CLEARANCE, MASTER=SLOW, SLAVE=SUP, VALUE=-0.02\n", -2e-5),
        ("*STEP\n*STATIC\n*CONTACT INTERFERENCE, SHRINK\nSUP, SLOW\n*END STEP\n", -1e-4),
    ],
)
def test_clearance_and_interference_are_gaps(text, gap, tmp_path):
    """Positive where surfaces are apart; an interference is the overlap of the mesh. The study has to agree."""
    moved = re.sub(r"^(1[0-3]\d, .*), 5$", r"\1, 4.9", BLOCKS, flags=re.MULTILINE)
    assert moved.count(", 4.9") == 15
    prepared, _ = prepared_deck(tmp_path, moved + text, gaps=True)
    np.testing.assert_allclose(prepared.pairs.gap, gap, atol=1e-12)
    with pytest.raises(SceneError, match=r"^gaps: deck.inp, line \d+: \*C"):
        prepared_deck(tmp_path, moved + text)


def test_removed_elements_and_pairs(tmp_path):
    """What a static step takes away is no part of the model; what one takes away that writes matrices is."""
    gone = "*ELSET, ELSET=GONE\n104, 108\n*STEP\n*STATIC\n*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nGONE\n*END STEP\n"
    fewer = re.sub(r"^10[48], 1\d\d, 1\d\d, .*\n", "", BLOCKS, flags=re.MULTILINE)
    deck = read_deck(write(tmp_path, BLOCKS + gone))
    expected = read_deck(write(tmp_path, fewer))
    assert [text.partition(": ")[2] for text in deck.notes] == ["*MODEL CHANGE takes elements away."]
    np.testing.assert_array_equal(deck.blocks[0].nodes, expected.blocks[0].nodes)
    assert deck.surfaces["SUP"].elements.tolist() == expected.surfaces["SUP"].elements.tolist()
    pair = "*STEP\n*STATIC\n*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nSUP, SLOW\n*END STEP\n"
    assert not read_deck(write(tmp_path, BLOCKS + pair)).contact_pairs
    written = pair.replace("*STATIC", "*FREQUENCY, SOLVER=MATRIXSTORAGE")
    assert len(read_deck(write(tmp_path, BLOCKS + written)).contact_pairs) == 1
