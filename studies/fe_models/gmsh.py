"""Meshes of Gmsh: `.msh` files of the formats 2.2 and 4.1, text and binary, as the manual of Gmsh describes them.

By hand: meshio 5.3.5 refuses a mesh of which a part is in no physical group, and elements with 13 and 15 nodes.
"""

import re
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.model import deck_of_arrays
from studies.fe_models.files import FloatArray, IntArray, library_errors
from studies.finite_element.solid_mesh import find_places
from studies.scene_error import SceneError

_SIZES = {1: (1, 2), 2: (2, 3), 3: (2, 4), 4: (3, 4), 5: (3, 8), 6: (3, 6), 7: (3, 5), 8: (1, 3), 9: (2, 6), 10: (2, 9)}
_SIZES |= {11: (3, 10), 12: (3, 27), 13: (3, 18), 14: (3, 14), 15: (0, 1), 16: (2, 8), 17: (3, 20), 18: (3, 15)}
_SIZES |= {19: (3, 13)}
"""Dimension and number of nodes of elements, by the numbers of Gmsh."""

_SOLIDS = {
    4: ("C3D4", [*range(4)]),
    5: ("C3D8I", [*range(8)]),
    6: ("C3D6", [*range(6)]),
    11: ("C3D10", [*range(8), 9, 8]),
    17: ("C3D20", [*range(9), 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]),
    18: ("C3D15", [*range(7), 9, 7, 12, 14, 13, 8, 10, 11]),
}
"""Kind and order of the nodes in a deck."""

_Take = Callable[..., NDArray[Any]]
_Block = tuple[int, IntArray, list[tuple[int, IntArray]]]
"""Number of the kind, node numbers (n, n_nodes), and physical groups: tag and which of the elements."""


def read_gmsh(path: Path) -> Deck:
    """The mesh of a .msh file, whether all of it belongs to physical groups or not. Raises SceneError."""
    with library_errors(path, "fretwear", "", "model"):
        content, sections, at = path.read_bytes(), dict[bytes, bytes](), 0
        while match := re.compile(rb"\$(\w+)\s*?\n").search(content, at):
            at = content.index(b"$End" + match[1], match.end())
            sections[match[1]] = content[match.end() : at]
            at += len(b"$End" + match[1])
        version, is_binary, size = sections[b"MeshFormat"].split(maxsplit=3)[:3]
        if version not in (b"2.2", b"4.1") or size != b"8":
            found = f"{path.name} has format {version.decode()}"
            raise SceneError("model", found, "save it in the format 4.1 or 2.2 of Gmsh")
        binary, nodes, elements = is_binary == b"1", sections[b"Nodes"], sections[b"Elements"]
        if binary and b"\x01\x00\x00\x00" not in sections[b"MeshFormat"]:
            raise ValueError("of a machine with another order of bytes")
        if version == b"2.2":
            (numbers, points), blocks = _nodes_22(nodes, binary), [*_elements_22(elements, binary)]
        else:
            physical = _entities(_numbers(sections[b"Entities"], binary)) if b"Entities" in sections else {}
            numbers, points = _nodes_41(_numbers(nodes, binary))
            blocks = [*_elements_41(_numbers(elements, binary), physical)]
        blocks = [(kind, 1 + find_places(nodes, numbers), groups) for kind, nodes, groups in blocks]
        if any((nodes == 0).any() for _, nodes, _ in blocks):
            raise ValueError("a node does not exist")
        named = re.findall(rb'(\d+)\s+(-?\d+)\s+"([^"]*)"', sections.get(b"PhysicalNames", b""))
        names = {(int(dim), int(tag)): name.decode(errors="replace") for dim, tag, name in named}
    return _deck(path.name, points, blocks, names)


def _deck(name: str, points: FloatArray, given: list[_Block], names: dict[tuple[int, int], str]) -> Deck:
    blocks: list[tuple[str, IntArray, IntArray]] = []
    node_sets: list[tuple[str, IntArray]] = []
    element_sets: list[tuple[str, IntArray]] = []
    numbered: dict[bytes, int] = {}
    for kind, nodes, groups in given:
        dimension, numbers = _SIZES[kind][0], None
        if dimension == 3:
            if kind not in _SOLIDS:
                raise _not_read(kind)
            # format 2.2 writes an element once for each of its groups
            (in_deck, order), before = _SOLIDS[kind], len(numbered)
            numbers = np.array([numbered.setdefault(row.tobytes(), len(numbered) + 1) for row in nodes], dtype=np.int64)
            new, first = np.unique(numbers, return_index=True)
            blocks.append((in_deck, new[new > before], nodes[first[new > before]][:, order]))
        for tag, members in groups:
            if group := names.get((dimension, tag)):
                node_sets.append((group, np.unique(nodes[members])))
                if numbers is not None:
                    element_sets.append((group, numbers[members]))
    return deck_of_arrays(name, (np.arange(1, len(points) + 1), points), blocks, node_sets, element_sets)


