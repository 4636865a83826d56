"""Errors of a scene as the user reads them: with the file that they stand in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from studies.scene_error import SceneError
from studyrunner.user_error import UserError, Verbatim


@contextmanager
def scene_errors(source: str, path: Path | None) -> Iterator[None]:
    """SceneError and OSError become UserError. source: the study file. path: the scene file, None of bundled scenes."""
    place, prefix = (source, "scene.") if path is None else (str(path), "")
    try:
        yield
    except SceneError as error:
        raise UserError(place, prefix + error.key, Verbatim(error.value), error.remedy) from None
    except OSError as error:
        raise UserError(place, "the scene file", None, f"give a file that can be read: {error.strerror}") from None
