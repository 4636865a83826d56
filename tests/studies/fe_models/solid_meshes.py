"""Meshes of blocks in every kind of element, and CalculiX decks of them."""

import shutil
import subprocess
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from studies.finite_element.elements import ELEMENT_KINDS
from studies.finite_element.solid_mesh import ElementGroup, Material, SolidMesh

STEEL = Material(210e9, 0.3, 7800.0)

# Six tetrahedra around a diagonal of the cube, and two wedges.
_TETS = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
_WEDGES = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]


def corner_grid(divisions):
    """Reference points (n, 3) of a grid in the unit cube, x slowest, and its hexahedra (m, 8)."""
    counts = [n + 1 for n in divisions]
    axes = [np.linspace(0.0, 1.0, n) for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(counts)
    steps = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [number[a : a + divisions[0], b : b + divisions[1], c : c + divisions[2]].ravel() for a, b, c in steps]
    return points, np.stack(cells, axis=1)


def block(kind, divisions, shape=lambda points: points, material=STEEL, part="", straight=False):
    """Mesh of one block in a kind of element, and its reference points.

    `shape` maps points (n, 3) of the unit cube into space; straight: mid-side nodes in the middle of straight edges.
    """
    reference, hexes = corner_grid(divisions)
    if kind in ("C3D4", "C3D10", "C3D10M"):
        elements = hexes[:, _TETS].reshape(-1, 4)
    elif kind in ("C3D6", "C3D15"):
        elements = hexes[:, _WEDGES].reshape(-1, 6)
    else:
        elements = hexes
    edges = ELEMENT_KINDS[kind].reference.edges
    coordinates = shape(reference)
    if edges:
        ends = np.sort(elements[:, np.array(edges)], axis=2).reshape(-1, 2)
        unique, edge_of = np.unique(ends, axis=0, return_inverse=True)
        middles = len(reference) + edge_of.reshape(len(elements), len(edges))
        reference = np.concatenate([reference, reference[unique].mean(axis=1)])
        coordinates = np.concatenate([coordinates, coordinates[unique].mean(axis=1)]) if straight else shape(reference)
        elements = np.hstack([elements, middles])
    # what rounds to the digits of a deck, so that both programs have the same mesh
    coordinates = np.round(coordinates, 11)
    group = ElementGroup(kind, elements, np.arange(len(elements)) + 1, material, part)
    return SolidMesh(coordinates, np.arange(len(coordinates)) + 1, (group,)), reference


def joined(first, second):
    """Two meshes in one, nodes and elements of the second numbered after those of the first."""
    n_nodes, n_elements = first.n_nodes, max(group.numbers.max() for group in first.groups)
    moved = [
        ElementGroup(each.kind, each.nodes + n_nodes, each.numbers + n_elements, each.material, each.part)
        for each in second.groups
    ]
    coordinates = np.concatenate([first.coordinates, second.coordinates])
    return SolidMesh(coordinates, np.arange(len(coordinates)) + 1, (*first.groups, *moved))


def deck_lines(mesh):
    """Nodes, elements, material; one element set G<i> a group."""
    lines = ["*NODE, NSET=NALL"]
    places = zip(mesh.numbers, mesh.coordinates, strict=True)
    lines += [f"{number}, {x:.11f}, {y:.11f}, {z:.11f}" for number, (x, y, z) in places]
    for place, group in enumerate(mesh.groups):
        lines.append(f"*ELEMENT, TYPE={group.kind}, ELSET=G{place}")
        for number, nodes in zip(group.numbers, group.nodes, strict=True):
            entries = [number, *mesh.numbers[nodes]]
            # a line ends with a comma where the element goes on
            parts = [entries[start:end] for start, end in pairwise([*range(0, len(entries), 10), len(entries)])]
            lines += [", ".join(map(str, part)) + ("," if part is not parts[-1] else "") for part in parts]
        material = group.material
        elastic = f"{material.young_modulus!r}, {material.poisson_ratio!r}"
        lines += [f"*MATERIAL, NAME=M{place}", "*ELASTIC", elastic, "*DENSITY", f"{material.density!r}"]
        lines += [f"*SOLID SECTION, ELSET=G{place}, MATERIAL=M{place}"]
    return lines


def node_set(name, numbers):
    return [f"*NSET, NSET={name}", *(f"{number}," for number in numbers)]


def centrifugal(mesh, omega_squared):
    """Load of a rotation about the z axis."""
    lines = [f"G{place}, CENTRIF, {omega_squared!r}, 0., 0., 0., 0., 0., 1." for place in range(len(mesh.groups))]
    return ["*DLOAD", *lines]


EXPORT = ["*EQUATION, REMOVE ALL", "*FREQUENCY, SOLVER=MATRIXSTORAGE, CYCMPC=INACTIVE", "*END STEP"]


needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")


def run_ccx(folder: Path, lines: Iterable[str], name: str = "job") -> Path:
    """Runs a deck and returns the name that its files have in common."""
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n", encoding="ascii")
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-500:]
    assert "Job finished" in done.stdout, done.stdout[-2000:]
    return folder / name
