"""Keywords of materials and sections, and of linear constraints."""

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND, Equation, MeanMotion, Section, Transform
from studies.fe_models.deck.keywords import Block, Row, keyword, unit
from studies.fe_models.deck.model import MaterialRows, Model
from studies.fe_models.files import Place, is_integer, shown

_ALL = (1, 2, 3)


@keyword("MATERIAL", "NAME")
def _material(model: Model, block: Block) -> None:
    """What follows is about it."""
    model.material = model.materials.setdefault(block.name("NAME"), MaterialRows())


def _of_material(model: Model, block: Block) -> MaterialRows:
    """The material of a keyword, which is given once: programs differ in which of two they take."""
    material = block.below(model.material, "MATERIAL, NAME=...")
    before = material.places.setdefault(block.keyword, block.place)
    if before != block.place:  # the same lines serve several instances
        raise block.place.wrong(f"one material again (before: {before})", "give each material once")
    return material


@keyword("ELASTIC", "TYPE DEPENDENCIES", "MODULI")
def _elastic(model: Model, block: Block) -> None:
    """Young's modulus, Poisson's ratio, temperature; a law that is not isotropic matters where it is used."""
    material, law = _of_material(model, block), block.value("TYPE") or "ISO"
    other = law not in ("ISO", "ISOTROPIC")
    if other or block.parameters.get("DEPENDENCIES", "0") != "0":
        material.problem = f"{block.place}, {f'TYPE={shown(law)}' if other else 'DEPENDENCIES'} is not read"
        return
    material.rows["ELASTIC"] = [block.reals(line, 2) for line in range(max(len(block.lines), 1))]
    for young, poisson, *_ in material.rows["ELASTIC"]:
        if not young > 0 or not -1 < poisson < 0.5:
            what = f"Young's modulus {young:g} and Poisson's ratio {poisson:g}"
            raise block.place.wrong(what, "give a positive modulus, and a ratio between -1 and 0.5")


@keyword("DENSITY")
def _density(model: Model, block: Block) -> None:
    """Density, temperature."""
    rows = [block.reals(line, 1) for line in range(max(len(block.lines), 1))]
    _of_material(model, block).rows["DENSITY"] = rows
    if not min(density for density, *_ in rows) > 0:
        raise block.place.wrong("a density of 0 or less", "give a positive one")


@keyword("SOLIDSECTION", "ELSET MATERIAL", "ORIENTATION CONTROLS")
def _section(model: Model, block: Block) -> None:
    """A set of elements and its material."""
    own = block.reference("ELSET")
    section = Section(model.mesh.name_of_elements(own), model.mesh.elements(own), block.name("MATERIAL"))
    model.add("sections", (section, block.place))
    _other_section(model, block)


@keyword("BEAMSECTION", "ELSET", "MATERIAL SECTION ORIENTATION OFFSET1 OFFSET2")
@keyword("MEMBRANESECTION", "ELSET", "MATERIAL")
@keyword("SHELLSECTION", "ELSET", "MATERIAL OFFSET ORIENTATION")
@keyword("DASHPOT MASS SPRING", "ELSET")
def _other_section(model: Model, block: Block) -> None:
    """Elements that are not read carry something."""
    elements = model.mesh.elements(block.reference("ELSET"))
    others = [each for each in model.mesh.blocks if each.kind not in NODES_OF_KIND]
    kinds = sorted(each.kind for each in others if np.isin(elements, each.numbers).any())
    if kinds:
        text = f"{block.place} of elements of type {' and '.join(kinds)}, which are not read"
        model.add("unassembled", (text, elements))


@keyword("INITIALCONDITIONS", "TYPE")
def _initial_conditions(model: Model, block: Block) -> None:
    """Temperatures; velocities do not matter."""
    kind = block.value("TYPE")
    if kind == "VELOCITY":
        model.skipped.append(str(block.place))
        return
    if kind != "TEMPERATURE":
        raise block.place.wrong(f"TYPE={shown(kind)} is not read", "remove it: the prestress is that of the rotation")
    for row in block.rows(2, "set of nodes and temperature"):
        model.add("temperatures", (model.mesh.nodes(row.reference(0)), row.real(1)))


