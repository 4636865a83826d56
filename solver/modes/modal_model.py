"""Linear modes of the joint, and the model whose periodic states are nonlinear modes.

The extended periodic motion concept (Krack, Computers and Structures 154 (2015) 59-71) seeks periodic motions without
excitation, where a negative damping feeds in the energy that the joint dissipates:

    M x'' + (C - 2 zeta omega M) x' + K x + (contact forces) = f_0.

The structure with its joint held is singular at the frequency of its own mode. So harmonic 1 gets a spring
`omega_0^2 M phi (q - Q)` on its modal coordinate `q = phi^H M x_1`, with the mass-normalised linear mode phi. Its other
end moves with the real amplitude Q (the drive). At a nonlinear mode `q = Q`, so that the spring has no force.
"""

from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import scipy.linalg

from solver.compliant_contact import stiffened
from solver.model import BoolArray, LinearModel, Matrix, ReducedModel
from solver.settings import NEGLIGIBLE
from solver.structure.schur import regular


@dataclass(frozen=True)
class LinearMode:
    """A mode of the linear structure that harmonic 1 sees: omega without damping, rad/s; shape (n,), phi,
    mass-normalised, its largest component real and positive; damping ratio of the damping matrix alone.
    """

    omega: float
    shape: Matrix
    damping_ratio: float


def linear_mode(
    model: ReducedModel, closed: BoolArray, *, sticking: bool = True, number: int = 1, near: float | None = None
) -> LinearMode | None:
    """A mode of the joint, rigid motions left out; None where the joint has fewer modes.

    closed (n_contact,): pairs held in the normal direction; sticking: those with friction in the tangential ones, too.
    Pairs with a law of another kind have its stiffness at rest.
    number: from 1 on in ascending frequency. near: rad/s; the mode nearest to a frequency instead.
    """
    # the springs of a worn contact as they are
    linear = stiffened(model, model.contact).harmonic_structure(1)
    dofs, closed = model.contact.dofs, closed & model.contact.rubs
    springs = np.zeros(len(linear.mass))
    springs[model.contact.relative] = model.contact.rest_stiffness[dofs >= 0]
    stuck = closed & (model.contact.friction > 0.0) if sticking else np.zeros_like(closed)
    held = np.concatenate([dofs[closed, 0], dofs[stuck, 1:].ravel()])
    free = np.setdiff1d(np.arange(len(linear.mass)), held)
    if not free.size:
        return None
    mass, stiffness = (part[np.ix_(free, free)] for part in (linear.mass, linear.stiffness + np.diag(springs)))
    # shift and limit of a rigid motion: 1e-12 of the ratio of the traces is of the order of round-off
    shift = NEGLIGIBLE * float(np.real(np.trace(stiffness)) / max(np.real(np.trace(mass)), 1e-300))
    # eigenvalues 1 / (omega^2 + shift), largest first: a mass matrix may be singular, a stiffness as well
    with regular("or its stiffness negative, at rest"):
        values, vectors = scipy.linalg.eigh(mass, stiffness + shift * mass)
    values, vectors = values[::-1], vectors[:, ::-1]
    with np.errstate(divide="ignore"):
        square = 1.0 / np.maximum(values, 0.0) - shift
    elastic = np.flatnonzero((square > NEGLIGIBLE * shift) & (values > 1e-12 * values[0]))
    if len(elastic) < (number if near is None else 1):
        return None
    omegas = np.sqrt(square[elastic])
    place = elastic[number - 1 if near is None else int(np.argmin(np.abs(omegas - near)))]
    shape = np.zeros(len(linear.mass), vectors.dtype)
    shape[free] = vectors[:, place] / np.sqrt(values[place])
    largest = shape[np.argmax(np.abs(shape))]
    shape = cast("Matrix", shape * (np.conj(largest) / np.abs(largest)))
    omega = float(np.sqrt(square[place]))
    return LinearMode(omega, shape, float(np.real(np.vdot(shape, linear.damping @ shape))) / (2.0 * omega))


@dataclass(frozen=True, eq=False)
class ModalModel(ReducedModel):
    """A model in which harmonic 1, `of_first`, has a spring on its modal coordinate. The excitation amplitude is Q."""

    of_first: LinearModel = field(kw_only=True)

    def harmonic_structure(self, harmonic: int) -> LinearModel:  # noqa: D102
        return self.of_first if harmonic == 1 else super().harmonic_structure(harmonic)


def modal_model(model: ReducedModel, mode: LinearMode, damping_rate: float) -> ModalModel:
    """The model with a spring on a modal coordinate and the damping `C - damping_rate M`, `2 zeta omega`, rad/s."""
    first = model.harmonic_structure(1)
    force = mode.omega**2 * (first.mass @ mode.shape)

    def damped(linear: LinearModel) -> LinearModel:
        return replace(linear, damping=linear.damping - damping_rate * linear.mass)

    sprung = replace(
        damped(first),
        stiffness=first.stiffness + np.outer(force, force.conj()) / mode.omega**2,
        load_harmonic=force.astype(complex),
    )
    kept = {name: getattr(model, name) for name in ("contact", "response_names", "n_sectors", "nodal_diameter")}
    return ModalModel(linear={k: damped(each) for k, each in model.linear.items()}, **kept, of_first=sprung)
