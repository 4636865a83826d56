"""Craig-Bampton reduction of a model to relative displacements of its pairs and modes with the pairs glued.

The static shapes of the relative displacements, and the lowest modes of the glued structure, are the coordinates: the
stiffness couples no mode with a shape. One factorisation of the glued stiffness at a nodal diameter gives both.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.linalg import eigh, qr

from solver.model import FloatArray, Matrix
from studies.finite_element.elimination import Dissection, Factor, NotPositiveDefiniteError, dissect, factorise
from studies.finite_element.pairing import ContactPairs
from studies.finite_element.solid_mesh import Rotation
from studies.finite_element.structure import Coordinates, Structure
from studies.scene_error import SceneError

_COLUMNS = 128  # vectors solved for at a time
_BLOCK = 8  # modes are looked for with so many vectors at a time
_SMALL = 400  # displacements of a structure whose modes are found by dense matrices
_STIFF = 1e-11  # flexibility of a mode that is round-off of the largest one, as of a singular mass
_DEPENDENT = 1e-12  # of a block: what is left of it where it depends on those before
_SAME, _ROUND_OFF = 1e-11, 1e-14  # change of a flexibility that is none, over itself and over the largest one


@dataclass(frozen=True)
class PreparedModel:
    """A model that can be reduced at any nodal diameter in 0..n_sectors // 2.

    forms: matrices (3 n_nodes, 3 n_nodes), symmetric and unconstrained, by name: "stiffness", "mass", "elastic" for the
    stiffness without prestress where that differs, "damping" where the model has one. positions (n_nodes,
    n_directions): of the nodes, for the order of elimination. static_load (3 n_nodes,): N. weight (n_nodes,): kg of
    each node. rotation: None at rest. rounding: of the stiffness, as in `rounding_of`. dissections: filled by the first
    factorisation; all others have the same order.

    All methods raise SceneError where the glued structure is not held, or unstable.
    """

    structure: Structure
    forms: Mapping[str, sparse.csr_matrix]
    positions: FloatArray
    static_load: FloatArray
    weight: FloatArray
    rotation: Rotation | None
    rounding: float = 0.0
    dissections: list[Dissection] = field(default_factory=list)

    @property
    def pairs(self) -> ContactPairs:
        """Contact pairs."""
        return self.structure.pairs

    def solve_static(self, load: FloatArray) -> FloatArray:
        """Displacements (3 n_nodes,), m, of the glued structure at nodal diameter 0 under a load (3 n_nodes,), N."""
        coordinates, _, factor = self._factorise(0)
        glued = coordinates.glued
        return np.asarray(glued @ factor.solve((glued.T @ load)[:, None])[:, 0])

    def frequencies(self, nodal_diameter: int, n_modes: int, stiffness: str = "stiffness") -> FloatArray:
        """Lowest natural frequencies (n_modes,) of the glued structure, Hz, ascending. stiffness: name of the form."""
        coordinates, form, factor = self._factorise(nodal_diameter, stiffness)
        mass = _projected(coordinates.glued, self.forms["mass"])
        return _lowest_modes(form, mass, factor, n_modes)[0] / (2.0 * np.pi)

    def reduce(
        self, nodal_diameter: int, n_modes: int, vectors: FloatArray
    ) -> tuple[FloatArray, dict[str, Matrix], Matrix]:
        """The structure in the coordinates [relative displacements | stuck modes], n of them, at a nodal diameter.

        Frequencies (n_modes,) of the glued structure, rad/s, ascending; the forms, Hermitian matrices (n, n), modes
        have unit modal mass; generalised forces (n, n_vectors).

        n_modes: stuck modes, at least 1; there are fewer where the structure has fewer. vectors (3 n_nodes, n_vectors):
        nodal forces.
        """
        coordinates, stiffness, factor = self._factorise(nodal_diameter)
        glued, relative = coordinates.glued, coordinates.relative
        shapes = _static_shapes(coordinates, self.forms["stiffness"], factor)
        frequencies, modes = _lowest_modes(stiffness, _projected(glued, self.forms["mass"]), factor, n_modes)
        moved, forms = glued @ modes, {}
        for name, form in self.forms.items():
            if name == "stiffness":  # no force but at the pairs
                own = (form @ relative).conj().T @ shapes
                coupling, modal = np.zeros((len(own), len(frequencies))), np.diag(frequencies**2)
            else:
                inertia = form @ moved
                own, coupling = _on_shapes(form, shapes), shapes.conj().T @ inertia
                modal = np.eye(len(frequencies)) if name == "mass" else moved.conj().T @ inertia
            whole = np.block([[own, coupling], [coupling.conj().T, modal]])
            forms[name] = np.asarray(0.5 * (whole + whole.conj().T))
        return frequencies, forms, np.concatenate([shapes.conj().T @ vectors, moved.conj().T @ vectors])

    def find_resistance(self, motions: FloatArray) -> tuple[float, str]:
        """How much constraints resist a motion as one body, Hz, and which of them resists most; 0 where none does.

        motions (3 n_nodes, 6): three translations and three turns, of a cyclic sector about a point on its axis. Where
        some displacements of a motion r depend on others, all that follow these are e away from it: the frequency is
        that of the strain energy, `omega^2 = e^H K e / (r^H M r)`. What is held does not count. Of a cyclic sector the
        motions across the axis are waves of nodal diameter 1.
        """
        structure, ways = self.structure, {0: np.eye(3)}
        if structure.cut is not None:
            axis = structure.cut.axis.axis
            across = np.linalg.svd(axis[None])[2][1]
            ways = {0: axis[:, None], 1: (across + 1j * np.cross(axis, across))[:, None]}
        worst, shares = 0.0, np.zeros(len(motions))
        for nodal_diameter, way in ways.items():
            for motion in np.hstack([motions[:, :3] @ way, motions[:, 3:] @ way]).T:
                apart, total = structure.deviation(motion, nodal_diameter)
                forces = self.forms.get("elastic", self.forms["stiffness"]) @ (total @ apart)
                own = ((total.conj().T @ forces).conj() * apart).real
                inertia = np.vdot(motion, self.forms["mass"] @ motion).real
                if inertia > 0.0 and own.sum() > worst * inertia:
                    worst, shares = own.sum() / inertia, own
        names = {**structure.constraints.origin}
        names.update(zip(structure.followers.tolist(), structure.labels, strict=True))
        sums: dict[str, float] = {}
        for node in np.flatnonzero(shares.reshape(-1, 3).any(axis=1)).tolist():
            sums[names[node]] = sums.get(names[node], 0.0) + shares[3 * node : 3 * node + 3].sum()
        return float(np.sqrt(worst) / (2.0 * np.pi)), max(sums, key=lambda name: sums[name], default="")

    def _factorise(self, nodal_diameter: int, name: str = "stiffness") -> tuple[Coordinates, sparse.csr_matrix, Factor]:
        """Coordinates at a nodal diameter, a stiffness with the pairs glued, and its factors."""
        coordinates = self.structure.coordinates(nodal_diameter)
        stiffness = _projected(coordinates.glued, self.forms[name])
        if not self.dissections:
            # where phases cancel at one of these diameters they do not at the other
            glued = sum(abs(self.structure.coordinates(diameter).glued) for diameter in (0, 1))
            everything = _projected(glued.tocsr(), sum(abs(form) for form in self.forms.values()))
            self.dissections.append(dissect(everything, coordinates.node, self.positions))
        try:
            return coordinates, stiffness, factorise(stiffness, self.dissections[0], self.rounding)
        except NotPositiveDefiniteError as error:
            at = f"at nodal diameter {nodal_diameter}"
            if error.unstable:
                rpm = None if self.rotation is None else np.sqrt(self.rotation.omega_squared) * 30.0 / np.pi
                speed = "that of the matrices" if rpm is None else f"{rpm:.6g}"
                found = "the glued structure is unstable: spin softening exceeds its stiffness"
                raise SceneError("rotation_speed", speed, f"reduce it: {at} {found}") from error
            digits = ", as far as the digits of the matrices tell" if self.rounding else ""
            found = f"{at} nothing holds the glued structure: its stiffness is singular{digits}"
            more = ", or write the matrices with more digits" if self.rounding else ""
            remedy = f"clamp nodes, or give a free body a `suspension`, Hz{more}"
            raise SceneError("clamp", found, f"{remedy}: with all pairs glued none may move freely") from error


def _projected(coordinates: sparse.csr_matrix, form: sparse.csr_matrix) -> sparse.csr_matrix:
    """A form in other coordinates."""
    return (coordinates.conj().T @ form @ coordinates).tocsr()


def _static_shapes(coordinates: Coordinates, stiffness: sparse.csr_matrix, factor: Factor) -> Matrix:
    """Displacements (3 n_nodes, n_relative) under unit relative displacements, with no force elsewhere."""
    glued, relative = coordinates.glued, coordinates.relative
    forces = (glued.conj().T @ stiffness @ relative).tocsc()
    shapes = np.empty(relative.shape, dtype=forces.dtype)
    for first in range(0, shapes.shape[1], _COLUMNS):
        part = slice(first, first + _COLUMNS)
        shapes[:, part] = relative[:, part].toarray() - glued @ factor.solve(forces[:, part].toarray())
    return shapes


def _on_shapes(form: sparse.csr_matrix, shapes: Matrix) -> Matrix:
    """`shapes^H form shapes` (n_relative, n_relative): its upper blocks are computed, the lower ones follow."""
    own: Matrix = np.empty_like(shapes, shape=(shapes.shape[1],) * 2)
    for first in range(0, len(own), _COLUMNS):
        part, before = slice(first, first + _COLUMNS), slice(first + _COLUMNS)
        own[before, part] = shapes[:, before].conj().T @ (form @ shapes[:, part])
        own[part, before] = own[before, part].conj().T
    return own


def _lowest_modes(
    stiffness: sparse.csr_matrix, mass: sparse.csr_matrix, factor: Factor, n_modes: int
) -> tuple[FloatArray, Matrix]:
    """Frequencies (n_modes,), rad/s, ascending, and modes (n, n_modes) of unit modal mass; fewer where there are fewer.

    Of `M x = K x / omega^2`, as the mass may be singular, in a growing space of vectors `(K^-1 M)^j x`, x random
    (block Lanczos). A random vector sees each mode as real and positive.
    """
    n, random = stiffness.shape[0], np.random.default_rng(0)
    small = n <= max(_SMALL, 4 * n_modes)
    block = np.eye(n) if small else random.standard_normal((n, _BLOCK)).astype(stiffness.dtype)
    inertia = mass @ block
    space = [np.zeros((n, 0), dtype=stiffness.dtype)] * 3  # the vectors, their products with the mass and the stiffness
    known = np.zeros(0)
    while True:
        if not small:
            block = _orthonormal(factor.solve(inertia), space[0])
        inertia = mass @ block
        new = block, inertia, stiffness @ block
        space = [np.concatenate(pair, axis=1) for pair in zip(space, new, strict=True)]
        adjoint = space[0].conj().T
        values, vectors = eigh(adjoint @ space[1], adjoint @ space[2])
        found = np.flatnonzero(values > _STIFF * values[-1])[::-1][:n_modes]
        if small or block.shape[1] == 0:
            break
        if len(known) == len(found) and (np.abs(values[found] - known) <= _SAME * known + _ROUND_OFF * known[0]).all():
            break
        known = values[found]
    modes = (space[0] @ vectors[:, found]) / np.sqrt(values[found])
    seen = random.standard_normal(n) @ modes
    return 1.0 / np.sqrt(values[found]), modes * (seen.conj() / np.abs(seen))


def _orthonormal(block: Matrix, basis: Matrix) -> Matrix:
    """What is new in vectors (n, n_columns) beside an orthonormal basis: twice, for round-off, which is left out."""
    scale = float(np.linalg.norm(block))
    for _ in range(2):
        block = block - basis @ (basis.conj().T @ block)
        block, sizes, _ = qr(block, mode="economic", pivoting=True, check_finite=False)
        block, scale = block[:, np.abs(np.diag(sizes)) > _DEPENDENT * scale], 1.0
    return block
