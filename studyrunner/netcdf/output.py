"""The files that a run writes: where they go, checked before anything is computed."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Sequence
from pathlib import Path

from studyrunner.system.files import create, leftovers, new_partial
from studyrunner.user_error import UserError

_SECONDS_TO_WRITE = 86400.0  # no run is at one file for so long


def check_output(option: str, path: Path, inputs: Sequence[Path]) -> Path:
    """The file that `path` stands for, links followed, after a try whether it can be written.

    option: the one on the command line that gave the path. inputs: files that the run reads and must not replace.
    Nothing is changed. Raises UserError.
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

    alone: whether no other run is at work on it; else only what is old.
    """
    for found in leftovers(path):
        # the file may have gone meanwhile, and one that stays is no harm
        with contextlib.suppress(OSError):
            if alone or time.time() - found.stat().st_mtime > _SECONDS_TO_WRITE:
                found.unlink()


def parts_folder(path: Path) -> Path:
    """The folder of results that are to go into the file `path`."""
    return path.with_name(f"{path.name}.parts")
