"""Pairs at the edge of a surface, on meshes of all kinds, and how much of the wear is there."""

from dataclasses import replace

import numpy as np
import pytest

from solver.model import ContactInterface
from studies import build_scene
from studyrunner.scene.edge_pairs import edge_pairs


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
