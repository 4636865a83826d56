"""The files that a run writes: where they go and what stands there already, checked before anything is computed."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Sequence
from pathlib import Path

from studies.sandboxed_read import check_scene_readable, is_hdf5
from studies.scene_error import SceneError
from studyrunner.netcdf.provenance import POINTS_LEFT
from studyrunner.study.archive import SCENE_GROUP
from studyrunner.system.files import create, leftovers, new_partial
from studyrunner.user_error import UserError

_SECONDS_TO_WRITE = 86400.0  # no run is at one file for so long


def check_output(option: str, path: Path, inputs: Sequence[Path]) -> Path:
    """The file that `path` stands for, links followed, after a try whether it can be written; nothing is changed.

    Parameters
    ----------
    option
        The one on the command line that gave the path.
    path
        As the user gave it.
    inputs
        Files that the run reads and must not replace.

    Raises
    ------
    UserError
        Where it cannot be written, or is one of the inputs.
    """

    def wrong(remedy: str) -> UserError:
        return UserError("command line", option, str(path), remedy)

    target = Path(os.path.realpath(path))
    try:
        if target.is_dir():
            raise wrong("give the name of a file: this is a folder")
        if not target.parent.is_dir():
            raise wrong(f"give a file in a folder that exists: there is no folder {path.parent}")
        if target.exists():
            if not target.is_file():
                raise wrong("give the name of an ordinary file")
            if not os.access(target, os.W_OK):
                raise wrong("give a file that may be written: this one is write-protected")
            if any(source.exists() and target.samefile(source) for source in inputs):
                raise wrong(f"give another file with {option}: this one is read by the run")
        if parts_folder(target).exists() and not parts_folder(target).is_dir():
            raise wrong(f"give another name: {parts_folder(target).name}, which the run needs, is a file")
        try_to_create(target)
    except OSError as error:
        raise wrong(f"give a file that can be written: {error.strerror}") from None
    return target


def try_to_create(path: Path) -> None:
    """Makes a new file beside `path` and removes it. Raises OSError."""
    trial = new_partial(path)
    create(trial).close()
    trial.unlink()


def remove_leftovers(path: Path, *, alone: bool) -> None:
    """Removes what runs that were killed have left while they wrote `path`.

    Parameters
    ----------
    alone
        Whether no other run is at work on it; else only what is old.
    """
    for found in leftovers(path):
        # the file may have gone meanwhile, and one that stays is no harm
        with contextlib.suppress(OSError):
            if alone or time.time() - found.stat().st_mtime > _SECONDS_TO_WRITE:
                found.unlink()


def parts_folder(path: Path) -> Path:
    """The folder of results that are to go into the file `path`."""
    return path.with_name(f"{path.name}.parts")


def holds_finished_result(path: Path) -> bool:
    """Whether `path` is a result in which no point is missing.

    Such a file is not replaced by one with less in it.

    Raises
    ------
    UserError
        Where it is no result of run-study at all, which is not replaced by anything.
    """
    from studies.guards.hdf5_guard import LARGEST_RESULT, open_hdf5, read_attribute

    try:
        if not path.exists() or path.stat().st_size == 0:
            return False
        if is_hdf5(path):
            check_scene_readable(path, SCENE_GROUP, ("study", POINTS_LEFT))
            with open_hdf5(path, LARGEST_RESULT) as file:
                if read_attribute(file, "study") is not None:
                    left = read_attribute(file, POINTS_LEFT)
                    return left is None or left.size != 1 or left.item() == 0
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, SceneError):
        # damaged, or unreadable: it may be anything
        pass
    remedy = "remove the file or give another name: it is no result of run-study that can be read, and is left as it is"
    raise UserError("command line", "-o", str(path), remedy)
