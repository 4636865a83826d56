"""Worn volumes of the bundled dovetail with another grid of contact points than the nodes of its mesh.

    python -m tests.benchmarks.contact_grid [--mesh 1 2 3] [--cells 0 2] [--bodies 4] [--places 8x3 8x5 16x3]
        [--ratio 0.99912 1.00029] [--soft 0.02]

Finer: of `cells` x `cells` contact points in each face (0: the nodes, as the program has it) the relative displacements
are those of the shape functions, `u = P v - C lambda`. As the points are more than the displacements v of the nodes,
rigid ones would share their forces in no single way. The compliance C is that of half-spaces under uniform tractions on
the cells (Love; Cerruti) for what the nodes do not see: `C = R^T C_h R` with `R = 1 - P (P^T P)^-1 P^T`, so that no
force moves twice, and a share (`--soft`) of the compliance of a cell itself, which makes C regular.

Coarser: displacements of the pairs of mesh `bodies` are interpolated between places, along the slot x up the flank.

Frequencies are ratios to the first one with all points stuck. Columns: worn volumes after 1e4 and 1e5 cycles, mm3, the
relative error that is told of the last, and CPU time. Mesh 3 with 2 x 2 points has 264 pairs: it takes by far longest.
"""

import argparse
from collections.abc import Iterator
from itertools import product

import numpy as np
from scipy.linalg import block_diag

from solver import march_wear
from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from studies import build_scene
from studies.scene import stuck_frequencies
from studies.scenes.dovetail_sector import Parameters
from studies.scenes.half_space import composite_modulus
from tests.benchmarks.error_bars import WEAR
from tests.benchmarks.frame import Table, arguments, measure


def cell_compliances(place: FloatArray, size: tuple[float, float], young: float, poisson: float) -> list[FloatArray]:
    """Of two half-spaces, normal, along x and along y, (n, n), m/N: displacements at the middles of rectangles.

    place (n, 2): the middles, m. size: of a rectangle, m. Displacements across a traction are left out.
    """
    x, y = (place[:, None, axis] - place[None, :, axis] for axis in (0, 1))
    along_x, along_y = np.zeros_like(x), np.zeros_like(x)  # integrals of x^2 / r^3 and y^2 / r^3
    for (end_x, sign_x), (end_y, sign_y) in product(((0.5, 1.0), (-0.5, -1.0)), repeat=2):
        one, two = x + end_x * size[0], y + end_y * size[1]
        along_x += sign_x * sign_y * two * np.arcsinh(one / np.abs(two))
        along_y += sign_x * sign_y * one * np.arcsinh(two / np.abs(one))
    whole, area, shear = along_x + along_y, size[0] * size[1], young / (2.0 * (1.0 + poisson))
    tangential = [((1.0 - poisson) * whole + poisson * each) / (np.pi * shear * area) for each in (along_x, along_y)]
    return [whole / (np.pi * composite_modulus(young, poisson) * area), *tangential]


def points_of(n_nodes: int, cells: int) -> FloatArray:
    """Shape functions (n_points, n_nodes) along a row of faces, at the middles of so many cells in each."""
    points, shapes = np.arange((n_nodes - 1) * cells), np.zeros(((n_nodes - 1) * cells, n_nodes))
    face, share = points // cells, (points % cells + 0.5) / cells
    shapes[points, face], shapes[points, face + 1] = 1.0 - share, share
    return shapes


