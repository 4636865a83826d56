"""Decks come out as they are written."""

import numpy as np
import pytest

from studies.fe_models.deck.contents import ContactPair, Material, SolidSection, Tie
from studies.fe_models.deck.read import read_deck
from tests.studies.fe_models.decks import CUBES, PART, write


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
    assert {name: numbers.tolist() for name, numbers in cubes.element_sets.items()} == {
        "LOWER": [1],
        "UPPER": [2],
        "ALL": [1, 2],
    }


def test_surfaces_and_contact(cubes):
    under, points = cubes.surfaces["UNDER"], cubes.surfaces["POINTS"]
    assert (under.elements.tolist(), under.faces.tolist(), under.of_nodes) == ([1], [2], False)
    assert (points.nodes.tolist(), points.elements.size, points.of_nodes) == ([5, 15, 16, 17, 18], 0, True)
    assert cubes.contact_pairs == (ContactPair("ABOVE", "UNDER", "RUB", 0.4),)
    assert cubes.materials == {"STEEL": Material(2.1e11, 0.3, 7800.0)}
    assert cubes.sections == (SolidSection("ALL", "STEEL"),)


def held(boundary):
    return boundary.name, boundary.nodes.tolist(), boundary.first_dof, boundary.last_dof, boundary.value


def test_steps(cubes):
    assert [held(item) for item in cubes.boundaries] == [
        ("BOTTOM", [1, 2, 3, 4], 1, 3, 0.0),
        ("7", [7], 2, 2, 0.0),
        ("TOP", [15, 16, 17, 18], 1, 1, 0.0),
        ("TOP", [15, 16, 17, 18], 5, 6, 0.0),
    ]
    (load,) = cubes.centrifugal
    assert (load.name, load.elements.tolist(), load.omega_squared) == ("ALL", [1, 2], 1e4)
    assert load.axis.tolist() == [0, 0, 1]
    assert cubes.gravity.tolist() == [0, 0, -9810]
    (force,) = cubes.forces
    assert (force.nodes.tolist(), force.dof, force.value) == ([15, 16, 17, 18], 3, -5.0)


def test_part_and_instance(tmp_path):
    deck = read_deck(write(tmp_path, PART))
    # shifted by 10 along x, then turned by 90 degrees about the line x = 10, y = 0
    expected = [[10, 0, 0], [10, 1, 0], [9, 0, 0], [10, 0, 1], [9, 1, 1]]
    np.testing.assert_allclose(deck.coordinates, [*expected, [5, 5, 5]], atol=1e-12)
    assert deck.node_sets["SET-1"].tolist() == [1, 3]
    assert deck.node_sets["BLOCK-1.SET-1"].tolist() == [1, 2, 3, 4, 5]
    assert deck.node_sets["REFERENCE"].tolist() == [11]  # a point of the assembly, not node 1 of the part
    assert deck.notes == ("Node 1 of the assembly is node 11.",)
    assert deck.sections == (SolidSection("SET-1", "GREY IRON"),)
    assert deck.surfaces["FACE"].elements.tolist() == [1]
    assert deck.surfaces["OTHER"].elements.tolist() == [2]
    assert deck.ties == (Tie("GLUE", "FACE", "OTHER", 0.01, False),)
    assert [held(item)[:3] for item in deck.boundaries] == [
        ("SET-1", [1, 3], 1),
        ("2", [2], 1),
        ("BLOCK-1.SET-1", [1, 2, 3, 4, 5], 3),
    ]


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


@pytest.mark.parametrize(
    "text",
    [
        CUBES.lower(),
        CUBES.replace("\n", "\r\n"),
        CUBES.replace(", ", ",  "),
        CUBES.replace(", ", ",\t"),
        "\xef\xbb\xbf" + CUBES,
    ],
    ids=["small", "Windows", "blanks", "tabs", "byte order mark"],
)
def test_case_line_ends_and_blanks_do_not_matter(tmp_path, cubes, text):
    deck = read_deck(write(tmp_path, text))
    np.testing.assert_array_equal(deck.coordinates, cubes.coordinates)
    assert deck.node_sets.keys() == cubes.node_sets.keys()
    assert deck.contact_pairs == cubes.contact_pairs
    assert len(deck.centrifugal) == len(deck.skipped) == 1
