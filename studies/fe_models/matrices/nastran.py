"""Matrices of Nastran: `PARAM,EXTOUT,DMIGPCH` punches DMIG entries of the stiffness KAAX and the mass MAAX.

A header "DMIG, name, 0, form, type" comes first, then for every column "DMIG, name, node, component" and four fields
an entry: node, component, real part, imaginary part. Lines have fields of 8 characters, or with a star behind their
first word of 16. A symmetric matrix (form 6) has one triangle, a square one (form 1) both. Components are along the
axes of the basic system, unless a GRID names another one.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np

from studies.fe_models.matrices.labels import from_labels
from studies.fe_models.matrices.matrices import LARGEST_ENTRIES, LARGEST_FILE, Matrices, sorted_dofs, symmetric, wrong
from studies.fe_models.text.read_errors import check_file, shown

_LONGEST_LINE = 1000
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d{1,4})|[eEdD](\d{1,4}))?")
_AT_ONCE = 100_000
_CD = 5  # field of a GRID, counted behind its first word


@dataclass
class _Dmig:
    """A matrix while it is read.

    name: in capitals. form: 6 symmetric, 1 square. column: node and component of the present one. labels (m, 4), values
    (m,): entries that are done. rows, numbers: those that are not packed yet.
    """

    name: str
    form: int
    column: tuple[int, int] = (0, 0)
    labels: list[np.ndarray] = field(default_factory=list)
    values: list[np.ndarray] = field(default_factory=list)
    rows: list[tuple[int, int, int, int]] = field(default_factory=list)
    numbers: list[float] = field(default_factory=list)
    n_entries: int = 0

    def pack(self) -> None:
        """Makes arrays of the entries that were read so far."""
        if self.rows:
            self.labels.append(np.array(self.rows, dtype=np.int64))
            self.values.append(np.array(self.numbers))
            self.rows, self.numbers = [], []


def read_nastran(path: Path) -> Matrices:
    """Matrices of a punch file with DMIG entries; other entries in it are passed over.

    Raises
    ------
    SceneError
        About "matrices": where there are not one stiffness and one mass, they are complex or not symmetric, or a line
        makes no sense.
    """
    check_file(path, LARGEST_FILE, "matrices")
    found = _Reader(path).matrices()
    stiffness, mass = (_choose(found, letter, path.name) for letter in "KM")
    labels = [np.concatenate(item.labels) for item in (stiffness, mass)]
    for item, of_item in zip((stiffness, mass), labels, strict=True):
        _check_triangles(item, of_item, path.name)
    values = [np.concatenate(item.values) for item in (stiffness, mass)]
    rows = from_labels(labels[0], labels[1], values[0], values[1], (path.name,))
    if np.any(rows.node < 1):
        wrong(path.name, "a node below 1", "punch the matrices again")
    return sorted_dofs(
        Matrices(
            symmetric(rows.stiffness, rows.node.size, path.name),
            symmetric(rows.mass, rows.node.size, path.name),
            rows.node,
            rows.direction,
            (path.name,),
            "nastran",
        )
    )


def _check_triangles(item: _Dmig, labels: np.ndarray, file: str) -> None:
    """Raises SceneError where a square matrix has entries (m, 4) of one triangle alone: it would not be symmetric."""
    above = np.sign((labels[:, 0] - labels[:, 2]) * 16 + labels[:, 1] - labels[:, 3])
    if item.form == 1 and len(np.unique(above[above != 0])) == 1:
        remedy = "write form 6 into its header if it is symmetric, else both triangles"
        wrong(file, f"{shown(item.name)} is square by its header (form 1), and has one triangle only", remedy)


def _choose(found: dict[str, _Dmig], letter: str, file: str) -> _Dmig:
    """The stiffness (K) or mass (M): KAAX where it is there, else the only one with the letter."""
    names = [name for name in found if name.startswith(letter) and not name.startswith(("K4", "K42"))]
    usual = f"{letter}AAX"
    if usual not in names and len(names) != 1:
        wrong(file, f"no matrix {usual} but {', '.join(map(shown, found)) or 'none'}", "punch it: PARAM,EXTOUT,DMIGPCH")
    chosen = found[usual if usual in names else names[0]]
    if not chosen.labels:
        wrong(file, f"the matrix {usual if usual in names else shown(names[0])} has no entries", "punch it again")
    return chosen


class _Reader:
    def __init__(self, path: Path) -> None:
        self.file = path.name
        self.path = path
        self.found: dict[str, _Dmig] = {}
        self.number = 0
        self.current: _Dmig | None = None
        self.fields: list[str] = []
        self.grid: list[str] = []  # fields of a GRID that goes on in the next line

    def matrices(self) -> dict[str, _Dmig]:
        """All real symmetric matrices by name."""
        with self.path.open(encoding="latin-1") as file:
            # a readline with a limit, as a line of a damaged file may be as long as the file
            while lines := list(islice(iter(lambda: file.readline(_LONGEST_LINE + 1), ""), _AT_ONCE)):
                if self._plain_lines(lines):
                    self.number += len(lines)
                    continue
                for text in lines:
                    self.number += 1
                    if len(text) > _LONGEST_LINE or "\0" in text:
                        self._wrong("is no text, or very long")
                    self._line(text.rstrip())
        self._entries()
        for item in self.found.values():
            item.pack()
        return self.found

    def _line(self, text: str) -> None:
        first = text[:8].strip().upper()
        if first in ("DMIG", "DMIG*"):
            self._entries()
            self._begin(_cut(text, 16 if first.endswith("*") else 8))
        elif text.startswith(("*", "+", "        ")) or not text:
            if self.grid and text:
                self._check_grid([*self.grid, *_cut(text, 16)])
            if self.current is None or not text:
                return
            if text[0] == "*" and not self.fields and self._plain_entry(text):
                return
            self.fields += _cut(text, 16 if text[0] == "*" else 8)
            if len(self.fields) > 1000:
                self._entries()
        elif text.startswith("$"):
            return
        else:
            if "," in text and first.split(",")[0] == "DMIG":
                self._wrong("is a DMIG with commas")
            self._entries()
            self.current = None
            word = first.split(",")[0]
            if word in ("GRID", "GRDSET"):
                self._check_grid(text.split(",")[1:] if "," in text else _cut(text, 8))
            elif word in ("GRID*", "GRDSET*"):
                self.grid = _cut(text, 16)

    def _check_grid(self, fields: list[str]) -> None:
        """fields: number, system of the position, position (3), system of the displacements, and more."""
        self.grid = []
        if len(fields) > _CD and fields[_CD].strip() not in ("", "0"):
            of = f"GRID {shown(fields[0])}" if fields[0].strip() else "GRDSET"
            found = f"line {self.number}: {of} has displacements in the coordinate system {shown(fields[_CD])} (CD)"
            wrong(self.file, found, "write the matrices with all displacements in the basic system: CD blank")

    def _plain_lines(self, lines: list[str]) -> bool:
        """Takes lines that are all columns and entries of one matrix in large fields; False where one of them is not.

        The same as `_line` for each of them, in arrays: a large file has nearly no others.
        """
        item = self.current
        if item is None or self.fields:
            return False
        try:
            table = np.array(lines, dtype="S73").view("S1").reshape(len(lines), 73)
            heads, entries = (table[:, :5] == np.frombuffer(b"DMIG*", dtype="S1")).all(axis=1), table[:, 0] == b"*"
            blank = np.isin(table, (b" ", b"", b"\n", b"\r"))
            if (
                not (heads | entries).all()
                or not (blank[entries, 1:8].all() and blank[:, 56:].all())
                or np.any(table == b"_")
                or np.any(_field(table[heads], 8) != item.name.ljust(16).encode())
            ):
                return False
            table[:, 40:56][table[:, 40:56] == b"D"] = b"E"
            nodes, components = (_field(table[entries], at).astype(np.int64) for at in (8, 24))
            values = _field(table[entries], 40).astype(np.float64)
            columns = np.stack([_field(table[heads], at).astype(np.int64) for at in (24, 40)], axis=1)
        except (ValueError, OverflowError, UnicodeEncodeError):
            return False
        columns = np.concatenate((np.array([item.column], dtype=np.int64), columns))
        for found in (nodes, columns[1:, 0]):
            if np.any((found < 1) | (found >= 2**31)):
                return False
        if np.any((components < 0) | (components > 9)):
            return False
        item.pack()
        item.labels.append(np.column_stack((columns[np.cumsum(heads)[entries]], nodes, components)))
        item.values.append(values)
        item.column = int(columns[-1, 0]), int(columns[-1, 1])
        self._count(item, values.size)
        return True

    def _count(self, item: _Dmig, n: int) -> None:
        item.n_entries += n
        if item.n_entries > LARGEST_ENTRIES:
            wrong(self.file, f"more than {LARGEST_ENTRIES} entries", "reduce the model")

    def _plain_entry(self, text: str) -> bool:
        """Takes a line of one entry in large fields, by far the most frequent one; False where it is not that."""
        assert self.current is not None
        try:
            node, component, value = int(text[8:24]), int(text[24:40]), float(text[40:56].replace("D", "E"))
        except ValueError:
            return False
        if text[56:72].strip() or "_" in text:
            return False
        self._add(node, component, value)
        return True

    def _begin(self, fields: list[str]) -> None:
        name = (fields[0] if fields else "").upper()
        fields = fields + [""] * (8 - len(fields))
        node = self._integer(fields[1])
        if node == 0:
            form, kind = self._integer(fields[2]), self._integer(fields[3])
            if name in self.found:
                self._wrong(f"begins {shown(name)} again")
            # others than the two wanted ones, such as loads, may have any form and type
            wanted = name[:1] in ("K", "M") and not name.startswith("K4")
            if wanted and kind not in (1, 2):
                self._wrong(f"says that {shown(name)} is complex")
            if wanted and form not in (1, 6):
                self._wrong(f"says that {shown(name)} is of form {form}, neither 6 (symmetric) nor 1 (square)")
            if len(self.found) >= 1000:
                self._wrong("is one matrix too many")
            self.found[name] = _Dmig(name, form)
            self.current = None
            return
        if name not in self.found:
            self._wrong(f"is a column of {shown(name)}, whose header is missing")
        self.current = self.found[name] if name[:1] in ("K", "M") and not name.startswith("K4") else None
        if self.current is None:
            return
        self.current.column = node, self._integer(fields[2])
        self.fields = fields[4:8] if any(fields[4:8]) else []

    def _entries(self) -> None:
        """Takes the fields since the last column as entries of four fields each."""
        fields, self.fields = self.fields, []
        if self.current is None:
            return
        fields += [""] * (-len(fields) % 4)
        for first in range(0, len(fields), 4):
            node, component, value, imaginary = fields[first : first + 4]
            if not (node or component or value):
                continue
            if imaginary and self._real(imaginary) != 0:
                self._wrong("has an imaginary part, or is no entry of a DMIG")
            self._add(self._integer(node), self._integer(component or "0"), self._real(value))

    def _add(self, node: int, component: int, value: float) -> None:
        item = self.current
        assert item is not None
        if not 0 < node < 2**31 or not 0 <= component < 10:
            self._wrong(f"has the node {node}, component {component}")
        item.rows.append((*item.column, node, component))
        item.numbers.append(value)
        self._count(item, 1)
        if len(item.rows) >= _AT_ONCE:
            item.pack()

    def _integer(self, text: str) -> int:
        if not re.fullmatch(r"\d{1,10}", text):
            self._wrong(f"has {shown(text)!r} in place of a whole number")
        return int(text)

    def _real(self, text: str) -> float:
        match = _REAL.fullmatch(text)
        if match is None:
            self._wrong(f"has {shown(text)!r} in place of a number")
        return float(f"{match[1]}e{match[2] or match[3] or 0}")

    def _wrong(self, found: str) -> NoReturn:
        wrong(self.file, f"line {self.number} {found}", "punch the matrices again, real and symmetric")


def _field(table: np.ndarray, at: int) -> np.ndarray:
    """Texts (m,) of 16 characters out of a table (m, n) of characters."""
    return np.ascontiguousarray(table[:, at : at + 16]).view("S16").reshape(len(table))


def _cut(text: str, width: int) -> list[str]:
    """All fields of a line, empty ones at its end as well, but for the first and the last, of 8 characters."""
    return [text[at : at + width].strip() for at in range(8, 72, width)]
