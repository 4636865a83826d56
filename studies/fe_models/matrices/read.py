"""Finds the files with a model's matrices by the name that a user gives, and reads them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from glob import escape
from pathlib import Path

from studies.fe_models.matrices.matrices import Matrices
from studies.fe_models.matrices.nastran import read_nastran
from studies.fe_models.matrices.tables import (
    NAMES,
    ONE_EACH,
    read_ansys,
    read_matlab,
    read_nastran_op4,
    read_tables,
    rows_of,
)
from studies.fe_models.matrices.text_files import read_abaqus, read_calculix, read_substructure
from studies.scene_error import SceneError

_CALCULIX = (".sti", ".mas", ".dof")
_ABAQUS = {"stiffness": "STIF", "mass": "MASS", "damping": "DMPV", "load": "LOAD"}
_IN_ONE_FILE: dict[str, Callable[[Path], Matrices]] = {
    **dict.fromkeys((".pch", ".dmig", ".bdf", ".dat"), read_nastran),
    ".full": read_ansys,
    ".mat": read_matlab,
    ".op4": read_nastran_op4,
    ".mtx": read_substructure,
}
_Found = tuple[Callable[[], Matrices], tuple[Path, ...]]


def find_matrix_files(path: Path) -> tuple[Path, ...]:
    """The files that belong to a name.

    path: the name that the files have in common, or one of the files. Raises SceneError about "matrices" where there
    are none, or of more than one kind.
    """
    return _find(path)[1]


def read_matrices(path: Path) -> Matrices:
    """The matrices of a model, by the name that their files have in common or one of the files.

    Raises SceneError about "matrices", in one sentence: where files are missing, damaged or do not belong together.
    """
    return _find(path)[0]()


def _find(path: Path) -> _Found:
    """What reads the matrices, and their files."""
    if path.suffix.lower() in _CALCULIX:
        return _of_calculix(path.with_suffix(""))
    if match := re.fullmatch(rf"(.*)_(?:{'|'.join(_ABAQUS.values())})(\d+)\.mtx", path.name, re.IGNORECASE):
        return _of_abaqus(path.with_name(match[1]), match[2])
    if match := re.fullmatch(rf"(.*)_(?:{'|'.join(NAMES)})({'|'.join(ONE_EACH)})", path.name, re.IGNORECASE):
        return _of_tables(path.with_name(match[1]), match[2])
    if path.suffix.lower() in _IN_ONE_FILE:
        return _of_one_file(path)
    found = list(_of_name(path))
    if not found:
        name = path.name
        looked_for = f"{name}.sti, .pch, .op4, .mat, .mtx or .full, {name}_STIF1.mtx or {name}_stiffness.mtx"
        raise SceneError("matrices", f"there is no {looked_for}", "give the name that the files have in common")
    if len(found) > 1:
        names = " and ".join(files[0].name for _, files in found)
        raise SceneError("matrices", f"there are {names}", "give the name of one of these files")
    return found[0]


def _of_name(job: Path) -> Iterator[_Found]:
    """Files of each kind that are there."""
    if job.with_name(f"{job.name}.sti").is_file():
        yield _of_calculix(job)
    for path in sorted(job.parent.glob(f"{escape(job.name)}_STIF[0-9]*.mtx")):
        yield _of_abaqus(job, path.stem.rpartition("STIF")[2])
    for end in ONE_EACH:
        if job.with_name(f"{job.name}_stiffness{end}").is_file():
            yield _of_tables(job, end)
    for end in set(_IN_ONE_FILE) - {".bdf", ".dat"}:
        if (path := job.with_name(f"{job.name}{end}")).is_file():
            yield _of_one_file(path)


def _of_calculix(job: Path) -> _Found:
    files = tuple(job.with_name(f"{job.name}{end}") for end in _CALCULIX)
    return partial(read_calculix, *files), files


def _of_abaqus(job: Path, number: str) -> _Found:
    return _one_each(read_abaqus, {name: f"{job.name}_{each}{number}.mtx" for name, each in _ABAQUS.items()}, job)


def _of_tables(job: Path, end: str) -> _Found:
    read, files = _one_each(partial(read_tables, rows=rows_of(job)), {n: f"{job.name}_{n}{end}" for n in NAMES}, job)
    return read, (*files, rows_of(job))


def _one_each(read: Callable[[dict[str, Path]], Matrices], names: dict[str, str], job: Path) -> _Found:
    """Files of one matrix each, of which damping and load may be missing."""
    paths = {name: job.with_name(each) for name, each in names.items()}
    files = {name: path for name, path in paths.items() if name in ("stiffness", "mass") or path.is_file()}
    return partial(read, files), tuple(files.values())


def _of_one_file(path: Path) -> _Found:
    rows = rows_of(path.with_suffix(""))
    return partial(_IN_ONE_FILE[path.suffix.lower()], path), (path, *((rows,) if rows.is_file() else ()))
