"""Meshes of Gmsh: `.msh` files of the formats 2.2 and 4.1, text and binary, as the manual of Gmsh describes them.

By hand: meshio 5.3.5 refuses a mesh of which a part is in no physical group, and elements with 13 and 15 nodes.
"""

import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.model import deck_of_arrays
from studies.fe_models.files import FloatArray, IntArray, library_errors
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

_SOLID = 3
_Known = TypeVar("_Known")
_Block = tuple[int, IntArray, list[tuple[int, IntArray]]]
"""Number of the kind, node numbers (n, n_nodes), and physical groups: tag and which of the elements."""


class _Numbers:
    """The numbers of a section, one after the other."""

    def __init__(self, section: bytes, *, binary: bool) -> None:
        self._values: Any = memoryview(section) if binary else np.array(section.split(), dtype=np.float64)
        self._at, self._binary = 0, binary

    def take(self, kind: str, n: int = 1) -> NDArray[Any]:
        """The next n of a kind of numpy. ValueError: there are fewer, or others."""
        end = self._at + n * (np.dtype(kind).itemsize if self._binary else 1)
        if not self._at <= end <= len(self._values):
            raise ValueError("numbers are missing")
        given, self._at = self._values[self._at : end], end
        found = np.frombuffer(given, dtype=kind) if self._binary and n else np.array(given, dtype=kind)
        if not self._binary and (found != given).any():
            raise ValueError("no whole number")
        return found

    def count(self) -> int:
        """The next number, a count."""
        return int(self.take("<u8")[0])


def read_gmsh(path: Path) -> Deck:
    """The mesh of a .msh file, whether all of it belongs to physical groups or not. Raises SceneError."""
    with library_errors(path, "fretwear", "", "model"):
        content = path.read_bytes()
        sections, at = dict[bytes, bytes](), 0
        while match := re.compile(rb"\$(\w+)\s*?\n").search(content, at):
            at = content.index(b"$End" + match[1], match.end())
            sections.setdefault(match[1], content[match.end() : at])
            at += len(b"$End" + match[1])
        version, is_binary, size = sections[b"MeshFormat"].split(maxsplit=3)[:3]
        if version not in (b"2.2", b"4.1") or size != b"8":
            found = f"{path.name} has format {version.decode()}"
            raise SceneError("model", found, "save it in the format 4.1 or 2.2 of Gmsh")
        binary = is_binary == b"1"
        if binary and b"\x01\x00\x00\x00" not in sections[b"MeshFormat"]:
            raise ValueError("of a machine with another order of bytes")
        numbers, points = (_nodes_22 if version == b"2.2" else _nodes_41)(sections[b"Nodes"], binary=binary)
        if version == b"2.2":
            blocks = [*_elements_22(sections[b"Elements"], binary=binary)]
        else:
            physical = _entities(sections.get(b"Entities"), binary=binary)
            blocks = [*_elements_41(sections[b"Elements"], physical, binary=binary)]
        blocks = [(kind, 1 + _places(numbers, nodes), groups) for kind, nodes, groups in blocks]
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
        if dimension == _SOLID:
            in_deck, order = _known(_SOLIDS, kind)
            # format 2.2 writes an element once for each of its groups
            before = len(numbered)
            numbers = np.array([numbered.setdefault(row.tobytes(), len(numbered) + 1) for row in nodes], dtype=np.int64)
            new, first = np.unique(numbers, return_index=True)
            blocks.append((in_deck, new[new > before], nodes[first[new > before]][:, order]))
        for tag, members in groups:
            if group := names.get((dimension, tag)):
                node_sets.append((group, np.unique(nodes[members])))
                if numbers is not None:
                    element_sets.append((group, numbers[members]))
    return deck_of_arrays(name, (np.arange(1, len(points) + 1), points), blocks, node_sets, element_sets)


def _places(numbers: IntArray, nodes: IntArray) -> IntArray:
    """Where the nodes of elements are among all numbers. ValueError: one does not exist."""
    order = np.argsort(numbers, kind="stable")
    places = order[np.minimum(np.searchsorted(numbers[order], nodes), len(numbers) - 1)]
    if (numbers[places] != nodes).any():
        raise ValueError("a node does not exist")
    return np.asarray(places)


