"""Protects results of other studies: finds out which study an existing result belongs to."""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from studies.sandboxed_read import check_scene_readable, is_hdf5
from studies.scene_error import SceneError
from studyrunner.netcdf.output import parts_folder
from studyrunner.netcdf.provenance import POINTS_LEFT
from studyrunner.study.study_of_result import SCENE_GROUP
from studyrunner.study.toml_text import read_toml
from studyrunner.system.files import NotPlainError, create, new_partial, open_plain
from studyrunner.user_error import UserError

if TYPE_CHECKING:
    from studyrunner.study.study import Study

_NOTE = "study.json"
_LARGEST_NOTE = 2**16


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

    Parameters
    ----------
    option
        The option of the command line that gave the path.
    path
        As `check_output` gives it; the file need not exist.
    study
        The study of the new result.
    overwrite
        Whether a result of another study may be replaced.
    how
        How the user asks for that, in words.

    Raises
    ------
    UserError
        Where the file is no result of run-study, or the file or the folder beside it belongs to another study.
    """
    standing, finished = _read_result(option, path)
    own = Label.of(study)
    for what, found in ((path, standing), (parts_folder(path), _read_note(path))):
        if found is not None and found != own and not overwrite:
            remedy = f"give another name or {how}: {what.name} is of {found}, this is {own}"
            raise UserError("command line", option, str(path), remedy)
    return Target(path, finished)


def check_scene_file(option: str, path: Path) -> None:
    """Raises UserError where a file exists that is no scene file."""
    from studies.guards.hdf5_guard import open_hdf5, read_attribute

    with contextlib.suppress(OSError, RuntimeError, ValueError, TypeError, KeyError, SceneError):
        if not path.exists() or path.stat().st_size == 0:
            return
        if is_hdf5(path):
            check_scene_readable(path)
            with open_hdf5(path) as file:
                if read_attribute(file, "study") is None:
                    return
    raise UserError("command line", option, str(path), "give another name: this is no scene file, and is left as it is")


def note_study(target: Path, study: Study) -> None:
    """Writes the identity of a study into the folder beside the result file."""
    label = Label.of(study)
    if _read_note(target) == label:
        return
    note = parts_folder(target) / _NOTE
    partial = new_partial(note)
    # a disk that is full is met by what is written next
    with contextlib.suppress(OSError):
        try:
            with create(partial) as file:
                file.write(json.dumps(asdict(label)).encode())
            os.replace(partial, note)
        finally:
            partial.unlink(missing_ok=True)


def _read_note(target: Path) -> Label | None:
    """The identity in a folder; None where there is none, as in folders of earlier versions."""
    try:
        with open_plain(parts_folder(target) / _NOTE, _LARGEST_NOTE) as file:
            found = json.loads(file.read())
        return Label(str(found["name"]), str(found["model"]))
    except (OSError, NotPlainError, ValueError, TypeError, KeyError, RecursionError):
        return None


def _read_result(option: str, path: Path) -> tuple[Label | None, bool]:
    """Identity of the study of an existing result, None without one, and whether the result is finished."""
    from studies.guards.hdf5_guard import LARGEST_RESULT, open_hdf5, read_attribute

    try:
        if not path.exists() or path.stat().st_size == 0:
            return None, False
        if is_hdf5(path):
            check_scene_readable(path, SCENE_GROUP, ("study", POINTS_LEFT))
            with open_hdf5(path, LARGEST_RESULT) as file:
                text, left = read_attribute(file, "study"), read_attribute(file, POINTS_LEFT)
                if text is not None:
                    return _label_in(text.item()), left is None or left.size != 1 or left.item() == 0
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, SceneError, UserError):
        # damaged, or unreadable: it may be anything
        pass
    remedy = "remove the file or give another name: it is no result of run-study that can be read, and is left as it is"
    raise UserError("command line", option, str(path), remedy)


def _label_in(text: str | bytes) -> Label:
    """The identity in the attributes of a result. Raises UserError, TypeError and KeyError."""
    table = read_toml(text if isinstance(text, bytes) else text.encode(), "")
    study, scene = table["study"], table["scene"]
    if not isinstance(study, dict) or not isinstance(scene, dict):
        raise TypeError("no study")
    return Label(str(study["name"]), os.path.basename(str(scene["model"])))  # noqa: PTH119