def _not_read(kind: int) -> SceneError:
    remedy = "mesh with tetrahedra, wedges and hexahedra of first or second order, Mesh.SecondOrderIncomplete = 1"
    return SceneError("model", f"elements of type {kind} of Gmsh", remedy)


def _n_nodes(kind: int) -> int:
    if kind not in _SIZES:
        raise _not_read(kind)
    return _SIZES[kind][1]


def _numbers(section: bytes, binary: bool) -> _Take:
    """What takes the next n numbers, of a kind of numpy, out of a section; ValueError: there are fewer, or others."""
    values: Any = memoryview(section) if binary else np.array(section.split(), dtype=np.float64)
    at = 0

    def take(kind: str, n: int = 1) -> NDArray[Any]:
        nonlocal at
        begin, at = at, at + int(n) * (np.dtype(kind).itemsize if binary else 1)
        if not begin <= at <= len(values):
            raise ValueError("numbers are missing")
        given = values[begin:at]
        found = np.frombuffer(given, dtype=kind) if binary and n else np.array(given, dtype=kind)
        if not binary and (found != given).any():
            raise ValueError("no whole number")
        return found

    return take


def _nodes_22(section: bytes, binary: bool) -> tuple[IntArray, FloatArray]:
    """Numbers (n,) and coordinates (n, 3). Format 2.2 has the number of rows as text, then the rows."""
    count, rest = section.split(b"\n", 1)
    if binary:
        rows = np.frombuffer(rest, [("number", "<i4"), ("at", "<f8", 3)], int(count))
        return rows["number"].astype(np.int64), rows["at"]
    table = _numbers(rest, binary)("<f8", 4 * int(count)).reshape(-1, 4)
    return table[:, 0].astype(np.int64), table[:, 1:]


def _elements_22(section: bytes, binary: bool) -> Iterator[_Block]:
    """Elements of one kind that follow each other, with the tag that is their physical group."""
    count, rest = section.split(b"\n", 1)
    parts: list[tuple[int, int, IntArray]] = []
    if binary:
        take, left = _numbers(rest, binary), int(count)
        while left > 0:
            kind, n, n_tags = take("<i4", 3).tolist()
            n_columns, left = 1 + n_tags + _n_nodes(kind), left - n
            parts.append((kind, n_tags, take("<i4", n * n_columns).reshape(n, n_columns).astype(np.int64)))
    else:
        lines = [line.split() for line in rest.splitlines()][: int(count)]
        for (kind, n_tags), rows in groupby(lines, lambda row: (int(row[1]), int(row[2]))):
            table = np.delete(np.array([*rows], dtype=np.float64), (1, 2), axis=1)
            parts.append((kind, n_tags, table.astype(np.int64)))
    for kind, same in groupby(parts, lambda part: part[0]):
        found = [(each[:, 1] if n_tags else 0 * each[:, 0], each[:, 1 + n_tags :]) for _, n_tags, each in same]
        physical, nodes = (np.concatenate(each) for each in zip(*found, strict=True))
        if nodes.shape[1] != _n_nodes(kind):
            raise ValueError("nodes of an element are missing")
        yield kind, nodes, [(int(tag), np.flatnonzero(physical == tag)) for tag in np.unique(physical)]


def _entities(take: _Take) -> dict[tuple[int, int], list[int]]:
    """Tags of the physical groups of each entity, by dimension and tag. Format 4.1 has blocks of an entity each."""
    found = {}
    for dimension, n in enumerate(take("<u8", 4).tolist()):
        for _ in range(n):
            tag = int(take("<i4")[0])
            take("<f8", 6 if dimension else 3)
            found[dimension, tag] = take("<i4", *take("<u8")).tolist()
            if dimension:
                take("<i4", *take("<u8"))
    return found


def _nodes_41(take: _Take) -> tuple[IntArray, FloatArray]:
    numbers, points = [], []
    for _ in range(int(take("<u8", 4)[0])):
        dimension, _, is_parametric = take("<i4", 3).tolist()
        n, n_columns = int(take("<u8")[0]), 3 + is_parametric * dimension
        numbers.append(take("<u8", n).astype(np.int64))
        points.append(take("<f8", n_columns * n).reshape(n, n_columns)[:, :3])
    return np.concatenate(numbers), np.concatenate(points)


def _elements_41(take: _Take, physical: dict[tuple[int, int], list[int]]) -> Iterator[_Block]:
    for _ in range(int(take("<u8", 4)[0])):
        dimension, entity, kind = take("<i4", 3).tolist()
        n, n_columns = int(take("<u8")[0]), 1 + _n_nodes(kind)
        nodes = take("<u8", n * n_columns).reshape(n, n_columns)[:, 1:].astype(np.int64)
        yield kind, nodes, [(abs(tag), np.arange(n)) for tag in physical.get((dimension, entity), [])]
