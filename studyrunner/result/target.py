"""Files that a run writes: obstacles are found, and results of other studies protected, before anything is computed."""

import contextlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studyrunner.checkpoint.store import read_study
from studyrunner.study.study import Study
from studyrunner.study.study_file import format_study
from studyrunner.study.text import read_archived, read_toml
from studyrunner.system.machine import find_fault, new_partial
from studyrunner.user_error import UserError

_BYTES_OF_TRIAL = 4096  # a full disk has room for a name


@dataclass(frozen=True)
class Target:
    """Path of a result. finished: whether a result without missing points exists, which only another such result
    replaces. old: where a result of other values, which exists, is kept when it is replaced; None without one.
    """

    path: Path
    finished: bool = False
    old: Path | None = None

    @property
    def progress(self) -> Path:
        """File of what is computed so far."""
        return self.path.with_name(f"{self.path.name}.progress")


def identity_of(name: str, model: str) -> str:
    """Identity of a study in words: the same study with other values, such as a finer axis, has the same.

    name: of the study. model: of its scene; of a file the name without folders.
    """
    return f'study "{name}" (scene {os.path.basename(model)})'  # noqa: PTH119 - of an empty text as well


def check_output(option: str, path: Path, inputs: Sequence[Path], *, new: bool = False) -> Path:
    """The file at `path`, links followed, after a test that it can be written; nothing is changed.

    option: of the command line, that gave the path. inputs: files that the run reads and must not replace. new: whether
    no file may hold anything there. Raises UserError where the file cannot be written, or is one of the inputs.
    """
    try:
        target = Path(os.path.realpath(path))
        # the libraries that write it are given a text, not bytes
        str(target).encode(sys.getfilesystemencoding())
        progress, is_file = Target(target).progress, target.is_file()
        # what leads to a stream, or to a file without a name, exists although its target does not
        is_free = is_file or not (os.path.lexists(target) or path.exists())
        is_free &= not os.path.lexists(progress) or (progress.is_file() and not progress.is_symlink())
        remedy = ""
        if not target.parent.is_dir():
            remedy = f"give a file in a folder that exists: there is no folder {path.parent}"
        elif not is_free or (is_file and not os.access(target, os.W_OK)):
            remedy = f"give the name of an ordinary file that may be written, as {progress.name} beside it must be"
        elif is_file and any(source.exists() and target.samefile(source) for source in inputs):
            remedy = f"give another file with {option}: this one is read by the run"
        elif new and is_file and target.stat().st_size:
            remedy = "give another name: there is such a file"
        if not remedy:
            trial = new_partial(target)
            trial.touch(exist_ok=False)
            fault = find_fault(trial, _BYTES_OF_TRIAL)
            trial.unlink()
            if fault is not None:
                raise fault
    except OSError as error:
        remedy = f"give a file that can be written: {error.strerror}"
    except ValueError:
        remedy = f"give a name in {sys.getfilesystemencoding().upper()}, as those of its folders"
    if remedy:
        raise UserError("command line", option, str(path), remedy)
    return target


def check_result(option: str, path: Path, study: Study, *, overwrite: bool, how: str = "--overwrite") -> Target:
    """Target of a result, after `check_output` and a test that nothing forbids to replace what exists there.

    overwrite: whether a result of another study may be replaced. how: the user asks for that, in words. Raises
    UserError where what exists, or its progress, is no result of run-study or belongs to another study, or where a file
    that the study reads has the name under which it would be kept.
    """
    target = Target(check_output(option, path, study.files))
    name = identity_of(study.study.name, study.scene.model)
    existing, finished, text = _read_result(option, target.path)
    for file, other in ((target.path, existing), (target.progress, read_study(target.progress))):
        if other is not None and other != name and not overwrite:
            remedy = f"give another name or {how}: {file.name} is of {other}, this is {name}"
            raise UserError("command line", option, str(target.path), remedy)
    if not text or text == format_study(study):
        return Target(target.path, finished)
    old = target.path.with_name(f"{target.path.name}.old")
    return Target(target.path, finished, check_output(option, old, study.files))


def _read_result(option: str, path: Path) -> tuple[str | None, bool, str]:
    """Identity of the study of an existing result, None without one, whether the result is finished, its study."""
    with contextlib.suppress(OSError, KeyError, TypeError, UserError):
        # damaged, or unreadable: it may be anything
        if not path.exists() or path.stat().st_size == 0:
            return None, False, ""
        archived = read_archived(path, "")
        table: Any = read_toml(archived.study.encode(), "")
        identity = identity_of(str(table["study"]["name"]), str(table["scene"]["model"]))
        return identity, archived.is_finished, archived.study
    remedy = "remove the file or give another name: it is no result of run-study that can be read, and is left as it is"
    raise UserError("command line", option, str(path), remedy)
