"""Keywords that make nodes and elements of others: they are carried out once all sets are read, in their order."""

from __future__ import annotations

from itertools import product

import numpy as np

from studies.fe_models.deck.draft import Draft, Records, refused
from studies.fe_models.deck.mesh import FloatArray, IntArray
from studies.fe_models.deck.sets import Reference, Resolver
from studies.fe_models.text.keyword_lines import Block, read_name
from studies.fe_models.text.numbers import LARGEST_NUMBER, is_integer, read_floats
from studies.fe_models.text.read_errors import Place, shown

_MOST_MADE = 4_000_000  # nodes or elements that one keyword may make


def read_ngen(draft: Draft, block: Block) -> None:
    """*NGEN: first and last node, and the step of the numbers between them, on a straight line."""
    if block.parameters.get("LINE", ""):
        raise refused(block, f"LINE={shown(block.parameters['LINE'])}", "give nodes on curves one by one")
    rows = [
        (_numbers(fields, place, 3, (0, 0, 1)), place)
        for fields, place in draft.lines(block, 2, "first and last node and the step of their numbers")
    ]

    def generate(now: Draft) -> None:
        for (first, last, step), place in rows:
            ends = np.array([first, last])
            numbers = _steps(first, last, step, place)
            share = np.linspace(0.0, 1.0, len(numbers) + 2)[1:-1, None]
            start, end = _coordinates(now, scope, ends, place)
            _make_nodes(now, block, scope, numbers, start + share * (end - start), set_name, ends)

    scope, set_name = draft.scope, read_name(block.parameters.get("NSET", ""))
    draft.generators.append(generate)


def read_nfill(draft: Draft, block: Block) -> None:
    """*NFILL: two sets of nodes, the number of intervals between them, and the step of the numbers."""
    rows = [
        (draft.refer(fields[0], place), draft.refer(fields[1], place), _numbers(fields[2:], place, 2, (1, 1)), place)
        for fields, place in draft.lines(block, 2, "two sets, the number of intervals and the step of the numbers")
    ]

    def generate(now: Draft) -> None:
        for one, other, (n_intervals, step), place in rows:
            first, last = _members(now, one), _members(now, other)
            if len(first) != len(last) or step * n_intervals * len(first) > LARGEST_NUMBER:
                found = f"*{block.written} between {len(first)} and {len(last)} nodes in {n_intervals} intervals"
                raise place.wrong(found, "give two sets of as many nodes")
            inner = np.arange(1, n_intervals)
            start, end = _coordinates(now, scope, first, place), _coordinates(now, scope, last, place)
            numbers = (first[:, None] + step * inner).ravel()
            points = start[:, None] + (inner / n_intervals)[:, None] * (end - start)[:, None]
            bounds = np.concatenate([first, last])
            _make_nodes(now, block, scope, numbers, points.reshape(-1, 3), set_name, bounds)

    scope, set_name = draft.scope, read_name(block.parameters.get("NSET", ""))
    draft.generators.append(generate)


def read_ncopy(draft: Draft, block: Block) -> None:
    """*NCOPY, SHIFT: the nodes of a set again, with larger numbers, shifted and then turned about an axis."""
    if "SHIFT" not in block.parameters:
        raise refused(block, "a copy without SHIFT", "give the nodes of copies that are mirrored or scaled")
    (change,) = _numbers([block.parameters.get("CHANGENUMBER", "")], block.place, 1, (0,))
    old = draft.named(block, "OLDSET")
    shift, turn = read_placement(block)
    scope, new = draft.scope, read_name(block.parameters.get("NEWSET", ""))

    def generate(now: Draft) -> None:
        numbers = _members(now, old)
        points = _coordinates(now, scope, numbers, block.place) @ turn.T + shift
        _make_nodes(now, block, scope, numbers + change, points, new, np.empty(0, dtype=np.int64))

    draft.generators.append(generate)


def read_placement(block: Block) -> tuple[FloatArray, FloatArray]:
    """Shift (3,) and turn (3, 3) of two data lines: a shift, and two points of an axis with an angle in degrees."""
    shift, turn = np.zeros(3), np.eye(3)
    if block.lines:
        shift = np.array((read_floats(block, 0, 0) + [0.0] * 3)[:3])
    if len(block.lines) > 1:
        values = read_floats(block, 1, 7)
        point, axis = np.array(values[:3]), np.array(values[3:6]) - values[:3]
        length = np.linalg.norm(axis)
        if not 0 < length < np.inf:
            raise block.place.wrong("a rotation about two equal points", "give two points of the axis")
        x, y, z = axis / length
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = np.radians(values[6])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        shift = turn @ (shift - point) + point
    return shift, turn


def read_elgen(draft: Draft, block: Block) -> None:
    """*ELGEN: an element, and up to three times how many there are in a row with the steps of nodes and elements."""
    rows = [
        (_numbers(fields, place, 10, (0, *(1, 1, 1) * 3)), place)
        for fields, place in draft.lines(block, 2, "element, number in a row, step of nodes, step of elements")
    ]
    scope, name = draft.scope, read_name(block.parameters.get("ELSET", ""))

    def generate(now: Draft) -> None:
        for (master, *rule), place in rows:
            counts, of_nodes, of_elements = rule[::3], rule[1::3], rule[2::3]
            if np.prod([float(n) for n in counts]) > _MOST_MADE:
                raise place.wrong(f"*{block.written} of more than {_MOST_MADE} elements", "give smaller numbers")
            steps = np.array(list(product(*(range(n) for n in counts))), dtype=np.int64).reshape(-1, 3)[1:]
            own = np.array([master], dtype=np.int64)
            by_element, by_node = (steps @ np.array(each, dtype=np.int64) for each in (of_elements, of_nodes))
            _make_elements(now, block, scope, own, by_element, by_node, name)

    draft.generators.append(generate)