def _known(table: dict[int, _Known], kind: int) -> _Known:
    if kind not in table:
        remedy = "mesh with tetrahedra, wedges and hexahedra of first or second order, Mesh.SecondOrderIncomplete = 1"
        raise SceneError("model", f"elements of type {kind} of Gmsh", remedy)
    return table[kind]


def _nodes_22(section: bytes, *, binary: bool) -> tuple[IntArray, FloatArray]:
    """Numbers (n,) and coordinates (n, 3)."""
    count, rest = section.split(b"\n", 1)
    if binary:
        rows = np.frombuffer(rest, [("number", "<i4"), ("at", "<f8", 3)], int(count))
        return rows["number"].astype(np.int64), rows["at"]
    table = _Numbers(rest, binary=False).take("<f8", 4 * int(count)).reshape(-1, 4)
    return table[:, 0].astype(np.int64), table[:, 1:]


def _nodes_41(section: bytes, *, binary: bool) -> tuple[IntArray, FloatArray]:
    given, numbers, points = _Numbers(section, binary=binary), [], []
    n_blocks = int(given.take("<u8", 4)[0])
    for _ in range(n_blocks):
        dimension, _, is_parametric = given.take("<i4", 3).tolist()
        n = given.count()
        numbers.append(given.take("<u8", n).astype(np.int64))
        n_columns = 3 + is_parametric * dimension
        points.append(given.take("<f8", n_columns * n).reshape(n, n_columns)[:, :3])
    return np.concatenate(numbers), np.concatenate(points)


def _elements_22(section: bytes, *, binary: bool) -> Iterator[_Block]:
    """Elements of one kind that follow each other, with the tag that is their physical group."""
    count, rest = section.split(b"\n", 1)
    parts: list[tuple[int, int, IntArray]] = []
    if binary:
        given, n_read = _Numbers(rest, binary=True), 0
        while n_read < int(count):
            kind, n, n_tags = given.take("<i4", 3).tolist()
            n_columns = 1 + n_tags + _known(_SIZES, kind)[1]
            parts.append((kind, n_tags, given.take("<i4", n * n_columns).reshape(n, n_columns).astype(np.int64)))
            n_read += n
    else:
        lines = [line.split() for line in rest.splitlines()][: int(count)]
        for (kind, n_tags), rows in groupby(lines, lambda row: (int(row[1]), int(row[2]))):
            table = np.array([*rows], dtype=np.float64).astype(np.int64)
            parts.append((kind, n_tags, np.delete(table, (1, 2), axis=1)))
    for kind, same in groupby(parts, lambda part: part[0]):
        found = [(each[:, 1] if n_tags else np.zeros(len(each)), each[:, 1 + n_tags :]) for _, n_tags, each in same]
        physical, nodes = (np.concatenate(each) for each in zip(*found, strict=True))
        if nodes.shape[1] != _known(_SIZES, kind)[1]:
            raise ValueError("nodes of an element are missing")
        yield kind, nodes, [(int(tag), np.flatnonzero(physical == tag)) for tag in np.unique(physical)]


def _elements_41(section: bytes, physical: dict[tuple[int, int], list[int]], *, binary: bool) -> Iterator[_Block]:
    """physical: tags of the groups of each entity, by its dimension and tag."""
    given = _Numbers(section, binary=binary)
    n_blocks = int(given.take("<u8", 4)[0])
    for _ in range(n_blocks):
        dimension, entity, kind = given.take("<i4", 3).tolist()
        n, n_columns = given.count(), 1 + _known(_SIZES, kind)[1]
        nodes = given.take("<u8", n * n_columns).reshape(n, n_columns)[:, 1:].astype(np.int64)
        yield kind, nodes, [(abs(tag), np.arange(n)) for tag in physical.get((dimension, entity), [])]


def _entities(section: bytes | None, *, binary: bool) -> dict[tuple[int, int], list[int]]:
    if section is None:
        return {}
    given, found = _Numbers(section, binary=binary), dict[tuple[int, int], list[int]]()
    for dimension, n in enumerate(given.take("<u8", 4).tolist()):
        for _ in range(n):
            tag = int(given.take("<i4")[0])
            given.take("<f8", 6 if dimension else 3)
            found[dimension, tag] = given.take("<i4", given.count()).tolist()
            if dimension:
                given.take("<i4", given.count())
    return found
