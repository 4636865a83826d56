"""The table of formats of matrices: which files each has, by the name that a user gives, and what reads them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from glob import escape
from pathlib import Path

from studies.fe_models.matrices.matrices import NAMES, Matrices
from studies.fe_models.matrices.nastran import read_op4, read_punch
from studies.fe_models.matrices.tables import read_ansys, read_matlab, read_tables
from studies.fe_models.matrices.text_files import read_abaqus, read_calculix, read_substructure
from studies.scene_error import SceneError


@dataclass(frozen=True)
class Format:
    """A format.

    ends: of the names of its files, by what is in them; * is a number. Damping, load and the table of rows may be
    missing. reader: takes these files. by_name: whether the name that the files have in common is enough.
    """

    reader: Callable[[Mapping[str, Path]], Matrices]
    ends: Mapping[str, str]
    by_name: bool = True


_ROWS = {"rows": "_rows.csv"}
_ABAQUS = zip(NAMES, ("STIF", "MASS", "DMPV", "LOAD"), strict=True)
FORMATS = (
    Format(read_calculix, {"stiffness": ".sti", "mass": ".mas", "dofs": ".dof"}),
    Format(read_abaqus, {name: f"_{short}*.mtx" for name, short in _ABAQUS}),
    *(Format(read_tables, {name: f"_{name}{end}" for name in NAMES} | _ROWS) for end in (".mtx", ".hb", ".rb")),
    *(Format(read_punch, {"matrices": end}, end in (".pch", ".dmig")) for end in (".pch", ".dmig", ".bdf", ".dat")),
    Format(read_op4, {"matrices": ".op4"} | _ROWS),
    Format(read_matlab, {"matrices": ".mat"} | _ROWS),
    Format(read_ansys, {"matrices": ".full"}),
    Format(read_substructure, {"matrices": ".mtx"}),
)
"""Matrices of CalculiX, of Abaqus, of any program, of Nastran, MATLAB and ANSYS, and substructures."""


def find_matrix_files(path: Path) -> tuple[Path, ...]:
    """The files that belong to the name that they have in common, or to one of them.

    Raises SceneError about "matrices" where there are none, or of more than one kind.
    """
    return tuple(_find(path)[1].values())


def read_matrices(path: Path) -> Matrices:
    """The matrices of these files. Raises SceneError about "matrices"."""
    reader, files = _find(path)
    return reader(files)


def _find(path: Path) -> tuple[Callable[[Mapping[str, Path]], Matrices], dict[str, Path]]:
    """What reads the matrices, and their files by what is in them."""
    for each in FORMATS:
        for end in set(each.ends.values()) - set(_ROWS.values()):
            pattern = "(.*)" + re.escape(end).replace(r"\*", r"(\d+)")
            if match := re.fullmatch(pattern, path.name, re.IGNORECASE):
                job, number = match[1], match[match.re.groups]
                files = {part: path.with_name(job + name.replace("*", number)) for part, name in each.ends.items()}
                may_miss = ("damping", "load", "rows")
                return each.reader, {part: own for part, own in files.items() if part not in may_miss or own.is_file()}
    firsts = [next(iter(each.ends.values())) for each in FORMATS if each.by_name]
    found = [
        file for end in firsts for file in sorted(path.parent.glob(escape(path.name) + end.replace("*", "[0-9]*")))
    ]
    if not found:
        looked_for = ", ".join(path.name + end.replace("*", "1") for end in firsts)
        raise SceneError("matrices", f"there is no {looked_for}", "give the name that the files have in common")
    if len(found) > 1:
        names = " and ".join(file.name for file in found)
        raise SceneError("matrices", f"there are {names}", "give the name of one of these files")
    return _find(found[0])
