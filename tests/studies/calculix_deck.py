"""Input decks for CalculiX from the project's own sector mesh, and readers of its tables. A helper of the tests."""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from solver.model import FloatArray, IntArray
from studies.scenes.dovetail_mesh import DovetailMesh
from studies.scenes.dovetail_parameters import Parameters

# Corners of the faces S1 to S6.
FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))

# Penalties of CalculiX's contact, Pa/m: at 10 MPa the flanks overlap by 1e-8 m and stick within 1e-7 m.
_NORMAL_SLOPE = 1e15
_STICK_SLOPE = 1e14


@dataclass(frozen=True)
class CalculixMesh:
    """A sector for CalculiX, node and element numbers from 0 (a deck counts from 1).

    nodes (n_nodes, 3). elements (n_elements, 8). clamped, left, right: node numbers; the clamped ones are not
    among left and right, which are in no particular order.
    """

    nodes: FloatArray
    elements: IntArray
    clamped: IntArray
    left: IntArray
    right: IntArray


def build_calculix_mesh(mesh: DovetailMesh, glued: bool = True) -> CalculixMesh:
    """The sector's mesh, flanks glued by shared nodes or left apart."""
    elements = mesh.mesh.elements.copy()
    if glued:
        follower = np.arange(len(mesh.mesh.nodes))
        follower[mesh.blade_flanks] = mesh.disk_flanks
        elements = follower[elements]
    return CalculixMesh(
        nodes=mesh.mesh.nodes,
        elements=elements,
        clamped=mesh.bore_nodes,
        left=np.setdiff1d(mesh.left_nodes, mesh.bore_nodes),
        right=np.setdiff1d(mesh.right_nodes, mesh.bore_nodes),
    )


def _rows(numbers: IntArray) -> str:
    """Numbers counted from 1, eight in a line."""
    ones = [str(number + 1) for number in numbers]
    return ",\n".join(", ".join(ones[start : start + 8]) for start in range(0, len(ones), 8))


def model_lines(mesh: CalculixMesh, parameters: Parameters) -> list[str]:
    """Nodes, elements, material, clamped bore and cyclic symmetry."""
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i + 1}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(mesh.nodes)]
    lines.append("*ELEMENT, TYPE=C3D8I, ELSET=EALL")
    for number, corners in enumerate(mesh.elements):
        lines += [f"{number + 1},", _rows(corners)]
    for name, members in (("CLAMPED", mesh.clamped), ("LEFT", mesh.left), ("RIGHT", mesh.right)):
        lines += [f"*NSET, NSET={name}", _rows(members)]
    return [
        *lines,
        "*MATERIAL, NAME=TITANIUM",
        "*ELASTIC",
        f"{parameters.young_modulus:.9e}, {parameters.poisson_ratio:.9e}",
        "*DENSITY",
        f"{parameters.density:.9e}",
        "*SOLID SECTION, ELSET=EALL, MATERIAL=TITANIUM",
        "*BOUNDARY",
        "CLAMPED, 1, 3",
        "*SURFACE, NAME=SRIGHT, TYPE=NODE",
        "RIGHT",
        "*SURFACE, NAME=SLEFT, TYPE=NODE",
        "LEFT",
        "*TIE, NAME=CUT, CYCLIC SYMMETRY, POSITION TOLERANCE=1.E-5",
        "SRIGHT, SLEFT",
        f"*CYCLIC SYMMETRY MODEL, N={parameters.n_sectors}, NGRAPH=1, TIE=CUT",
        "0., 0., 0., 0., 0., 1.",
    ]


def centrifugal_load(parameters: Parameters) -> list[str]:
    """The centrifugal load about the z axis."""
    return ["*DLOAD", f"EALL, CENTRIF, {parameters.angular_speed**2:.12e}, 0., 0., 0., 0., 0., 1."]


def frequency_step(nodal_diameter: int, n_modes: int, perturbation: bool) -> list[str]:
    """Natural frequencies at one nodal diameter; with `perturbation` under the load of the step before."""
    return [
        "*STEP, PERTURBATION" if perturbation else "*STEP",
        "*FREQUENCY",
        str(n_modes),
        f"*SELECT CYCLIC SYMMETRY MODES, NMIN={nodal_diameter}, NMAX={nodal_diameter}",
        "*END STEP",
    ]


def run_calculix(folder: Path, lines: list[str], executable: str = "ccx") -> str:
    """Runs a deck in a folder and returns the table file; raises RuntimeError with the end of the log on failure."""
    (folder / "sector.inp").write_text("\n".join(lines) + "\n", encoding="ascii")
    done = subprocess.run([executable, "-i", "sector"], cwd=folder, capture_output=True, text=True, timeout=1800)
    table = folder / "sector.dat"
    if done.returncode != 0 or "*ERROR" in done.stdout or not table.exists():
        raise RuntimeError(done.stdout[-2000:] + done.stderr[-500:])
    return table.read_text(encoding="ascii")


def read_frequencies(table: str, n_modes: int) -> FloatArray:
    """The lowest n_modes different natural frequencies, Hz, of a step with cyclic symmetry.

    CalculiX finds each twice, as the real and the imaginary part of a rotating wave, nodal diameter 0 included: a step
    has to ask for 2 n_modes.
    """
    number = r"(-?\d\.\d+E[+-]\d+)"
    rows = re.findall(rf"^ +\d+ +\d+ +{number} +{number} +{number} +{number} *$", table, re.MULTILINE)
    values = np.sort([float(row[2]) for row in rows])
    different = values[np.append(True, np.diff(values) > 1e-5 * values[1:])]
    return np.asarray(different[:n_modes])


def contact_lines(mesh: DovetailMesh, calculix: CalculixMesh, parameters: Parameters) -> list[str]:
    """Frictional contact on the flanks: surfaces B0, B1 of the blade (slaves) on D0, D1 of the disk."""
    lines: list[str] = []
    for side in (0, 1):
        for body, flanks in (("B", mesh.blade_flanks), ("D", mesh.disk_flanks)):
            inside = np.isin(calculix.elements, flanks[side])
            lines.append(f"*SURFACE, NAME={body}{side}, TYPE=ELEMENT")
            for number, corners in enumerate(FACES):
                found = np.flatnonzero(inside[:, corners].all(axis=1))
                lines += [f"{element + 1}, S{number + 1}" for element in found]
    lines += [
        "*SURFACE INTERACTION, NAME=DRY",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{_NORMAL_SLOPE:g}",
        "*FRICTION",
        f"{parameters.friction_coefficient:g}, {_STICK_SLOPE:g}",
    ]
    for side in (0, 1):
        lines += ["*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE", f"B{side}, D{side}"]
    return lines


def contact_step(parameters: Parameters) -> list[str]:
    """Centrifugal load raised gradually, with the contact forces printed at the end."""
    lines = ["*STEP, INC=500", "*STATIC", "0.1, 1., 1.E-6, 0.2", *centrifugal_load(parameters)]
    for side in (0, 1):
        lines += [f"*CONTACT PRINT, SLAVE=B{side}, MASTER=D{side}, FREQUENCY=1000", "CF"]
    return [*lines, "*END STEP"]


def read_contact_forces(table: str) -> FloatArray:
    """Normal (compression positive) and tangential force, N, on each flank (2, 2)."""
    number = r"(-?\d\.\d+E[+-]\d+)"
    rows = re.findall(rf"normal force.*\n\s*\n +{number} +{number} +{number}", table)
    if len(rows) != 2:
        raise RuntimeError(f"{len(rows)} tables of contact forces instead of 2")
    return np.array([[-float(normal), float(shear)] for _, normal, shear in rows])
