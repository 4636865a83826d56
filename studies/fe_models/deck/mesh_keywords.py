"""Keywords of the mesh: nodes, elements, sets, surfaces, parts and instances, and what makes nodes of others.

What makes nodes and elements of others is carried out once all sets are read, in the order of the file.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND
from studies.fe_models.deck.draft import (
    KEYWORDS,
    Draft,
    Records,
    check_parameters,
    chosen,
    data_lines,
    keyword,
    refused,
    unit,
)
from studies.fe_models.deck.sets import Reference, Resolver
from studies.fe_models.text import (
    LARGEST_NUMBER,
    Block,
    FloatArray,
    IntArray,
    Place,
    is_integer,
    read_fields,
    read_floats,
    read_name,
    read_points,
    read_records,
    shown,
)
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

_OF_PARTS = ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE")
_MOST_MADE = 4_000_000  # nodes or elements that one keyword may make
_NONE = np.empty(0, dtype=np.int64)


def read_mesh_keyword(draft: Draft, block: Block) -> None:
    """Acts on a keyword of the mesh; others are put aside, as all keywords of a part are until it has an instance."""
    if block.keyword in _OF_PARTS:
        for name in block.parameters:
            if name not in ("NAME", "PART", "NSET", "ELSET"):
                raise block.place.wrong(f"*{block.written} with {shown(name)} is not read", "leave it out")
        _of_parts(draft, block)
    elif draft.part:
        draft.parts[draft.part].append(block)
    else:
        known = KEYWORDS.get(block.keyword)
        if known is None or not known.of_mesh:
            draft.others.append((draft.scope, block))
            return
        check_parameters(known, block)
        known.reader(draft, block)


def _of_parts(draft: Draft, block: Block) -> None:
    """*PART and *INSTANCE, which is the mesh of a part, shifted and turned."""
    if block.keyword == "PART":
        name = block.name("NAME")
        if draft.part or draft.scope or name in draft.parts:
            raise block.place.wrong(f"*PART {shown(name)} again, or within another", "write *END PART above it")
        draft.part, draft.parts[name] = name, []
    elif block.keyword == "ENDPART":
        draft.part = ""
    elif block.keyword == "ENDINSTANCE":
        draft.scope, draft.system = "", None
    else:
        name, part = block.name("NAME"), block.name("PART")
        if part not in draft.parts or draft.part or draft.scope or name in draft.placed:
            found = f"*INSTANCE {shown(name)} of {shown(part)}, which is no part, or again"
            raise block.place.wrong(found, "give *PART above it, and each instance once")
        draft.placed[name] = _placement(block)
        draft.scope, draft.system = name, None
        for each in draft.parts[part]:
            read_mesh_keyword(draft, each)
        # sets of the assembly with all of the instance
        for parameter, sets in (("NSET", draft.node_sets), ("ELSET", draft.element_sets)):
            if parameter in block.parameters:
                sets.add_all("", read_name(block.parameters[parameter]), name)


@keyword("NODE", "NSET SYSTEM INPUT", of_mesh=True)
def _node(draft: Draft, block: Block) -> None:
    """Number, x, y, z, in the coordinates of *SYSTEM."""
    if chosen(block, "SYSTEM", ("R", "C", "S"), "R") != "R":
        raise refused(block, "nodes in cylindrical or spherical coordinates", "give them in Cartesian ones")
    numbers, coordinates = read_points(block)
    if draft.system is not None:
        origin, axes = draft.system
        coordinates = coordinates @ axes + origin
    draft.nodes.append(Records(draft.scope, numbers, coordinates, block.place))
    if "NSET" in block.parameters:
        draft.node_sets.add(draft.scope, block.name("NSET"), numbers)


@keyword("SYSTEM", of_mesh=True)
def _system(draft: Draft, block: Block) -> None:
    """Origin, a point on the first axis, a point in the plane of two axes; no data: the global one."""
    draft.system = None
    if not block.lines:
        return
    values = read_floats(block, 0, 3)
    origin, first, second = np.array(values[:3]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    if len(values) >= 6:
        first = np.array(values[3:6]) - origin
        # without a third point the first axis turns about the global third one
        second = np.array(read_floats(block, 1, 3)[:3]) - origin if len(block.lines) > 1 else np.cross([0, 0, 1], first)
    third = np.cross(first, second)
    wrong = block.place_of(0), "*SYSTEM by points on one line", "give points that span a plane"
    draft.system = origin, np.stack([unit(each, *wrong) for each in (first, np.cross(third, first), third)])


@keyword("ELEMENT", "TYPE ELSET INPUT", of_mesh=True)
def _element(draft: Draft, block: Block) -> None:
    """Number and nodes, over as many lines as the element needs."""
    kind = block.name("TYPE")
    length = NODES_OF_KIND.get(kind) or OTHER_KINDS.get(kind)
    if length is None:
        remedy = f"mesh the model with {', '.join(NODES_OF_KIND)}, and remove elements that carry nothing"
        raise block.place.wrong(f"elements of type {shown(kind)}", remedy)
    records = read_records(block, length + 1, f"a {kind} of {length} nodes with its number")
    draft.elements.append(Records(draft.scope, records[:, 0], records[:, 1:], block.place, kind))
    if "ELSET" in block.parameters:
        draft.element_sets.add(draft.scope, block.name("ELSET"), records[:, 0])


@keyword("NSET", "NSET ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL", of_mesh=True)
def _nset(draft: Draft, block: Block) -> None:
    """Numbers, ranges, other sets, or the nodes of a set of elements."""
    key = draft.scope, block.name("NSET")
    draft.node_sets.add_block(key, block, draft.placed)
    if "ELSET" in block.parameters:
        reference = draft.refer(block.parameters["ELSET"], block.place)
        draft.node_sets.of_elements.setdefault(key, []).append(reference)


@keyword("ELSET", "ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL", of_mesh=True)
def _elset(draft: Draft, block: Block) -> None:
    draft.element_sets.add_block((draft.scope, block.name("ELSET")), block, draft.placed)


@keyword("SURFACE", "NAME TYPE", "INTERNAL", of_mesh=True)
def _surface(draft: Draft, block: Block) -> None:
    """Faces of elements, or with TYPE=NODE nodes."""
    name, kind = block.name("NAME"), chosen(block, "TYPE", ("ELEMENT", "NODE"), "ELEMENT")
    surface = draft.surfaces.setdefault((draft.scope, name), [])
    for line in range(len(block.lines)):
        place, fields = block.place_of(line), read_fields(block, line)
        reference = draft.refer(fields[0] if fields else "", place)
        label = fields[1].upper() if len(fields) > 1 else ""
        if kind == "ELEMENT" and label not in ("S1", "S2", "S3", "S4", "S5", "S6"):
            found = f"{shown(label)!r} in place of a face" if label else f"no face of {shown(fields[0])}"
            raise place.wrong(found, "give S1 to S6 behind each element or set")
        surface.append((reference, 0 if kind == "NODE" else int(label[1])))
        if (surface[0][1] == 0) != (kind == "NODE"):
            raise place.wrong("a surface of nodes and of faces", "give two surfaces")


@keyword("NGEN", "NSET LINE", of_mesh=True)
def _ngen(draft: Draft, block: Block) -> None:
    """First and last node, and the step of the numbers between them, on a straight line."""
    if block.parameters.get("LINE", ""):
        raise refused(block, f"LINE={shown(block.parameters['LINE'])}", "give nodes on curves one by one")
    lines = data_lines(block, 2, "first and last node and the step of their numbers")
    rows = [(_whole_numbers(fields, place, (0, 0, 1)), place) for fields, place in lines]
    scope = draft.scope

    def generate(now: Draft) -> None:
        for (first, last, step), place in rows:
            if first == last or (last - first) % abs(step) or abs(last - first) // abs(step) > _MOST_MADE:
                found = f"from node {first} to {last} in steps of {step}"
                raise place.wrong(found, "give a step that leads to the last node")
            ends, step = np.array([first, last]), abs(step) if last > first else -abs(step)
            numbers = np.arange(first + step, last, step, dtype=np.int64)
            share = np.linspace(0.0, 1.0, len(numbers) + 2)[1:-1, None]
            start, end = _coordinates(now, scope, ends, place)
            _make_nodes(now, block, scope, numbers, start + share * (end - start), "NSET", ends)

    draft.generators.append(generate)


@keyword("NFILL", "NSET", of_mesh=True)
def _nfill(draft: Draft, block: Block) -> None:
    """Two sets of nodes, the number of intervals between them, and the step of the numbers."""
    rows = [
        (draft.refer(fields[0], place), draft.refer(fields[1], place), _whole_numbers(fields[2:], place, (1, 1)), place)
        for fields, place in data_lines(block, 2, "two sets, the number of intervals and the step of the numbers")
    ]
    scope = draft.scope

    def generate(now: Draft) -> None:
        for one, other, (n_intervals, step), place in rows:
            first, last = _members(now, one), _members(now, other)
            if len(first) != len(last) or step * n_intervals * len(first) > LARGEST_NUMBER:
                found = f"*{block.written} between {len(first)} and {len(last)} nodes in {n_intervals} intervals"
                raise place.wrong(found, "give two sets of as many nodes")
            inner = np.arange(1, n_intervals)
            start, end = _coordinates(now, scope, first, place), _coordinates(now, scope, last, place)
            points = start[:, None] + (inner / n_intervals)[:, None] * (end - start)[:, None]
            numbers, bounds = (first[:, None] + step * inner).ravel(), np.concatenate([first, last])
            _make_nodes(now, block, scope, numbers, points.reshape(-1, 3), "NSET", bounds)

    draft.generators.append(generate)


@keyword("NCOPY", "CHANGENUMBER OLDSET NEWSET SHIFT", of_mesh=True)
def _ncopy(draft: Draft, block: Block) -> None:
    """The nodes of a set again, with larger numbers, shifted and then turned about an axis."""
    if "SHIFT" not in block.parameters:
        raise refused(block, "a copy without SHIFT", "give the nodes of copies that are mirrored or scaled")
    (change,) = _whole_numbers([block.parameters.get("CHANGENUMBER", "")], block.place, (0,))
    old, (shift, turn), scope = draft.named(block, "OLDSET"), _placement(block), draft.scope

    def generate(now: Draft) -> None:
        numbers = _members(now, old)
        points = _coordinates(now, scope, numbers, block.place) @ turn.T + shift
        _make_nodes(now, block, scope, numbers + change, points, "NEWSET", _NONE)

    draft.generators.append(generate)


@keyword("ELGEN", "ELSET", of_mesh=True)
def _elgen(draft: Draft, block: Block) -> None:
    """An element, and up to three times how many there are in a row with the steps of nodes and elements."""
    lines = data_lines(block, 2, "element, number in a row, step of nodes, step of elements")
    rows = [(_whole_numbers(fields, place, (0, *(1, 1, 1) * 3)), place) for fields, place in lines]
    scope = draft.scope

    def generate(now: Draft) -> None:
        for (master, *rule), place in rows:
            counts, of_nodes, of_elements = rule[::3], rule[1::3], rule[2::3]
            if np.prod([float(n) for n in counts]) > _MOST_MADE:
                raise place.wrong(f"*{block.written} of more than {_MOST_MADE} elements", "give smaller numbers")
            steps = np.array(list(product(*(range(n) for n in counts))), dtype=np.int64).reshape(-1, 3)[1:]
            _make_elements(now, block, scope, np.array([master]), (steps @ of_elements, steps @ of_nodes), "ELSET")

    draft.generators.append(generate)


@keyword("ELCOPY", "ELEMENTSHIFT SHIFTNODES OLDSET NEWSET", of_mesh=True)
def _elcopy(draft: Draft, block: Block) -> None:
    """The elements of a set again, with larger numbers of elements and nodes."""
    given = [block.parameters.get(name, "") for name in ("ELEMENTSHIFT", "SHIFTNODES")]
    by_element, by_node = (np.array(_whole_numbers([text], block.place, (0,))) for text in given)
    old, scope = draft.named(block, "OLDSET"), draft.scope

    def generate(now: Draft) -> None:
        known = np.concatenate([each.numbers for each in now.elements if each.scope == scope] or [_NONE])
        own = Resolver(now.element_sets, np.unique(known), {scope: 0}, "EALL").find(old)
        _make_elements(now, block, scope, own, (by_element, by_node), "NEWSET")

    draft.generators.append(generate)


def _placement(block: Block) -> tuple[FloatArray, FloatArray]:
    """Shift (3,) and turn (3, 3) of two data lines: a shift, and two points of an axis with an angle in degrees."""
    shift, turn = np.zeros(3), np.eye(3)
    if block.lines:
        shift = np.array((read_floats(block, 0, 0) + [0.0] * 3)[:3])
    if len(block.lines) > 1:
        values = np.array(read_floats(block, 1, 7))
        point, remedy = values[:3], "give two points of the axis"
        axis = unit(values[3:6] - point, block.place, "a rotation about two equal points", remedy)
        turn = turn_about(axis, float(np.radians(values[6])))
        shift = turn @ (shift - point) + point
    return shift, turn


def _whole_numbers(fields: list[str], place: Place, default: tuple[int, ...]) -> list[int]:
    """Whole numbers, with defaults for those that are missing. Raises SceneError."""
    values = list(default)
    if len(fields) > len(values):
        raise place.wrong(f"{len(fields)} numbers", f"give at most {len(values)}")
    for at, text in enumerate(fields):
        if text and not (is_integer(text) and 0 < abs(int(text)) <= LARGEST_NUMBER):
            raise place.wrong(f"{shown(text)!r} in place of a whole number", "give one that is not 0")
        values[at] = int(text) if text else values[at]
    return values


def _members(now: Draft, reference: Reference) -> IntArray:
    """Nodes (m,) of a set, by number. Raises SceneError."""
    known = np.concatenate([each.numbers for each in now.nodes if each.scope == reference.scope] or [_NONE])
    if (reference.scope, reference.target) in now.node_sets.unsorted:
        raise reference.place.wrong(f"the set {reference.target} is UNSORTED", "give sets by ascending numbers here")
    return Resolver(now.node_sets, np.unique(known), {reference.scope: 0}, "NALL").find(reference)


def _coordinates(now: Draft, scope: str, wanted: IntArray, place: Place) -> FloatArray:
    """Coordinates (m, 3) of nodes by their numbers (m,). Raises SceneError where one does not exist."""
    own = [each for each in now.nodes if each.scope == scope]
    numbers = np.concatenate([each.numbers for each in own] or [_NONE])
    order = np.argsort(numbers, kind="stable")
    at = np.minimum(np.searchsorted(numbers[order], wanted), max(numbers.size - 1, 0))
    missing = numbers[order][at] != wanted if numbers.size else np.ones(len(wanted), dtype=np.bool_)
    if missing.any():
        raise place.wrong(f"there is no node {wanted[missing][0]}", "define it above this line")
    return np.concatenate([each.values for each in own])[order[at]]


def _make_nodes(
    now: Draft, block: Block, scope: str, numbers: IntArray, points: FloatArray, parameter: str, bounds: IntArray
) -> None:
    """Nodes that a keyword makes; the set that a parameter names has them, and those between which they are."""
    if numbers.size > _MOST_MADE or (numbers.size and not 0 < numbers.min() <= numbers.max() <= LARGEST_NUMBER):
        raise block.place.wrong(f"*{block.written} of {numbers.size} nodes", "give numbers that are possible")
    now.nodes.append(Records(scope, numbers, points, block.place))
    if name := read_name(block.parameters.get(parameter, "")):
        now.node_sets.add(scope, name, np.concatenate([numbers, bounds]))


def _make_elements(
    now: Draft, block: Block, scope: str, own: IntArray, steps: tuple[IntArray, IntArray], parameter: str
) -> None:
    """Elements with numbers and nodes shifted by steps (m,), (m,), once for each step."""
    by_element, by_node = steps
    if own.size * by_element.size > _MOST_MADE:
        raise block.place.wrong(f"*{block.written} of more than {_MOST_MADE} elements", "give smaller numbers")
    done, name = 0, read_name(block.parameters.get(parameter, ""))
    for each in [each for each in now.elements if each.scope == scope]:
        rows = np.flatnonzero(np.isin(each.numbers, own))
        numbers = (each.numbers[rows] + by_element[:, None]).ravel()
        nodes = (each.values[rows] + by_node[:, None, None]).reshape(-1, each.values.shape[1])
        done += rows.size
        both = np.append(numbers, nodes)
        if both.size and not 0 < both.min() <= both.max() <= LARGEST_NUMBER:
            raise block.place.wrong(f"*{block.written} to impossible numbers", "give smaller steps")
        now.elements.append(Records(scope, numbers, nodes, block.place, each.kind))
        if name:
            now.element_sets.add(scope, name, np.concatenate([each.numbers[rows], numbers]))
    if done < own.size or not own.size:
        raise block.place.wrong(f"*{block.written} of an element that does not exist", "define it above this line")
