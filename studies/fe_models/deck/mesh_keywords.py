"""Keywords of the mesh: nodes, elements, sets, surfaces, parts and instances."""

from dataclasses import replace

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND
from studies.fe_models.deck.keywords import HARMLESS, KEYWORDS, Block, Row, find_keyword, keyword, unit
from studies.fe_models.deck.mesh import Draft, Records
from studies.fe_models.deck.sets import Numbers
from studies.fe_models.files import LARGEST_NUMBER, FloatArray, IntArray, is_integer, read_integer, shown
from studies.finite_element.cut_faces import turn_about

OTHER_KINDS = {
    "MASS": 1,
    **dict.fromkeys(("T3D2", "T2D2", "B31", "B21", "SPRINGA", "DASHPOTA"), 2),
    **dict.fromkeys(("T3D3", "B32", "S3", "S3R", "CPS3", "CPE3", "M3D3", "STRI3"), 3),
    **dict.fromkeys(("S4", "S4R", "CPS4", "CPE4", "CPS4R", "CPE4R", "M3D4", "M3D4R", "SFM3D4", "R3D4"), 4),
    **dict.fromkeys(("S6", "CPS6", "CPE6", "M3D6", "STRI65"), 6),
    **dict.fromkeys(("S8", "S8R", "CPS8", "CPE8", "CPS8R", "CPE8R", "M3D8", "M3D8R"), 8),
}
"""Kinds of elements that are not read, and their numbers of nodes: without a section they carry nothing."""


def read_mesh_keyword(draft: Draft, block: Block) -> None:
    """Acts on a keyword of the mesh; others are put aside, as all keywords of a part are until it has an instance."""
    block = replace(block, scope=draft.scope)
    if draft.part and block.keyword not in ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE"):
        draft.parts[draft.part].append(block)
    elif block.keyword not in HARMLESS and (block.keyword not in KEYWORDS or KEYWORDS[block.keyword].of_mesh):
        # what is not read is refused before anything lacks the nodes that it would make
        find_keyword(block).reader(draft, block)
    else:
        draft.others.append(block)


@keyword("PART", "NAME", of_mesh=True)
def _part(draft: Draft, block: Block) -> None:
    name = block.name("NAME")
    if draft.part or draft.scope or name in draft.parts:
        raise block.place.wrong(f"{shown(name)} again, or within another", "write *END PART above it")
    draft.part, draft.parts[name] = name, []


@keyword("ENDPART ENDINSTANCE", of_mesh=True)
def _end(draft: Draft, _block: Block) -> None:
    draft.part, draft.scope, draft.system = "", "", None


@keyword("INSTANCE", "NAME PART NSET ELSET", of_mesh=True)
def _instance(draft: Draft, block: Block) -> None:
    """The mesh of a part, shifted and turned; sets of the assembly with all of the instance."""
    name, part = block.name("NAME"), block.name("PART")
    if part not in draft.parts or draft.part or draft.scope or name in draft.placed:
        what = f"{shown(name)} of {shown(part)}, which is no part, or again"
        raise block.place.wrong(what, "give *PART above it, and each instance once")
    draft.placed[name] = _placement(block)
    draft.scope, draft.system = name, None
    for each in draft.parts[part]:
        read_mesh_keyword(draft, each)
    for parameter, sets in (("NSET", draft.node_sets), ("ELSET", draft.element_sets)):
        if parameter in block.parameters:
            sets.add(("", block.name(parameter)), Numbers(name, np.array([1, LARGEST_NUMBER]), 1))


@keyword("NODE", "NSET SYSTEM INPUT", of_mesh=True)
def _node(draft: Draft, block: Block) -> None:
    """Number, x, y, z, in the coordinates of *SYSTEM."""
    if block.value("SYSTEM") not in ("", "R"):
        raise block.place.wrong("nodes in cylindrical or spherical coordinates", "give them in Cartesian ones")
    numbers, coordinates = block.numbered_points()
    if draft.system is not None:
        origin, axes = draft.system
        coordinates = coordinates @ axes + origin
    _add(draft, block, numbers, coordinates)


