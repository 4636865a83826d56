"""Nodes and elements of a draft under the numbers that they have in the deck."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.fe_models.deck.draft import Draft, Records
from studies.fe_models.deck.mesh import ElementBlock, FloatArray, IntArray
from studies.fe_models.text.numbers import LARGEST_NUMBER
from studies.fe_models.text.read_errors import Place
from studies.scene_error import SceneError


def find_offsets(draft: Draft) -> dict[str, int]:
    """What is added to the numbers of every scope: 0 for the first one, then a power of ten and its multiples."""
    largest: dict[str, int] = {}
    for each in (*draft.nodes, *draft.elements):
        largest[each.scope] = max(largest.get(each.scope, 0), int(each.numbers.max(initial=0)))
    step = 10 ** len(str(max(largest.values(), default=0)))
    if step * len(largest) > LARGEST_NUMBER and len(largest) > 1:
        raise SceneError("model", f"{draft.name}: {len(largest)} instances with numbers up to {step}", "number from 1")
    return {scope: place * step for place, scope in enumerate(largest)} or {"": 0}


def build_nodes(draft: Draft, offsets: Mapping[str, int]) -> tuple[IntArray, FloatArray]:
    """Numbers (n,), ascending, and coordinates (n, 3)."""
    if not any(each.numbers.size for each in draft.nodes):
        what = "nodes: no *PART has an *INSTANCE" if draft.parts and not draft.placed else "nodes"
        raise SceneError("model", f"{draft.name} has no {what}", "give the deck with its mesh")
    numbers = np.concatenate([each.numbers + offsets[each.scope] for each in draft.nodes])
    coordinates = np.concatenate([each.values.astype(np.float64) for each in draft.nodes])
    scopes = np.repeat([each.scope for each in draft.nodes], [each.numbers.size for each in draft.nodes])
    for scope, (shift, turn) in draft.placed.items():
        own = scopes == scope
        coordinates[own] = coordinates[own] @ turn.T + shift
    order = np.argsort(numbers, kind="stable")
    numbers, coordinates = numbers[order], coordinates[order]
    again = np.flatnonzero(numbers[1:] == numbers[:-1])
    moved = again[np.any(coordinates[again] != coordinates[again + 1], axis=1)]
    if moved.size:
        number = numbers[moved[0]]
        place = _place_of(draft.nodes, offsets, number)
        raise place.wrong(f"node {number} is defined again at another position", "give each node once")
    keep = np.ones(numbers.size, dtype=bool)
    keep[again] = False
    return numbers[keep].astype(np.int64), coordinates[keep]


def _place_of(records: list[Records], offsets: Mapping[str, int], number: int) -> Place:
    """Place of the last record of a number."""
    return next(each.place for each in reversed(records) if number - offsets[each.scope] in each.numbers)


def build_blocks(draft: Draft, offsets: Mapping[str, int], nodes: IntArray) -> tuple[ElementBlock, ...]:
    """Elements, one block a kind, by ascending number."""
    kinds: dict[str, list[tuple[IntArray, IntArray]]] = {}
    for each in draft.elements:
        used = each.values.astype(np.int64) + offsets[each.scope]
        at = np.minimum(np.searchsorted(nodes, used), nodes.size - 1)
        missing = nodes[at] != used
        if missing.any():
            row, column = np.argwhere(missing)[0]
            found = f"element {each.numbers[row]} has the node {each.values[row, column]}, which does not exist"
            raise each.place.wrong(found, "give the whole mesh")
        kinds.setdefault(each.kind, []).append((each.numbers + offsets[each.scope], used))
    blocks: list[ElementBlock] = []
    for kind, parts in kinds.items():
        numbers, used = (np.concatenate(each) for each in zip(*parts, strict=True))
        order = np.argsort(numbers, kind="stable")
        blocks.append(ElementBlock(kind, numbers[order], used[order]))
    numbers = np.sort(np.concatenate([block.numbers for block in blocks] or [np.empty(0, dtype=np.int64)]))
    again = numbers[1:][numbers[1:] == numbers[:-1]]
    if again.size:
        place = _place_of(draft.elements, offsets, again[0])
        raise place.wrong(f"element {again[0]} is defined again", "give each element once")
    return tuple(block for block in blocks if block.numbers.size)
