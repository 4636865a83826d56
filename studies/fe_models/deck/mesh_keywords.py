"""Keywords of the mesh: nodes, elements, sets, surfaces, parts and instances, and what makes nodes of others."""

from dataclasses import replace
from itertools import product

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND
from studies.fe_models.deck.keywords import KEYWORDS, Block, Reference, Row, find_keyword, keyword, unit
from studies.fe_models.deck.mesh import Draft, Records
from studies.fe_models.deck.sets import NONE, Numbers, Resolver
from studies.fe_models.files import LARGEST_NUMBER, FloatArray, IntArray, Place, is_integer, read_integer, shown
from studies.finite_element.cut_faces import turn_about
from studies.finite_element.solid_mesh import find_places

OTHER_KINDS = {
    "MASS": 1,
    **dict.fromkeys(("T3D2", "T2D2", "B31", "B21", "SPRINGA", "DASHPOTA"), 2),
    **dict.fromkeys(("T3D3", "B32", "S3", "S3R", "CPS3", "CPE3", "M3D3", "STRI3"), 3),
    **dict.fromkeys(("S4", "S4R", "CPS4", "CPE4", "CPS4R", "CPE4R", "M3D4", "M3D4R", "SFM3D4", "R3D4"), 4),
    **dict.fromkeys(("S6", "CPS6", "CPE6", "M3D6", "STRI65"), 6),
    **dict.fromkeys(("S8", "S8R", "CPS8", "CPE8", "CPS8R", "CPE8R", "M3D8", "M3D8R"), 8),
}
"""Kinds of elements that are not read, and their numbers of nodes: without a section they carry nothing."""

_MOST_MADE = 4_000_000  # nodes or elements that one keyword may make


def read_mesh_keyword(draft: Draft, block: Block) -> None:
    """Acts on a keyword of the mesh; others are put aside, as all keywords of a part are until it has an instance."""
    block = replace(block, scope=draft.scope)
    if draft.part and block.keyword not in ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE"):
        draft.parts[draft.part].append(block)
    elif block.keyword in KEYWORDS and KEYWORDS[block.keyword].of_mesh:
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


