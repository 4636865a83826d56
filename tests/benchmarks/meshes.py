"""What a mesh of the bundled dovetail root is worth, and why: finite elements, contact pairs, or static pressure.

    python -m tests.benchmarks.meshes --mesh 1 2 3
    python -m tests.benchmarks.meshes --mesh 2 --bodies 4
    python -m tests.benchmarks.meshes --picture studies/pictures/meshes.png

Worn volumes after 1e5 cycles at equal f/f_1, with f_1 the first frequency of the glued sector of each mesh: so the
frequency of the finite elements does not count. With `--bodies` the pairs of a mesh are compared on the bodies of
another one in two ways:

- the pairs of the coarse mesh on the bodies of the fine one: its relative displacements are interpolated between the
  pairs of the coarse mesh, forces and areas are shared accordingly;
- the coarse mesh under the static forces of the fine one, shared among the coarse pairs in the same way.

If pairs are what matters, the first is like the coarse mesh; if bodies are, it is like the fine one. The picture shows
what `meshes.csv` holds of earlier runs.
"""

import argparse
import csv
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from solver.loading_history.start_states import follow_branch
from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from solver.results.history import WearHistory
from solver.settings import SolverSettings
from tests.solver.models import glued_frequency, march_wear, scene

FRICTION, AMPLITUDE, WEAR = 0.5, 0.5, 1.1e-11  # 1, N, 1/Pa
HARMONICS = 21
SHARES = (0.99556, 0.99676, 0.99735, 0.99794, 0.99853, 0.99912, 1.00029)  # f/f_1


def hats(fine: FloatArray, coarse: FloatArray) -> FloatArray:
    """Piecewise linear functions (n_fine, n_coarse) that are 1 at one of the coarse places, at the fine places."""
    return np.array([np.interp(fine, coarse, row) for row in np.eye(len(coarse))]).T


def interpolation(fine: ContactInterface, coarse: ContactInterface) -> FloatArray:
    """Bilinear interpolation (n_fine, n_coarse) between the pairs of a coarse flank, of both flanks.

    The pairs of a flank form a grid, along the axis z and along the radius x, and the flanks come one after the other.
    """
    shares = np.zeros((fine.n_contact, coarse.n_contact))
    for name in dict.fromkeys(fine.surface):
        own, other = (np.flatnonzero(np.array(part.surface) == name) for part in (fine, coarse))
        along = [
            hats(fine.position[own][:, axis], np.unique(coarse.position[other][:, axis].round(9))) for axis in (2, 0)
        ]
        order = np.lexsort(coarse.position[other][:, [0, 2]].round(9).T)
        shares[np.ix_(own, other[order])] = np.einsum("ij,ik->ijk", *along).reshape(len(own), -1)
    return shares


def static_forces(model: ReducedModel) -> FloatArray:
    """Forces of the static load on the displacements of the pairs (n_contact, 3), N, while all of them stick."""
    linear, pairs = model.linear[0], model.contact.dofs
    inner = np.setdiff1d(np.arange(len(linear.mass)), pairs)
    moved = np.linalg.solve(linear.stiffness[np.ix_(inner, inner)], linear.load_static[inner])
    return np.real(linear.load_static[pairs] - linear.stiffness[pairs][:, :, inner] @ moved)


def with_pairs_of(fine: ReducedModel, coarse: ReducedModel) -> ReducedModel:
    """The bodies of the fine model, whose relative displacements lie between those of the coarse pairs."""
    shares, linear = interpolation(fine.contact, coarse.contact), fine.linear[0]
    n_fine, n_coarse = (3 * part.contact.n_contact for part in (fine, coarse))
    basis = np.zeros((len(linear.mass), n_coarse + len(linear.mass) - n_fine))
    inner = np.setdiff1d(np.arange(len(linear.mass)), fine.contact.dofs)
    dofs = np.arange(n_coarse).reshape(-1, 3)
    for direction in range(3):
        basis[np.ix_(fine.contact.dofs[:, direction], dofs[:, direction])] = shares
    basis[inner, n_coarse:] = np.eye(len(inner))
    reduced = LinearModel(
        *(basis.T @ part @ basis for part in (linear.mass, linear.damping, linear.stiffness)),
        basis.T @ linear.load_static,
        basis.T @ linear.load_harmonic,
        linear.response @ basis,
    )
    return replace(
        fine, linear={0: reduced}, contact=replace(coarse.contact, dofs=dofs, area=shares.T @ fine.contact.area)
    )


