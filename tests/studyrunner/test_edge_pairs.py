"""Pairs at the edge of a surface, on meshes of all kinds, and how much of the wear is there."""

from dataclasses import replace

import numpy as np
import pytest

from solver.model import ContactInterface
from studies import build_scene
from studyrunner.scene.edge_pairs import edge_pairs
from studyrunner.study.study_file import read_study
from studyrunner.summary.edge_wear import EdgeWear
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import results_of, told


def contact_at(position, surface=None):
    """Pairs at these places, (n, 3), m."""
    n = len(position)
    dofs = np.stack([np.arange(n), np.full(n, -1), np.full(n, -1)], axis=1)
    labels = ("",) * n if surface is None else surface
    return ContactInterface(dofs, np.ones(n), np.zeros(n), np.zeros(n), position, labels)


def turned(x, y, z=0.0):
    """Places in a plane that lies anywhere in space."""
    axes, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    flat = np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1).reshape(-1, 3)
    return np.asarray(flat @ axes + [0.3, -2.0, 0.1])


@pytest.mark.parametrize("side", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("skew", [0.0, 1.0])
def test_a_structured_mesh_has_the_edge_of_its_rows_and_columns(side, skew):
    i, j = np.meshgrid(np.arange(9.0), np.arange(5.0), indexing="ij")
    expected = (i == 0) | (i == 8) | (j == 0) | (j == 4)
    # round-off of a mesh of one's own leaves no edge straight
    noise = 1e-9 * np.random.default_rng(1).normal(size=i.shape)
    found = edge_pairs(contact_at(turned(i + skew * j + noise, side * j)))
    assert found.tolist() == expected.ravel().tolist()


def test_an_unstructured_mesh_has_its_edge_and_its_hole():
    random, kept = np.random.default_rng(0), []
    for place in random.random((1500, 2)):
        if all(np.hypot(*(place - other)) > 0.04 for other in kept) and np.hypot(*(place - 0.5)) > 0.2:
            kept.append(place)
    x, y = np.array(kept).T
    found = edge_pairs(contact_at(turned(x, y)))
    from_side = np.minimum(np.minimum(x, 1.0 - x), np.minimum(y, 1.0 - y))
    from_hole = np.hypot(x - 0.5, y - 0.5) - 0.2
    assert found[from_side < 0.01].all()
    assert found[from_hole < 0.01].mean() > 0.5
    assert not found[(from_side > 0.08) & (from_hole > 0.08)].any()


def test_a_scene_that_says_its_edge_is_believed():
    contact = build_scene("cylinder_on_flat", strips=12).contact
    assert edge_pairs(contact).tolist() == [False] * 5 + [True]
    # along a line the ends are the edge
    assert edge_pairs(replace(contact, edge=None)).tolist() == [True] + [False] * 4 + [True]


GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=adaptive", "outputs.variables=['wear_depth']")
AREA = np.array([1.0, 2.0, 1.0, 1.0, 2.0, 1.0]) * 1e-4
BY_SIX = replace(
    FACTS,
    position=np.zeros((6, 3)),
    area=AREA,
    surface=("left",) * 3 + ("right",) * 3,
    edge=np.array([True, False, True] * 2),
)


def row_of(depths, edge=BY_SIX.edge, **outcome):
    """The rows where the second of three frequencies has these last depths, um, and the others wear in the middle."""
    study = read_study("sdof_slider", GRID)
    facts, n = replace(BY_SIX, edge=edge), len(study.cycles_kept)

    def depth(point):
        last = depths if point[0] == 1 else [0.0, 1.0, 0.0] * 2
        return np.asarray(1e-6 * np.outer(np.linspace(0.0, 1.0, n), last))

    results = results_of(study, wear_depth=depth, outcome=lambda point: outcome.get("at", 0) if point[0] == 1 else 0)
    return told(EdgeWear.rows, lambda: EdgeWear(study, facts), study, results, facts)


LABEL = "wear at the edge of the contact"
REMARK = "right where the bodies end, else add pairs"


def test_the_surface_with_most_at_its_edge_is_named():
    assert row_of([3.0, 1.0, 1.0, 0.0, 3.0, 0.0]) == [
        (LABEL, f"up to 67 % of the wear of left (50 % of its area), the deepest pair too, at 211.25 Hz: {REMARK}")
    ]
    # more than its share, though the deepest pair is inside
    assert row_of([0.0, 3.0, 0.0, 2.0, 1.9, 2.0])[0][1].endswith(f"at 211.25 Hz: {REMARK}")
    # less than its share is nothing to look at
    assert row_of([0.5, 1.0, 0.0, 0.0, 1.0, 0.5]) == [
        (LABEL, "up to 20 % of the wear of left (50 % of its area), at 211.25 Hz")
    ]
    assert row_of([0.0, 1.0, 0.0, 0.0, 1.0, 0.0]) == [(LABEL, "none")]
