"""Paths of the files that a run writes; obstacles are found before anything is computed."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from studyrunner.system.files import create, new_partial, sync
from studyrunner.user_error import UserError

_TRIAL = bytes(4096)  # a full disk has room for a name
_STREAMS = (0, 1, 2)


def check_output(option: str, path: Path, inputs: Sequence[Path]) -> Path:
    """The file at `path`, links followed, after a test that it can be written; nothing is changed.

    option: of the command line, that gave the path. inputs: files that the run reads and must not replace. Raises
    UserError where the file cannot be written, or is one of the inputs.
    """
    try:
        target = Path(os.path.realpath(path))
        # the libraries that write it are given a text, not bytes
        str(target).encode(sys.getfilesystemencoding())
        remedy = _obstacle(option, path, target, inputs)
        if not remedy:
            trial = new_partial(target)
            with create(trial) as file:
                try:
                    file.write(_TRIAL)
                    sync(file)
                finally:
                    trial.unlink()
    except OSError as error:
        remedy = f"give a file that can be written: {error.strerror}"
    except ValueError:
        remedy = f"give a name in {sys.getfilesystemencoding().upper()}, as those of its folders"
    if remedy:
        raise UserError("command line", option, str(path), remedy)
    return target


def _obstacle(option: str, path: Path, target: Path, inputs: Sequence[Path]) -> str:
    """Remedy for what keeps a file from being written to `target`; "" for nothing. Raises OSError."""
    if target.is_dir():
        return "give the name of a file: this is a folder"
    if not target.parent.is_dir():
        no_folder = next((part for part in path.parents if os.path.lexists(part) and not part.is_dir()), None)
        missing = f"there is no folder {path.parent}" if no_folder is None else f"{no_folder} is no folder"
        return f"give a file in a folder that exists: {missing}"
    # what leads to a stream, or to a file without a name, exists although its target does not
    if os.path.lexists(target) or path.exists():
        if not target.is_file() or _is_stream(target):
            return "give the name of an ordinary file"
        if not os.access(target, os.W_OK):
            return "give a file that may be written: this one is write-protected"
        if any(source.exists() and target.samefile(source) for source in inputs):
            return f"give another file with {option}: this one is read by the run"
    progress = progress_file(target)
    if os.path.lexists(progress) and (progress.is_symlink() or not progress.is_file()):
        return f"give another name: {progress.name}, which the run needs, is no plain file"
    return ""


def _is_stream(target: Path) -> bool:
    for number in _STREAMS:
        with contextlib.suppress(OSError):
            if os.path.samestat(target.stat(), os.fstat(number)):
                return True
    return False


def progress_file(path: Path) -> Path:
    """File of what is computed so far of the result file `path`."""
    return path.with_name(f"{path.name}.progress")


def older_folder(path: Path) -> Path:
    """Folder of what version 0.4.0 or before has computed of the result file `path`."""
    return path.with_name(f"{path.name}.parts")
