"""Finds the files with a model's matrices by the name that a user gives, and reads them."""

from __future__ import annotations

import re
from pathlib import Path

from studies.fe_models.matrices.abaqus import read_abaqus
from studies.fe_models.matrices.ansys import read_ansys
from studies.fe_models.matrices.calculix import read_calculix
from studies.fe_models.matrices.matrices import Matrices
from studies.fe_models.matrices.nastran import read_nastran
from studies.scene_error import SceneError

_PUNCHED = (".pch", ".dmig", ".bdf", ".dat")
_PUNCH = "punch the matrices: PARAM,EXTOUT,DMIGPCH"


def find_matrix_files(path: Path) -> tuple[Path, ...]:
    """The files that belong to a name: job.sti, .mas, .dof; job_STIF1.mtx, job_MASS1.mtx; job.full; or job.pch.

    Parameters
    ----------
    path
        The name that the files have in common, or one of the files.

    Raises
    ------
    SceneError
        About "matrices": where there are none, or of more than one kind.
    """
    suffix = path.suffix.lower()
    folder = path.parent
    if suffix in (".sti", ".mas", ".dof"):
        return tuple(path.with_suffix(end) for end in (".sti", ".mas", ".dof"))
    if suffix == ".mtx":
        match = re.fullmatch(r"(.*)_(STIF|MASS)(\d+)\.mtx", path.name, re.IGNORECASE)
        if match is None:
            raise SceneError("matrices", f"{path.name} is no pair", "name the files job_STIF1.mtx and job_MASS1.mtx")
        return folder / f"{match[1]}_STIF{match[3]}.mtx", folder / f"{match[1]}_MASS{match[3]}.mtx"
    if suffix in (".full", *_PUNCHED):
        return (path,)
    if suffix == ".op4":
        raise SceneError("matrices", f"{path.name} is an OP4 file of Nastran, which is not read", _PUNCH)
    name = path.name
    found: list[tuple[Path, ...]] = []
    if (folder / f"{name}.sti").is_file():
        found.append(tuple(folder / f"{name}{end}" for end in (".sti", ".mas", ".dof")))
    if folder.is_dir():
        pattern = re.compile(re.escape(name) + r"_STIF(\d+)\.mtx")
        numbers = sorted(int(match[1]) for item in folder.iterdir() if (match := pattern.fullmatch(item.name)))
        found += [(folder / f"{name}_STIF{n}.mtx", folder / f"{name}_MASS{n}.mtx") for n in numbers]
    found += [(folder / f"{name}{end}",) for end in (".full", *_PUNCHED[:2]) if (folder / f"{name}{end}").is_file()]
    if not found and (folder / f"{name}.op4").is_file():
        raise SceneError("matrices", f"{name}.op4 is an OP4 file of Nastran, which is not read", _PUNCH)
    if not found:
        looked_for = f"{name}.sti, {name}_STIF1.mtx, {name}.full or {name}.pch"
        raise SceneError("matrices", f"there is no {looked_for}", "give the name that the files have in common")
    if len(found) > 1:
        names = " and ".join(files[0].name for files in found)
        raise SceneError("matrices", f"there are {names}", "give the name of one of these files")
    return found[0]


def read_matrices(path: Path) -> Matrices:
    """The matrices of a model, by the name that their files have in common or one of the files.

    Raises
    ------
    SceneError
        About "matrices", in one sentence: where files are missing, damaged or do not belong together.
    """
    files = find_matrix_files(path)
    suffix = files[0].suffix.lower()
    if suffix == ".sti":
        return read_calculix(*files)
    if suffix == ".mtx":
        return read_abaqus(*files)
    if suffix == ".full":
        return read_ansys(files[0])
    return read_nastran(files[0])
