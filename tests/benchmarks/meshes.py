"""What a mesh of the bundled dovetail root is worth, and why: finite elements or contact pairs.

    python -m tests.benchmarks.meshes --mesh 1 2 3 [--records meshes.csv] [--picture meshes.png]
    python -m tests.benchmarks.meshes --mesh 2 --bodies 4

Worn volumes after 1e5 cycles at equal f/f_1, with f_1 the first frequency of the glued sector of each mesh: so the
frequency of the finite elements does not count. With `--bodies` the pairs of a mesh are on the bodies of a finer one:
its relative displacements are interpolated between the pairs of the coarse mesh, forces and areas are shared
accordingly. If pairs are what matters, this is like the coarse mesh; if bodies are, it is like the fine one.
"""

from dataclasses import replace

import numpy as np

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from solver.settings import SolverSettings
from tests.benchmarks.frame import Table, arguments, measure
from tests.solver.models import branch_states, glued_frequency, march_wear, scene

FRICTION, AMPLITUDE, WEAR = 0.5, 0.5, 1.1e-11  # 1, N, 1/Pa
HARMONICS = 21
SHARES = [0.99556, 0.99676, 0.99735, 0.99794, 0.99853, 0.99912, 1.00029]  # f/f_1


def interpolation(fine: ContactInterface, coarse: ContactInterface) -> FloatArray:
    """Bilinear interpolation (n_fine, n_coarse) between the pairs of a coarse flank, of both flanks.

    The pairs of a flank form a grid, along the axis z and along the radius x, and the flanks come one after the other.
    """
    shares = np.zeros((fine.n_contact, coarse.n_contact))
    for name in dict.fromkeys(fine.surface):
        own, other = (np.flatnonzero(np.array(part.surface) == name) for part in (fine, coarse))
        along = []
        for axis in (2, 0):
            places = np.unique(coarse.position[other][:, axis].round(9))
            along.append(
                np.array([np.interp(fine.position[own][:, axis], places, row) for row in np.eye(len(places))]).T
            )
        order = np.lexsort(coarse.position[other][:, [0, 2]].round(9).T)
        shares[np.ix_(own, other[order])] = np.einsum("ij,ik->ijk", *along).reshape(len(own), -1)
    return shares


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
    matrices = (basis.T @ part @ basis for part in (linear.mass, linear.damping, linear.stiffness))
    loads = (basis.T @ linear.load_static, basis.T @ linear.load_harmonic)
    contact = replace(coarse.contact, dofs=dofs, area=shares.T @ fine.contact.area)
    return replace(fine, linear={0: LinearModel(*matrices, *loads, linear.response @ basis)}, contact=contact)


def main() -> None:
    """A row for each model and frequency."""
    given = arguments(__doc__, mesh=[1, 2, 3], bodies=[0], share=SHARES, records=None, picture=None)
    columns = ("f/f_1", "worn volume, mm3", "error", "outcome", "tip, mm", "worn tip, mm", "CPU s")
    table, settings = Table("model", *columns, file=given.records), SolverSettings()
    for mesh in given.mesh:
        coarse = scene("dovetail_sector", HARMONICS, mesh=mesh)
        models = {f"mesh {mesh}": coarse}
        for body in filter(None, given.bodies):
            fine = scene("dovetail_sector", HARMONICS, mesh=body)
            models = {f"pairs of mesh {mesh} on bodies of {body}": with_pairs_of(fine, coarse)}
        for name, model in models.items():
            first = glued_frequency(model)
            omegas = [2.0 * np.pi * share * first for share in given.share]
            starts = branch_states(model, FRICTION, AMPLITUDE, omegas, settings)
            for share, start in zip(given.share, starts, strict=True):
                asked = (1e3, "adaptive", np.linspace(0.0, 1e5, 11), settings)
                found = measure(lambda: march_wear(model, FRICTION, start, WEAR, *asked))  # noqa: B023
                history, tip = found.result, 1e3 * abs(found.result.response[[0, -1], 0])
                worn = (1e9 * float(history.worn_volume[-1]), history.error_estimate, history.outcome)
                table.row(f"{name}, {first:.2f} Hz", share, *worn, *tip.tolist(), start.run_time + found.seconds)
    table.draw(given.picture, "f/f_1", "worn volume, mm3")


if __name__ == "__main__":
    main()
