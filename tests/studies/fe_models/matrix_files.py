"""Files with matrices that the tests write, after the manuals of the codes, and matrices to write."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")


def run_ccx(folder: Path, text: str, name: str = "sector") -> Path:
    """Runs a deck and returns the name that its files have in common."""
    (folder / f"{name}.inp").write_text(text)
    done = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert "Job finished" in done.stdout, done.stdout[-500:]
    return folder / name


System = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Stiffness and mass, dense, and node and direction (from 1) of the rows."""


def chain(nodes: tuple[int, ...] = (1, 2, 10)) -> System:
    """Stiffness and mass (dense, definite) of some nodes, and node and direction (from 1) of the rows."""
    n = 3 * len(nodes)
    generator = np.random.default_rng(5)
    stiffness = generator.normal(size=(n, n))
    stiffness = 1e9 * (stiffness + stiffness.T + n * np.eye(n))
    mass = np.diag(np.arange(1.0, n + 1)) * 1e-3
    mass[0, 1] = mass[1, 0] = 2e-4
    return stiffness, mass, np.repeat(nodes, 3), np.tile([1, 2, 3], len(nodes))


def entries(matrix: np.ndarray, lower: bool = False, both: bool = False) -> list[tuple[int, int, float]]:
    """Row, column (from 0) and value of the upper triangle, column by column, or the lower one, or both."""
    n = len(matrix)
    found = [(row, column, matrix[row, column]) for column in range(n) for row in range(n) if matrix[row, column]]
    return [(r, c, v) for r, c, v in found if both or (r >= c if lower else r <= c)]


def write_calculix(
    folder: Path, name: str = "job", nodes: tuple[int, ...] = (1, 2, 10), system: System | None = None
) -> Path:
    stiffness, mass, node, direction = system or chain(nodes)
    for matrix, end in ((stiffness, "sti"), (mass, "mas")):
        lines = [f"{r + 1} {c + 1}  {v:.13e}" for r, c, v in entries(matrix)]
        (folder / f"{name}.{end}").write_text("\n".join(lines) + "\n")
    (folder / f"{name}.dof").write_text("".join(f"{n}.{d}\n" for n, d in zip(node, direction, strict=True)))
    return folder / name


def write_abaqus(folder: Path, name: str = "job", triangles: str = "lower", system: System | None = None) -> Path:
    stiffness, mass, node, direction = system or chain((1, 2, -7))
    for matrix, end in ((stiffness, "STIF1"), (mass, "MASS1")):
        lines = [
            f"{node[r]},{direction[r]}, {node[c]},{direction[c]}, {v:.15e}"
            for r, c, v in entries(matrix, triangles == "lower", triangles == "both")
        ]
        (folder / f"{name}_{end}.mtx").write_text("** a matrix\n" + "\n".join(lines) + "\n")
    return folder / name


def write_nastran(folder: Path, name: str = "job", large: bool = True, system: System | None = None) -> Path:
    """DMIG entries in large fields as Nastran punches them, or in small fields, two entries a line."""
    stiffness, mass, node, direction = system or chain()
    lines = ["$ matrices of a superelement", "GRID,1,,0.,0.,0."]
    for title, matrix in (("KAAX", stiffness), ("PAX", stiffness), ("MAAX", mass)):
        lines.append(f"{'DMIG':8}{title:8}{0:8d}{9 if title == 'PAX' else 6:8d}{2:8d}{0:8d}")
        for column in range(len(matrix)):
            rows = [row for row in range(column, len(matrix)) if matrix[row, column]]
            at = node[column], direction[column]
            if large:
                lines.append(f"{'DMIG*':8}{title:16}{at[0]:16d}{at[1]:16d}")
                for row in rows:
                    value = f"{matrix[row, column]:.9E}".replace("E", "D")
                    lines.append(f"{'*':8}{node[row]:16d}{direction[row]:16d}{value:>16}")
                continue
            groups = [f"{node[r]:8d}{direction[r]:8d}{_short(matrix[r, column]):>8}{'':8}" for r in rows]
            lines.append(f"{'DMIG':8}{title:8}{at[0]:8d}{at[1]:8d}{'':8}{groups[0][:24]}")
            for first in range(1, len(groups), 2):
                lines.append(f"{'':8}{''.join(groups[first : first + 2])}")
    (folder / f"{name}.pch").write_text("\n".join(lines) + "\n")
    return folder / name


def _short(value: float) -> str:
    """A number in 8 characters, as Nastran has it: 1.234+9."""
    mantissa, exponent = f"{value:.3e}".split("e")
    return f"{mantissa}{int(exponent):+d}"
