"""Keywords of materials and sections, and of linear constraints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import Equation, RigidMotion, Transform
from studies.fe_models.deck.draft import chosen, data_lines, keyword, refused
from studies.fe_models.deck.model import MaterialRows, Model
from studies.fe_models.deck.sets import Reference
from studies.fe_models.text import (
    Block,
    IntArray,
    Place,
    is_integer,
    read_fields,
    read_float,
    read_floats,
    read_integer,
    shown,
)

_ALL = (1, 2, 3)


@keyword("MATERIAL", "NAME")
def _material(model: Model, block: Block) -> None:
    """What follows is about it."""
    model.material = model.materials.setdefault(block.name("NAME"), MaterialRows())


def _rows(model: Model, block: Block, least: int) -> tuple[MaterialRows, list[list[float]]]:
    """The material and the rows of a keyword about it, which are given once: programs differ in which of two they take.

    The same lines serve several instances.
    """
    material = model.material
    if material is None:
        raise block.place.wrong(f"*{block.written} without a material", "write *MATERIAL, NAME=... above it")
    before = material.places.setdefault(block.keyword, block.place)
    if before != block.place:
        found = f"*{block.written} of one material again (before: {before})"
        raise block.place.wrong(found, "give each material once")
    return material, [read_floats(block, line, least) for line in range(max(len(block.lines), 1))] if least else []


@keyword("ELASTIC", "TYPE DEPENDENCIES", "MODULI")
def _elastic(model: Model, block: Block) -> None:
    """Young's modulus, Poisson's ratio, temperature; a law that is not isotropic matters where it is used."""
    law = block.parameters.get("TYPE", "ISO").upper()
    other = law not in ("ISO", "ISOTROPIC")
    if other or block.parameters.get("DEPENDENCIES", "0") != "0":
        what = f"TYPE={shown(law)}" if other else "DEPENDENCIES"
        _rows(model, block, 0)[0].problem = f"{block.place}: *{block.written}, {what} is not read"
        return
    material, material_rows = _rows(model, block, 2)
    material.problem, material.elastic = "", material_rows
    for line, (young, poisson, *_) in enumerate(material_rows):
        if not young > 0 or not -1 < poisson < 0.5:
            found = f"Young's modulus {young:g} and Poisson's ratio {poisson:g}"
            raise block.place_of(line).wrong(found, "give a positive modulus, and a ratio between -1 and 0.5")


@keyword("DENSITY")
def _density(model: Model, block: Block) -> None:
    """Density, temperature."""
    material, rows = _rows(model, block, 1)
    material.density = rows
    for line, (density, *_) in enumerate(material.density):
        if not density > 0:
            raise block.place_of(line).wrong(f"a density of {density:g}", "give a positive one")


@keyword("SOLIDSECTION", "ELSET MATERIAL", "ORIENTATION CONTROLS")
def _section(model: Model, block: Block) -> None:
    """A set of elements and its material."""
    elements, material = model.named(block, "ELSET"), block.name("MATERIAL")
    model.add("sections", [(model.mesh.elements(elements)[0], material, block.place)])
    _other_section(model, block)


@keyword("BEAMSECTION", "ELSET", "MATERIAL SECTION ORIENTATION OFFSET1 OFFSET2")
@keyword("MEMBRANESECTION", "ELSET", "MATERIAL")
@keyword("SHELLSECTION", "ELSET", "MATERIAL OFFSET ORIENTATION")
@keyword("DASHPOT MASS SPRING", "ELSET")
def _other_section(model: Model, block: Block) -> None:
    """Elements that are not read carry something."""
    elements = model.mesh.elements(model.named(block, "ELSET"))[1]
    kinds = model.mesh.other_kinds(elements)
    if kinds:
        text = f"{block.place}: *{block.written} of elements of type {' and '.join(kinds)}, which are not read"
        model.add("unassembled", [(text, elements)])


@keyword("INITIALCONDITIONS", "TYPE")
def _initial_conditions(model: Model, block: Block) -> None:
    """Temperatures; velocities do not matter."""
    kind = block.parameters.get("TYPE", "").upper()
    if kind == "VELOCITY":
        model.skip(block)
        return
    if kind != "TEMPERATURE":
        raise refused(block, f"TYPE={shown(kind)} is not read", "remove it: the prestress is that of the rotation")
    for fields, place in data_lines(block, 2, "set of nodes and temperature"):
        nodes = model.mesh.nodes(model.refer(fields[0], place))[1]
        model.add("temperatures", [(nodes, read_float(fields[1], place))])


@keyword("EXPANSION", "", "TYPE ZERO")
@keyword("TEMPERATURE", "", "OP AMPLITUDE FILE BSTEP BINC ESTEP EINC INTERPOLATE USER")
def _thermal(model: Model, block: Block) -> None:
    """They change nothing but where there are both, or values at several temperatures."""
    model.thermal[block.keyword] = block.place
    model.skip(block)


@keyword("TRANSFORM", "NSET TYPE")
def _transform(model: Model, block: Block) -> None:
    """Directions of the displacements of nodes."""
    kind = chosen(block, "TYPE", ("R", "C", "S"), "R")
    if kind == "S":
        raise refused(block, "spherical directions are not read", "give rectangular or cylindrical ones")
    points = np.array(read_floats(block, 0, 6)[:6]).reshape(2, 3)
    spans = points[1] - points[0] if kind == "C" else np.cross(points[0], points[1])
    if not 0 < np.linalg.norm(spans) < np.inf:
        raise block.place_of(0).wrong(f"*{block.written} by points on one line", "give points that are apart")
    placed = model.mesh.placed(model.scope, points, vectors=kind == "R")
    nodes = model.mesh.nodes(model.named(block, "NSET"))[1]
    model.add("transforms", [Transform(f"{block.place}: *{block.written}", nodes, kind == "C", placed)])


@keyword("EQUATION", "REMOVE REMOVEALL")
def _equation(model: Model, block: Block) -> None:
    """The number of terms, then node or set, dof and coefficient of each; or REMOVE ALL in a step."""
    if "REMOVEALL" in block.parameters or "REMOVE" in block.parameters:
        if model.step is None or "REMOVE" in block.parameters:
            remedy = "write REMOVE ALL in the step that writes matrices"
            raise refused(block, "REMOVE of some equations is not read", remedy)
        model.step.writes = True
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
            (model.refer(node, place), read_integer(dof, place, "a dof"), read_float(value, place))
            for node, dof, value in zip(fields[::3], fields[1::3], fields[2::3], strict=True)
        ]
        if terms[0][2] == 0.0:
            raise place.wrong("the first coefficient is 0", "give a first term that depends on the others")
        model.add("equations", _equations(model, terms, place))
        line += 1


def _equations(model: Model, terms: list[tuple[Reference, int, float]], place: Place) -> Iterator[Equation]:
    """One equation, or one for each node of a set; single nodes are in all of them."""
    nodes = [model.mesh.ordered(reference) for reference, _, _ in terms]
    count = max(map(len, nodes))
    for (reference, _, _), each in zip(terms, nodes, strict=True):
        if len(each) not in (1, count) or len(nodes[0]) != count:
            remedy = "give sets of as many nodes as the first one, or one node"
            raise place.wrong(f"*EQUATION: {shown(str(reference.target))} has {len(each)} nodes", remedy)
    dofs, values = np.array([dof for _, dof, _ in terms]), np.array([value for _, _, value in terms])
    for row in range(count):
        own = np.array([each[min(row, len(each) - 1)] for each in nodes])
        yield Equation(f"{place}: *EQUATION", own, dofs, values)


def _follow(
    model: Model, place: Place, nodes: IntArray, dofs: tuple[int, ...], reference: int, rotation: int = 0
) -> None:
    """Nodes that follow a reference node; rotation: -1 where they do not turn with it, else as in `RigidMotion`."""
    nodes = nodes[(nodes != reference) & (nodes != rotation)]
    if not nodes.size:
        raise place.wrong("no node follows the reference node", "give the nodes that are rigid")
    text = f"{place}: *{place.keyword}"
    model.add("rigid_motions", [RigidMotion(text, nodes, dofs, reference, max(rotation, 0), rotation >= 0)])


@keyword("MPC")
def _mpc(model: Model, block: Block) -> None:
    """TIE and PIN join two nodes, BEAM makes a node follow the motion of another one."""
    for fields, place in data_lines(block, 1, "type and nodes"):
        kind = fields[0].upper()
        if kind not in ("TIE", "PIN", "BEAM") or len(fields) != 3:
            remedy = "write TIE, PIN or BEAM and two nodes or sets, or *EQUATION"
            raise place.wrong(f"*{block.written} {shown(kind)} of {len(fields) - 1} nodes is not read", remedy)
        if kind == "BEAM":
            model.notes.append(f"{place}: *{block.written} BEAM is rigid, as in Abaqus.")
        first, second = (model.mesh.ordered(model.refer(text, place)) for text in fields[1:])
        if len(second) not in (1, len(first)):
            remedy = "give sets of as many nodes, or one node for all"
            raise place.wrong(f"*MPC of {len(first)} and {len(second)} nodes", remedy)
        # a node or set that follows a node, or the nodes of a set in their order
        parts = [first] if len(second) == 1 else np.split(first, len(first))
        for nodes, reference in zip(parts, second, strict=True):
            _follow(model, place, nodes, _ALL, int(reference), 0 if kind == "BEAM" else -1)


@keyword("RIGIDBODY", "NSET ELSET PINNSET TIENSET REFNODE ROTNODE", "ISOTHERMAL")
def _rigid_body(model: Model, block: Block) -> None:
    """Nodes, or those of elements, follow a reference node."""
    mesh, given = model.mesh, block.parameters
    nodes = [mesh.nodes(model.named(block, key))[1] for key in ("NSET", "PINNSET", "TIENSET") if key in given]
    nodes += [mesh.nodes_of(model.named(block, "ELSET"))] if "ELSET" in given else []
    if not nodes:
        raise block.place.wrong(f"*{block.written} without NSET or ELSET", "give the nodes that are rigid")
    reference = mesh.node(model.named(block, "REFNODE"))
    rotation = mesh.node(model.named(block, "ROTNODE")) if "ROTNODE" in given else 0
    _follow(model, block.place, np.unique(np.concatenate(nodes)), _ALL, reference, rotation)


@keyword("COUPLING", "REFNODE SURFACE", "CONSTRAINTNAME")
def _coupling(model: Model, block: Block) -> None:
    """A reference node and a surface; *KINEMATIC below it says what is coupled."""
    for parameter in ("REFNODE", "SURFACE"):
        block.name(parameter)
    model.coupling = block


@keyword("KINEMATIC")
def _kinematic(model: Model, block: Block) -> None:
    """Dofs of the surface of *COUPLING that follow its reference node; all of them without data."""
    head, model.coupling = model.coupling, None
    if head is None:
        raise block.place.wrong(f"*{block.written} without *COUPLING", "write it below its *COUPLING")
    lines = [_dofs(read_fields(block, line), block.place_of(line)) for line in range(len(block.lines))]
    following = tuple(dof for dof in _ALL if not lines or any(dof in dofs for dofs in lines))
    nodes = model.mesh.surface_nodes(model.mesh.surface(model.named(head, "SURFACE")))
    if following:
        _follow(model, block.place, nodes, following, model.mesh.node(model.named(head, "REFNODE")))


@keyword("KINEMATICCOUPLING", "REFNODE")
def _kinematic_coupling(model: Model, block: Block) -> None:
    """Node or set, first and last dof that follow the reference node."""
    reference = model.mesh.node(model.named(block, "REFNODE"))
    for fields, place in data_lines(block, 1, "node or set, first and last dof"):
        nodes, dofs = model.mesh.nodes(model.refer(fields[0], place))[1], _dofs(fields[1:], place)
        if dofs:
            _follow(model, place, nodes, dofs, reference)


def _dofs(fields: list[str], place: Place) -> tuple[int, ...]:
    """Displacements from the first to the last dof of a line; all of them without. Raises SceneError."""
    if len(fields) > 2 or not all(is_integer(text) and 1 <= int(text) <= 6 for text in fields):
        raise place.wrong("no first and last dof", "give numbers from 1 to 6")
    if fields and int(fields[-1]) < int(fields[0]):
        raise place.wrong(f"dofs from {fields[0]} to {fields[-1]}", "give the smaller one first")
    return tuple(dof for dof in _ALL if not fields or int(fields[0]) <= dof <= int(fields[-1]))