def on_grid(scene: Parameters, cells: int, soft: float) -> ReducedModel:
    """The dovetail with contact at so many points by so many in each face; displacements of the points come first."""
    model = build_scene("dovetail_sector", mesh=scene.mesh)
    nodes = 4 * scene.mesh, scene.mesh + 1
    extent = scene.rim_width, scene.flank_length
    rows = [points_of(n, cells) for n in nodes]
    shapes = np.kron(*rows)
    lines = [row @ np.linspace(0.0, length, row.shape[1]) for row, length in zip(rows, extent, strict=True)]
    place = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    size = extent[0] / len(rows[0]), extent[1] / len(rows[1])
    n, n_nodes = shapes.shape
    unseen, joined = np.eye(n) - shapes @ np.linalg.pinv(shapes), np.hstack([np.eye(n), -shapes])
    old, both_flanks = model.linear[0], np.split(model.contact.position, 2)
    n_new = 6 * n
    springs = np.zeros((n_new + len(old.stiffness),) * 2)
    springs[n_new:, n_new:] = old.stiffness
    for axis, whole in enumerate(cell_compliances(place, size, scene.young_modulus, scene.poisson_ratio)):
        spring = np.linalg.inv(unseen.T @ whole @ unseen + soft * whole[0, 0] * np.eye(n))
        spring = 0.5 * (spring + spring.T)
        for flank in (0, 1):
            own = 3 * (flank * n + np.arange(n)) + axis
            of_nodes = n_new + model.contact.dofs[flank * n_nodes + np.arange(n_nodes), axis]
            both = np.concatenate([own, of_nodes])
            springs[np.ix_(both, both)] += joined.T @ spring @ joined
    pad = (n_new, 0)
    linear = LinearModel(
        mass=np.pad(old.mass, pad),
        damping=np.pad(old.damping, pad),
        stiffness=springs,
        load_static=np.pad(old.load_static, pad),
        load_harmonic=np.pad(old.load_harmonic, pad),
        response=np.pad(old.response, ((0, 0), pad)),
    )
    contact = _contact(np.full(2 * n, size[0] * size[1]), np.concatenate([shapes @ each for each in both_flanks]))
    return ReducedModel({0: linear}, contact, model.response_names)


def between_places(mesh: int, along: int, up: int) -> ReducedModel:
    """The dovetail whose relative displacements are linear between so many places along the slot and up the flank."""
    model = build_scene("dovetail_sector", mesh=mesh)
    hats = [
        np.stack([np.interp(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, m), unit) for unit in np.eye(m)], axis=1)
        for n, m in ((4 * mesh, along), (mesh + 1, up))
    ]
    old, flank = model.linear[0], np.kron(*hats)
    pairs = block_diag(flank, flank)
    basis = block_diag(np.kron(pairs, np.eye(3)), np.eye(len(old.stiffness) - 3 * len(pairs)))
    linear = LinearModel(
        mass=basis.T @ old.mass @ basis,
        damping=basis.T @ old.damping @ basis,
        stiffness=basis.T @ old.stiffness @ basis,
        load_static=basis.T @ old.load_static,
        load_harmonic=basis.T @ old.load_harmonic,
        response=old.response @ basis,
    )
    contact = _contact(pairs.T @ model.contact.area, np.linalg.pinv(pairs) @ model.contact.position)
    return ReducedModel({0: linear}, contact, model.response_names)


def _contact(area: FloatArray, position: FloatArray) -> ContactInterface:
    """Pairs whose displacements are the first ones; half of them are on each flank."""
    n = len(area)
    surface = ("intrados",) * (n // 2) + ("extrados",) * (n // 2)
    return ContactInterface(np.arange(3 * n).reshape(-1, 3), area, np.zeros(n), np.zeros(n), position, surface)


def models(given: argparse.Namespace) -> Iterator[tuple[str, ReducedModel]]:
    """All that are asked for, one by one."""
    for mesh, cells in product(given.mesh, given.cells):
        if cells:
            yield f"mesh {mesh}, {cells} x {cells} in each face", on_grid(Parameters(mesh=mesh), cells, given.soft)
        else:
            yield f"mesh {mesh}, nodes", build_scene("dovetail_sector", mesh=mesh)
    for places in given.places:
        along, up = (int(part) for part in places.split("x"))
        yield f"bodies of mesh {given.bodies}, places {places}", between_places(given.bodies, along, up)


def main() -> None:
    finer, coarser = {"mesh": [1, 2, 3], "cells": [0, 2]}, {"bodies": 4, "places": ["8x3", "8x5", "16x3"]}
    given = arguments(__doc__, (), **finer, **coarser, ratio=[0.99912, 1.00029], soft=0.02)
    table = Table("model", "pairs", "ratio", "1e4 cycles", "1e5 cycles", "told", "CPU s")
    for name, model in models(given):
        stuck = float(stuck_frequencies(model)[0][0])
        for ratio in given.ratio:
            work = measure(lambda m=model, f=ratio * stuck: march_wear(m, f, 0.5, 0.5, WEAR, [1e4, 1e5]))
            row = *(1e9 * work.result.worn_volume[1:]).tolist(), work.result.error_estimate, work.seconds
            table.row(name, model.contact.n_contact, f"{ratio:.5f}", *row)


if __name__ == "__main__":
    main()
