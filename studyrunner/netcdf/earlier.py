"""The file that stands already where a result is to be written: whose it is, and whether it is finished."""

from __future__ import annotations

from pathlib import Path

from studies.sandboxed_read import check_scene_readable, is_hdf5
from studies.scene_error import SceneError
from studyrunner.netcdf.provenance import POINTS_LEFT
from studyrunner.study.archive import SCENE_GROUP
from studyrunner.user_error import UserError

_STUDY = "study"


def holds_finished_result(path: Path) -> bool:
    """Whether `path` is a result in which no point is missing.

    Such a file is not replaced by one with less in it. Raises UserError where it is no result of run-study at all,
    which is not replaced by anything.
    """
    from studies.guards.hdf5_guard import LARGEST_RESULT, open_hdf5, read_attribute

    try:
        if not path.exists() or path.stat().st_size == 0:
            return False
        if is_hdf5(path):
            check_scene_readable(path, SCENE_GROUP, (_STUDY, POINTS_LEFT))
            with open_hdf5(path, LARGEST_RESULT) as file:
                if read_attribute(file, _STUDY) is not None:
                    left = read_attribute(file, POINTS_LEFT)
                    return left is None or left.size != 1 or left.item() == 0
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, SceneError):
        # damaged, or unreadable: it may be anything
        pass
    remedy = "remove the file or give another name: it is no result of run-study that can be read, and is left as it is"
    raise UserError("command line", "-o", str(path), remedy)
