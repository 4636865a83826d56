"""Held displacements and linear constraints of a deck, SI: boundary conditions, equations, rigid and mean motions.

A reference node may follow the mean motion of a surface (*DISTRIBUTING). The surface has a mass by its area: its mean
motion is that of a rigid body with the same linear and angular momentum about the centre (Abaqus Theory Guide,
distributing coupling elements). A force on the reference node, which depends on the surface, is then shared by area,
and its moment about the centre by `F_i = w_i T^-1 M x r_i`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from solver.model import BoolArray, FloatArray, IntArray
from studies.fe_models.deck.contents import Deck, Equation, MeanMotion, RigidMotion
from studies.fe_models.files import Units
from studies.fe_models.from_files.selections import Selections
from studies.finite_element.constraints import Constraints, Dependence, eliminate
from studies.finite_element.solid_mesh import rigid_motions
from studies.finite_element.surfaces import faces_of_elements, integrate_shapes
from studies.scene_error import SceneError

_ROUND_OFF = 1e-9  # of a direction


@dataclass(frozen=True)
class Supported:
    """What holds and joins the nodes: those of the model, then `extra` (m,), the numbers of nodes without elements.

    held (n, 3): displacements that are 0 or follow others. own (n, 3): those that are 0 by a boundary condition.
    references: rows of nodes without elements. forces (3 n,): constant nodal forces, N. motions (3 m, 6): of the extra
    ones where all moves as one body, see `rigid_motions`.
    """

    held: BoolArray
    extra: IntArray
    constraints: Constraints | None
    own: BoolArray
    forces: FloatArray
    references: Mapping[int, int]
    motions: FloatArray


def find_constraints(selections: Selections, numbers: IntArray, clamped: IntArray | None, cut: IntArray) -> Supported:
    """Held displacements, constraints and nodal forces of a deck.

    numbers (n_nodes,): nodes of the model, in any order. clamped: rows of nodes that the study holds in place of the
    deck's boundary conditions; None of none. cut: rows of nodes on cut faces. Raises SceneError where a displacement
    depends on others and is held, depends twice, or nodes are missing.
    """
    deck, rows = selections.deck, {("", number): row for row, number in enumerate(numbers.tolist())}
    means = (each for motion in deck.mean_motions for each in _mean_motion(selections, motion))
    deck = replace(deck, equations=(*deck.equations, *means))
    return _Builder(deck, numbers, selections.units, set(cut.tolist()), rows).build(clamped)


@dataclass
class _Builder:
    """rows: of nodes, kind "", of the "turn" of reference nodes, and of displacements in "own" directions of a node, by
    kind and number. extra: numbers of all that is not in the model.
    """

    deck: Deck
    numbers: IntArray
    units: Units
    cut: set[int]
    rows: dict[tuple[str, int], int]
    extra: list[int] = field(default_factory=list)
    oblique: dict[int, FloatArray] = field(default_factory=dict)
    entries: list[Dependence] = field(default_factory=list)

    def build(self, clamped: IntArray | None) -> Supported:
        deck = self.deck
        self.first_terms = {int(equation.nodes[0]) for equation in deck.equations}
        self.frames = {int(node): each for each in deck.transforms for node in each.nodes}
        for motion in deck.rigid_motions:
            self._rigid(motion)
        for equation in deck.equations:
            for node in equation.nodes:
                self._row(int(node), equation.place)
        held = self._held_by_deck() if clamped is None else {3 * row + k for row in clamped.tolist() for k in range(3)}
        for equation in deck.equations:
            self._equation(equation)
        forces = self._forces()
        own: BoolArray = np.isin(np.arange(len(forces)), list(held)).reshape(-1, 3)
        extra = np.array(self.extra, dtype=np.int64)
        references = {node: row for (kind, node), row in self.rows.items() if not kind and row >= len(self.numbers)}
        constraints, fixed = None, own.copy()
        if self.entries or self.oblique:
            everything = np.concatenate([self.numbers, extra])
            constraints, fixed = eliminate(self.entries, own, self.oblique, everything, len(self.numbers))
        return Supported(fixed, extra, constraints, own, forces, references, self._motions())

    def _motions(self) -> FloatArray:
        """Motions (3 m, 6) of the extra nodes where all moves as one body; rotations turn with it."""
        rotations = {motion.rotation for motion in self.deck.rigid_motions if motion.rotation}
        numbers = np.array(self.extra, dtype=np.int64)
        motions = rigid_motions(self.deck.coordinates[self.deck.rows_of_nodes(numbers)] * self.units.length)
        for (kind, number), row in self.rows.items():
            if row >= len(self.numbers) and (kind == "turn" or number in rotations):
                motions[row - len(self.numbers)] = np.eye(3, 6, 3)
            elif kind == "own":
                motions[row - len(self.numbers)] = self._frame(number) @ motions[row - len(self.numbers)]
        return motions.reshape(-1, 6)

    def _row(self, number: int, place: str, kind: str = "") -> int:
        """Row of a node, or of what else it has; what is not there is added. Raises SceneError where it is no node."""
        if (kind, number) not in self.rows:
            if not np.isin(number, self.deck.node_numbers):
                raise SceneError("model", f"{place}: there is no node {number}", "define it with *NODE")
            self.rows[kind, number] = len(self.numbers) + len(self.extra)
            self.extra.append(number)
        return self.rows[kind, number]

    def _turn(self, motion: RigidMotion) -> int:
        """Row of the rotations of a reference node."""
        return self._row(motion.rotation or motion.reference, motion.place, "" if motion.rotation else "turn")

    def _rigid(self, motion: RigidMotion) -> None:
        """`u = u_reference + theta x arm` for each node."""
        nodes = np.array([self._row(int(node), motion.place) for node in motion.nodes])
        partly = [node for node in motion.nodes if int(node) in self.frames] if len(motion.dofs) < 3 else []
        if partly:
            found = f"{motion.place}: some dofs of node {partly[0]}, which has *TRANSFORM, follow"
            raise SceneError("model", found, "let all of its dofs follow, or leave *TRANSFORM out")
        reference = self._row(motion.reference, motion.place)
        directions = np.array(motion.dofs) - 1
        dependent = (3 * nodes[:, None] + directions).ravel()
        rows = np.arange(len(dependent))
        parts = [(rows, 3 * reference + np.tile(directions, len(nodes)), np.ones(len(rows)))]
        if motion.turns:
            turn, deck = self._turn(motion), self.deck
            places = deck.coordinates[deck.rows_of_nodes(np.append(motion.nodes, motion.reference))]
            arms = (places[:-1] - places[-1]) * self.units.length
            moved = rigid_motions(arms)[:, directions, 3:].reshape(-1, 3)  # theta_k e_k x arm
            parts += [(rows, np.full(len(rows), 3 * turn + k), moved[:, k]) for k in range(3)]
        row, column, value = (np.concatenate(each) for each in zip(*parts, strict=True))
        self.entries.append(Dependence(dependent, row, column, value, motion.place))

    def _held_by_deck(self) -> set[int]:
        """Displacements that boundary conditions hold, of nodes with directions of their own in these."""
        held: set[int] = set()
        wanted: dict[int, set[int]] = {}
        for boundary in self.deck.boundaries:
            first, last = max(boundary.first_dof, 1), min(boundary.last_dof, 6)
            if first <= min(last, 3) and boundary.value != 0.0:
                found = f"{boundary.place} moves nodes by {boundary.value:g}"
                raise SceneError("clamp", found, "hold it, or give `clamp`")
            for node in boundary.nodes:
                wanted.setdefault(int(node), set()).update(range(first, last + 1))
        turns = {motion.reference: self._turn(motion) for motion in self.deck.rigid_motions if motion.turns}
        for node, dofs in wanted.items():
            if ("", node) in self.rows:
                held.update(self._held(node, sorted(dof - 1 for dof in dofs if dof <= 3)))
            if node in turns:
                held.update(3 * turns[node] + dof - 4 for dof in dofs if dof > 3)
        return held

    def _held(self, node: int, local: list[int]) -> list[int]:
        """Displacements that are 0 where those along some directions of a node are."""
        row = self.rows["", node]
        if node not in self.frames:
            return [3 * row + k for k in local]
        frame = self._frame(node)
        across = frame[local].T @ frame[local]
        straight = np.abs(across - np.diag(np.round(np.diag(across)))).max() < _ROUND_OFF
        if straight and not (row in self.cut and 0 < len(local) < 3):
            return [3 * row + int(k) for k in np.flatnonzero(np.round(np.diag(across)))]
        if node in self.first_terms:
            return [3 * self._own_directions(node) + k for k in local]
        self.oblique[row] = across
        return []

    def _own_directions(self, node: int) -> int:
        """Row of a node in its own directions, on which the node of the model depends."""
        place, new, own = self.frames[node].place, ("own", node) not in self.rows, self.rows["", node]
        row = self._row(node, place, "own")
        if new:
            frame = self._frame(node)
            rows, columns = np.divmod(np.arange(9), 3)
            self.entries.append(Dependence(3 * own + np.arange(3), rows, 3 * row + columns, frame.T.ravel(), place))
        return row

    def _frame(self, node: int) -> FloatArray:
        """Unit vectors (3, 3), one a row, of the dofs 1 to 3 of a node. Raises SceneError of a node on the axis."""
        if (transform := self.frames.get(node)) is None:
            return np.eye(3)
        start, end = transform.points
        if not transform.cylindrical:
            third = np.cross(start, end)
            frame = np.stack([start, np.cross(third, start), third])
        else:
            arm = self.deck.coordinates[self.deck.rows_of_nodes(np.array([node]))][0] - start
            axis = (end - start) / np.linalg.norm(end - start)
            radial = arm - (arm @ axis) * axis
            if not np.linalg.norm(radial) > _ROUND_OFF * np.linalg.norm(end - start):
                raise SceneError("model", f"{transform.place}: node {node} is on the axis", "take it out of the set")
            frame = np.stack([radial, np.cross(axis, radial), axis])
        return np.asarray(frame / np.linalg.norm(frame, axis=1, keepdims=True))

    def _equation(self, equation: Equation) -> None:
        """The first term from the others."""
        terms: list[tuple[int, float]] = []
        for at, (node, dof, value) in enumerate(zip(equation.nodes, equation.dofs, equation.coefficients, strict=True)):
            row, number = self._row(int(node), equation.place), int(node)
            if dof > 3:
                row = self.rows.get(("turn", number), -1)
                if row < 0 or dof > 6:
                    found = f"{equation.place}: node {number} has no dof {dof}"
                    raise SceneError("model", found, "give displacements 1 to 3, or the rotation of a reference node")
                terms.append((3 * row + int(dof) - 4, value * self.units.length))
                continue
            direction = self._frame(number)[dof - 1]
            axis = int(np.argmax(np.abs(direction)))
            if abs(direction[axis]) > 1.0 - _ROUND_OFF and ("own", number) not in self.rows:
                terms.append((3 * row + axis, value * float(np.sign(direction[axis]))))
            elif at == 0 or ("own", number) in self.rows:
                terms.append((3 * self._own_directions(number) + int(dof) - 1, float(value)))
            else:
                terms += [(3 * row + k, float(value * direction[k])) for k in range(3)]
        (dependent, first), others = terms[0], terms[1:]
        columns = np.array([dof for dof, _ in others], dtype=np.int64)
        values = np.array([-value / first for _, value in others])
        rows = np.zeros(len(others), dtype=np.int64)
        self.entries.append(Dependence(np.array([dependent]), rows, columns, values, equation.place))

    def _forces(self) -> FloatArray:
        """Forces (3 n,), N."""
        forces = np.zeros((len(self.numbers) + len(self.extra), 3))
        for force in self.deck.forces:
            for node in force.nodes:
                if ("", int(node)) not in self.rows or force.first_dof > 3:
                    if force.value == 0.0:
                        continue
                    found = f"{force.place}: node {node} has no dof {force.first_dof}"
                    raise SceneError("model", found, "give forces on nodes of elements, or of reference nodes")
                direction = self._frame(int(node))[force.first_dof - 1]
                forces[self.rows["", int(node)]] += self.units.force * force.value * direction
        return forces.ravel()


def _mean_motion(selections: Selections, motion: MeanMotion) -> Iterator[Equation]:
    """An equation, in the units of the file, for each dof of a reference node; of its rotations where one is joined."""
    deck, mesh, surface = selections.deck, selections.mesh, selections.deck.surfaces[motion.surface]
    faces = faces_of_elements(mesh, motion.surface, surface.elements, surface.faces)
    weights = integrate_shapes(mesh.coordinates, faces)[0]
    nodes = np.unique([node for face in faces for node in face.nodes]).astype(np.int64)
    numbers = mesh.numbers[nodes]
    joined = _check(deck, motion, numbers)
    weights = weights[nodes] / weights.sum()
    places = deck.coordinates[deck.rows_of_nodes(np.append(numbers, motion.reference))]
    centre = weights @ places[:-1]
    arms, arm = places[:-1] - centre, places[-1] - centre
    cross = np.cross(arms[:, None], np.eye(3)).swapaxes(1, 2)  # arm x u = cross @ u
    inertia = np.einsum("i,iab,icb->ac", weights, cross, cross)
    # rows (3, n, 3) of the mean rotation and of the displacement of the reference node
    turn = np.einsum("ab,i,ibc->aic", np.linalg.inv(inertia), weights, cross)
    moved = weights[:, None] * np.eye(3)[:, None] + np.einsum("ba,bic->aic", np.cross(np.eye(3), arm), turn)
    of_dofs = np.tile([1, 2, 3], len(numbers))
    for dof, row in enumerate((*moved, *turn), 1):
        if dof <= 3 or (joined and dof in motion.turns):
            terms = np.append(motion.reference, np.repeat(numbers, 3)), np.append(dof, of_dofs)
            yield Equation(motion.place, *terms, np.append(1.0, -row.ravel()))


def _check(deck: Deck, motion: MeanMotion, numbers: IntArray) -> bool:
    """Whether something is joined to the rotations of the reference node. numbers: of the nodes of the surface.

    Raises SceneError where dofs of the nodes are along other axes, or the rotations are held or those of another node.
    """
    reference = motion.reference
    turned = np.intersect1d(np.append(numbers, reference), [node for each in deck.transforms for node in each.nodes])
    joined = [each for each in deck.rigid_motions if each.reference == reference and each.turns]
    held = any(reference in each.nodes and each.last_dof > 3 for each in deck.boundaries)
    for wrong, found, remedy in (
        (not numbers.size, f"{motion.surface} has no face", "give faces that no step takes away"),
        (reference in numbers, f"the reference node {reference} is on the surface", "give a node of its own"),
        (turned.size, f"node {min(turned, default=0)} has *TRANSFORM", "leave *TRANSFORM out there"),
        (held, f"the rotations of node {reference} are held", "hold nodes of the surface, or leave it out"),
        (any(each.rotation for each in joined), f"node {reference} has a ROT NODE", "leave ROT NODE out"),
    ):
        if wrong:
            raise SceneError("model", f"{motion.place}: {found}", remedy)
    return bool(joined)