@keyword("EXPANSION", "", "TYPE ZERO")
@keyword("TEMPERATURE", "", "OP AMPLITUDE FILE BSTEP BINC ESTEP EINC INTERPOLATE USER")
def _thermal(model: Model, block: Block) -> None:
    """They change nothing but where there are both, or values at several temperatures."""
    model.thermal[block.keyword] = block.place
    model.skipped.append(str(block.place))


@keyword("TRANSFORM", "NSET TYPE")
def _transform(model: Model, block: Block) -> None:
    """Directions of the displacements of nodes."""
    kind = block.chosen("TYPE", ("R", "C"), "R")
    points = block.points()
    spans = points[1] - points[0] if kind == "C" else np.cross(points[0], points[1])
    unit(spans, block.place, "points that are apart")
    placed = model.mesh.draft.at(block.scope, points, vectors=kind == "R")
    nodes = model.mesh.nodes(block.reference("NSET"))
    model.add("transforms", Transform(str(block.place), nodes, kind == "C", placed))


@keyword("EQUATION", "REMOVE REMOVEALL")
def _equation(model: Model, block: Block) -> None:
    """The number of terms, then node or set, dof and coefficient of each; or REMOVE ALL in a step."""
    if "REMOVEALL" in block.parameters or "REMOVE" in block.parameters:
        if "REMOVE" in block.parameters:
            raise block.place.wrong("REMOVE of some equations is not read", "write REMOVE ALL, in a step with matrices")
        block.below(model.step, "STEP").writes = True
        return
    rows = block.rows()
    for head in rows:
        n_terms, fields = head.whole(0, "the number of terms"), list[str]()
        while len(fields) < 3 * n_terms and (more := next(rows, None)) is not None:
            fields += more.fields + [""] * (-len(more.fields) % 3)
        if len(fields) != 3 * n_terms:
            what = f"{len(fields)} entries for {n_terms} terms"
            raise head.place.wrong(what, "give node, dof and coefficient of each")
        terms = [Row(fields[at : at + 3], head.place, block.scope) for at in range(0, len(fields), 3)]
        model.add("equations", *_equations(model, terms, head.place))


def _equations(model: Model, terms: list[Row], place: Place) -> Iterator[Equation]:
    """One equation, or one for each node of a set; single nodes are in all of them."""
    nodes = [model.mesh.ordered(term.reference(0)) for term in terms]
    dofs, values = np.array([term.whole(1, "a dof") for term in terms]), np.array([term.real(2) for term in terms])
    if values[0] == 0.0:
        raise place.wrong("the first coefficient is 0", "give a first term that depends on the others")
    count = max(map(len, nodes))
    if len(nodes[0]) != count or any(len(each) not in (1, count) for each in nodes):
        raise place.wrong("sets of different sizes", "give sets of as many nodes as the first one, or one node")
    for row in range(count):
        yield Equation(str(place), np.array([each[min(row, len(each) - 1)] for each in nodes]), dofs, values)


@keyword("MPC")
def _mpc(model: Model, block: Block) -> None:
    """TIE and PIN join two nodes, BEAM makes a node follow the motion of another one."""
    for row in block.rows(1, "type and nodes"):
        kind = row.text(0).upper()
        if kind not in ("TIE", "PIN", "BEAM") or len(row.fields) != 3:
            what = f"{shown(kind)} of {len(row.fields) - 1} nodes is not read"
            raise row.place.wrong(what, "write TIE, PIN or BEAM and two nodes or sets, or *EQUATION")
        if kind == "BEAM":
            model.notes.append(f"{row.place} BEAM is rigid, as in Abaqus.")
        first, second = (model.mesh.ordered(row.reference(n)) for n in (1, 2))
        if len(second) not in (1, len(first)):
            raise row.place.wrong(f"{len(first)} and {len(second)} nodes", "give as many nodes, or one node for all")
        # a node or set that follows a node, or the nodes of a set in their order
        parts = [first] if len(second) == 1 else np.split(first, len(first))
        for nodes, reference in zip(parts, second, strict=True):
            model.follow(row.place, nodes, _ALL, int(reference), 0 if kind == "BEAM" else -1)


