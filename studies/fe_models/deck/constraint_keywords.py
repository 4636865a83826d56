"""Keywords of linear constraints: equations, rigid bodies, couplings, and the directions of displacements."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from studies.fe_models.deck.draft import Draft, chosen, refused
from studies.fe_models.deck.mesh import Equation, IntArray, RigidMotion, Transform
from studies.fe_models.deck.sets import Reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import is_integer, read_fields, read_float, read_floats, read_integer
from studies.fe_models.text.read_errors import Place, shown

if TYPE_CHECKING:
    from studies.fe_models.deck.resolve import Resolved

_ALL = (1, 2, 3)


def read_transform(draft: Draft, block: Block) -> None:
    """*TRANSFORM: directions of the displacements of nodes."""
    kind = chosen(block, "TYPE", ("R", "C", "S"), "R")
    if kind == "S":
        raise refused(block, "spherical directions are not read", "give rectangular or cylindrical ones")
    nodes, scope = draft.named(block, "NSET"), draft.scope
    values = read_floats(block, 0, 6)
    points = np.array(values[:6]).reshape(2, 3)
    spans = points[1] - points[0] if kind == "C" else np.cross(points[0], points[1])
    if not 0 < np.linalg.norm(spans) < np.inf:
        raise block.place_of(0).wrong(f"*{block.written} by points on one line", "give points that are apart")

    def transforms(found: Resolved) -> list[Transform]:
        placed = found.placed(scope, points, vectors=kind == "R")
        return [Transform(f"{block.place}: *{block.written}", found.nodes(nodes)[1], kind == "C", placed)]

    draft.add("transforms", transforms)


def read_equation(draft: Draft, block: Block) -> None:
    """*EQUATION: the number of terms, then node or set, dof and coefficient of each; or REMOVE ALL in a step."""
    if "REMOVEALL" in block.parameters or "REMOVE" in block.parameters:
        if draft.step is None or "REMOVE" in block.parameters:
            raise refused(
                block, "REMOVE of some equations is not read", "write REMOVE ALL in the step that writes matrices"
            )
        draft.step.writes = True
        return
    line = 0
    while line < len(block.lines):
        place, first = block.place_of(line), read_fields(block, line)
        n_terms = read_integer(first[0] if first else "", place, "the number of terms")
        fields: list[str] = []
        while len(fields) < 3 * n_terms and line + 1 < len(block.lines):
            line += 1
            more = read_fields(block, line)
            fields += more + [""] * (-len(more) % 3)
        if len(fields) != 3 * n_terms:
            raise place.wrong(f"{len(fields)} entries for {n_terms} terms", "give node, dof and coefficient of each")
        terms = [
            (draft.refer(node, place), read_integer(dof, place, "a dof"), read_float(value, place))
            for node, dof, value in zip(fields[::3], fields[1::3], fields[2::3], strict=True)
        ]
        if terms[0][2] == 0.0:
            raise place.wrong("the first coefficient is 0", "give a first term that depends on the others")
        draft.add("equations", partial(_equations, terms=terms, place=place))
        line += 1


def _equations(found: Resolved, terms: list[tuple[Reference, int, float]], place: Place) -> Iterator[Equation]:
    """One equation, or one for each node of a set; single nodes are in all of them."""
    nodes = [found.ordered(reference) for reference, _, _ in terms]
    count = max(map(len, nodes))
    for (reference, _, _), each in zip(terms, nodes, strict=True):
        if len(each) not in (1, count) or not len(each) or len(nodes[0]) != count:
            remedy = "give sets of as many nodes as the first one, or one node"
            raise place.wrong(f"*EQUATION: {shown(str(reference.target))} has {len(each)} nodes", remedy)
    dofs, values = np.array([dof for _, dof, _ in terms]), np.array([value for _, _, value in terms])
    for row in range(count):
        own = np.array([each[min(row, len(each) - 1)] for each in nodes])
        yield Equation(f"{place}: *EQUATION", own, dofs, values)


def read_mpc(draft: Draft, block: Block) -> None:
    """*MPC: TIE and PIN join two nodes, BEAM makes a node follow the motion of another one."""
    for fields, place in draft.lines(block, 1, "type and nodes"):
        kind = fields[0].upper()
        if kind not in ("TIE", "PIN", "BEAM") or len(fields) != 3:
            remedy = "write TIE, PIN or BEAM and two nodes or sets, or *EQUATION"
            raise place.wrong(f"*{block.written} {shown(kind)} of {len(fields) - 1} nodes is not read", remedy)
        if kind == "BEAM":
            draft.notes.append(f"{place}: *{block.written} BEAM is rigid, as in Abaqus.")
        one, other = (draft.refer(text, place) for text in fields[1:])
        text = f"{place}: *{block.written}"
        draft.add("rigid_motions", partial(_mpc, one=one, other=other, text=text, turns=kind == "BEAM"))


def _mpc(found: Resolved, one: Reference, other: Reference, text: str, *, turns: bool) -> Iterator[RigidMotion]:
    """A node or set that follows a node, or the nodes of a set in their order."""
    first, second = found.ordered(one), found.ordered(other)
    if len(second) not in (1, len(first)) or not len(first):
        remedy = "give sets of as many nodes, or one node for all"
        raise one.place.wrong(f"*MPC of {len(first)} and {len(second)} nodes", remedy)
    parts = [first] if len(second) == 1 else np.split(first, len(first))
    for nodes, reference in zip(parts, second, strict=True):
        yield _motion(text, nodes, _ALL, int(reference), 0, one.place, turns=turns)


def read_rigid_body(draft: Draft, block: Block) -> None:
    """*RIGID BODY: nodes, or those of elements, follow a reference node."""
    text = f"{block.place}: *{block.written}"
    node_sets = [draft.named(block, key) for key in _SETS_OF_NODES if key in block.parameters]
    elements = [draft.named(block, "ELSET")] if "ELSET" in block.parameters else []
    if not node_sets and not elements:
        raise block.place.wrong(f"*{block.written} without NSET or ELSET", "give the nodes that are rigid")
    reference = draft.named(block, "REFNODE")
    rotation = draft.named(block, "ROTNODE") if "ROTNODE" in block.parameters else None

    def motions(found: Resolved) -> list[RigidMotion]:
        nodes = [found.nodes(each)[1] for each in node_sets] + [found.nodes_of(each) for each in elements]
        turned = 0 if rotation is None else found.node(rotation)
        return [_motion(text, np.unique(np.concatenate(nodes)), _ALL, found.node(reference), turned, block.place)]

    draft.add("rigid_motions", motions)


_SETS_OF_NODES = ("NSET", "PINNSET", "TIENSET")


def _motion(
    text: str,
    nodes: IntArray,
    dofs: tuple[int, ...],
    reference: int,
    rotation: int,
    place: Place,
    *,
    turns: bool = True,
) -> RigidMotion:
    nodes = nodes[(nodes != reference) & (nodes != rotation)]
    if not nodes.size:
        raise place.wrong("no node follows the reference node", "give the nodes that are rigid")
    return RigidMotion(text, nodes, dofs, reference, rotation, turns)


def read_coupling(draft: Draft, block: Block) -> None:
    """*COUPLING: a reference node and a surface; *KINEMATIC below it says what is coupled."""
    for parameter in ("REFNODE", "SURFACE"):
        block.name(parameter)
    draft.coupling = block


def read_kinematic(draft: Draft, block: Block) -> None:
    """*KINEMATIC: dofs of the surface of *COUPLING that follow its reference node; all of them without data."""
    head, draft.coupling = draft.coupling, None
    if head is None:
        raise block.place.wrong(f"*{block.written} without *COUPLING", "write it below its *COUPLING")
    lines = [_dofs(read_fields(block, line), block.place_of(line)) for line in range(len(block.lines))]
    following = tuple(dof for dof in _ALL if not lines or any(dof in dofs for dofs in lines))
    surface, reference = (draft.named(head, key) for key in ("SURFACE", "REFNODE"))
    text = f"{block.place}: *{block.written}"

    def motions(found: Resolved) -> list[RigidMotion]:
        nodes = found.surface_nodes(found.surface(surface))
        return [_motion(text, nodes, following, found.node(reference), 0, block.place)] if following else []

    draft.add("rigid_motions", motions)


def read_kinematic_coupling(draft: Draft, block: Block) -> None:
    """*KINEMATIC COUPLING: node or set, first and last dof that follow the reference node."""
    reference = draft.named(block, "REFNODE")
    for fields, place in draft.lines(block, 1, "node or set, first and last dof"):
        nodes, dofs = draft.refer(fields[0], place), _dofs(fields[1:], place)
        text = f"{place}: *{block.written}"
        draft.add("rigid_motions", partial(_coupled, nodes=nodes, dofs=dofs, reference=reference, text=text))


def _coupled(
    found: Resolved, nodes: Reference, dofs: tuple[int, ...], reference: Reference, text: str
) -> list[RigidMotion]:
    if not dofs:
        return []
    return [_motion(text, found.nodes(nodes)[1], dofs, found.node(reference), 0, nodes.place)]


def _dofs(fields: list[str], place: Place) -> tuple[int, ...]:
    """Displacements from the first to the last dof of a line; all of them without. Raises SceneError."""
    if len(fields) > 2 or not all(is_integer(text) and 1 <= int(text) <= 6 for text in fields):
        raise place.wrong("no first and last dof", "give numbers from 1 to 6")
    if fields and int(fields[-1]) < int(fields[0]):
        raise place.wrong(f"dofs from {fields[0]} to {fields[-1]}", "give the smaller one first")
    return tuple(dof for dof in _ALL if not fields or int(fields[0]) <= dof <= int(fields[-1]))