@keyword("NGEN", "NSET LINE", of_mesh=True)
def _ngen(draft: Draft, block: Block) -> None:
    """First and last node, and the step of the numbers between them, on a straight line."""
    if block.parameters.get("LINE", ""):
        raise block.place.wrong(f"LINE={shown(block.parameters['LINE'])}", "give nodes on curves one by one")
    for row in block.rows(2, "first and last node and the step of their numbers"):
        first, last, step = _whole_numbers(row.fields, row.place, (0, 0, 1))
        step = abs(step) if last > first else -abs(step)
        if first == last or (last - first) % step:
            raise row.place.wrong(f"from node {first} to {last} by {step}", "give a step that leads to the last node")
        _fill(draft, block, row.place, (np.array([first]), np.array([last])), (last - first) // step, step)


@keyword("NFILL", "NSET", of_mesh=True)
def _nfill(draft: Draft, block: Block) -> None:
    """Two sets of nodes, the number of intervals between them, and the step of the numbers."""
    for row in block.rows(2, "two sets, the number of intervals and the step of the numbers"):
        ends = _members(draft, row.reference(0)), _members(draft, row.reference(1))
        _fill(draft, block, row.place, ends, *_whole_numbers(row.fields[2:], row.place, (1, 1)))


def _fill(
    draft: Draft, block: Block, place: Place, ends: tuple[IntArray, IntArray], n_intervals: int, step: int
) -> None:
    """Nodes between those of two sets, at equal distances on straight lines."""
    first, last = ends
    if len(first) != len(last) or n_intervals < 1 or n_intervals * len(first) > _MOST_MADE:
        what = f"{n_intervals} intervals between {len(first)} and {len(last)} nodes"
        raise place.wrong(what, f"give as many nodes at both ends, and at most {_MOST_MADE} between them")
    numbers = (first[:, None] + step * np.arange(1, n_intervals)).ravel()
    start, end = _coordinates(draft, block, first), _coordinates(draft, block, last)
    share = np.linspace(0.0, 1.0, n_intervals + 1)[1:-1, None]
    points = (start[:, None] + share * (end - start)[:, None]).reshape(-1, 3)
    _add(draft, block, numbers, points, more=np.concatenate(ends))


@keyword("NCOPY", "CHANGENUMBER OLDSET NEWSET SHIFT", of_mesh=True)
def _ncopy(draft: Draft, block: Block) -> None:
    """The nodes of a set again, with larger numbers, shifted and then turned about an axis."""
    if "SHIFT" not in block.parameters:
        raise block.place.wrong("a copy without SHIFT", "give the nodes of copies that are mirrored or scaled")
    (change,) = _whole_numbers([block.parameters.get("CHANGENUMBER", "")], block.place, (0,))
    numbers, (shift, turn) = _members(draft, block.reference("OLDSET")), _placement(block)
    _add(draft, block, numbers + change, _coordinates(draft, block, numbers) @ turn.T + shift)


@keyword("ELGEN", "ELSET", of_mesh=True)
def _elgen(draft: Draft, block: Block) -> None:
    """An element, and up to three times how many there are in a row with the steps of nodes and elements."""
    for row in block.rows(2, "element, number in a row, step of nodes, step of elements"):
        master, *rule = _whole_numbers(row.fields, row.place, (0, *(1, 1, 1) * 3))
        counts, of_nodes, of_elements = rule[::3], rule[1::3], rule[2::3]
        if np.prod([float(n) for n in counts]) > _MOST_MADE:
            raise row.place.wrong(f"more than {_MOST_MADE} elements", "give smaller numbers")
        steps = np.array(list(product(*(range(n) for n in counts))), dtype=np.int64).reshape(-1, 3)[1:]
        _copy_elements(draft, block, np.array([master]), steps @ of_elements, steps @ of_nodes)


@keyword("ELCOPY", "ELEMENTSHIFT SHIFTNODES OLDSET NEWSET", of_mesh=True)
def _elcopy(draft: Draft, block: Block) -> None:
    """The elements of a set again, with larger numbers of elements and nodes."""
    given = [block.parameters.get(name, "") for name in ("ELEMENTSHIFT", "SHIFTNODES")]
    by_element, by_node = (np.array(_whole_numbers([text], block.place, (0,))) for text in given)
    own = _members(draft, block.reference("OLDSET"), of_elements=True)
    _copy_elements(draft, block, own, by_element, by_node)


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


def _whole_numbers(fields: list[str], place: Place, default: tuple[int, ...]) -> list[int]:
    """Whole numbers, with defaults for those that are missing. Raises SceneError."""
    values = list(default)
    for at, text in enumerate(fields):
        if at >= len(values) or (text and not (is_integer(text) and 0 < abs(int(text)) <= LARGEST_NUMBER)):
            raise place.wrong(f"{shown(text)!r} in place of a number", f"give {len(values)} whole ones, none of them 0")
        values[at] = int(text) if text else values[at]
    return values


def _members(draft: Draft, reference: Reference, *, of_elements: bool = False) -> IntArray:
    """Nodes, or elements, (m,) of a set of the same scope by number, as far as the deck is read. Raises SceneError."""
    records, sets = (draft.elements, draft.element_sets) if of_elements else (draft.nodes, draft.node_sets)
    if (reference.scope, reference.target) in sets.unsorted and not of_elements:
        raise reference.place.wrong(f"the set {reference.target} is UNSORTED", "give sets by ascending numbers here")
    known = np.concatenate([NONE, *(each.numbers for each in records if each.scope == reference.scope)])
    return Resolver(sets, np.unique(known), {reference.scope: 0})(reference)


def _coordinates(draft: Draft, block: Block, wanted: IntArray) -> FloatArray:
    """Coordinates (m, 3) of nodes by their numbers (m,). Raises SceneError where one does not exist."""
    own = [each for each in draft.nodes if each.scope == block.scope]
    places = find_places(wanted, np.concatenate([NONE, *(each.numbers for each in own)]))
    if (places < 0).any():
        raise block.place.wrong(f"there is no node {wanted[places < 0].min()}", "define it above this line")
    return np.concatenate([each.values for each in own])[places]


def _add(
    draft: Draft, block: Block, numbers: IntArray, values: FloatArray | IntArray, kind: str = "", more: IntArray = NONE
) -> None:
    """Nodes, or elements, which have a kind; the set that a parameter names has them, and `more`."""
    whole = np.append(numbers, values) if kind else numbers
    if whole.size and not 0 < whole.min() <= whole.max() <= LARGEST_NUMBER:
        raise block.place.wrong(f"numbers beyond 1 to {LARGEST_NUMBER}", "give smaller steps")
    records, sets = (draft.elements, draft.element_sets) if kind else (draft.nodes, draft.node_sets)
    records.append(Records(block.scope, numbers, values, block.place, kind))
    for parameter in block.parameters.keys() & {"NSET", "ELSET", "NEWSET"}:
        sets.add((block.scope, block.name(parameter)), Numbers(block.scope, np.concatenate([numbers, more])))


def _copy_elements(draft: Draft, block: Block, own: IntArray, by_element: IntArray, by_node: IntArray) -> None:
    """Elements with numbers and nodes shifted by steps (m,), (m,), once for each step."""
    if own.size * by_element.size > _MOST_MADE:
        raise block.place.wrong(f"more than {_MOST_MADE} elements", "give smaller numbers")
    done = 0
    for each in [each for each in draft.elements if each.scope == block.scope]:
        rows = np.flatnonzero(np.isin(each.numbers, own))
        numbers = (each.numbers[rows] + by_element[:, None]).ravel()
        nodes = (each.values[rows] + by_node[:, None, None]).reshape(-1, each.values.shape[1]).astype(np.int64)
        _add(draft, block, numbers, nodes, each.kind, each.numbers[rows])
        done += rows.size
    if done < own.size or not own.size:
        raise block.place.wrong("an element that does not exist", "define it above this line")