@keyword("SYSTEM", of_mesh=True)
def _system(draft: Draft, block: Block) -> None:
    """Origin, a point on the first axis, a point in the plane of two axes; no data: the global one."""
    draft.system = None
    if not block.lines:
        return
    values = block.reals(0, 3)
    origin, first, second = np.array(values[:3]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    if len(values) >= 6:
        first = np.array(values[3:6]) - origin
        # without a third point the first axis turns about the global third one
        second = np.array(block.reals(1, 3)[:3]) - origin if len(block.lines) > 1 else np.cross([0, 0, 1], first)
    third = np.cross(first, second)
    axes = (first, np.cross(third, first), third)
    draft.system = origin, np.stack([unit(each, block.place, "points that span a plane") for each in axes])


@keyword("ELEMENT", "TYPE ELSET INPUT", of_mesh=True)
def _element(draft: Draft, block: Block) -> None:
    """Number and nodes, over as many lines as the element needs."""
    kind = block.name("TYPE")
    if (length := NODES_OF_KIND.get(kind) or OTHER_KINDS.get(kind)) is None:
        remedy = f"mesh with {', '.join(NODES_OF_KIND)}, and remove elements that carry nothing"
        raise block.place.wrong(f"elements of type {shown(kind)}", remedy)
    records = block.records(length + 1, f"a {kind} of {length} nodes with its number")
    _add(draft, block, records[:, 0], records[:, 1:], kind=kind)


@keyword("NSET", "NSET ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL", of_mesh=True)
@keyword("ELSET", "ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL", of_mesh=True)
def _set(draft: Draft, block: Block) -> None:
    """Numbers, ranges, other sets, or the nodes of a set of elements; INSTANCE may say whose numbers they are."""
    sets = draft.node_sets if block.keyword == "NSET" else draft.element_sets
    key = block.scope, block.name(block.keyword)
    sets.add(key)
    if block.keyword == "NSET" and "ELSET" in block.parameters:
        sets.add(key, replace(block.reference("ELSET"), of_elements=True))
    if "UNSORTED" in block.parameters:
        sets.unsorted.add(key)
    if "INSTANCE" in block.parameters:
        block = replace(block, scope=block.name("INSTANCE"))
        if block.scope not in draft.placed:
            raise block.place.wrong(f"there is no instance {shown(block.scope)}", "give INSTANCE=... of one above")
    numbers: list[int] = []
    for row in block.rows():
        if "GENERATE" in block.parameters:
            sets.add(key, _range(row))
            continue
        for n, part in enumerate(row.fields):
            if is_integer(part):
                numbers.append(read_integer(part, row.place))
            elif part:
                sets.add(key, row.reference(n))
    if numbers:
        sets.add(key, Numbers(block.scope, np.array(numbers, dtype=np.int64)))


def _range(row: Row) -> Numbers:
    """First, last and step, which may be negative; the members are the same in both senses."""
    if not 2 <= len(row.fields) <= 3:
        raise row.place.wrong(f"{len(row.fields)} numbers below GENERATE", "give first, last and step")
    first, last = row.whole(0, "the first number"), row.whole(1, "the last number")
    step = row.text(2) or ("-1" if last < first else "1")
    size = read_integer(step.lstrip("-"), row.place)
    if first != last and step.startswith("-") != (last < first):
        raise row.place.wrong(f"from {first} to {last} in steps of {step}", "give a step that leads to the last number")
    return Numbers(row.scope, np.array([first, last]), size)


@keyword("SURFACE", "NAME TYPE", "INTERNAL", of_mesh=True)
def _surface(draft: Draft, block: Block) -> None:
    """Faces of elements, or with TYPE=NODE nodes."""
    kind = block.chosen("TYPE", ("ELEMENT", "NODE"), "ELEMENT")
    surface = draft.surfaces.setdefault((block.scope, block.name("NAME")), [])
    for row in block.rows():
        label = row.text(1).upper()
        if kind == "ELEMENT" and label not in ("S1", "S2", "S3", "S4", "S5", "S6"):
            raise row.place.wrong(f"{shown(label)!r} in place of a face", "give S1 to S6 behind each element or set")
        surface.append((row.reference(0), 0 if kind == "NODE" else int(label[1])))
        if (surface[0][1] == 0) != (kind == "NODE"):
            raise row.place.wrong("a surface of nodes and of faces", "give two surfaces")


def _placement(block: Block) -> tuple[FloatArray, FloatArray]:
    """Shift (3,) and turn (3, 3) of two data lines: a shift, and two points of an axis with an angle in degrees."""
    shift, turn = np.zeros(3), np.eye(3)
    if block.lines:
        shift = np.array((block.reals(0, 0) + [0.0] * 3)[:3])
    if len(block.lines) > 1:
        values = np.array(block.reals(1, 7))
        point, angle = values[:3], float(np.radians(values[6]))
        turn = turn_about(unit(values[3:6] - point, block.place, "two points of the axis"), angle)
        shift = turn @ (shift - point) + point
    return shift, turn


def _add(draft: Draft, block: Block, numbers: IntArray, values: FloatArray | IntArray, kind: str = "") -> None:
    """Nodes, or elements, which have a kind; the set that a parameter names has them."""
    whole = np.append(numbers, values) if kind else numbers
    if whole.size and not 0 < whole.min() <= whole.max() <= LARGEST_NUMBER:
        raise block.place.wrong(f"numbers beyond 1 to {LARGEST_NUMBER}", "give smaller steps")
    records, sets = (draft.elements, draft.element_sets) if kind else (draft.nodes, draft.node_sets)
    records.append(Records(block.scope, numbers, values, block.place, kind))
    for parameter in block.parameters.keys() & {"NSET", "ELSET"}:
        sets.add((block.scope, block.name(parameter)), Numbers(block.scope, numbers))
