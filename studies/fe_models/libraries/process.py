"""Has a library read a foreign file in a process of its own, with limits of time and memory.

Such a library may crash, end its process, or take what memory a damaged file asks for. The process hands back arrays
in a file of NumPy's, without pickles; its end is the answer where it comes to a bad one.
"""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from studies.fe_models.text.read_errors import check_file
from studies.guards.limited_process import REFUSED, run_limited
from studies.scene_error import SceneError

Arrays = dict[str, np.ndarray]

_READERS: Mapping[str, tuple[str, str]] = {
    "gmsh": ("meshio", "meshio"),
    "cdb": ("ansys.mapdl.reader", "ansys-mapdl-reader"),
    "full": ("ansys.mapdl.reader", "ansys-mapdl-reader"),
}
"""Library of every kind of file, and the package that brings the library."""

_LARGEST_FILE = 2**31
_LEAST_SECONDS = 60
_BYTES_A_SECOND = 2**20
_CHILD = "studies.fe_models.libraries.child"


def read_by_library(kind: str, path: Path, key: str) -> Arrays:
    """Arrays of a file, as the reader of its kind gives them.

    Parameters
    ----------
    kind
        "gmsh", "cdb" or "full".
    path
        The file.
    key
        What errors are about: "model" or "matrices".

    Raises
    ------
    SceneError
        Where the library is not installed, refuses the file, crashes, or takes too long or too much memory.
    """
    size = check_file(path, _LARGEST_FILE, key)
    library, package = _READERS[kind]
    if not _is_installed(library):
        found = f"{path.name} needs the library {library}, which is not installed"
        raise SceneError(key, found, f"install the library: pip install {package}")
    with tempfile.TemporaryDirectory(prefix="fretwear-") as folder:
        answer = Path(folder) / "arrays.npz"
        status, said = run_limited(_CHILD, [kind, str(path.absolute()), str(answer)], 4.0 * seconds_for(size))
        if status == REFUSED:
            # behind whatever the library has written
            raise SceneError(key, *json.loads(said.rpartition("\n")[2]))
        if status != 0 or not answer.is_file():
            found = f"{path.name} is damaged: {library} cannot read it in a reasonable time and memory"
            raise SceneError(key, found, "write it again")
        with np.load(answer, allow_pickle=False) as arrays:
            return dict(arrays)


def _is_installed(library: str) -> bool:
    try:
        return importlib.util.find_spec(library) is not None
    except ModuleNotFoundError:
        return False


def seconds_for(size: int) -> int:
    """CPU seconds that a file of so many bytes may take."""
    return _LEAST_SECONDS + size // _BYTES_A_SECOND
