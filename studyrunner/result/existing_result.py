"""Protects results of other studies: finds out which study an existing result belongs to."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.hdf5 import is_hdf5, open_hdf5, read_attribute
from studies.scene_error import SceneError
from studies.scene_file import has_mesh
from studyrunner.checkpoint.store import read_study
from studyrunner.result.paths import progress_file
from studyrunner.result.provenance import POINTS_LEFT
from studyrunner.study.toml_text import read_toml
from studyrunner.user_error import UserError

if TYPE_CHECKING:
    from studyrunner.study.study import Study

_UNREADABLE = (OSError, RuntimeError, ValueError, TypeError, KeyError, SceneError, UserError)


@dataclass(frozen=True)
class Label:
    """Identity of a study: its name and the model of its scene; of a file the name without folders.

    The same study with other values, such as a finer axis, has the same identity.
    """

    name: str
    model: str

    @classmethod
    def of(cls, study: Study) -> Label:
        """Identity of a study."""
        return cls(study.study.name, os.path.basename(study.scene.model))  # noqa: PTH119 - of an empty text as well

    def __str__(self) -> str:
        """Identity in words."""
        return f'study "{self.name}" (scene {self.model})'


@dataclass(frozen=True)
class Target:
    """Path of a result. finished: whether a result without missing points exists, which only another such result
    replaces.
    """

    path: Path
    finished: bool = False


def check_result(option: str, path: Path, study: Study, *, overwrite: bool, how: str = "--overwrite") -> Target:
    """Path of a result, after a test that nothing forbids to replace what exists there; nothing is changed.

    option: of the command line, that gave the path. path: as `check_output` gives it. study: of the new result.
    overwrite: whether a result of another study may be replaced. how: the user asks for that, in words. Raises
    UserError where the file is no result of run-study, or the file or its progress belongs to another study.
    """
    own, (standing, finished), in_progress = Label.of(study), _read_result(option, path), progress_file(path)
    note = read_study(in_progress)
    for what, found in ((path, standing), (in_progress, note and Label(*note))):
        if found is not None and found != own and not overwrite:
            remedy = f"give another name or {how}: {what.name} is of {found}, this is {own}"
            raise UserError("command line", option, str(path), remedy)
    return Target(path, finished)


def check_scene_file(option: str, path: Path) -> None:
    """Raises UserError where a file exists that is no scene file."""
    with contextlib.suppress(*_UNREADABLE):
        if not path.exists() or path.stat().st_size == 0:
            return
        if is_hdf5(path):
            has_mesh(path)  # raises where there is anything but a scene
            with open_hdf5(path) as file:
                if read_attribute(file, "study") is None:
                    return
    raise UserError("command line", option, str(path), "give another name: this is no scene file, and is left as it is")


def _read_result(option: str, path: Path) -> tuple[Label | None, bool]:
    """Identity of the study of an existing result, None without one, and whether the result is finished."""
    with contextlib.suppress(*_UNREADABLE):
        # damaged, or unreadable: it may be anything
        if not path.exists() or path.stat().st_size == 0:
            return None, False
        with open_hdf5(path) as file:
            text, left = read_attribute(file, "study"), read_attribute(file, POINTS_LEFT)
            stored: Any = b"" if text is None else text.item()
            table: Any = read_toml(stored if isinstance(stored, bytes) else stored.encode(), "")
            label = Label(str(table["study"]["name"]), os.path.basename(str(table["scene"]["model"])))  # noqa: PTH119
            # version 0.4.0 does not say how many points are left
            return label, left is None or left.item() == 0
    remedy = "remove the file or give another name: it is no result of run-study that can be read, and is left as it is"
    raise UserError("command line", option, str(path), remedy)