@keyword("RIGIDBODY", "NSET ELSET PINNSET TIENSET REFNODE ROTNODE", "ISOTHERMAL")
def _rigid_body(model: Model, block: Block) -> None:
    """Nodes, or those of elements, follow a reference node."""
    mesh, given = model.mesh, block.parameters
    nodes = [mesh.nodes(block.reference(key)) for key in ("NSET", "PINNSET", "TIENSET") if key in given]
    if "ELSET" in given or not nodes:
        nodes.append(mesh.nodes_of(block.reference("ELSET")))
    rotation = mesh.node(block.reference("ROTNODE")) if "ROTNODE" in given else 0
    model.follow(block.place, np.unique(np.concatenate(nodes)), _ALL, mesh.node(block.reference("REFNODE")), rotation)


@keyword("COUPLING", "REFNODE SURFACE", "CONSTRAINTNAME")
def _coupling(model: Model, block: Block) -> None:
    """A reference node and a surface; *KINEMATIC or *DISTRIBUTING below it says what is coupled."""
    model.check_coupling()
    model.coupling = block


@keyword("KINEMATIC")
def _kinematic(model: Model, block: Block) -> None:
    """Dofs of the surface of *COUPLING that follow its reference node; all of them without data."""
    head, model.coupling = block.below(model.coupling, "COUPLING"), None
    lines = [_dofs(row.fields, row.place) for row in block.rows()]
    following = tuple(dof for dof in _ALL if not lines or any(dof in dofs for dofs in lines))
    nodes = model.mesh.surface_nodes(model.mesh.surface(head.reference("SURFACE")))
    if following:
        model.follow(block.place, nodes, following, model.mesh.node(head.reference("REFNODE")))


@keyword("DISTRIBUTING", "COUPLING WEIGHTINGMETHOD")
def _distributing(model: Model, block: Block) -> None:
    """The reference node of *COUPLING follows the mean motion of the surface; data: its dofs, all of them without."""
    head, model.coupling = block.below(model.coupling, "COUPLING"), None
    block.chosen("COUPLING", ("CONTINUUM",), "CONTINUUM")
    block.chosen("WEIGHTINGMETHOD", ("UNIFORM",), "UNIFORM")
    lines = [_dofs(row.fields, row.place, (4, 5, 6)) for row in block.rows()]
    turns = tuple(dof for dof in (4, 5, 6) if not lines or any(dof in dofs for dofs in lines))
    name = model.mesh.surface(head.reference("SURFACE"))
    if not model.mesh.surfaces[name].faces.size:
        raise head.place.wrong("a surface of nodes", "give one of element faces: the mean is weighted by their areas")
    model.add("mean_motions", MeanMotion(str(block.place), name, model.mesh.node(head.reference("REFNODE")), turns))


@keyword("KINEMATICCOUPLING", "REFNODE")
def _kinematic_coupling(model: Model, block: Block) -> None:
    """Node or set, first and last dof that follow the reference node."""
    reference = model.mesh.node(block.reference("REFNODE"))
    for row in block.rows(1, "node or set, first and last dof"):
        nodes, dofs = model.mesh.nodes(row.reference(0)), _dofs(row.fields[1:], row.place)
        if dofs:
            model.follow(row.place, nodes, dofs, reference)


def _dofs(fields: list[str], place: Place, known: tuple[int, ...] = _ALL) -> tuple[int, ...]:
    """Those of some dofs from the first to the last one of a line; all of them without. Raises SceneError."""
    found = [int(text) if is_integer(text) else 0 for text in fields] or [1, 6]
    if len(found) > 2 or not 1 <= found[0] <= found[-1] <= 6:
        raise place.wrong(f"no first and last dof: {shown(', '.join(fields))}", "give numbers from 1 to 6")
    return tuple(dof for dof in known if found[0] <= dof <= found[-1])
