"""Craig-Bampton reduction of a structure to relative displacements and stuck modes.

Nodes are eliminated in blocks, the nodes of the contact pairs last. The rest of the stiffness is the reduced stiffness.
Mass and other forms are condensed with the stiffness (`condensation`), so that static shapes are never formed. Blocks
without nodes of a cut face are real and independent of the nodal diameter: they are eliminated once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from solver.model import FloatArray, Matrix
from studies.finite_element.condensation.factor import (
    Factor,
    FrontFactor,
    NotPositiveDefiniteError,
    eliminate,
    factorise,
    mirrored,
    solve_lower,
    times,
)
from studies.finite_element.condensation.modes import lowest_modes
from studies.finite_element.condensation.ordered_form import OrderedForm
from studies.finite_element.condensation.projection import Projection
from studies.finite_element.joint.ordering import KeptCoordinates, OrderedStructure

_BLOCK = 8  # modes are looked for with so many vectors at a time
_SMALL = 900  # displacements of a structure whose modes are found by dense matrices
_ROUND_OFF = 1e-11  # of the largest eigenvalue of a mass or a flexibility
_COLUMNS = 64  # vectors that are condensed at a time


class GluedStructureError(ValueError):
    """The glued structure is not held, or unstable from spin softening. `unstable` says which."""

    def __init__(self, *, unstable: bool) -> None:
        super().__init__(
            "the glued structure is unstable: spin softening exceeds its stiffness"
            if unstable
            else "nothing holds the glued structure: its stiffness is singular"
        )
        self.unstable = unstable


@dataclass(frozen=True)
class ReducedStructure:
    """A structure in the coordinates [relative displacements | stuck modes], `n` of them, at one nodal diameter.

    frequencies (n_modes,): natural frequencies of the glued structure, rad/s, ascending; the modes have unit modal
        mass.
    forms: Hermitian matrices (n, n) by name, with "stiffness" and "mass".
    vectors (n, n_vectors): generalised forces.
    """

    frequencies: FloatArray
    forms: Mapping[str, Matrix]
    vectors: Matrix


@dataclass(frozen=True)
class GluedStructure:
    """A structure at one nodal diameter, with glued pairs and factorised stiffness.

    Displacements and forces (3 n_places, n_vectors) are in the order of elimination, nodes of the pairs last.

    factor: factors of all other nodes.
    last: factors of the coordinates `kept.glued`.
    kept: coordinates of the nodes of the pairs.
    stiffness (n_relative, n_relative): reduced stiffness of the relative displacements.
    """

    factor: Factor
    last: FrontFactor
    kept: KeptCoordinates
    stiffness: Matrix

    @property
    def _first(self) -> int:
        return 3 * self.factor.dissection.n_eliminated

    def solve(self, forces: Matrix) -> Matrix:
        """Displacements under forces with all relative displacements 0."""
        result, glued = self.factor.condense(forces), self.kept.glued
        inner = solve_lower(self.last.lower, glued.conj().T @ result[self._first :], transposed=False)
        result = result.conj().astype(np.result_type(result, glued.dtype))
        result[self._first :] = glued.conj() @ solve_lower(self.last.lower, inner.conj(), transposed=True)
        return self.factor.expand(result).conj()

    def equivalent(self, forces: Matrix) -> Matrix:
        """Forces (n_relative, n_vectors) on the relative displacements that are statically equivalent."""
        kept = self.factor.condense(forces)[self._first :]
        inner = solve_lower(self.last.lower, self.kept.glued.conj().T @ kept, transposed=False)
        return np.asarray(self.kept.relative.conj().T @ kept - self.last.below @ inner)

    def driven(self) -> Matrix:
        """Displacements (3 n_kept, n_relative) of the nodes of the pairs under unit relative displacements."""
        inner = solve_lower(self.last.lower, self.last.below.T, transposed=True).conj()
        return np.asarray(self.kept.relative.toarray() - self.kept.glued @ inner)


@dataclass(frozen=True)
class Reduction:
    """Forms of a structure that can be reduced at any nodal diameter.

    ordered: the structure.
    forms: matrices (3 n_nodes, 3 n_nodes), symmetric and unconstrained, by name, with "stiffness" and "mass".
    """

    ordered: OrderedStructure
    forms: Mapping[str, sparse.csr_matrix]
    _ordered_forms: dict[str, OrderedForm] = field(default_factory=dict)
    _factors: list[Factor] = field(default_factory=list)
    _condensed: list[Matrix] = field(default_factory=list)
    _unphased: dict[int, tuple[FrontFactor, Matrix | None]] = field(default_factory=dict)

    def solve_static(self, load: FloatArray) -> FloatArray:
        """Displacements (3 n_nodes,), m, of the glued structure at nodal diameter 0 under a load (3 n_nodes,), N.

        Raises GluedStructureError where the glued structure is not held, or unstable.
        """
        followers = self.ordered.followers(0)
        return np.asarray(followers @ self._glue(0).solve((followers.T @ load)[:, None])[:, 0])

    def frequencies(self, nodal_diameter: int, n_modes: int) -> FloatArray:
        """Lowest natural frequencies (n_modes,) of the glued structure, rad/s, ascending.

        Raises GluedStructureError where the glued structure is not held, or unstable.
        """
        return self._modes(self._glue(nodal_diameter), self.ordered.followers(nodal_diameter), n_modes)[0]

    def reduce(self, nodal_diameter: int, n_modes: int, vectors: FloatArray) -> ReducedStructure:
        """The structure at a nodal diameter in 0..n_sectors // 2.

        n_modes: stuck modes, at least 1; there are fewer where the structure has fewer. vectors (3 n_nodes, n_vectors):
        nodal forces.

        Raises GluedStructureError where the glued structure is not held, or unstable.
        """
        glued, followers = self._glue(nodal_diameter), self.ordered.followers(nodal_diameter)
        others = [name for name in self.forms if name != "stiffness"]
        condensed = self._project(glued, others, nodal_diameter)
        frequencies, modes = self._modes(glued, followers, n_modes)
        moved = followers @ modes
        inertia = {name: self.forms[name] @ moved for name in others}
        # forces in all columns, few at a time
        back = followers.conj().T.tocsr()
        forces = np.concatenate([vectors, *inertia.values()], axis=1)
        parts = range(0, forces.shape[1], _COLUMNS)
        equivalent = np.concatenate([glued.equivalent(back @ forces[:, n : n + _COLUMNS]) for n in parts], axis=1)
        n_vectors, n_found = vectors.shape[1], len(frequencies)
        # The shapes are those of the stiffness: it couples no mode with them.
        nothing = np.zeros((len(glued.stiffness), n_found))
        forms = {"stiffness": _joined(glued.stiffness, nothing, np.diag(frequencies**2))}
        for place, (name, part) in enumerate(zip(others, condensed, strict=True)):
            first = n_vectors + place * n_found
            own = np.eye(n_found) if name == "mass" else moved.conj().T @ inertia[name]
            forms[name] = _joined(part, equivalent[:, first : first + n_found], own)
        return ReducedStructure(
            frequencies=frequencies,
            forms=forms,
            vectors=np.concatenate([equivalent[:, :n_vectors], moved.conj().T @ vectors]),
        )

    def _project(self, glued: GluedStructure, names: list[str], nodal_diameter: int) -> list[Matrix]:
        """Forms (n_relative, n_relative) on the static shapes."""
        driven = glued.driven()
        forms = [self._form(name) for name in names]
        if self.ordered.supports.turned.any():
            return Projection(glued.factor, forms, self.ordered.supports.phase(nodal_diameter)).project(driven)
        if not self._condensed:
            self._condensed.extend(Projection(glued.factor, forms, 1.0).condense())
        projected = [driven.conj().T @ times(form, driven) for form in self._condensed]
        return [0.5 * (each + each.conj().T) for each in projected]

    def _form(self, name: str) -> OrderedForm:
        if name not in self._ordered_forms:
            self._ordered_forms[name] = self.ordered.order(self.forms[name], stiffness=name == "stiffness")
        return self._ordered_forms[name]

    def _glue(self, nodal_diameter: int) -> GluedStructure:
        ordered, kept = self.ordered, self.ordered.kept(nodal_diameter)
        phase = ordered.supports.phase(nodal_diameter)
        try:
            factor = self._factor(phase)
            left = factor.left
            glued, relative = left @ kept.glued, left @ kept.relative
            update = np.asfortranarray(kept.relative.conj().T @ relative)
            own, below = (
                np.asfortranarray(kept.glued.conj().T @ glued),
                np.asfortranarray(relative.conj().T @ kept.glued),
            )
            last = eliminate(own, below, update)
        except NotPositiveDefiniteError as error:
            raise GluedStructureError(unstable=error.unstable) from error
        return GluedStructure(factor, last, kept, mirrored(update))

    def _factor(self, phase: complex | float) -> Factor:
        if self.ordered.supports.turned.any():
            return factorise(self._form("stiffness"), self.ordered.dissection, phase, self._unphased)
        # no phase anywhere
        if not self._factors:
            self._factors.append(factorise(self._form("stiffness"), self.ordered.dissection, 1.0))
        return self._factors[0]

    def _modes(self, glued: GluedStructure, followers: sparse.csr_matrix, n_modes: int) -> tuple[FloatArray, Matrix]:
        """Frequencies and modes in the order of elimination, their phase fixed by what a random vector sees of them."""
        mass = (followers.conj().T @ self.forms["mass"] @ followers).tocsr()
        # A singular mass leaves nothing of some vectors: those that inertia drives all have mass.
        random = mass @ np.random.default_rng(0).standard_normal((mass.shape[0], _BLOCK)).astype(glued.last.lower.dtype)
        if mass.shape[0] <= _SMALL:
            squares, modes = _all_modes(glued, mass.toarray().astype(random.dtype), n_modes)
        else:
            squares, modes = lowest_modes(glued.solve, lambda vectors: mass @ vectors, glued.solve(random), n_modes)
        # No mode is orthogonal to a random vector: the component along the vector is made real and positive. The vector
        # has entries at nodes that follow no other only: it is the same, whether cut faces are kept or eliminated.
        sees = np.zeros((self.ordered.supports.n_nodes, 3))
        leading = self.ordered.leading
        sees[leading] = np.random.default_rng(0).standard_normal((len(leading), 3))
        seen = sees[self.ordered.free].ravel() @ modes
        return np.sqrt(squares), modes * (seen.conj() / np.abs(seen))


def _all_modes(glued: GluedStructure, mass: Matrix, n_modes: int) -> tuple[FloatArray, Matrix]:
    """Lowest modes as `lowest_modes` gives them, by dense matrices; as many as a singular mass (n, n) lets there be.

    With M = L L^H and the flexibility H = L^H K^-1 L the mode of an eigenvector y, H y = y / omega^2, is K^-1 L y.
    """
    values, vectors = np.linalg.eigh(mass)
    moved = values > _ROUND_OFF * values[-1]
    root = vectors[:, moved] * np.sqrt(values[moved])
    solved = glued.solve(root)
    flexibility = root.conj().T @ solved
    values, vectors = np.linalg.eigh(0.5 * (flexibility + flexibility.conj().T))
    found = np.flatnonzero(values > _ROUND_OFF * values[-1])[::-1][:n_modes]
    return 1.0 / values[found], solved @ (vectors[:, found] / values[found])


def _joined(relative: Matrix, coupling: Matrix, modal: Matrix) -> Matrix:
    whole = np.block([[relative, coupling], [coupling.conj().T, modal]])
    return np.asarray(0.5 * (whole + whole.conj().T))