def under_forces_of(coarse: ReducedModel, fine: ReducedModel) -> ReducedModel:
    """The coarse model with the static forces that the pairs of the fine one see."""
    shares, linear = interpolation(fine.contact, coarse.contact), coarse.linear[0]
    load = linear.load_static.copy()
    load[coarse.contact.dofs] += shares.T @ static_forces(fine) - static_forces(coarse)
    return replace(coarse, linear={0: replace(linear, load_static=load)})


def histories(model: ReducedModel, shares: list[float]) -> Iterator[tuple[float, WearHistory, float]]:
    """Share of the first frequency, wear history and CPU seconds; start state as in a study, sweep up."""
    settings = SolverSettings()
    frequencies = np.array(shares) * glued_frequency(model)
    for place, start in follow_branch(model, FRICTION, AMPLITUDE, frequencies, "up", settings):
        began = time.thread_time()
        history = march_wear(model, FRICTION, start, WEAR, 1e3, "adaptive", np.linspace(0.0, 1e5, 11), settings)
        yield shares[place], history, start.run_time + time.thread_time() - began


def draw(path: Path) -> None:
    """Worn volume over the share of the first frequency, of all models in `meshes.csv`."""
    with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    figure, axes = plt.subplots(figsize=(7.0, 4.2))
    for place, (name, group) in enumerate(groupby(rows, key=lambda row: row["model"])):
        own = list(group)
        share, volume, told = (np.array([float(row[key] or 0.0) for row in own]) for key in ("share", "volume", "told"))
        of_one_mesh = "," not in name
        axes.errorbar(
            share, volume, volume * told, label=name, capsize=3, color=f"C{place}", alpha=0.8,
            marker="o" if of_one_mesh else "x", linestyle="-" if of_one_mesh else "none",
        )  # fmt: skip
    axes.set(xlabel="excitation over first frequency of the mesh", ylabel="worn volume after 1e5 cycles (mm3)")
    axes.legend(fontsize=8, loc="upper left")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """A line for each model and frequency."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--bodies", type=int, nargs="*", default=[], help="finer meshes that lend bodies and forces")
    parser.add_argument("--share", type=float, nargs="+", default=list(SHARES), help="f/f_1")
    parser.add_argument("--picture", type=Path, help="draw the figures of meshes.csv, compute nothing")
    given = parser.parse_args()
    if given.picture:
        draw(given.picture)
        return
    for mesh in given.mesh:
        coarse = scene("dovetail_sector", HARMONICS, mesh=mesh)
        models = {} if given.bodies else {f"mesh {mesh}": coarse}
        for body in given.bodies:
            fine = scene("dovetail_sector", HARMONICS, mesh=body)
            models[f"pairs of mesh {mesh}, bodies of {body}"] = with_pairs_of(fine, coarse)
            models[f"mesh {mesh}, static forces of {body}"] = under_forces_of(coarse, fine)
        for name, model in models.items():
            forces = static_forces(model)[:, 0] / model.contact.area
            print(
                f"{name}: {model.contact.n_contact} pairs, f_1 {glued_frequency(model):.4f} Hz, glued at rest "
                f"{forces.min() / 1e6:.1f} to {forces.max() / 1e6:.1f} MPa",
                flush=True,
            )
            for share, history, spent in histories(model, given.share):
                tip = 1e3 * abs(history.response[[0, -1], 0])
                print(
                    f"  {share:.5f}: {1e9 * history.worn_volume[-1]:.4f} mm3, told {history.error_estimate:.2%}, "
                    f"{history.outcome.meaning}, tip {tip[0]:.3f} and {tip[1]:.3f} mm, {spent:.1f} CPU s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