def read_elcopy(draft: Draft, block: Block) -> None:
    """*ELCOPY: the elements of a set again, with larger numbers of elements and nodes."""
    shifts = [block.parameters.get(name, "") for name in ("ELEMENTSHIFT", "SHIFTNODES")]
    by_element, by_node = (np.array(_numbers([text], block.place, 1, (0,))) for text in shifts)
    old = draft.named(block, "OLDSET")
    scope, name = draft.scope, read_name(block.parameters.get("NEWSET", ""))

    def generate(now: Draft) -> None:
        found = np.concatenate([each.numbers for each in now.elements if each.scope == scope] or [np.empty(0, int)])
        own = Resolver(now.element_sets, np.unique(found), {scope: 0}, "EALL").find(old)
        _make_elements(now, block, scope, own, by_element, by_node, name)

    draft.generators.append(generate)


def _numbers(fields: list[str], place: Place, n: int, default: tuple[int, ...]) -> list[int]:
    """Whole numbers, at most n, with values for those that are missing. Raises SceneError."""
    values = list(default)
    if len(fields) > n:
        raise place.wrong(f"{len(fields)} numbers", f"give at most {n}")
    for at, text in enumerate(fields):
        if text and not (is_integer(text) and 0 < abs(int(text)) <= LARGEST_NUMBER):
            raise place.wrong(f"{shown(text)!r} in place of a whole number", "give one that is not 0")
        values[at] = int(text) if text else values[at]
    return values


def _steps(first: int, last: int, step: int, place: Place) -> IntArray:
    """Numbers between two numbers. Raises SceneError where the steps do not lead from one to the other."""
    if first == last or (last - first) % abs(step) or abs(last - first) // abs(step) > _MOST_MADE:
        raise place.wrong(f"from node {first} to {last} in steps of {step}", "give a step that leads to the last node")
    step = abs(step) if last > first else -abs(step)
    return np.arange(first + step, last, step, dtype=np.int64)


def _members(now: Draft, reference: Reference) -> IntArray:
    """Nodes (m,) of a set, by number. Raises SceneError."""
    known = np.concatenate([each.numbers for each in now.nodes if each.scope == reference.scope] or [np.empty(0, int)])
    if (reference.scope, reference.target) in now.node_sets.unsorted:
        raise reference.place.wrong(f"the set {reference.target} is UNSORTED", "give sets by ascending numbers here")
    return Resolver(now.node_sets, np.unique(known), {reference.scope: 0}, "NALL").find(reference)


def _coordinates(now: Draft, scope: str, wanted: IntArray, place: Place) -> FloatArray:
    """Coordinates (m, 3) of nodes by their numbers (m,). Raises SceneError where one does not exist."""
    own = [each for each in now.nodes if each.scope == scope]
    numbers = np.concatenate([each.numbers for each in own] or [np.empty(0, dtype=np.int64)])
    order = np.argsort(numbers, kind="stable")
    at = np.searchsorted(numbers[order], wanted)
    missing = (at >= numbers.size) | (
        numbers[order][np.minimum(at, numbers.size - 1)] != wanted if numbers.size else True
    )
    if np.any(missing):
        raise place.wrong(f"there is no node {wanted[missing][0]}", "define it above this line")
    return np.concatenate([each.values for each in own])[order[at]]


def _make_nodes(
    now: Draft, block: Block, scope: str, numbers: IntArray, points: FloatArray, name: str, bounds: IntArray
) -> None:
    """Nodes that a keyword makes; the set of the name has them, and those between which they are."""
    if numbers.size > _MOST_MADE or (numbers.size and not 0 < numbers.min() <= numbers.max() <= LARGEST_NUMBER):
        raise block.place.wrong(f"*{block.written} of {numbers.size} nodes", "give numbers that are possible")
    now.nodes.append(Records(scope, numbers, points, block.place))
    if name:
        now.node_sets.add(scope, name, np.concatenate([numbers, bounds]))


def _make_elements(
    now: Draft, block: Block, scope: str, own: IntArray, by_element: IntArray, by_node: IntArray, name: str
) -> None:
    """Elements with numbers and nodes shifted by steps (m,), once for each step."""
    if own.size * by_element.size > _MOST_MADE:
        raise block.place.wrong(f"*{block.written} of more than {_MOST_MADE} elements", "give smaller numbers")
    done = 0
    for each in [each for each in now.elements if each.scope == scope]:
        rows = np.flatnonzero(np.isin(each.numbers, own))
        numbers = (each.numbers[rows] + by_element[:, None]).ravel()
        nodes = (each.values[rows] + by_node[:, None, None]).reshape(-1, each.values.shape[1])
        done += rows.size
        if (
            numbers.size
            and not 0 < min(numbers.min(), nodes.min()) <= max(numbers.max(), nodes.max()) <= LARGEST_NUMBER
        ):
            raise block.place.wrong(f"*{block.written} to impossible numbers", "give smaller steps")
        now.elements.append(Records(scope, numbers, nodes, block.place, each.kind))
        if name:
            now.element_sets.add(scope, name, np.concatenate([each.numbers[rows], numbers]))
    if done < own.size or not own.size:
        raise block.place.wrong(f"*{block.written} of an element that does not exist", "define it above this line")
