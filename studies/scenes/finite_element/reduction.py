"""Craig-Bampton reduction of a sector to its relative displacements and stuck modes.

Nodes are eliminated front by front, those of the contact pairs last. What is left of the stiffness is the reduced one;
mass and other forms go along (`condensation`), so that the static shapes are never formed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from solver.model import FloatArray, IntArray, Matrix
from studies.scenes.finite_element.condensation.dissection import Dissection, dissect
from studies.scenes.finite_element.condensation.factor import (
    Factor,
    FrontFactor,
    NotPositiveDefiniteError,
    eliminate,
    factorise,
    mirrored,
    solve_lower,
)
from studies.scenes.finite_element.condensation.modes import lowest_modes
from studies.scenes.finite_element.condensation.ordered_form import OrderedForm, order_form
from studies.scenes.finite_element.condensation.projection import Projection
from studies.scenes.finite_element.contact_pairs import ContactPairs
from studies.scenes.finite_element.cyclic import CyclicSector

_BLOCK = 8  # modes are looked for with so many vectors at a time


class GluedSectorError(ValueError):
    """The glued sector is singular, or unstable from spin softening."""


@dataclass(frozen=True)
class ReducedSector:
    """A sector in the coordinates [relative displacements | stuck modes], `n` of them, at one nodal diameter.

    frequencies (n_modes,): natural frequencies of the glued sector, rad/s, ascending. The modes have unit modal mass.
    stiffness, mass, elastic (n, n): Hermitian. vectors (n, n_vectors): generalised forces.
    """

    frequencies: FloatArray
    stiffness: Matrix
    mass: Matrix
    elastic: Matrix
    vectors: Matrix


@dataclass(frozen=True)
class GluedSector:
    """A sector whose stiffness is factorised with its pairs glued, at one nodal diameter.

    Displacements and forces (3 n_places, n_vectors) stand in the order of elimination, both nodes of the pairs last.
    factor: of all other nodes. last: of the fixed nodes of the pairs, which the moving ones follow. glued, relative
    (3 n_kept, ...): displacements of the nodes of the pairs from those of the fixed ones, and from the relative ones.
    stiffness (3 n_contact, 3 n_contact): what is left.
    """

    factor: Factor
    last: FrontFactor
    glued: sparse.csr_matrix
    relative: sparse.csr_matrix
    stiffness: Matrix

    def solve(self, forces: Matrix) -> Matrix:
        """Displacements under forces with all relative displacements 0."""
        first = 3 * self.factor.dissection.n_eliminated
        result = self.factor.condense(forces)
        fixed = solve_lower(self.last.lower, self.glued.T @ result[first:], transposed=False)
        result = result.conj()
        result[first:] = self.glued @ solve_lower(self.last.lower, fixed.conj(), transposed=True)
        return self.factor.expand(result).conj()

    def equivalent(self, forces: Matrix) -> Matrix:
        """Forces (3 n_contact, n_vectors) on the relative displacements that are statically equivalent."""
        kept = self.factor.condense(forces)[3 * self.factor.dissection.n_eliminated :]
        fixed = solve_lower(self.last.lower, self.glued.T @ kept, transposed=False)
        return np.asarray(self.relative.T @ kept - self.last.below @ fixed)

    def driven(self) -> Matrix:
        """Displacements (3 n_kept, 3 n_contact) of the nodes of the pairs under unit relative displacements."""
        fixed = solve_lower(self.last.lower, self.last.below.T, transposed=True).conj()
        return np.asarray(self.relative.toarray() - self.glued @ fixed)


@dataclass(frozen=True)
class OrderedSector:
    """A sector with its nodes in an order of elimination, for any nodal diameter.

    dissection: of the nodes that take part. place (n_nodes,): of each node, or its master, in the order; -1 where held.
    free (n_free,): nodes that take part, by their place.
    """

    sector: CyclicSector
    pairs: ContactPairs
    dissection: Dissection
    place: IntArray
    free: IntArray

    def order(self, matrix: sparse.bsr_matrix) -> OrderedForm:
        """A form (3 n_nodes, 3 n_nodes) of all nodes in the order of elimination."""
        return order_form(matrix, self.dissection, self.place, self.sector.turned, self.sector.rotation)

    def followers(self, nodal_diameter: int) -> sparse.csr_matrix:
        """Displacements (3 n_nodes, 3 n_places) of all nodes from those in the order of elimination."""
        return self.sector.followers(self.place, len(self.free), nodal_diameter)

    def kept(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """`glued` and `relative` of `GluedSector`."""
        first, pairs = self.dissection.n_eliminated, self.pairs
        n_kept, n_contact = len(self.free) - first, len(pairs.moving)
        movable, follows = np.unique(self.place[pairs.fixed], return_inverse=True)
        held = int(len(movable) > 0 and movable[0] < 0)
        fixed = movable[held:]
        glued = np.zeros((n_kept, 3, len(fixed), 3))
        relative = np.zeros((n_kept, 3, n_contact, 3))
        glued[fixed - first, :, np.arange(len(fixed))] = np.eye(3)
        moving = self.place[pairs.moving] - first
        loose = follows >= held
        glued[moving[loose], :, follows[loose] - held] = np.eye(3)
        relative[moving, :, np.arange(n_contact)] = np.swapaxes(pairs.frames, 1, 2)
        return (
            sparse.csr_matrix(glued.reshape(3 * n_kept, 3 * len(fixed))),
            sparse.csr_matrix(relative.reshape(3 * n_kept, 3 * n_contact)),
        )


def order_sector(
    sector: CyclicSector, pairs: ContactPairs, matrix: sparse.bsr_matrix, positions: FloatArray | IntArray
) -> OrderedSector:
    """Order of elimination of a sector.

    Parameters
    ----------
    sector, pairs
        Neither node of a pair lies on the right cut face.
    matrix
        (3 n_nodes, 3 n_nodes): its blocks of 3 show which nodes are coupled.
    positions
        (n_nodes, n_directions): coordinates, or places in a structured grid.
    """
    master = sector.master
    free = np.flatnonzero(master == np.arange(sector.n_nodes))
    number = np.full(sector.n_nodes + 1, -1)
    number[free] = np.arange(len(free))
    node = number[master]
    rows = node[np.repeat(np.arange(sector.n_nodes), np.diff(matrix.indptr))]
    columns = node[matrix.indices]
    both = (rows >= 0) & (columns >= 0)
    ones = np.ones(np.count_nonzero(both), dtype=np.int8)
    couplings = sparse.csr_matrix((ones, (rows[both], columns[both])), shape=(len(free), len(free)))
    kept = np.isin(free, np.concatenate([pairs.moving, pairs.fixed]))
    dissection = dissect(couplings, positions[free], kept)
    place = np.empty(len(free) + 1, dtype=np.int64)
    place[dissection.order] = np.arange(len(free))
    place[-1] = -1
    return OrderedSector(sector, pairs, dissection, place[node], free[dissection.order])


@dataclass(frozen=True)
class SectorReduction:
    """Stiffness and mass of a sector, to be reduced at any nodal diameter.

    Parts that no cut face touches do not depend on it, and are eliminated once.

    ordered: the sector. stiffness, mass: (3 n_nodes, 3 n_nodes), unconstrained, symmetric, in blocks of 3.
    """

    ordered: OrderedSector
    stiffness: sparse.bsr_matrix
    mass: sparse.bsr_matrix
    _forms: dict[str, OrderedForm] = field(default_factory=dict)
    _unphased: dict[int, tuple[FrontFactor, Matrix | None]] = field(default_factory=dict)

    def _glue(self, nodal_diameter: int) -> GluedSector:
        if "stiffness" not in self._forms:
            self._forms["stiffness"] = self.ordered.order(self.stiffness)
        return glue(self.ordered, self._forms["stiffness"], nodal_diameter, self._unphased)

    def frequencies(self, nodal_diameter: int, n_modes: int) -> FloatArray:
        """Lowest natural frequencies (n_modes,) of the glued sector, rad/s, ascending.

        Raises GluedSectorError where the glued sector is singular or, from spin softening, unstable.
        """
        followers = self.ordered.followers(nodal_diameter)
        return self._modes(self._glue(nodal_diameter), followers, n_modes)[0]

    def _modes(self, glued: GluedSector, followers: sparse.csr_matrix, n_modes: int) -> tuple[FloatArray, Matrix]:
        """Frequencies and modes in the order of elimination, their phase fixed by what a random vector sees of them."""
        mass = (followers.conj().T @ self.mass @ followers).tocsr()
        rng = np.random.default_rng(0)
        start = glued.solve(rng.standard_normal((mass.shape[0], _BLOCK)).astype(mass.dtype))
        squares, modes = lowest_modes(glued.solve, lambda vectors: mass @ vectors, start, n_modes)
        # No mode is orthogonal to a random vector: what that sees of a mode is made real and positive.
        sees = np.zeros((self.ordered.sector.n_nodes, 3))
        inner = np.setdiff1d(self.ordered.free, self.ordered.pairs.moving)
        sees[inner] = np.random.default_rng(0).standard_normal(3 * len(inner)).reshape(-1, 3)
        seen = sees[self.ordered.free].ravel() @ modes
        return np.sqrt(squares), modes * (seen.conj() / np.abs(seen))

    def reduce(
        self, nodal_diameter: int, n_modes: int, elastic: sparse.bsr_matrix | None, vectors: FloatArray
    ) -> ReducedSector:
        """The sector at a nodal diameter in 0..n_sectors // 2.

        Parameters
        ----------
        nodal_diameter
            Of the sector's motion.
        n_modes
            Stuck modes, at least 1.
        elastic
            Another form, like the stiffness; None where it is the stiffness.
        vectors
            (3 n_nodes, n_vectors): nodal forces.

        Raises
        ------
        GluedSectorError
            Where the glued sector is singular or, from spin softening, unstable.
        """
        glued = self._glue(nodal_diameter)
        others = {"mass": self.mass} if elastic is None else {"mass": self.mass, "elastic": elastic}
        for name, matrix in others.items():
            if name not in self._forms:
                self._forms[name] = self.ordered.order(matrix)
        projection = Projection(
            glued.factor, [self._forms[name] for name in others], self.ordered.sector.phase(nodal_diameter)
        )
        condensed = projection.project(glued.driven())

        followers = self.ordered.followers(nodal_diameter)
        frequencies, modes = self._modes(glued, followers, n_modes)
        moved = followers @ modes
        forces = [vectors, *(matrix @ moved for matrix in others.values())]
        back = followers.conj().T.tocsr()
        equivalent = glued.equivalent(np.concatenate([back @ force for force in forces], axis=1))
        n_vectors = vectors.shape[1]
        results = {}
        for place, (name, part) in enumerate(zip(others, condensed, strict=True)):
            first = n_vectors + place * n_modes
            coupling = equivalent[:, first : first + n_modes]
            own = np.eye(n_modes) if name == "mass" else moved.conj().T @ forces[1 + place]
            results[name] = _joined(part, coupling, own)
        # The shapes are those of the stiffness: it couples no mode with them.
        nothing = np.zeros((len(glued.stiffness), n_modes))
        stiffness = _joined(glued.stiffness, nothing, np.diag(frequencies**2))
        return ReducedSector(
            frequencies=frequencies,
            stiffness=stiffness,
            mass=results["mass"],
            elastic=results.get("elastic", stiffness),
            vectors=np.concatenate([equivalent[:, :n_vectors], moved.conj().T @ vectors]),
        )


def glue(
    ordered: OrderedSector,
    stiffness: OrderedForm,
    nodal_diameter: int,
    unphased: dict[int, tuple[FrontFactor, Matrix | None]] | None = None,
) -> GluedSector:
    """Factorises a stiffness; unphased: as for `factorise`.

    Raises GluedSectorError where the glued sector is singular or, from spin softening, unstable.
    """
    glued, relative = ordered.kept()
    try:
        factor = factorise(stiffness, ordered.dissection, ordered.sector.phase(nodal_diameter), unphased)
        left = factor.left
        update = np.asfortranarray(relative.T @ left @ relative)
        own, below = np.asfortranarray(glued.T @ left @ glued), np.asfortranarray(relative.T @ left @ glued)
        last = eliminate(own, below, update)
    except NotPositiveDefiniteError as error:
        if error.unstable:
            raise GluedSectorError("the glued sector is unstable: spin softening exceeds its stiffness") from error
        raise GluedSectorError("the stiffness of the glued sector is singular") from error
    return GluedSector(factor, last, glued, relative, mirrored(update))


def solve_glued(ordered: OrderedSector, stiffness: sparse.bsr_matrix, load: FloatArray) -> FloatArray:
    """Nodal displacements (3 n_nodes,), m, of the glued sector at nodal diameter 0 under a nodal load (3 n_nodes,).

    Raises GluedSectorError where the stiffness is singular.
    """
    followers = ordered.followers(0)
    solved = glue(ordered, ordered.order(stiffness), 0).solve((followers.T @ load)[:, None])
    return np.asarray(followers @ solved[:, 0])


def _joined(relative: Matrix, coupling: Matrix, modal: Matrix) -> Matrix:
    whole = np.block([[relative, coupling], [coupling.conj().T, modal]])
    return np.asarray(0.5 * (whole + whole.conj().T))
