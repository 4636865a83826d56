"""The text of a study: TOML, in a file of its own or in a result file, with what is wrong in one sentence.

By hand: `tomli_w` gives each value of a list a line of its own, and axes have up to 100 000 values.
"""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.hdf5 import is_hdf5, open_hdf5, read_attribute, read_text_attribute
from studies.scene_error import SceneError
from studyrunner.user_error import UserError, Verbatim, toml_key, toml_value

SCENE_GROUP = "scene"
"""Group of a result file with the contents of a scene file."""

POINTS_LEFT = "points_not_computed"
"""Attribute of a result file: number of points that are not computed, 0 in a finished result."""

_LARGEST = 5 * 2**19  # bytes: an axis of 100 000 values


def read_toml(content: bytes | Path, source: str) -> dict[str, object]:
    """The table in a text or a file. source: the file as the user named it. Raises UserError, and OSError of a file."""
    if isinstance(content, Path):
        with content.open("rb") as file:
            content = file.read(_LARGEST + 1)
    remedy = f"give a study file of at most {_LARGEST / 2**20:g} MiB; an axis can be {{start, stop, num}}"
    if len(content) <= _LARGEST:
        try:
            return tomllib.loads(content.decode("utf-8-sig"))  # editors of Windows begin with a byte order mark
        except UnicodeDecodeError:
            remedy = "give a text file in UTF-8"
        except (ValueError, RecursionError) as error:
            # no TOML, but also whole numbers of thousands of digits, dates that no calendar has
            remedy = f"give valid TOML: {error}"
    raise UserError(source, "the file", None, remedy)


def format_toml(tables: Mapping[str, Any]) -> str:
    """Tables, or lists of tables, as TOML, without empty tables and without keys that are None."""
    lines = []
    for name, section in tables.items():
        for table in section if isinstance(section, list | tuple) else [section] if section else []:
            lines.append(f"[[{name}]]" if table is not section else f"[{name}]")
            lines += [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items() if value is not None]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Archived:
    """Attributes of a result file.

    study: the effective study, TOML. scene_sha256, solver_digest, versions: hashes of scene and solver, and versions of
    packages; empty where unknown; scene_sha256 None where the scenes are no longer those of the file. holds_scene:
    whether the group SCENE_GROUP is there. is_finished: whether no point is left; version 0.4.0 does not say so.
    """

    study: str
    scene_sha256: str | None
    solver_digest: str
    versions: str
    holds_scene: bool
    is_finished: bool


@contextmanager
def result_errors(name: str) -> Iterator[None]:
    """What is wrong with a result file, called `name` by the user, becomes UserError."""
    try:
        yield
    except (OSError, RuntimeError, ValueError, TypeError, LookupError) as error:
        # errors of the NetCDF library have numbers below zero
        of_system = isinstance(error, OSError) and (error.errno or 0) > 0
        reason = (
            error.value if isinstance(error, SceneError) else getattr(error, "strerror", "") * of_system or "damaged"
        )
        raise UserError(name, "the file", Verbatim(reason), "give a result file of run-study that is whole") from None


def read_archived(path: Path, name: str) -> Archived:
    """Reads the attributes of a result file that the user calls `name`. Raises UserError."""
    with result_errors(name), open_hdf5(path) as file:
        names = ("study", "scene_sha256", "solver_digest", "versions")
        study, scene, solver, versions = (read_text_attribute(file, name) for name in names)
        holds_scene, left = SCENE_GROUP in file, read_attribute(file, POINTS_LEFT)
    if not study:
        remedy = "missing: give a study file (TOML) or a result file of run-study"
        raise UserError(name, "the attribute study", None, remedy)
    return Archived(study, scene, solver, versions, holds_scene, left is None or left.item() == 0)


def check_result_file(path: Path, name: str) -> None:
    """Raises UserError where a file that the user calls `name` is no result file."""
    with result_errors(name):
        if not path.is_file() or not is_hdf5(path):
            what = "is no NetCDF file (NetCDF-4)" if path.exists() else "there is none of this name"
            raise UserError(name, "the file", None, f"{what}, give a result file of run-study")
